"""Solves all balls or some by the linear model, for a plan, and estimates time and memory of all."""

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.errors import InvalidProblem
from linear_bem.problem import Load, Periodic, Problem
from linear_bem.report import silent
from linear_bem.result import Result
from linear_bem.sampled_solution import SAMPLE
from linear_bem.smooth.contacts import CHECKED
from linear_bem.touching import to_nearest
from runs.display.numbers import leading_ball
from runs.models import COMMAND_BYTES, MODELS, Run, at_small_strain

CLOSE, ABOUT = 7, 5
"""Number of balls up to which advice is on the whole scene; number of balls in the advice on larger scenes: the ball
with the largest T and its nearest neighbours."""
FEW, MANY = 12, 120
"""Balls about the middle that a plan solves if the scene has more; `MANY` if more than `CHECKED` balls are loaded.
Without the sample, time is proportional to the number of balls."""
SAMPLED, LARGER = 4, 3.0
"""Size of the sample of balls that estimates the error of a part, and the time of the sample of all balls over that
of this sample: measured 2.8 to 4.1, least in periodic cells."""
ROUGH, QUICK = 1e-2, 1.0
"""Relative accuracy of a plan's solution of few balls; if it took less than `QUICK` [s], the required one follows."""
MEMORY, PER_COEFFICIENT, PER_BALL, PER_CELL = 175e6 - COMMAND_BYTES, 4.1e3, 110e3, 500.0
"""Memory of the linear model [bytes]: constant part; per coefficient if a sample estimates the error; otherwise per
ball and per unknown (grids). Measured, in MB, with the command: 165 for 2 balls, 180 for 60, 180 to 228 for 200 to
400, 274 for 2000, 327 for 3000, 754 for 10 000; 357 for 1600 of degree 6; 119 for 126 thousand cells."""


def ahead_of(problem: Problem, accuracy: float | None) -> tuple[Problem, Sequence[int], Result, float]:
    """Solve all balls by the linear model if they are few, else some about the middle.

    Return the problem of these balls, their numbers, their result, and the time [s] of all balls of ``problem``. The
    error of many balls is estimated by a smaller sample than in the run, whose sample may take most of the time.
    """
    small = at_small_strain(problem)
    if np.count_nonzero(_loaded(small)) > CHECKED:
        part, seen = in_the_middle(small, MANY)
        phases = _Phases()
        result = measured(part, accuracy, phases, SAMPLED)
        touching, seconds = sum(ball.normal_force > 0.0 for ball in result.balls), result.solved.seconds
        if touching * problem.size > CHECKED * part.size:
            sampled = min(phases.sampled, seconds)
            rest = (seconds - sampled) * problem.size / part.size
            return part, seen, result, LARGER * sampled + rest
    part, seen = in_the_middle(small, FEW)
    whole = part is small
    result = measured(part, ROUGH if whole else accuracy)
    if whole and result.solved.seconds < QUICK:
        result = measured(part, accuracy)
    return part, seen, result, result.solved.seconds * problem.size / part.size


class _Phases:
    """Receives the linear model's progress lines; ``sampled``: processor time [s] of the sample."""

    def __init__(self) -> None:
        self.sampled = 0.0
        self._since: float | None = None

    def __call__(self, text: str) -> None:
        if not text.startswith("degree"):
            return
        now = time.process_time()
        if self._since is not None:
            self.sampled += now - self._since
        self._since = now if SAMPLE in text else None


def measured(
    problem: Problem, accuracy: float | None, report: Callable[[str], None] = silent, sample: int | None = None
) -> Result:
    """Return the linear model's result with its time [s] on an idle machine: the lesser of wall and processor time."""
    begun = time.process_time()
    result = MODELS["linear_bem"].solve(problem, Run(accuracy, report=report, sample=sample))
    seconds = min(result.solved.seconds, time.process_time() - begun)
    return dataclasses.replace(result, solved=dataclasses.replace(result.solved, seconds=seconds))


