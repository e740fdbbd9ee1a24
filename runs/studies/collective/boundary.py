"""The thickness at which T of two touching balls vanishes, by both models."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem import solve
from runs.process.files import read_json, write_text
from runs.process.json_values import to_json
from runs.studies.collective.cases import APPROACH, POISSON
from runs.studies.framework.pair import pair

THICKNESSES = (1.6, 1.8, 2.0)
ACCURACY = 0.05
"""Accuracy of T at finite strain, relative to |T| or to a tenth of a half-space's force."""
KEY = f"D {APPROACH:g} R, nu {POISSON:g}, accuracy {ACCURACY:g}"
"""Saved answers with another key are not used."""


def compute(thickness: float, file: Path) -> None:
    """Save T/Q of two touching balls by both models, with errors."""
    from mpi4py import MPI  # noqa: PLC0415

    import finite_strain  # noqa: PLC0415  (imports DOLFINx)

    problem = pair(APPROACH, thickness, poisson=POISSON, substrate=None)
    row: dict[str, Any] = {"h/R": thickness, "key": KEY}
    linear = dataclasses.replace(problem, finite_strain=None)
    # one rank alone runs this study
    finite = finite_strain.solve(problem, accuracy=ACCURACY, comm=MPI.COMM_SELF)
    for name, result in (("small", solve(linear)), ("finite", finite)):
        left = result.balls[0]
        row[f"{name} strain"] = left.tangential_force[0] / left.normal_force
        row[f"error, {name} strain"] = left.tangential_force_error / left.normal_force
    write_text(file, to_json(row))


def read(folder: Path) -> list[dict[str, Any]]:
    """Return the saved rows."""
    found = (read_json(file_of(folder, thickness)) for thickness in THICKNESSES)
    return [row for row in found if row is not None and row.pop("key", "") == KEY]


def file_of(folder: Path, thickness: float) -> Path:
    """Return the file of a thickness."""
    return folder / f"touching-h{thickness:g}.json"


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
