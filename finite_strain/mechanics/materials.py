"""Strain energies per reference volume in the displacement gradient; stresses follow by differentiation.

The laws of `linear_bem.law` are written in H = F - I, without differences of nearly equal numbers: in a stiff
substrate, with strains of 1e-5 and less, the roundoff of I1 - 3 and ln J would exceed the energy. An energy's arguments
are the law with its parameters, H, the shear modulus, the volumetric energy, and ``still``, the values of H without
derivative; its value and first two derivatives are correct (`finite_strain.mechanics.invariants.second_order`).
"""

from collections.abc import Callable
from typing import Any

import ufl

from finite_strain.mechanics.invariants import minus_logarithm, second_invariant, second_order, volume_change
from finite_strain.mechanics.principal_stretches import PrincipalStretches, exponential_ratio, summed
from finite_strain.mechanics.volumetric import Volumetric
from linear_bem.law import Energy, Gent, Hyperfoam, Law, MooneyRivlin, NeoHookean, Ogden, Yeoh


def neo_hookean(law: NeoHookean, H: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
    """Return mu/2 A + volumetric(J - 1), A = I1 - 3 - 2 ln J.

    The volumetric term is lambda/2 (J - 1)^2 or its mixed form. The term in (ln J)^2 is not used: it softens in strong
    compression.
    """
    return shear / 2 * _first(H, still) + volumetric(volume_change(H))


def mooney_rivlin(law: MooneyRivlin, H: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
    """Return mu/2 [(1 - s) A + s B] - s mu (J - 1)^2 + volumetric(J - 1), B = I2 - 3 - 4 ln J."""
    j, first = volume_change(H), _first(H, still)
    second = 2 * first + second_invariant(H + H.T + H.T * H)
    return shear / 2 * ((1 - law.share) * first + law.share * second) - law.share * shear * j**2 + volumetric(j)


def yeoh(law: Yeoh, H: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
    """Return mu/2 (A + c A^2 + d A^3) + volumetric(J - 1)."""
    first, (c, d) = _first(H, still), law.ratios
    return shear / 2 * (first + c * first**2 + d * first**3) + volumetric(volume_change(H))


def gent(law: Gent, H: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
    """Return -mu/2 J_m ln(1 - A / J_m) + volumetric(J - 1); nan from A = J_m on."""
    first, present = _first(H, still), _first(still, still)
    limited = second_order(lambda a: a[0] + law.limit * minus_logarithm(-a[0] / law.limit), [first], [present])
    return shear / 2 * limited + volumetric(volume_change(H))


def ogden(law: Ogden, H: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
    """Return the sum of 2 mu w / a^2 (l1^a + l2^a + l3^a - 3 - a ln J), plus volumetric(J - 1)."""
    return summed(lambda stretches: _terms(law, shear, stretches), H, still) + volumetric(volume_change(H))


def hyperfoam(law: Hyperfoam, H: Any, shear: Any, volumetric: Any, still: Any) -> Any:
    """Return the sum of 2 mu w / a^2 [l1^a + l2^a + l3^a - 3 + (J^(-a b) - 1) / b] with b = lambda / (2 mu)."""
    b = volumetric.lame / (2 * shear)

    def energy(stretches: PrincipalStretches) -> Any:
        volume = stretches.logarithm
        terms = zip(law.exponents, law.weights, strict=True)
        # (J^(-a b) - 1) / b + a ln J = a^2 b (ln J)^2 (exp(x) - 1 - x) / x^2 with x = -a b ln J
        grown = sum(2 * shear * w * b * volume**2 * exponential_ratio(-a * b * volume) for a, w in terms)
        return _terms(law, shear, stretches) + grown

    return summed(energy, H, still)


def _first(H: Any, still: Any) -> Any:
    """Return A = I1 - 3 - 2 ln J: (I1 - 3)/2 = tr H + H:H / 2, tr H = J - 1 - (second and third invariants of H)."""
    less_logarithm = second_order(lambda j: minus_logarithm(j[0]), [volume_change(H)], [volume_change(still)])
    return ufl.inner(H, H) - 2 * (second_invariant(H) + ufl.det(H) - less_logarithm)


def _terms(law: Ogden | Hyperfoam, shear: Any, stretches: PrincipalStretches) -> Any:
    terms = zip(law.exponents, law.weights, strict=True)
    return sum(2 * shear * w / a**2 * stretches.excess(a) for a, w in terms)


ENERGIES: dict[type[Law], Callable[[Any, Any, Any, Volumetric, Any], Any]] = {
    NeoHookean: neo_hookean, MooneyRivlin: mooney_rivlin, Yeoh: yeoh, Gent: gent, Ogden: ogden, Hyperfoam: hyperfoam,
}  # fmt: skip


def energy_density(law: Law | Energy | None, H: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
    """Return the strain energy under a law or a user's psi(F), nan where an element is inverted.

    Without a law it is that of linear isotropic elasticity at small strain, mu e:e + volumetric(tr e).
    """
    if law is None:
        strain = ufl.sym(H)
        return shear * ufl.inner(strain, strain) + volumetric(ufl.tr(strain))
    if isinstance(law, Law):
        return ENERGIES[type(law)](law, H, shear, volumetric, still)
    return law(ufl.Identity(3) + H)


def cauchy_stress(law: Law | Energy | None, H: Any, stress: Any) -> Any:
    """Return the Cauchy stress P F^T / J [Pa] of the energy's derivative P; at small strain they are the same."""
    if law is None:
        return stress
    F = ufl.Identity(3) + H
    return stress * F.T / ufl.det(F)
