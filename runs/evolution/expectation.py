"""Estimates of ``plan`` for ``evolve``: number of runs and steps, and the time of each part."""

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.coupled_point_loads import estimated_relations
from linear_bem.problem import Ball, Load, Problem
from runs.display.numbers import count, duration
from runs.evolution.drift import AT_END, Drift, Moment
from runs.evolution.evolving import TABLES, balls_of, start
from runs.evolution.forces import DirectForces, Forces
from runs.evolution.hard_balls import IN_ONE_FILE
from runs.evolution.outcome import COARSER
from runs.evolution.pair_table import DEPTHS
from runs.evolution.providers import (
    DIRECT_ACCURACY,
    MEASURED,
    PAIR_ACCURACY,
    Alone,
    kinds,
    planned_table,
    point_loads,
    table_of,
)
from runs.look_ahead import MEMORY, measured
from runs.models import COMMAND_SECONDS, ONE, TWO, Model, as_command
from runs.process.machine import slowness
from runs.scene.scene_file import Scene

STEPS, CROWD, COARSE, FINER = 5.5, 600.0, 1e-4, 1.0 / 3.0
"""Estimated steps of a path to rest: steps per ball with the tolerance `COARSE`; number of balls above which they grow
more slowly; exponent of the tolerance. Six paths of 25 to 200 balls took 0.4 to 1.4 times as many steps, one of 30 took
ten times as many; 1000 balls took 1400 where they gather, but 120 to 1100 where they keep apart."""
PATIENCE = 3.0
"""Time [s] that a path is followed to count its steps, by point loads, and to time them, by the run's own forces."""
LATER, TOUCHING = 1.0, 40
"""For pair forces, later steps take longer, as more balls touch: extra time over that of the first steps; number of
balls from which all of it counts (below, in proportion)."""
COMPARED = 2.5
"""Time of the coarser path with its comparison, for the error of the positions, over that of this path alone."""
EVALUATIONS, WARM, SEARCH = 4.6, 0.35, 8.0
"""For direct forces: evaluations per step; time of one next to a solved state over that of a first solution, where more
than `IN_ONE_FILE` balls make it too long to measure; number of times that the search for an equilibrium evaluates T at
two values of each coordinate."""
OVERHEAD = 0.8
"""Time [s] of a command without finite elements beside its parts, on the reference machine: imports and files."""
PICTURES, PER_BALL, PER_PATH = 1.1, 0.04, 0.1
"""Time of the pictures [s]: constant part, per ball that is drawn individually, and per path."""


def expectation(
    scene: Scene, model: Model, problem: Problem, solution: float, tables: Path | None = None
) -> dict[str, Any]:
    """Return the runs of the table, steps and paths, and time [s] and memory [bytes] of the whole command.

    ``solution`` is the time [s] of the linear solution of all balls; ``tables`` is the folder of the tables of pairs.
    ``parts`` are processor times [s] of one process.
    """
    sliding, size = scene.sliding, problem.size
    direct = sliding.forces == "direct" and model.name != "point_load"
    missing = [] if direct else _missing(scene, model, problem, tables or TABLES)
    table = planned_table(model, missing, scene.tangential_force, scene.budget)
    last, seconds = _path(scene, problem)
    steps, ended = float(last.steps), last.resting or last.sigma >= AT_END * sliding.end
    if not ended:  # steps become longer where balls slow down
        usual = STEPS * size / (1.0 + size / CROWD) * (COARSE / sliding.tolerance) ** FINER
        steps = max(steps, min(usual, steps * sliding.end / last.sigma))
    later = 1.0 if ended else 1.0 + LATER * min(size / TOUCHING, 1.0)
    step = later * seconds / max(last.steps, 1)
    if direct:
        step = _direct(scene, problem, solution) if steps else 0.0
    paths = sliding.ensemble + (0.0 if size > IN_ONE_FILE else COMPARED * COARSER**-FINER)
    drawn = 0 if size > IN_ONE_FILE or "periodic" in scene.drift else size
    equilibrium = direct and "rolling_resistance" not in scene.drift
    parts = {
        "table": _by_linear_model(missing, scene) if table is None else table["processor_seconds"],
        "paths": paths * steps * step,
        # the full model, and once more for the first state if the forces are direct
        "check": (3.0 if direct else 2.0) * solution if model.name != "finite_strain" and size <= MEASURED else 0.0,
        "equilibrium": SEARCH * 4.0 * drawn * step / EVALUATIONS if equilibrium else 0.0,
        "pictures": slowness() * (PICTURES + PER_BALL * drawn + PER_PATH * sliding.ensemble),
    }
    alone = sum(parts.values())
    cost = {"seconds": alone, "memory_bytes": MEMORY}
    if table is not None:
        cost = table | {"processor_seconds": alone, "seconds": alone - parts["table"] + table["seconds"]}
    counted = {"runs": len(missing), "paths": sliding.ensemble, "steps": steps, "steps_counted": ended}
    return {**counted, "parts": parts, **as_command(cost, OVERHEAD if table is None else COMMAND_SECONDS)}


