"""The thickness at which T of two touching balls vanishes, by both models."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from runs.studies.collective.cases import APPROACH, POISSON
from runs.studies.framework.case import FINITE, LINEAR, Case
from runs.studies.framework.pair import as_seen_by, pair
from runs.studies.framework.saved_cases import DONE, Found, pull

THICKNESSES = (1.6, 1.8, 2.0)
ACCURACY = {LINEAR: 1e-4, FINITE: 0.05}
"""Accuracy of T by model, relative to |T| or, at finite strain, to a tenth of a half-space's force."""
KINEMATICS = {LINEAR: "small strain", FINITE: "finite strain"}


def cases() -> list[Case]:
    """Return two touching balls on every layer by both models."""
    problems = {h: pair(APPROACH, h, poisson=POISSON, substrate=None) for h in THICKNESSES}
    return [
        Case(f"touching-h{h:g}-{model}", as_seen_by(model, problem), model, accuracy, labels={"h": h}, alone=True)
        for h, problem in problems.items()
        for model, accuracy in ACCURACY.items()
    ]


def read(found: Found) -> list[dict[str, Any]]:
    """Return T/Q with its error by both models, one row per thickness that both have solved."""
    rows: dict[float, dict[str, Any]] = {h: {"h/R": h} for h in THICKNESSES}
    for case in found.cases:
        if found.state(case.name) == DONE:
            balls = found.steps(case.name)[-1]["balls"]
            ratio, error = np.divide(pull(balls), balls[0]["normal_force"]).tolist()
            rows[case.labels["h"]] |= {KINEMATICS[case.model]: ratio, f"error, {KINEMATICS[case.model]}": error}
    return [row for row in rows.values() if len(row) == 5]


def vanishing(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the thickness where T vanishes at small and at finite strain; empty until all rows are saved.

    It is the zero of a parabola of T/Q through three points; its error: that of T plus the difference from a line.
    """
    if len(rows) < len(THICKNESSES):
        return []
    h = np.array([row["h/R"] for row in rows])
    ends = []
    for name in ("small strain", "finite strain"):
        ratio, error = (np.array([row[key] for row in rows]) for key in (name, f"error, {name}"))
        order = np.argsort(ratio)
        place = float(np.polyval(np.polyfit(ratio, h, 2), 0.0))
        line = float(np.interp(0.0, ratio[order], h[order]))
        known = abs(place - line) + float(np.max(error / np.gradient(ratio, h)))
        ends.append(f"{place:.3f} +- {known:.3f} R")
    return ends
