r"""Near and far part of the layer's kernel; the far part is smooth enough for a mesh.

    K(r)/singular = near + far,   w(r) = [erf((r - s)/d) + erf((r + s)/d)]/2,

    thin = False, s = 0:  far = w(r)/r + smooth(r),   near = [1 - w(r)]/r,
    thin = True:          far = w(r) K(r)/singular,   near = [1 - w(r)] K(r)/singular.

The first is Ewald's split [Ewald 1921, Ann. Phys. 369, 253, doi 10.1002/andp.19213690304] of 1/r; the transform of the
layer's smooth part decays as exp(-2 k h), so its mesh needs the spacing h/3. The second needs only a mesh fine enough
for the width d: w rises from 0 at the distance s (s = 0 again for a half-space), where the layer's contribution varies
on the scale of the distance. Its near pairs reach twice as far.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import erf, erfc, j0

from linear_bem.arrays import Array
from linear_bem.layer.kernel import LayeredKernel

POINTS = 400
"""Quadrature points over the near part, where the waves of a mesh have up to 25 periods."""


@dataclass(frozen=True)
class Rule:
    """Ratios for a mesh of spacing H: H/d, (r - s)/d of the last near pair, s/d if ``thin``, and h/H otherwise."""

    share: float
    cut: float
    step: float
    per_layer: float = 3.0


RULES = ((1e-5, Rule(0.4, 3.7, 3.6)), (1e-7, Rule(0.3, 4.5, 4.0)))
"""(Least precision, rule). Measured on 400 random loads per (40 H)^2, splines of order 8 (rms error of one load):
first split: field 1e-6/H and 6e-8/H, slope (`ParticleMesh.slope`) 1e-6/H^2 and 1.5e-7/H^2; second split, layers of
0.02 to 1 H: 5e-7/H and 5e-8/H, 9e-7/H^2 and 5e-8/H^2, times ``far_ratio`` where that is above 1.
"""
IN_CELL = ((1e-5, Rule(0.4, 3.7, 3.6)), (1e-7, Rule(0.3, 4.5, 4.0, 4.0)), (0.0, Rule(0.2, 5.2, 5.0, 5.0)))
"""The same for a periodic cell."""


@dataclass(frozen=True)
class Split:
    """The two parts of K/``singular`` [1/m]; ``width`` is d and ``step`` is s [m]."""

    kernel: LayeredKernel
    width: float
    step: float = 0.0
    thin: bool = False

    @classmethod
    def of(cls, kernel: LayeredKernel, spacing: float, rule: Rule) -> "Split":
        """Return the split for a mesh of this ``spacing`` [m]; the second one if it is too coarse for the layer."""
        width = spacing / rule.share
        if spacing <= 1.0001 * kernel.thickness / rule.per_layer:
            return cls(kernel, width)
        return cls(kernel, width, rule.step * width, thin=True)

    def far(self, r: Array) -> Array:
        """Return the part of K/``singular`` on the mesh [1/m]; finite at r = 0."""
        r = np.maximum(r, 1e-6 * self.width)
        if self.thin:
            return np.asarray((1.0 - self.fall(r)) * self.kernel.scaled(r))
        return np.asarray((1.0 - self.fall(r)) / r + self.kernel.smooth(r))

    def far_slope(self, r: Array) -> Array:
        """Return the derivative of `far` [1/m^2]."""
        r = np.maximum(r, 1e-3 * self.width)
        w, dw = 1.0 - self.fall(r), self.rise_slope(r)
        if self.thin:
            return np.asarray(dw * self.kernel.scaled(r) + w * self.kernel.scaled_slope(r))
        return np.asarray((dw - w / r) / r + self.kernel.smooth_slope(r))

    def near(self, r: Array) -> Array:
        """Return the part of K/``singular`` for near pairs [1/m], r > 0."""
        return np.asarray(self.fall(r) * (self.kernel.scaled(r) if self.thin else 1.0 / r))

    def near_slope(self, r: Array) -> Array:
        """Return the derivative of `near` [1/m^2]."""
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
        r = cut * t**2  # dense near r = 0, for thin layers
        rings = 2.0 * np.pi * r * self.near(r) * cut * t * weights
        found, place = np.unique(np.round(waves * cut, 9), return_inverse=True)
        taken = np.array([rings @ j0(one * t**2) for one in found])
        return np.asarray(whole - taken[place].reshape(waves.shape))

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
    """Return the distance [m] beyond which the slope of K is below ``least`` of a half-space's; inf if it never is."""
    if kernel.homogeneous or kernel.far_ratio > 0.0:
        return np.inf
    r = kernel.thickness * np.geomspace(0.1, 100.0, 400)
    felt = np.flatnonzero(np.abs(kernel.scaled_slope(r)) * r * r > least)
    return float(r[min(felt[-1] + 1, len(r) - 1)]) if felt.size else float(r[0])
