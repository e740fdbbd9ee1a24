"""The linear solution that a plan is based on: of which balls, and what that of all takes in time and memory."""

import dataclasses
import time
from collections.abc import Sequence

import numpy as np

from linear_bem.arrays import Array
from linear_bem.problem import Load, Problem
from linear_bem.result import Result
from linear_bem.smooth.contacts import CHECKED
from runs.display.numbers import leading_ball
from runs.models import COMMAND_BYTES, MODELS, Model, Run, without

CLOSE, ABOUT = 7, 5
"""Balls up to which advice is about the whole scene; of more, about that with the largest T and its nearest ones: so
many together."""
LEAST, MOST = 150, 400
"""Of more balls than the second number a plan solves as many about the middle: time grows along a straight line."""
ROUGH, QUICK = 1e-2, 1.0
"""Relative accuracy of a plan's linear solution of few balls; within so many seconds it is made as asked for too."""
MEMORY, PER_COEFFICIENT, PER_BALL, PER_CELL = 150e6 - COMMAND_BYTES, 4.1e3, 110e3, 500.0
"""Memory of the linear model [bytes]: alone, more per coefficient of balls judged by a sample, of others more per ball
and per unknown, which grids need. Measured, in MB, with the command: 165 for 2 balls, 172 for 50, 211 for 800, 274 for
2000, 327 for 3000, 754 for 10 000; 357 for 1600 of degree 6; 119 for 126 thousand cells."""


def ahead_of(problem: Problem, seen: Sequence[int], accuracy: float | None) -> tuple[Result, float]:
    """Return the linear solution of the balls ``seen``, and the time [s] that all of them take."""
    model, small = MODELS["linear_bem"], without(problem, ["finite_strain"])
    part = only(small, seen)
    many = part.size > CHECKED
    ahead = measured(model, part, accuracy if many else ROUGH)
    if not many and ahead.solved.seconds < QUICK:
        ahead = measured(model, part, accuracy)
    if part is small:
        return ahead, ahead.solved.seconds
    fewer = measured(model, only(small, seen[:LEAST]), accuracy)
    rise = (ahead.solved.seconds - fewer.solved.seconds) / (MOST - LEAST)
    return ahead, max(ahead.solved.seconds, fewer.solved.seconds + rise * (problem.size - LEAST))


def measured(model: Model, problem: Problem, accuracy: float | None) -> Result:
    """Return a model's result with its time [s] on an idle machine: the processor time, where that is less."""
    begun = time.process_time()
    result = model.solve(problem, Run(accuracy))
    seconds = min(result.solved.seconds, time.process_time() - begun)
    return dataclasses.replace(result, solved=dataclasses.replace(result.solved, seconds=seconds))


def closest(problem: Problem, ahead: Result) -> tuple[Problem, Result]:
    """Return the ball with the largest T and the nearest others with their solution; few balls, and a cell, whole."""
    if problem.size <= CLOSE or problem.periodic is not None:
        return problem, ahead
    place = problem.positions[leading_ball([ball.to_dict() for ball in ahead.balls])]
    if problem.load.kind == "total_force":
        problem = problem.with_load("force", [ball.normal_force for ball in ahead.balls])
    part = only(without(problem, ["finite_strain"]), _nearest(problem, place, ABOUT))
    return part, measured(MODELS["linear_bem"], part, ROUGH)


def in_the_middle(problem: Problem) -> Sequence[int]:
    """Return the numbers of up to `MOST` balls about the loaded one nearest to the middle; all of a cell."""
    if problem.size <= MOST or problem.periodic is not None:
        return range(problem.size)
    loaded = problem.positions[np.broadcast_to(np.array(problem.load.values) > 0.0, problem.size)]
    middle = problem.positions.mean(axis=0)
    return _nearest(problem, loaded[np.argmin(np.hypot(*(loaded - middle).T))], MOST)


def _nearest(problem: Problem, place: Array, count: int) -> Sequence[int]:
    """Return the numbers of the ``count`` balls nearest to a place (2,) [m], nearest first."""
    chosen: list[int] = np.argsort(np.hypot(*(problem.positions - place).T), kind="stable")[:count].tolist()
    return chosen


def only(problem: Problem, kept: Sequence[int]) -> Problem:
    """Return the problem of some of its balls, with their share of a total force; the problem itself of all."""
    if len(kept) == problem.size:
        return problem
    load = problem.load
    if load.kind == "total_force":
        values = [load.values[0] * len(kept) / problem.size]
    else:
        values = [load.values[i] for i in kept]
    balls = tuple(problem.balls[i] for i in kept)
    return dataclasses.replace(problem, balls=balls, load=Load(load.kind, tuple(values)))


def memory(problem: Problem, ahead: Result) -> float:
    """Return the memory [bytes] of the linear solution without the command, from that of some of its balls."""
    unknowns = unknowns_of(problem, ahead)
    if "sample" in ahead.solved.accuracy:
        return MEMORY + PER_COEFFICIENT * unknowns
    return MEMORY + PER_BALL * problem.size + PER_CELL * unknowns


def unknowns_of(problem: Problem, ahead: Result) -> int:
    """Return the number of unknowns, in proportion to the balls."""
    return round(ahead.solved.unknowns * problem.size / len(ahead.balls))