def closest(problem: Problem, ahead: Result) -> tuple[Problem, Result]:
    """Return the ball with the largest T, first, and its nearest ones, with their solution; all if few, or in a cell.

    In this solution another ball may have the largest T, as its own neighbours are missing.
    """
    if problem.size <= CLOSE or problem.periodic is not None:
        return problem, ahead
    place = problem.positions[leading_ball([ball.to_dict() for ball in ahead.balls])]
    if problem.load.kind == "total_force":
        problem = problem.with_load("force", [ball.normal_force for ball in ahead.balls])
    part = only(at_small_strain(problem), _nearest(problem, place, ABOUT))
    return part, measured(part, ROUGH)


def in_the_middle(problem: Problem, count: int) -> tuple[Problem, Sequence[int]]:
    """Return the problem of up to ``count`` balls about the loaded ball nearest to the middle, and their numbers.

    Balls of a periodic cell get a smaller cell: their extent plus the largest diameter. If that is not smaller, the
    whole problem is returned.
    """
    whole = problem, range(problem.size)
    if problem.size <= count:
        return whole
    loaded = problem.positions[_loaded(problem)]
    place = loaded[np.argmin(np.hypot(*(loaded - problem.positions.mean(axis=0)).T))]
    if problem.periodic is None:
        seen = _nearest(problem, place, count)
        return only(problem, seen), seen
    lengths = np.array(problem.periodic.lengths)
    offsets = offsets_from(place, problem)
    shares = np.max(np.abs(offsets) / lengths, axis=1)
    seen = np.argsort(shares, kind="stable")[:count].tolist()
    cell = 2.0 * shares[seen[-1]] * lengths + 2.0 * max(ball.radius for ball in problem.balls)
    if np.any(cell >= lengths):
        return whole
    part = only(problem, seen).at(place + offsets[seen])
    try:
        return dataclasses.replace(part, periodic=Periodic((float(cell[0]), float(cell[1])))), seen
    except InvalidProblem:  # bodies wider than their radius
        return whole


def out_of_cell(problem: Problem, ahead: Result) -> Problem:
    """Return the problem without its cell, each ball at its image nearest to the ball with the largest T."""
    place = problem.positions[leading_ball([ball.to_dict() for ball in ahead.balls])]
    return dataclasses.replace(problem.at(place + offsets_from(place, problem)), periodic=None)


def offsets_from(place: Array, problem: Problem) -> Array:
    """Return positions (n, 2) [m] of the balls relative to a place (2,), in a cell those of the nearest images."""
    return to_nearest(problem.positions - place, problem.cell)


def _loaded(problem: Problem) -> Mask:
    """Return which balls have a load or a share of the total load."""
    return np.broadcast_to(np.array(problem.load.values) > 0.0, problem.size)


def _nearest(problem: Problem, place: Array, count: int) -> Sequence[int]:
    """Return the numbers of the ``count`` balls nearest to a place (2,) [m], nearest first."""
    chosen: list[int] = np.argsort(np.hypot(*(problem.positions - place).T), kind="stable")[:count].tolist()
    return chosen


def only(problem: Problem, kept: Sequence[int]) -> Problem:
    """Return the problem with only the balls ``kept``, a total force reduced in proportion."""
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
    """Return the memory [bytes] of the linear solution alone, extrapolated from that of some balls (``ahead``)."""
    unknowns = unknowns_of(problem, ahead)
    if "sample" in ahead.solved.accuracy:
        return MEMORY + PER_COEFFICIENT * unknowns
    return MEMORY + PER_BALL * problem.size + PER_CELL * unknowns


def unknowns_of(problem: Problem, ahead: Result) -> int:
    """Return the number of unknowns, extrapolated in proportion to the number of balls."""
    return round(ahead.solved.unknowns * problem.size / len(ahead.balls))
