"""Faster fixed points: the combination of past steps whose residuals cancel best."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Anderson:
    """Anderson's mixing [Anderson 1965, J. ACM 12, 547; Walker and Ni 2011, SIAM J. Numer. Anal. 49, 1715].

    For a linear iteration x -> G(x) it is equivalent to GMRES: a few slow components no longer set the pace.
    """

    def __init__(self, depth: int = 10) -> None:
        self.depth = depth
        self.forget()

    def forget(self) -> None:
        """Drop the past: the unknowns have changed their meaning."""
        self._points: list[Array] = []
        self._residuals: list[Array] = []

    def next(self, point: Array, image: Array) -> Array:
        """Return the next point from G(``point``) = ``image``."""
        self._points = [*self._points[-self.depth :], point]
        self._residuals = [*self._residuals[-self.depth :], image - point]
        if len(self._points) < 2:
            return image
        steps, changes = np.diff(self._points, axis=0), np.diff(self._residuals, axis=0)
        weights = np.linalg.lstsq(changes.T, self._residuals[-1], rcond=1e-10)[0]
        return np.asarray(image - weights @ (steps + changes))
