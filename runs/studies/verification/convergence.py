"""Convergence of Q and T / Q^2 of the finite elements at small strain to the linear model."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from runs.comparison.linear_states import LinearStates
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import as_seen_by, pair
from runs.studies.framework.saved_cases import Found, pull
from runs.studies.verification.part import Part, claimed

NAME = "convergence"
LEVELS = ((2, 1.0), (3, 1.0), (4, 1.0), (4, 1.5))
"""Order of the elements and fineness of the mesh; their product is the resolution. The quick version takes two."""
ACCURACY, WIDE = 0.02, 2.0
"""Accuracy that determines the domain size, and a factor on it: truncation must not hide the discretisation error."""
BAND = (2.0, 7.0)
"""Accepted convergence orders in the resolution: the theoretical 3 to 6, widened by one on either side.

Pressure falls like a square root at the contact's edge: u lies in H^s for s < 5/2, and functionals converge with order
2 (s - 1) = 3, or twice that in the polynomial degree where mesh lines follow the edge.
"""
FLOOR = 2e-3
"""Relative error of the finest mesh up to which a row passes if the errors show no order: T is a small difference."""


def cases(quick: bool) -> list[Case]:
    """Return small strain on a rigid base, compressible and nearly incompressible."""
    levels = LEVELS[:2] if quick else LEVELS
    return [
        LevelCase(
            f"{NAME}-nu{poisson:g}", as_seen_by("small_strain", pair(0.1, poisson=poisson, substrate=None)),
            "small_strain", ACCURACY, labels={"part": NAME, "nu": poisson},
            levels=tuple(Level(*level, WIDE) for level in levels),
        )
        for poisson in ((0.3,) if quick else (0.3, 0.48))
    ]  # fmt: skip


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per case and quantity: its errors by resolution, and the observed order."""
    table = []
    for case in found.done(NAME):
        steps = found.steps(case.name)
        (truth,) = LinearStates(case.problem, 1e-7, {}).along("approach", steps[-1:])["steps"]
        sizes = [step["record"]["order"] * step["record"]["fineness"] for step in steps]
        for quantity in ("Q", "T / Q²"):
            known = _value(truth, quantity)
            errors = [_value(step, quantity) / known - 1.0 for step in steps]
            table.append({"nu": case.labels["nu"], "quantity": quantity, **judged(sizes, errors)})
    return table


def judged(resolutions: Sequence[float], errors: Sequence[float]) -> dict[str, Any]:
    """Return the entries of a row: relative errors, coarse to fine, and their order by least squares.

    If the order is outside the band, the finest error must be below the floor.
    """
    sizes = np.abs(errors)
    order = -float(np.polyfit(np.log(resolutions), np.log(np.maximum(sizes, 1e-300)), 1)[0])
    holds = BAND[0] <= order <= BAND[1] or sizes[-1] <= FLOOR
    return {
        "resolution": ", ".join(f"{r:g}" for r in resolutions),
        "errors": ", ".join(f"{100.0 * e:+.2g}" for e in errors),
        "order": order, "coarse": float(sizes[0]), "fine": float(sizes[-1]),
        "verdict": claimed(bool(holds)),
    }  # fmt: skip


def _value(step: Any, quantity: str) -> float:
    force = float(step["balls"][0]["normal_force"])
    return force if quantity == "Q" else float(pull(step["balls"])[0] / np.square(force))


PART = Part(NAME, "Order of convergence", cases, rows)
