r"""Near and far part of the layer's kernel; the far part is smooth, so that a mesh can hold it.

    K(r)/singular = near + far,   w(r) = [erf((r - s)/d) + erf((r + s)/d)]/2,

    thin = False, s = 0:  far = w(r)/r + smooth(r),   near = [1 - w(r)]/r,
    thin = True:          far = w(r) K(r)/singular,   near = [1 - w(r)] K(r)/singular.

The first is Ewald's split [Ewald 1921, Ann. Phys. 369, 253, doi 10.1002/andp.19213690304] of 1/r; the rest of the
layer's kernel falls in wave numbers like exp(-2 k h), so that it needs a mesh of spacing h/3. The second needs a mesh
of the width d only: w rises from 0 at the distance s (s = 0 again for a half-space), where all that the layer adds is
smooth on the scale of the distance. Its near pairs reach twice as far.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import erf, erfc

from linear_bem.arrays import Array
from linear_bem.layer.kernel import LayeredKernel

PER_LAYER = 3.0
"""Least thickness of the layer over the spacing where ``thin`` is False: its rest is then known to 2e-6/H."""


@dataclass(frozen=True)
class Rule:
    """What a mesh of spacing H takes: H/d, and r/d of the last near pair beyond s, and s/d of the second split."""

    share: float
    cut: float
    step: float


RULES = ((1e-5, Rule(0.4, 3.7, 3.6)), (1e-7, Rule(0.3, 4.5, 4.0)))
"""By the least precision. Measured on 400 random loads per (40 H)^2, splines of order 8 (root mean square of one load):
first split: field 1e-6/H and 6e-8/H, slope (`ParticleMesh.slope`) 1e-6/H^2 and 1.5e-7/H^2; second split, layers of
0.02 to 1 H: 5e-7/H and 5e-8/H, 9e-7/H^2 and 5e-8/H^2, times ``far_ratio`` where that is above 1.
"""


@dataclass(frozen=True)
class Split:
    """The kernel's two parts over ``singular`` [1/m]; ``width`` d and ``step`` s [m]."""

    kernel: LayeredKernel
    width: float
    step: float = 0.0
    thin: bool = False

    @classmethod
    def of(cls, kernel: LayeredKernel, spacing: float, rule: Rule) -> "Split":
        """Return the split for a mesh of a spacing [m]."""
        width = spacing / rule.share
        if spacing <= 1.0001 * kernel.thickness / PER_LAYER:
            return cls(kernel, width)
        return cls(kernel, width, rule.step * width, thin=True)

    def far(self, r: Array) -> Array:
        """Return the part of K that the mesh holds [1/m]; it is finite at r = 0."""
        r = np.maximum(r, 1e-6 * self.width)
        if self.thin:
            return np.asarray(self._rise(r) * self.kernel.scaled(r))
        return np.asarray(self._rise(r) / r + self.kernel.smooth(r))

    def far_slope(self, r: Array) -> Array:
        """Return its derivative [1/m^2]."""
        r = np.maximum(r, 1e-3 * self.width)
        w, dw = self._rise(r), self.rise_slope(r)
        if self.thin:
            return np.asarray(dw * self.kernel.scaled(r) + w * self.kernel.scaled_slope(r))
        return np.asarray((dw - w / r) / r + self.kernel.smooth_slope(r))

    def near(self, r: Array) -> Array:
        """Return the part of K that the mesh does not hold [1/m], r > 0."""
        return np.asarray(self.fall(r) * (self.kernel.scaled(r) if self.thin else 1.0 / r))

    def near_slope(self, r: Array) -> Array:
        """Return its derivative [1/m^2]."""
        fall, dw = self.fall(r), self.rise_slope(r)
        if self.thin:
            return np.asarray(fall * self.kernel.scaled_slope(r) - dw * self.kernel.scaled(r))
        return np.asarray(-(dw + fall / r) / r)

    def _rise(self, r: Array) -> Array:
        d, s = self.width, self.step
        return np.asarray(0.5 * (erf((r - s) / d) + erf((r + s) / d)) if s else erf(r / d))

    def fall(self, r: Array) -> Array:
        """Return 1 - w."""
        d, s = self.width, self.step
        return np.asarray(0.5 * (erfc((r - s) / d) + erfc((r + s) / d)) if s else erfc(r / d))

    def rise_slope(self, r: Array) -> Array:
        """Return dw/dr [1/m]."""
        d, s = self.width, self.step
        bells = np.exp(-(((r - s) / d) ** 2)) + np.exp(-(((r + s) / d) ** 2))
        return np.asarray(bells / (np.sqrt(np.pi) * d))


def reach_of(kernel: LayeredKernel, least: float) -> float:
    """Return the distance [m] beyond which the slope of K is below ``least`` of a half-space's; inf without one."""
    if kernel.homogeneous or kernel.far_ratio > 0.0:
        return np.inf
    r = kernel.thickness * np.geomspace(0.1, 100.0, 400)
    felt = np.flatnonzero(np.abs(kernel.scaled_slope(r)) * r * r > least)
    return float(r[min(felt[-1] + 1, len(r) - 1)]) if felt.size else float(r[0])
