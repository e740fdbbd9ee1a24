"""What ``plan`` says about the drift: how many pairs of balls act on each other, and how long their paths take."""

import math
from typing import Any

import numpy as np

from runs.evolution.hard_balls import IN_ONE_FILE
from runs.evolution.outcome import COARSER
from runs.evolution.pair_forces import PairLaw
from runs.evolution.pair_list import CutLaw
from runs.process.machine import slowness
from runs.scene.scene_file import Scene

PER_PAIR, PER_BALL, ON_MESH = 6.5e-7, 1.5e-4, 9e-5
"""Processor time of a step [s]: 4.6 evaluations of the forces, six problems of contacts; in a cell more per ball."""
STEPS, COARSE, FINER = 36.0, 1e-4, 1.0 / 3.0
"""Steps of a path to rest over the root of the number of balls: 510 of 200 balls that gather with the tolerance that is
second. The power of the tolerance with which they grow is 0.26 for nine balls, up to 0.5 with many contacts."""


def expectation(scene: Scene) -> dict[str, Any]:
    """Return number of pairs, steps of a path and processor time [s] of all paths, to a factor of about three."""
    problem, sliding = scene.problem, scene.reciprocation
    assert sliding is not None
    periodic = scene.drift.get("periodic")
    x, touch = problem.positions, 2.0 * min(ball.radius for ball in problem.balls)
    law = CutLaw(PairLaw(problem), touch, on_mesh=periodic is not None)
    sides = np.ptp(x, axis=0) + touch if periodic is None else np.array(periodic.lengths)
    around = problem.size * math.pi * law.reach**2 / float(np.prod(sides))
    pairs = 0.5 * problem.size * (around if periodic is not None else min(around, problem.size - 1.0))
    steps = STEPS * math.sqrt(problem.size) * (COARSE / sliding.tolerance) ** FINER
    # a coarser path is for the error of the positions
    paths = sliding.ensemble + (0.0 if problem.size > IN_ONE_FILE else COARSER**-FINER)
    step = pairs * PER_PAIR + problem.size * (PER_BALL if periodic is None else PER_BALL + ON_MESH)
    return {
        "reach": law.reach,
        "pairs": pairs,
        "steps": steps,
        "seconds": slowness() * paths * steps * step,
    }


def sentence(found: dict[str, Any]) -> str:
    """Return the expectation in words."""
    minutes = found["seconds"] / 60.0
    time = "less than a minute" if minutes < 1.0 else f"{minutes:.0f} minutes"
    if minutes >= 120.0:
        time = f"{minutes / 60.0:.0f} hours"
    pairs, steps = (f"{float(f'{found[key]:.1g}'):.0f}" for key in ("pairs", "steps"))
    return (
        f"evolve: about {pairs} pairs act on each other, each step takes all of them; to rest about "
        f"{steps} steps, {time} of one core, within a factor of three (the table of pairs not counted)"
    )