def sentence(found: Mapping[str, Any], model: str, memory: Mapping[str, str]) -> str:
    """Return the expectation in words; ``memory`` holds its memory values in words."""
    steps = count(round(found["steps"]), "step")
    if not found["steps_counted"]:
        rounded = float(f"{found['steps']:.1g}")
        steps = f"perhaps {rounded:.0f} steps, or a third to three times as many"
    by = f"{count(found['runs'], 'run')} by {model} for the table of pairs"
    words = {
        "table": "the balls alone" if model == "point_load" else by,
        "paths": f"{count(found['paths'], 'path')} of {steps}",
        "check": "the full linear model at start and end",
        "equilibrium": "the equilibrium next to the end",
        "pictures": "pictures",
    }
    parts = ", ".join(f"{duration(seconds)} for {words[key]}" for key, seconds in found["parts"].items() if seconds)
    alone = "processor_seconds" not in found
    said = f"about {duration(found['seconds'])} on {'one idle core' if alone else TWO}"
    said += f", {memory['memory_bytes']}"
    if not alone:
        said += f"; on {ONE} {duration(found['processor_seconds'])}, {memory['processor_memory_bytes']}"
    still = "" if found["steps"] else "; as point loads, the balls do not move at all"
    return f"evolve: {said}: {parts}{still}"


def _missing(scene: Scene, model: Model, problem: Problem, tables: Path) -> list[Problem]:
    """Return the problems that are solved before the first step."""
    if model.name == "point_load":
        deepest = Load("approach", (max(problem.load.values),))
        return [replace(problem, balls=(ball,), load=deepest) for ball in kinds(problem).values()]
    return table_of(model, problem, scene.tangential_force, tables, None, scene.budget).missing_problems()


def _by_linear_model(missing: list[Problem], scene: Scene) -> float:
    """Return the time [s] of runs by the linear model, estimated from a measured one."""
    if not missing:
        return 0.0
    states = sum(len(DEPTHS) if each.size == 1 else each.size for each in missing)
    one = next((each for each in missing if each.size == 2), missing[-1])
    result = measured(one, scene.tangential_force or PAIR_ACCURACY)
    return result.solved.seconds * states / one.size


def _path(scene: Scene, problem: Problem) -> tuple[Moment, float]:
    """Follow the first path by point loads, until the patience ends."""
    depths = np.array(DEPTHS) * max(problem.load.values)

    def estimated(ball: Ball) -> Alone:
        radii = np.full(len(depths), ball.radius)
        return list(estimated_relations(problem.layer, problem.substrate, radii)[0](depths)), 0.0

    return _followed(scene, problem, point_loads(problem, balls_of(scene).cell, estimated))


def _direct(scene: Scene, problem: Problem, solution: float) -> float:
    """Return the time [s] of a step by the full model."""
    if problem.size > IN_ONE_FILE:
        return EVALUATIONS * WARM * solution
    last, seconds = _followed(scene, problem, DirectForces(problem, scene.tangential_force or DIRECT_ACCURACY))
    return seconds / max(last.steps, 1)


def _followed(scene: Scene, problem: Problem, forces: Forces) -> tuple[Moment, float]:
    """Follow the first path until the patience ends; return the last moment and the time [s] since the first."""
    sliding, balls = scene.sliding, balls_of(scene)
    drift = Drift(forces, balls, balls.tolerance, sliding.rest)
    moments = drift.path(start(balls, problem.positions, sliding, 0), sliding.end)
    moment = next(moments)
    begun, spent = time.process_time(), 0.0
    for moment in moments:
        spent = time.process_time() - begun
        if spent > PATIENCE and not moment.resting:
            break
    return moment, spent
