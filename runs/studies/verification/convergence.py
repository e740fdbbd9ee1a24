"""How fast Q and T / Q^2 converge with the element size: three meshes of one family, ratio 1.4."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from runs.presentation import attraction
from runs.studies.case import Case
from runs.studies.records import DONE, Found
from runs.studies.verification.part import COARSE, Part, as_seen_by, cases_of, pair
from runs.studies.verification.pressing import MeshCase

NAME = "convergence"
RATIO = 1.4
SIZES, QUICK_SIZES = (RATIO, 1.0, 1.0 / RATIO), (RATIO**2, RATIO, 1.0)
"""Element sizes over the planned ones."""
ACCURACY = 0.03
LEAST_ORDER = 1.5
"""Order of Q and T / Q^2 that counts as converging: quadratic elements at the edge of a contact allow about 2 to 3."""


def cases(quick: bool) -> list[Case]:
    """Return both kinematics on three meshes, at a light and at a deeper approach."""
    sizes, accuracy = (QUICK_SIZES, COARSE) if quick else (SIZES, ACCURACY)
    wanted = (
        [("small_strain", 0.0125)]
        if quick
        else [("small_strain", 0.0125), ("finite_strain", 0.0125), ("finite_strain", 0.1)]
    )
    return [
        MeshCase(
            f"{NAME}-{model.replace('_', '-')}-{depth:g}", as_seen_by(model, pair(depth)), model, accuracy,
            labels={"part": NAME, "depth": depth}, sizes=sizes,
        )
        for model, depth in wanted
    ]  # fmt: skip


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per case and quantity: its values on the meshes, coarse to fine, and the order they show."""
    table = []
    for case in cases_of(found, NAME):
        if found.state(case.name) != DONE or not isinstance(case, MeshCase):
            continue
        steps = found.steps(case.name)
        last = {step["record"]["size"]: step for step in steps}  # load steps are in order: the deepest stays
        for quantity in ("Q", "T / Q²"):
            values = [_value(last[size], quantity) for size in case.sizes]
            table.append({"model": case.model, "D": case.labels["depth"], "quantity": quantity, **judged(values)})
    return table


def judged(values: list[float]) -> dict[str, Any]:
    """Return the entries of a row from values on three meshes, coarse to fine."""
    from finite_strain.extrapolation import observed_order  # noqa: PLC0415  (only where elements are pressed)

    before, change = values[1] - values[0], values[2] - values[1]
    order = observed_order(change, before, [1.0, RATIO, RATIO**2])
    last = abs(change / values[2])
    # differences that change their sign show no order; they must then be small themselves
    return {
        "coarse": values[0], "middle": values[1], "fine": values[2], "order": order, "last change": last,
        "holds": bool(order >= LEAST_ORDER) if math.isfinite(order) else last < 0.01,
    }  # fmt: skip


def _value(step: Any, quantity: str) -> float:
    ball = step["balls"][0]
    if quantity == "Q":
        return float(ball["normal_force"])
    return float(attraction(step["balls"], 0, ball["tangential_force"]) / np.square(ball["normal_force"]))


PART = Part(
    NAME,
    "Order of convergence",
    "Thin pair (h = 1.16 R, L = 2 R, nu = 0.48) at fixed approach on three meshes whose element sizes have the "
    "ratio 1.4, nothing extrapolated. The solver assumes 3 for Q and 2.5 for T / Q², and 2 for the error of T; a "
    "dash: the differences show none.",
    cases,
    rows,
    {
        "model": "model", "D": "D / R", "quantity": "quantity", "coarse": "coarse", "middle": "middle", "fine": "fine",
        "order": "observed order", "last change": "last change, relative",
    },
)  # fmt: skip
