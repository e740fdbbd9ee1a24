"""The study's page: error and processor time of every discretisation, with and without the small-strain correction."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from runs.display.numbers import leading_ball
from runs.process.files import write_csv
from runs.studies.discretisations.matrix import cases
from runs.studies.framework.case import Case, Found
from runs.studies.framework.page import render
from runs.studies.framework.runner import study_of_cases

BY_ITSELF, PAIRED, BAR = "error of T, unpaired [%]", "error of T, paired [%]", "error bar of T [%]"


def present(found: Found, folder: Path) -> str:
    """Write discretisations.csv; return the table as Markdown."""
    rows = [row for case in found.cases for row in _rows(case, found)]
    write_csv(folder / "discretisations.csv", rows)
    return render(__file__, rows=rows)


def _rows(case: Case, found: Found) -> Iterator[dict[str, Any]]:
    """Yield one row per finished discretisation of a case."""
    steps = found.steps(case.name)
    if not steps:
        return
    ball = leading_ball(steps[-1]["balls"])
    truth = steps[-1]["balls"][ball]["tangential_force"]
    size = math.hypot(*truth)
    for step in steps:
        record, state = step["record"], step["balls"][ball]
        yield {
            "scene": case.labels["scene"],
            **{key: record[key] for key in ("order", "fineness", "unknowns", "iterations", "tangents", "seconds")},
            BY_ITSELF: 100.0 * math.dist(state["tangential_force_routes"]["domain_without_pair"], truth) / size,
            PAIRED: None if step is steps[-1] else 100.0 * math.dist(state["tangential_force"], truth) / size,
            BAR: 100.0 * state["tangential_force_error"] / size,
        }


STUDY = study_of_cases("discretisations", cases, present)
