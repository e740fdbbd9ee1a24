"""Five scenes at full load on the same discretisations: error against the last one, paired and unpaired, and time."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from linear_bem.problem import Ball
from runs.display.numbers import leading_ball
from runs.process.files import write_csv
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.page import render
from runs.studies.framework.pair import THICK, pair, pressed
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import Found

LEVELS = (Level(2, 1.0), Level(2, 1.5), Level(3, 1.0), Level(4, 1.0))
"""Coarse to fine; the states on each are the initial guesses on the next."""


SCENES = {
    "thin pair": pair(0.32, substrate=None),
    "thick pair": pair(0.32, THICK, substrate=None),
    "radii 1 : 4": pressed([Ball((0.0, 0.0), 1.0), Ball((4.0, 0.0), 4.0)], 0.2, 2.0, 0.45),
    "three unlike balls": pressed(
        [Ball((0.0, 0.0), 1.0), Ball((2.4, 0.3), 1.3), Ball((0.7, 2.4), 0.8)], 0.2, 1.5, 0.45
    ),
    "nine balls": pressed([Ball((x, y), 1.0) for x in (-2.2, 0.0, 2.2) for y in (-2.2, 0.0, 2.2)], 0.1),
}
"""Nine balls have two mirror planes, the three unlike balls none."""


def cases(quick: bool) -> list[Case]:
    """Return one case per scene."""
    scenes = {"thin pair": pair(0.03, substrate=None)} if quick else SCENES
    levels = (Level(2, 1.0), Level(3, 1.0)) if quick else LEVELS
    return [
        LevelCase(name.replace(" ", "-"), scene, "finite_strain", 0.02, labels={"scene": name}, levels=levels)
        for name, scene in scenes.items()
    ]


BY_ITSELF, PAIRED, BAR = "error of T, unpaired [%]", "error of T, paired [%]", "error bar of T [%]"


def present(found: Found, folder: Path) -> str:
    """Write discretisations.csv; return the table as Markdown."""
    rows = [row for case in found.cases for row in _rows(case, found)]
    write_csv(folder / "discretisations.csv", rows)
    return render(__file__, rows=rows)


def _rows(case: Case, found: Found) -> Iterator[dict[str, Any]]:
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
