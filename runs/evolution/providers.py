"""The forces of a model for an evolution: set up once, then evaluated thousands of times."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem, UnsupportedProblem
from linear_bem.point_load import moments
from linear_bem.problem import Ball, Load, Problem
from linear_bem.result import Result
from runs.display.numbers import count, duration
from runs.evolution.equilibria import DIFFERENCE
from runs.evolution.forces import DirectForces, Forces
from runs.evolution.pair_forces import PairForces, PairLaw, SingleBall
from runs.evolution.pair_table import DEPTHS, PairTable, common_ball
from runs.models import MODELS, Model, Run, planned_runs, time_on
from runs.process import ranks
from runs.process.json_values import Document
from runs.scene.scene_file import OutputTable

Alone = tuple[Sequence[float], float]
"""A ball alone: forces [N] at `DEPTHS` of the largest approach, and its largest contact area [m^2]."""

PAIR_ACCURACY = 1e-3
"""Relative accuracy of T in a linear table if the scene states none."""
DIRECT_ACCURACY = 1e-2
"""Relative accuracy of T at every step if the scene states none."""
MEASURED = 2000
"""Largest number of balls whose forces are compared with the full linear model at start and end, in seconds."""
DIRECT_DIFFERENCE = 1e-3
"""Length of secants over the touching distance, so large that T changes by more than its error of that accuracy."""


@dataclass(frozen=True)
class Provider:
    """Forces, notes on what they are, and the table that they come from.

    ``difference`` is the length over the touching distance of the secants that give derivatives of T.
    """

    forces: Forces
    notes: tuple[str, ...]
    table: Document | None = None
    difference: float = DIFFERENCE


def provider(
    model: Model,
    problem: Problem,
    accuracy: float | None,
    kind: str,
    folder: Path,
    comm: Any = None,
    print_status: Callable[[str], None] = lambda text: None,
    budget: Mapping[str, float] | None = None,
    cell: Array | None = None,
) -> Provider:
    """Return the forces of ``model``; ``folder`` holds tables of pairs (collective over the model's ranks).

    ``cell`` holds the lengths [m] of a periodic cell. ``budget`` bounds each finite-element run of a table ("unknowns",
    "seconds").
    Raises what `require_forces` raises, and what the model's plan raises for any run of a table.
    """
    if model.name == "point_load":

        def alone(ball: Ball) -> Alone:
            balls, load = (replace(ball, position=(0.0, 0.0)),), Load("approach", (max(problem.load.values),))
            return _alone(MODELS["linear_bem"], replace(problem, balls=balls, load=load))

        return Provider(point_loads(problem, cell, alone), ("balls act on each other as point loads",))
    require_forces(model, problem, kind)
    if kind == "direct":
        return Provider(
            DirectForces(problem, accuracy or DIRECT_ACCURACY),
            ("the full model is solved at every step",),
            difference=DIRECT_DIFFERENCE,
        )
    table = table_of(model, problem, accuracy, folder, comm, budget)
    if table.damage and ranks.is_root():
        print_status(table.damage)
    # also reports what the model cannot solve, before the first run
    planned = planned_table(model, table.missing_problems(), accuracy, budget or {})
    if ranks.is_root() and table.missing:
        cores = ranks.rank_and_size()[1]
        time = "" if planned is None else f", about {duration(time_on(cores, planned))} on {count(cores, 'idle core')}"
        print_status(f"pair table {table.path}: {count(table.missing, 'run')} to do by {model.name}{time}")
    table.complete(print_status)
    worst, measured = table.worst(), model.name != "finite_strain" and problem.size <= MEASURED
    note = (
        f"forces from the pair table {table.path.name}: on {worst.arrangement} T differs from the full model by "
        f"{100.0 * worst.coupled:.2g} % of the largest (bare sum of pair forces: {100.0 * worst.bare_sum:.2g} %)"
        + (
            ""
            if measured
            else "; the stated error of T is this share and the error of pairs: other arrangements may differ more"
        )
    )
    return Provider(table.forces(cell), (note,) if problem.size > 2 else (), table.data)


@lru_cache(maxsize=64)
def _alone(linear: Model, problem: Problem) -> Alone:
    """Return the states of one ball, solved once for all arrangements of such balls."""
    states = [step.balls[0] for step in linear.solve(problem, Run(PAIR_ACCURACY, steps=DEPTHS)).steps]
    return tuple(state.normal_force for state in states), max(state.contact_area for state in states)


def require_forces(model: Model, problem: Problem, kind: str) -> None:
    """Raise `UnsupportedProblem` for "direct" forces of a model that takes minutes per state, and unequal balls."""
    if model.name == "point_load":
        return
    if kind == "pairs":
        common_ball(problem)
    elif model.parallel:
        raise UnsupportedProblem(
            f'[reciprocation] forces = "direct": {model.name} takes minutes for one state; use forces = "pairs"'
        )


def table_of(
    model: Model,
    problem: Problem,
    accuracy: float | None,
    folder: Path,
    comm: Any = None,
    budget: Mapping[str, float] | None = None,
) -> PairTable:
    """Return the table of pairs that belongs to ``problem`` with its saved entries; nothing is computed."""
    asked = accuracy if model.parallel else accuracy or PAIR_ACCURACY
    settings: dict[str, Any] = {"accuracy": asked}
    if model.parallel:
        from finite_strain import FORMAT  # noqa: PLC0415  (only where a scene calls for finite elements)

        settings["elements"] = FORMAT
        # what a scene does not state is left out, so that it does not change the name of its table
        if budget:
            settings["budget"] = dict(budget)
        if problem.elements is not None:
            settings["form"] = problem.elements.form

    def solve(one: Problem, workspace: Path | None, steps: Sequence[float]) -> Result:
        # the workspace is deleted after the run: it needs no fields
        nothing = OutputTable(fields=())
        return model.solve(one, Run(asked, comm, workspace, output=nothing, budget=budget or {}, steps=steps))

    return PairTable(problem, model.name, solve, folder, settings, slow=model.parallel)


def planned_table(
    model: Model, missing: Sequence[Problem], accuracy: float | None, budget: Mapping[str, float]
) -> dict[str, float] | None:
    """Return `planned_runs` of a table of pairs; a refused depth is said to be that of the ball alone."""
    try:
        return planned_runs(model, missing, accuracy, budget)
    except (InvalidProblem, UnsupportedProblem) as error:
        if not str(error).startswith("load.approach"):
            raise
        alone = f"lower it: for the table of pairs, one ball alone is pressed to {DEPTHS[-1]:g} of the approach"
        raise type(error)(f"{error}; {alone}") from None


def point_loads(problem: Problem, cell: Array | None, alone: Callable[[Ball], Alone]) -> PairForces:
    """Return the point-load law, whose error is that of balls with their contact area ``alone``."""
    depths = [d * max(problem.load.values) for d in DEPTHS]
    curves = {}
    for kind, ball in kinds(problem).items():
        forces, area = alone(ball)
        curves[kind] = SingleBall(depths, forces, moments(ball, area))
    singles = [curves[ball.radius, ball.shape] for ball in problem.balls]
    return PairForces(problem, singles, PairLaw(problem), cell=cell)


def kinds(problem: Problem) -> dict[tuple[float, Any], Ball]:
    """Return one ball of each radius and shape."""
    return {(ball.radius, ball.shape): ball for ball in reversed(problem.balls)}
