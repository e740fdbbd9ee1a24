"""Checks that a user-defined strain energy psi(F) has the layer's moduli at small strain.

The linear model, the pairs and S_Q compare with Hooke's law of the layer: another small-strain limit would count as
an effect of finite strain. UFL evaluates psi at a few values of F; nothing is compiled.
"""

import logging
import math
from itertools import takewhile
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
"""Simple shears along which an energy must be convex."""


def _of_user(problem: Problem) -> Any:
    """Return a user's energy, None for the laws of `linear_bem.law`."""
    psi = None if problem.finite_strain is None else problem.finite_strain.chosen
    return None if isinstance(psi, Law) else psi


def _value(psi: Any, F: np.ndarray) -> float:
    """Return an energy at F (3, 3); raises whatever the user's function or UFL raises.

    UFL's own conversion to a float hides every exception behind a `TypeError`.
    """
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)  # UFL reports what it cannot evaluate, besides raising it
    try:
        return float(ufl.as_ufl(psi(ufl.as_matrix(F.tolist())))(()))
    finally:
        logging.disable(before)


def _or_nan(psi: Any, F: np.ndarray) -> float:
    """Return an energy at F (3, 3), nan where it has no value: beyond the limit of a law."""
    try:
        return _value(psi, F)
    except Exception:  # whatever a user's function raises
        return math.nan


def softening(problem: Problem) -> list[str]:
    """Return a sentence where the shear stress of a user's energy falls as a simple shear grows: it is unstable there.

    Simple shears are rank-one, along which a stable energy is convex [Ball 1976, doi 10.1007/BF00279992].
    """
    psi = _of_user(problem)
    if psi is None:
        return []
    every = (_or_nan(psi, np.eye(3) + shear * np.eye(3, k=2)) for shear in SHEARS)
    bends = np.diff(list(takewhile(math.isfinite, every)), 2)
    fallen = SHEARS[1:-1][: len(bends)][bends < -ALIKE * abs(bends[:1])]
    return [f"the stress falls in simple shear from about {s:.2g} on: psi(F) is unstable" for s in fallen[:1]]


def check_own_energy(problem: Problem) -> None:
    """Raise `InvalidProblem` unless a user's energy is a number, with the layer's moduli and no stress at F = I."""
    psi, layer = _of_user(problem), problem.layer
    if psi is None:
        return

    def energies(strain: np.ndarray, step: float = STEP) -> np.ndarray:
        """Return the energies at F = I + e with e = -step, 0 and step times a strain (3, 3)."""
        return np.array([_value(psi, np.eye(3) + e * strain) for e in (-step, 0.0, step)])

    stretch = np.diag([1.0, 0.0, 0.0])
    try:
        along, sheared = energies(stretch), energies(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
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
    _check_invariance(psi)
    stress = (along[2] - along[0]) / (2.0 * STEP)
    bends = [float(np.diff(values, 2)[0]) / STEP**2 for values in (along, sheared)]
    shear, lame = bends[1] / 4.0, bends[0] - bends[1] / 2.0
    wanted = layer.lame_first + 2.0 * layer.shear_modulus
    if abs(stress) > ALIKE * max(wanted, abs(bends[0])):
        raise InvalidProblem(
            f"finite_strain.law: psi(F) must have no stress at F = I, got {stress:.4g} Pa; subtract a term with the "
            "same stress there, as mu ln J in mu/2 (I1 - 3) - mu ln J"
        )
    bend = float(np.diff(energies(stretch, NEARER * STEP), 2)[0]) / (NEARER * STEP) ** 2
    if abs(bend - bends[0]) > KINKED * abs(bends[0]):
        raise InvalidProblem(
            f"finite_strain.law: psi(F) must have second derivatives at F = I, got {bends[0]:.5g} Pa over strains of "
            f"{STEP:g} and {bend:.5g} Pa over {NEARER * STEP:g}; add nothing like a root of a squared strain"
        )
    is_shear = abs(shear - layer.shear_modulus) <= ALIKE * layer.shear_modulus
    if not is_shear or abs(bends[0] - wanted) > ALIKE * wanted:
        missing, times = layer.lame_first - lame, bends[0] / wanted
        alike = abs(shear - times * layer.shear_modulus) <= 10.0 * ALIKE * abs(shear)
        young, poisson = shear * (3.0 * lame + 2.0 * shear) / (lame + shear), lame / (2.0 * (lame + shear))
        raise InvalidProblem(
            f"finite_strain.law: psi(F) must have the layer's moduli at small strain, young {layer.young:g} Pa and "
            f"poisson {layer.poisson:g}, got {young:.5g} Pa and {poisson:.5g}: mu is {shear:.5g} Pa (the layer's "
            f"{layer.shear_modulus:.5g}), lambda {lame:.5g} Pa (the layer's {layer.lame_first:.5g})"
            + (f"; to correct lambda, add {0.5 * missing:.5g} (J - 1)^2 to psi" if is_shear else "")
            + (f"; both are {times:.4g} times the layer's: check the units of psi" if alike else "")
        )


def _check_invariance(psi: Any) -> None:
    """Raise `InvalidProblem` if an energy changes with rotations of the space or of the material."""
    generator = np.random.default_rng(0)
    for size in SHAKEN:
        F = np.eye(3) + size * generator.uniform(-1.0, 1.0, (3, 3))
        R = np.linalg.qr(generator.normal(size=(3, 3)))[0]
        R *= np.sign(np.linalg.det(R))
        values = [_or_nan(psi, each) for each in (np.eye(3), F, R @ F, F @ R)]
        if not np.all(np.isfinite(values)):
            if size > SHAKEN[0]:
                continue  # beyond the limit of the law
            raise InvalidProblem(f"finite_strain.law: psi(F) must be finite at strains of {size:g}, got {values} Pa")
        change = abs(values[1] - values[0])
        for turned, what in ((values[2], "objective, psi(R F) = psi(F)"), (values[3], "isotropic, psi(F R) = psi(F)")):
            if not abs(turned - values[1]) <= ALIKE * change:
                raise InvalidProblem(
                    f"finite_strain.law: psi(F) must be {what} for every rotation R, got {turned:.6g} and "
                    f"{values[1]:.6g} Pa for one"
                )
