r"""A periodic patch: pressure and displacement repeat with its sides, and are multiplied in Fourier space.

A pressure of wave number k displaces the surface by 2 pi G(k h)/k times `LayeredKernel.singular`. At k = 0 this is
`LayeredKernel.uniform`; where that is infinite, displacements are measured from their mean (`linear_bem.layer.cell`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import fft

from linear_bem.arrays import Array
from linear_bem.grid.patches import Patch


@dataclass
class PeriodicPatch(Patch):
    """A patch that is one period."""

    @cached_property
    def _symbol(self) -> Array:
        k = self.wave_numbers
        k[0, 0] = 1.0
        symbol = 2.0 * np.pi * self.kernel.response_at(k) / k
        symbol[0, 0] = self.kernel.uniform if np.isfinite(self.kernel.uniform) else 0.0
        return np.asarray(symbol)

    def complete(self, heights: Array) -> float:
        """Return the least mean pressure times ``singular`` under which heights [m] are in contact everywhere."""
        waves = fft.rfft2(heights) / np.where(self._symbol > 0.0, self._symbol, np.inf)
        waves[0, 0] = 0.0
        return float(np.max(fft.irfft2(waves, heights.shape)))

    @cached_property
    def influence(self) -> Array:
        """Displacement per pressure times ``singular`` [m] at the offsets from one loaded cell, shape (nx, ny)."""
        return np.asarray(fft.irfft2(self._symbol, (self.nx, self.ny)))

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement [m] at the cells under a pressure times ``singular``."""
        return np.asarray(fft.irfft2(fft.rfft2(pressure) * self._symbol, pressure.shape))

    @cached_property
    def _inverse_spectrum(self) -> Array:
        return np.asarray(1.0 / np.where(self._symbol > 0.0, self._symbol, np.max(self._symbol)))
