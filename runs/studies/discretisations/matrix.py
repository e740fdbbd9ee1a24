"""Five scenes at full load, each on the same discretisations; the last is the reference for the others."""

from linear_bem.problem import Ball
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import THICK, pair, pressed

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
