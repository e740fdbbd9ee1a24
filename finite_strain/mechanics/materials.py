"""Hyperelastic laws: strain-energy functions of the displacement gradient; stresses follow by differentiation.

They are written in the displacement gradient H = F - I, without differences of nearly equal numbers:
a stiff substrate strains by 1e-5 and less, and the roundoff of I1 - 3 and ln J would exceed its energy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ufl

from finite_strain.mechanics.volumetric import Volumetric

_SERIES_RANGE = 0.02
_SERIES_TERMS = 10


def volume_change(H: Any) -> Any:
    """Return J - 1 = det(I + H) - 1."""
    return ufl.tr(H) + (ufl.tr(H) ** 2 - ufl.tr(H * H)) / 2 + ufl.det(H)


def _minus_logarithm(j: Any) -> Any:
    """Return j - ln(1 + j); by its Taylor series (error below 1e-17) where j is small."""
    series = 0
    for n in range(_SERIES_TERMS, 1, -1):
        series = j * series + (-1) ** n / n
    return ufl.conditional(ufl.lt(abs(j), _SERIES_RANGE), j * j * series, j - ufl.ln(1 + j))


def neo_hookean(H: Any, shear: Any, volumetric: Volumetric) -> Any:
    """Return mu/2 (I1 - 3) - mu ln J + volumetric(J - 1), the energy per reference volume.

    Neo-Hookean solid with Lame's constants of the small-strain limit; the volumetric term is lambda/2 (J - 1)^2 or
    its mixed form. The term in (ln J)^2 is not used: it softens in strong compression.
    """
    j = volume_change(H)
    # mu/2 (I1 - 3) = mu (tr H + H:H / 2), and tr H = j - (second and third invariants of H)
    deviation = ufl.inner(H, H) / 2 - (ufl.tr(H) ** 2 - ufl.tr(H * H)) / 2 - ufl.det(H)
    return shear * (deviation + _minus_logarithm(j)) + volumetric(j)


LAWS: dict[str, Callable[[Any, Any, Volumetric], Any]] = {"neo_hookean": neo_hookean}
