"""Cases at the ends of the fit's range and just outside, and S_Q there beside the fit; the template has the text."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from runs.comparison.strengthening_fit import fit_error, outside, strengthening_at_force
from runs.studies.framework.case import Case
from runs.studies.framework.page import render
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import Found
from runs.studies.strengthening.matrix import along
from runs.studies.strengthening.ratios import load_paths

CORNERS = (
    (1.0, 0.47, 2.0), (1.0, 0.49, 2.0), (1.2, 0.47, 2.0), (1.2, 0.49, 2.0), (1.16, 0.48, 2.0), (1.16, 0.48, 2.1),
    (5.0, 0.47, 2.0), (8.0, 0.49, 2.0), (6.0, 0.48, 2.1), (1.0, 0.47, 2.1), (1.2, 0.49, 2.1), (1.3, 0.47, 2.0),
)  # fmt: skip
"""Thickness over R, Poisson's ratio and distance over R; the last one is outside the range."""
APPROACHES = (0.16, 0.5)
"""Approaches over R."""
ACCURACY, UNKNOWNS = 0.004, 60e3


def cases(quick: bool) -> list[Case]:
    """Return a case per corner; two coarse ones in the quick version."""
    accuracy, corners = (0.2, CORNERS[4:8:2]) if quick else (ACCURACY, CORNERS)
    return [
        along("range", h, APPROACHES, accuracy, poisson=nu, distance=L, unknowns=UNKNOWNS, substrate=None)
        for h, nu, L in corners
    ]


def present(found: Found, folder: Path) -> str:
    """Write factors.csv and return the answer as Markdown."""
    rows = [
        _row(case.labels, row) for case, path in load_paths(found, folder) for row in path if row["S_Q"] is not None
    ]
    inside = [row for row in rows if row["in the range"] == "yes"]
    held = sum(row["fit holds"] == "yes" for row in inside)
    return render(__file__, rows=rows, held=held, count=len(inside))


def _row(labels: Mapping[str, Any], row: Mapping[str, Any]) -> dict[str, Any]:
    """Return S_Q of one state beside the fit, and whether they agree within both errors."""
    h, nu, L, depth = labels["h"], labels["nu"], labels["L"], row["D"]
    fit, error = strengthening_at_force(depth, h, nu, L), fit_error(depth, h, nu, L)
    holds = abs(row["S_Q"] - fit) <= error + row["S_Q_error"]
    return {
        "h / R": h, "nu": nu, "L / R": L, "D / R": depth,
        "S_Q": (row["S_Q"], row["S_Q_error"]), "fit": (fit, error),
        "fit holds": "yes" if holds else "no", "in the range": "no" if outside(depth, h, L, nu) else "yes",
    }  # fmt: skip


STUDY = study_of_cases("fit_range", cases, present)
