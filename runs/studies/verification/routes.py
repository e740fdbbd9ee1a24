"""T by three routes along the load: domain integral, contact traction, and the energy's slope by distance.

The energy is taken on one mesh that is moved with the balls, so that its mesh error is the same at both distances; it
is extrapolated from two such meshes as T itself is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from runs.presentation import attraction
from runs.studies.case import Case
from runs.studies.records import DONE, Found
from runs.studies.verification.part import COARSE, Part, pair
from runs.studies.verification.pressing import MeshCase

NAME = "routes"
DISTANCE, SHIFT = 2.1, 0.02
"""Distance of the balls over R, and by how much each is moved either way."""
SIZES = (1.4, 1.0)
"""Element sizes of the two meshes, as a run's own first two."""
ANSWER, APART, TOGETHER = "routes-answer", "routes-apart", "routes-together"
ACCURACY = 0.1


def cases(quick: bool) -> list[Case]:
    """Return the answer to be checked and the two runs whose energies are compared."""
    problem, accuracy = pair(0.015 if quick else 0.5, distance=DISTANCE), COARSE if quick else ACCURACY
    labels = {"part": NAME}
    one = {"finite_strain.refinement.MOST_MESHES": 1}
    shifted = [
        MeshCase(name, problem, "finite_strain", accuracy, labels=labels, sizes=SIZES, shift=sign * SHIFT)
        for name, sign in ((APART, 1.0), (TOGETHER, -1.0))
    ]
    return [Case(ANSWER, problem, "finite_strain", accuracy, one, labels), *shifted]


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per load step: T / Q^2 by every route, the error bar, and the largest departure over it."""
    if found.state(APART) != DONE or found.state(TOGETHER) != DONE:
        return []
    slopes = energy_slopes(found.steps(APART), found.steps(TOGETHER))
    table = []
    for step in found.steps(ANSWER):
        energy = slopes.get(round(step["record"]["fraction"], 9))
        if energy is not None:
            table.append(_row(step, energy))
    return table


def energy_slopes(
    apart: Sequence[Mapping[str, Any]], together: Sequence[Mapping[str, Any]], shift: float = SHIFT
) -> dict[float, tuple[float, float]]:
    """Return (dU/dL) / Q^2 on the coarse and the fine mesh by load fraction; none where the runs differ in kind."""
    found: dict[float, dict[float, float]] = {}
    others = {_place(step): step for step in together}
    for step in apart:
        other = others.get(_place(step))
        if other is None or step["record"]["augmentations"] != other["record"]["augmentations"]:
            continue
        change = _energy(step) - _energy(other)
        force = 0.5 * (step["balls"][0]["normal_force"] + other["balls"][0]["normal_force"])
        size, fraction = _place(step)
        # each ball moves by the shift, so the distance changes by four shifts between the two runs
        found.setdefault(fraction, {})[size] = change / (4.0 * shift) / force**2
    return {f: (by[SIZES[0]], by[SIZES[1]]) for f, by in found.items() if set(SIZES) <= set(by)}


def _energy(step: Mapping[str, Any]) -> float:
    """Return the energy [J] whose slope is T though the contact gives way a little.

    By the penetration g under the pressure p, the strain energy's slope is short of T by int p dg and that of the
    augmented potential long by int g dp; as p and g grow alike, their mean has neither.
    """
    return 0.5 * float(step["record"]["strain_energy"] + step["record"]["potential"])


def _place(step: Mapping[str, Any]) -> tuple[float, float]:
    return float(step["record"]["size"]), round(float(step["record"]["fraction"]), 9)


def _row(step: Mapping[str, Any], energy: tuple[float, float]) -> dict[str, Any]:
    ball = step["balls"][0]
    squared = ball["normal_force"] ** 2

    def toward(route: str) -> float:
        return attraction(step["balls"], 0, ball["tangential_force_routes"][route]) / squared

    domain, traction = toward("domain"), toward("traction")
    plain = _extrapolated(toward("domain_companion_mesh"), toward("domain_main_mesh"))
    # what the model's end adds to T is taken off the answer, and must be off the energy's slope alike
    slope = _extrapolated(*energy) - (plain - domain)
    error = step["record"]["tangential_force_error_at_force"][0] / squared
    worst = max(abs(traction - domain), abs(slope - domain))
    return {
        "D": ball["approach"],
        "Q": ball["normal_force"],
        "domain": (domain, error),
        "traction": traction,
        "energy": slope,
        "traction off": traction / domain - 1.0,
        "energy off": slope / domain - 1.0,
        "bar": error / abs(domain),
        "worst": worst / error,
        "holds": bool(worst <= error),
    }


def _extrapolated(coarse: float, fine: float) -> float:
    from finite_strain.extrapolation import force_ratio  # noqa: PLC0415  (only where elements are pressed)

    values = [np.array([[fine, 0.0]]), np.array([[coarse, 0.0]])]
    return float(force_ratio(values, [SIZES[1], SIZES[0]]).value[0, 0])


PART = Part(
    NAME,
    "Three routes to T along the load",
    f"Thin pair (h = 1.16 R, L = {DISTANCE:g} R, nu = 0.48). T E1 R² / Q² (T > 0 attracts) by domain integral (the "
    "answer, with its error bar at its normal force), by contact traction, and by dU/dL at fixed approach: "
    f"energies of two runs whose balls, and one mesh with them, are moved by ± {SHIFT:g} R. The last column is the "
    "largest departure over the error bar.",
    cases,
    rows,
    {
        "D": "D / R", "Q": "Q / E1 R²", "domain": "domain integral", "traction": "traction", "energy": "energy",
        "worst": "departure / error bar",
    },
)  # fmt: skip
