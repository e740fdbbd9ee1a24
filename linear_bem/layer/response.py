r"""The response G(t) of a layered half-space to a pressure that varies like a cosine.

A pressure p cos(k x) on an elastic half-space (E, nu) displaces its surface down by
w = 2 (1 - nu^2) / (E k) p cos(k x). On a layer of thickness h bonded to another half-space the same
holds with the layer's constants and a factor G(t), t = k h,

    G = [1 + 4 kap t e - lam kap e^2] / [(1 - lam e)(1 - kap e) - 4 kap t^2 e],   e = exp(-2 t),
    kap = (mu - 1) / (mu + 3 - 4 nu1),   lam = 1 - 4 (1 - nu1) / (1 + mu (3 - 4 nu2)),   mu = G1 / G2.

Derivation: Papkovich-Neuber (or Love) functions give the layer four and the base two exponentials;
two conditions at z = 0 (given pressure, no shear) and four at z = -h (bond) fix them. kap and lam are
Dundurs-like contrasts of the two materials, so that equal materials (both 0) give G = 1, a rigid base
is mu = 0, and t -> 0 gives the substrate's compliance. Sources: [Burmister 1945, J. Appl. Phys.
16, 89, doi 10.1063/1.1707558], [Chen and Engel 1972, Int. J. Solids Struct. 8, 1257,
doi 10.1016/0020-7683(72)90079-0]; thin limits [Johnson 1985, Contact Mechanics, section 5.8].
"""

from __future__ import annotations

import numpy as np

from linear_bem.arrays import Array
from linear_bem.problem import Elastic


class LayerResponse:
    """G(t) of one pair of materials; ``substrate`` None is a rigid base.

    ``expm1`` keeps the accuracy at small t for stiff and soft substrates
    (E1/E2 from 1e-6 to 1e6: relative error below 1e-12 wherever G > 1e-4).
    """

    def __init__(self, layer: Elastic, substrate: Elastic | None) -> None:
        nu = layer.poisson
        mu = 0.0 if substrate is None else layer.shear_modulus / substrate.shear_modulus
        below = 3.0 if substrate is None else 3.0 - 4.0 * substrate.poisson
        self._one_less_kap = 4.0 * (1.0 - nu) / (mu + 3.0 - 4.0 * nu)
        self._one_less_lam = 4.0 * (1.0 - nu) / (1.0 + mu * below)
        self._kap = (mu - 1.0) / (mu + 3.0 - 4.0 * nu)
        self._lam = 1.0 - self._one_less_lam

    def __call__(self, t: Array | float) -> Array:
        """Return G at t = k h >= 0."""
        t = np.asarray(t, dtype=float)
        kap, lam = self._kap, self._lam
        e = np.exp(-2.0 * t)
        rise = -np.expm1(-2.0 * t)
        at_zero = self._one_less_lam + lam * self._one_less_kap
        numerator = at_zero - lam * kap * np.expm1(-4.0 * t) + 4.0 * kap * t * e
        denominator = (self._one_less_lam + lam * rise) * (self._one_less_kap + kap * rise) - 4.0 * kap * t * t * e
        return np.asarray(numerator / denominator)

    @property
    def at_zero(self) -> float:
        """G(0): the substrate's compliance over the layer's (0 on a rigid base)."""
        return (self._one_less_lam + self._lam * self._one_less_kap) / (self._one_less_lam * self._one_less_kap)

    @property
    def smallest_scale(self) -> float:
        """A t below which G changes by no more than about its own size, which limits tables."""
        contrast = min(self._one_less_lam, self._one_less_kap) / max(abs(self._kap), 1e-300)
        return float(min(1.0, max(contrast, 1e-9), max(self.at_zero, 1e-9)))
