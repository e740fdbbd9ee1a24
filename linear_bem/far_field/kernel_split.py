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
from scipy.special import erf, erfc, j0

from linear_bem.arrays import Array
from linear_bem.layer.kernel import LayeredKernel

POINTS = 400
"""Of the quadrature over the near part; the waves of a mesh have up to 25 periods there."""


@dataclass(frozen=True)
class Rule:
    """What a mesh of spacing H takes: H/d, r/d of the last near pair beyond s, s/d where ``thin``, h/H elsewhere."""

    share: float
    cut: float
    step: float
    per_layer: float = 3.0


RULES = ((1e-5, Rule(0.4, 3.7, 3.6)), (1e-7, Rule(0.3, 4.5, 4.0)))
"""By the least precision. Measured on 400 random loads per (40 H)^2, splines of order 8 (root mean square of one load):
first split: field 1e-6/H and 6e-8/H, slope (`ParticleMesh.slope`) 1e-6/H^2 and 1.5e-7/H^2; second split, layers of
0.02 to 1 H: 5e-7/H and 5e-8/H, 9e-7/H^2 and 5e-8/H^2, times ``far_ratio`` where that is above 1.
"""
IN_CELL = ((1e-5, Rule(0.4, 3.7, 3.6)), (1e-7, Rule(0.3, 4.5, 4.0, 4.0)), (0.0, Rule(0.2, 5.2, 5.0, 5.0)))
"""The same in a cell that repeats."""


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
        if spacing <= 1.0001 * kernel.thickness / rule.per_layer:
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

    def far_transform(self, waves: Array, cut: float, uniform: float) -> Array:
        """Return the far part's two-dimensional Fourier transform [m] at wave numbers [1/m].

        Beyond ``cut`` [m] there is no near part; ``uniform`` [m] is the transform of the whole kernel at 0.
        """
        k = np.where(waves > 0.0, waves, 1.0)
        whole = np.where(waves > 0.0, 2.0 * np.pi / k * self.kernel.response_at(k), uniform)
        if not self.thin:
            near = np.where(waves > 0.0, 2.0 * np.pi / k * erf(0.5 * self.width * k), 2.0 * np.sqrt(np.pi) * self.width)
            return np.asarray(whole - near)
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        t = 0.5 * (nodes + 1.0)
        r = cut * t**2  # close together on the scale of a thin layer
        rings = 2.0 * np.pi * r * self.near(r) * cut * t * weights
        found, place = np.unique(np.round(waves * cut, 9), return_inverse=True)
        taken = np.array([rings @ j0(one * t**2) for one in found])
        return np.asarray(whole - taken[place].reshape(waves.shape))

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
