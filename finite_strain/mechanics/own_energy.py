"""Checks that a user-defined strain energy psi(F) has the layer's moduli at small strain.

The linear model, the pairs and S_Q compare with Hooke's law of the layer: another small-strain limit would count as
an effect of finite strain. UFL evaluates psi at a few values of F; nothing is compiled.
"""

from typing import Any

import numpy as np
import ufl

from linear_bem.errors import InvalidProblem
from linear_bem.law import Law
from linear_bem.problem import Problem

STEP, ALIKE = 1e-3, 1e-3
"""Strain of the differences, whose error is of second order in it; largest accepted relative difference of moduli."""

NEARER, KINKED = 1e-2, 1e-2
"""Second step of a second difference, over `STEP`, and the largest relative difference of smooth energies."""
SHAKEN = (0.05, 0.05, 0.05, 0.3, 0.3, 0.3)
"""Sizes of the entries of F - I for which rotations are tried; a law may have no value for the larger ones."""

SHEARS = np.linspace(0.0, 1.0, 51)
"""Simple shears at which an energy must not fall."""


def softening(problem: Problem) -> list[str]:
    """Return a sentence where a user's energy falls as a simple shear grows, if it does: it is unstable there."""
    psi, last = None if problem.finite_strain is None else problem.finite_strain.chosen, -np.inf
    if psi is None or isinstance(psi, Law):
        return []
    for shear in SHEARS:
        try:
            value = float(psi(ufl.as_matrix([[1.0, 0.0, shear], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])))
        except (ArithmeticError, ValueError):  # beyond the limit of the law
            break
        if value < last:
            return [f"psi(F) falls where a simple shear grows beyond {shear:.2g}: the law is unstable there"]
        last = value
    return []


def check_own_energy(problem: Problem) -> None:
    """Raise `InvalidProblem` unless a user's energy is a number, with the layer's moduli and no stress at F = I."""
    psi = None if problem.finite_strain is None else problem.finite_strain.chosen
    if psi is None or isinstance(psi, Law):
        return
    layer = problem.layer

    def energy(*entries: tuple[int, int], step: float = STEP) -> np.ndarray:
        """Return the energies at F = I + e with entries -step, 0 and step of e."""
        values = []
        for e in (-step, 0.0, step):
            F = np.eye(3)
            for place in entries:
                F[place] += e
            values.append(float(psi(ufl.as_matrix(F.tolist()))))
        return np.array(values)

    try:
        along, sheared = energy((0, 0)), energy((0, 1), (1, 0))
    except Exception as error:  # whatever a user's function raises
        raise InvalidProblem(
            "finite_strain.law: psi(F) must be an expression of ufl with one finite value for every F near I (no "
            f"tensor, no logarithm or root without value), got {type(error).__name__}: {error}"
        ) from error
    if not np.all(np.isfinite([along, sheared])):
        raise InvalidProblem(
            f"finite_strain.law: psi(F) must be finite near F = I, got {along.tolist()}; write it without eigenvalues "
            "or quotients that have no value where principal stretches coincide"
        )
    if np.ptp([along, sheared]) == 0.0:
        raise InvalidProblem(f"finite_strain.law: psi(F) must grow with the strain, got {along[1]:g} Pa near F = I")
    stress = (along[2] - along[0]) / (2.0 * STEP)
    bends = [(v[2] - 2.0 * v[1] + v[0]) / STEP**2 for v in (along, sheared)]
    shear, lame = bends[1] / 4.0, bends[0] - bends[1] / 2.0
    wanted = layer.lame_first + 2.0 * layer.shear_modulus
    if abs(stress) > ALIKE * wanted:
        raise InvalidProblem(
            f"finite_strain.law: psi(F) must have no stress at F = I, got {stress:.4g} Pa; subtract a term with the "
            "same stress there, as mu ln J in mu/2 (I1 - 3) - mu ln J"
        )
    near = energy((0, 0), step=NEARER * STEP)
    bend = (near[2] - 2.0 * near[1] + near[0]) / (NEARER * STEP) ** 2
    if abs(bend - bends[0]) > KINKED * abs(bends[0]):
        raise InvalidProblem(
            f"finite_strain.law: psi(F) must have second derivatives at F = I, got {bends[0]:.5g} Pa over strains of "
            f"{STEP:g} and {bend:.5g} Pa over {NEARER * STEP:g}; add nothing like a root of a squared strain"
        )
    if abs(shear - layer.shear_modulus) > ALIKE * layer.shear_modulus or abs(bends[0] - wanted) > ALIKE * wanted:
        young, poisson = shear * (3.0 * lame + 2.0 * shear) / (lame + shear), lame / (2.0 * (lame + shear))
        raise InvalidProblem(
            f"finite_strain.law: psi(F) must have the layer's moduli at small strain, young {layer.young:g} Pa and "
            f"poisson {layer.poisson:g}, got {young:.5g} Pa and {poisson:.5g}; change either"
        )
    _check_invariance(psi)


def _check_invariance(psi: Any) -> None:
    """Raise `InvalidProblem` if an energy changes with rotations of the space or of the material."""
    generator = np.random.default_rng(0)
    for size in SHAKEN:
        F = np.eye(3) + size * generator.uniform(-1.0, 1.0, (3, 3))
        R = np.linalg.qr(generator.normal(size=(3, 3)))[0]
        R *= np.sign(np.linalg.det(R))
        try:
            values = [float(psi(ufl.as_matrix(each.tolist()))) for each in (np.eye(3), F, R @ F, F @ R)]
        except (ArithmeticError, ValueError):
            if size == SHAKEN[0]:
                raise
            continue  # beyond the limit of the law
        if size > SHAKEN[0] and not np.all(np.isfinite(values)):
            continue
        change = abs(values[1] - values[0])
        for turned, what in ((values[2], "objective, psi(R F) = psi(F)"), (values[3], "isotropic, psi(F R) = psi(F)")):
            if not abs(turned - values[1]) <= ALIKE * change:
                raise InvalidProblem(
                    f"finite_strain.law: psi(F) must be {what} for every rotation R, got {turned:.6g} and "
                    f"{values[1]:.6g} Pa for one"
                )
