"""The scenes: balls pressed in until the layer is a thin film, each on several meshes and two element orders."""

from dataclasses import dataclass

from linear_bem.problem import Ball, Problem
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import THICK, pair, pressed

LEVELS = (Level(2, 1.0), Level(2, 1.5), Level(3, 1.0), Level(3, 1.5))
"""Coarse to fine; the states on each are the initial guesses on the next."""
EVIDENCE = (Level(2, 1.0), Level(2, 1.5), Level(2, 2.0), Level(3, 1.0), Level(3, 1.5), Level(3, 2.0))
"""Discretisations of the thin pair: the end of its load path must not depend on mesh or order."""


@dataclass(frozen=True)
class Deep:
    """A scene at full load, the approaches over R with output, and the discretisations."""

    problem: Problem
    approaches: tuple[float, ...]
    levels: tuple[Level, ...] = LEVELS


def scenes() -> dict[str, Deep]:
    """Return the scenes by name; R = 1 and E1 = 1, rigid base."""
    ball = pressed([Ball((0.0, 0.0), 1.0)], 2.0, THICK)
    return {
        "thin pair": Deep(pair(1.0, substrate=None), (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0), EVIDENCE),
        "pair on 2 R": Deep(pair(1.6, 2.0, substrate=None), (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6)),
        "pair on 6 R": Deep(pair(1.6, THICK, substrate=None), (0.2, 0.4, 0.8, 1.2, 1.6)),
        "one ball on 6 R": Deep(ball, (0.25, 0.5, 1.0, 1.5, 2.0)),
    }


def cases(quick: bool) -> list[Case]:
    """Return one case per scene."""
    chosen = scenes()
    if quick:
        chosen = {"thin pair": Deep(pair(0.03, substrate=None), (0.015, 0.03), (Level(2, 1.0), Level(3, 1.0)))}
    return [
        LevelCase(
            name.replace(" ", "-"), scene.problem, "finite_strain", 0.05, labels={"scene": name},
            steps=[depth / max(scene.problem.load.values) for depth in scene.approaches], levels=scene.levels,
            incomplete=True,
        )
        for name, scene in chosen.items()
    ]  # fmt: skip
