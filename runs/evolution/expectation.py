"""What ``plan`` says of ``evolve``: the runs of its table of pairs, its paths, and the time of each part."""

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from linear_bem.coupled_point_loads import estimated_relations
from linear_bem.problem import Ball, Load, Problem
from runs.display.numbers import count, duration
from runs.evolution.drift import Drift
from runs.evolution.evolving import TABLES, balls_of, start
from runs.evolution.forces import DirectForces, Forces
from runs.evolution.hard_balls import IN_ONE_FILE
from runs.evolution.outcome import COARSER
from runs.evolution.pair_table import DEPTHS
from runs.evolution.providers import (
    DIRECT_ACCURACY,
    MEASURED,
    PAIR_ACCURACY,
    kinds,
    point_loads,
    table_of,
)
from runs.look_ahead import MEMORY, measured
from runs.models import MODELS, Model, as_command, planned_runs
from runs.process.machine import slowness
from runs.scene.scene_file import Scene

STEPS, CROWD, COARSE, FINER = 5.5, 600.0, 1e-4, 1.0 / 3.0
"""Steps of a path to rest for each ball with the tolerance `COARSE`; number of balls from which on they grow less;
power of the tolerance with which they grow. Six paths of 25 to 200 balls took 0.4 to 1.4 times as many, 1000 balls
1400 where they gather, but 120 to 1100 where they keep apart."""
PATIENCE = 3.0
"""Time [s] that a path is followed to count and time its steps."""
LATER, TOUCHING = 1.0, 40
"""What a step takes longer than the first ones, when fewer balls touch: so many times their time, from so many balls
on; of fewer in proportion."""
PICTURES, PER_BALL, PER_PATH = 1.1, 0.04, 0.1
"""Time of the pictures [s], and more for each of the balls that are drawn one by one, and for each path."""


def expectation(scene: Scene, model: Model, problem: Problem, solution: float) -> dict[str, Any]:
    """Return the runs of the table, steps and paths, and time [s] and memory [bytes] of the whole command.

    ``solution`` is the time [s] of the linear solution of all balls. ``parts`` are processor times [s] of one process.
    """
    sliding, size = scene.reciprocation, problem.size
    assert sliding is not None
    direct = sliding.forces == "direct" and model.name != "point_load"
    missing = [] if direct else _missing(scene, model, problem)
    table = planned_runs(model, missing, scene.tangential_force, scene.budget)
    parts = {"table": _by_linear_model(missing, scene) if table is None else table["processor_seconds"]}
    taken, step, ended = _path(scene, problem, direct)
    later = 1.0 if ended else 1.0 + LATER * min(size / TOUCHING, 1.0)
    usual = STEPS * size / (1.0 + size / CROWD) * (COARSE / sliding.tolerance) ** FINER
    steps = taken if ended else max(usual, taken)
    # a coarser path is for the error of the positions
    paths = sliding.ensemble + (0.0 if size > IN_ONE_FILE else COARSER**-FINER)
    parts["paths"] = paths * steps * later * step
    parts["check"] = 2.0 * solution if model.name != "finite_strain" and size <= MEASURED else 0.0
    drawn = 0 if size > IN_ONE_FILE or "periodic" in scene.drift else size
    parts["pictures"] = slowness() * (PICTURES + PER_BALL * drawn + PER_PATH * sliding.ensemble)
    alone = sum(parts.values())
    cost = {"seconds": alone, "memory_bytes": MEMORY}
    if table is not None:
        cost = table | {"processor_seconds": alone, "seconds": alone - parts["table"] + table["seconds"]}
    counted = {"runs": len(missing), "paths": sliding.ensemble, "steps": steps, "steps_counted": ended}
    return {**counted, "parts": parts, **as_command(cost)}


def sentence(found: Mapping[str, Any], model: str, memory: Mapping[str, str]) -> str:
    """Return the expectation in words; ``memory`` are those of its values."""
    alone = "processor_seconds" not in found
    said = f"about {duration(found['seconds'])} on {'one idle core' if alone else 'two idle cores'}"
    said += f", {memory['memory_bytes']}"
    if not alone:
        said += f"; on one {duration(found['processor_seconds'])}, {memory['processor_memory_bytes']}"
    table = f"{count(found['runs'], 'run')} by {'linear_bem' if model == 'point_load' else model} for the forces"
    rounded = float(f"{found['steps']:.1g}")
    steps = f"perhaps {rounded:.0f} steps, or a third to three times as many"
    if found["steps_counted"]:
        steps = f"about {found['steps']:.0f} steps"
    words = {
        "table": table,
        "paths": f"{count(found['paths'], 'path')} to rest, {steps}",
        "check": "the full linear model at start and end",
        "pictures": "pictures",
    }
    parts = [f"{duration(seconds)} for {words[key]}" for key, seconds in found["parts"].items() if seconds > 0.0]
    return f"evolve: {said} ({', '.join(parts)})"


def _missing(scene: Scene, model: Model, problem: Problem) -> list[Problem]:
    """Return the problems that are solved before the first step."""
    if model.name == "point_load":
        deepest = Load("approach", (max(problem.load.values),))
        return [replace(problem, balls=(ball,), load=deepest) for ball in kinds(problem).values()]
    return table_of(model, problem, scene.tangential_force, TABLES, None, scene.budget).missing_problems()


def _by_linear_model(missing: list[Problem], scene: Scene) -> float:
    """Return the time [s] of runs by the linear model, one of which is made to see how long it takes."""
    if not missing:
        return 0.0
    states = sum(len(DEPTHS) if each.size == 1 else each.size for each in missing)
    one = next((each for each in missing if each.size == 2), missing[-1])
    result = measured(MODELS["linear_bem"], one, scene.tangential_force or PAIR_ACCURACY)
    return result.solved.seconds * states / one.size


def _path(scene: Scene, problem: Problem, direct: bool) -> tuple[int, float, bool]:
    """Return steps of a path, the time [s] of one, and whether the path came to its end within the patience.

    It is followed by point loads where a table is to be made.
    """
    sliding, balls = scene.reciprocation, balls_of(scene)
    assert sliding is not None
    depths = np.array(DEPTHS) * max(problem.load.values)

    def estimated(ball: Ball) -> list[float]:
        return list(estimated_relations(problem, np.full(len(depths), ball.radius))[0](depths))

    forces: Forces = point_loads(problem, balls.cell, estimated)
    if direct:
        forces = DirectForces(problem, scene.tangential_force or DIRECT_ACCURACY)
    tolerance = sliding.tolerance * min(ball.radius for ball in problem.balls)
    drift = Drift(forces, balls, tolerance, sliding.rest)
    moments = drift.path(start(balls, problem.positions, sliding, 0), sliding.end)
    next(moments)
    begun, spent = time.process_time(), 0.0
    for _ in moments:
        spent = time.process_time() - begun
        if spent > PATIENCE:
            return drift.steps, spent / drift.steps, False
    return drift.steps, spent / max(drift.steps, 1), True
