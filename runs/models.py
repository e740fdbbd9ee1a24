"""The models: the effects that each supports, and how it is called."""

from __future__ import annotations

import dataclasses
import enum
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from linear_bem.depth import LARGE_STRAIN
from linear_bem.errors import MissingDependency, ThirdBodyError, UnsupportedProblem
from linear_bem.problem import Problem
from linear_bem.result import Result, Step
from runs.process.machine import slowness
from runs.scene.effects import EFFECTS
from runs.scene.scene_file import OutputTable, Scene

if TYPE_CHECKING:
    from finite_strain import Observer
    from linear_bem.solution import Solution


class ModelName(enum.StrEnum):
    """Names that ``--model`` takes."""

    POINT_LOAD = "point_load"
    LINEAR_BEM = "linear_bem"
    SMALL_STRAIN = "small_strain"
    FINITE_STRAIN = "finite_strain"


@dataclass(frozen=True)
class Run:
    """Arguments of a model other than the problem.

    Accuracy, MPI communicator, folder, observer, fields to be written, limits of mesh refinement, the load fractions
    with output (None: those of `load_path`), values of `finite_strain.Numerics` other than its defaults; for the linear
    model, receivers of its progress lines and solutions, and the size of the ``sample`` that estimates its error.
    """

    tangential_force: float | None = None
    comm: Any = None
    folder: Path | None = None
    observer: Observer | None = None
    output: OutputTable | None = None
    budget: Mapping[str, float] = field(default_factory=dict)
    steps: Sequence[float] | None = (1.0,)
    numerics: Mapping[str, Any] = field(default_factory=dict)
    report: Callable[[str], None] = lambda text: None
    inspect: Callable[[Solution], None] = lambda solution: None
    sample: int | None = None


OTHER_NUMPY = ("numpy.dtype size changed", "numpy.core.multiarray failed to import", "compiled using NumPy")
"""Words in the error of a module that was built for another numpy."""
TWO, ONE = "two idle cores (mpirun -n 2)", "one (without mpirun)"
"""Words for the two numbers of cores for which a plan gives times."""
USUAL = 0.02
"""Relative accuracy of T that others are compared with if the scene states none: the default of finite elements."""
COMMAND_SECONDS, LINEAR_SECONDS, COMMAND_BYTES = 1.7, 1.1, 7e7
"""Overhead of a command (imports, figures, files), measured on small scenes: processor time [s] with finite elements,
with the linear model; memory [bytes]."""


@dataclass(frozen=True)
class Model:
    """A model: the effects that it supports, that select it, and that it may leave out if the user names the model.

    ``plan``: of finite elements, the plan of a run, from problem, accuracy, budget and load fractions.
    """

    name: str
    summary: str
    effects: frozenset[str]
    solve: Callable[[Problem, Run], Result]
    called_for_by: frozenset[str] = frozenset()
    leaves_out: frozenset[str] = frozenset()
    plan: Callable[[Problem, float | None, Mapping[str, float], Sequence[float] | None], dict[str, Any]] | None = None

    @property
    def parallel(self) -> bool:
        """Whether the model runs on several ranks."""
        return self.plan is not None


def _accuracy(value: float | None) -> dict[str, Any]:
    return {} if value is None else {"accuracy": value}


def _point_load(problem: Problem, run: Run) -> Result:
    from linear_bem import solve_point_load  # noqa: PLC0415

    return solve_point_load(problem)


def _linear_bem(problem: Problem, run: Run) -> Result:
    from linear_bem import solve_contact  # noqa: PLC0415

    solution = solve_contact(problem, **_accuracy(run.tangential_force), report=run.report, sample=run.sample)
    run.inspect(solution)
    return solution.result()


def load_path(problem: Problem) -> Sequence[float]:
    """Return the default load fractions with output."""
    from finite_strain.geometry.load_control import prescribed  # noqa: PLC0415  (no DOLFINx)

    return prescribed(problem).answered_fractions()


def _stepwise(solve: Callable[[Problem, Run], Result], problem: Problem, run: Run) -> Result:
    """Return the result of a linear model that solves every load fraction of its run independently.

    The notes of earlier fractions name these. Of the notes on depth, only that at the last fraction is kept.
    """
    steps, notes, seconds, iterations = [], [], 0.0, 0
    for fraction in load_path(problem) if run.steps is None else run.steps:
        values = [fraction * value for value in problem.load.values]
        result = solve(problem.with_load(problem.load.kind, values), run)
        steps.append(Step(result.balls, {"fraction": fraction}))
        notes += [(fraction, note) for note in result.solved.notes]
        seconds += result.solved.seconds
        iterations += result.solved.iterations
    last = result.solved.notes
    earlier = [(f, note) for f, note in notes if note not in last and not note.startswith(LARGE_STRAIN)]
    said = (*(f"at {f:.3g} of the load: {note}" for f, note in earlier), *last)
    solved = dataclasses.replace(result.solved, seconds=seconds, iterations=iterations, notes=said)
    return result if len(steps) == 1 else dataclasses.replace(result, steps=tuple(steps), solved=solved)


def _elements(kinematics: str, problem: Problem, run: Run) -> Result:
    import finite_strain  # noqa: PLC0415

    options: dict[str, Any] = {**_accuracy(run.tangential_force), **run.budget, "steps": run.steps}
    if run.output is not None:
        chosen = {} if run.output.fields is None else {"names": run.output.fields}
        options["fields"] = finite_strain.FieldChoice(every=run.output.every, **chosen)
    try:
        return finite_strain.solve(
            problem, model=kinematics, comm=run.comm, folder=run.folder, observer=run.observer,
            numerics=finite_strain.Numerics(**run.numerics), **options,
        )  # fmt: skip
    except (ImportError, ValueError) as error:
        if isinstance(error, ThirdBodyError) or not any(words in str(error) for words in OTHER_NUMPY):
            raise
        raise MissingDependency(
            f"{kinematics} needs DOLFINx, which {sys.executable} cannot import: {error}; `thirdbody doctor` names "
            "the remedy"
        ) from error


def _elements_plan(
    kinematics: str, problem: Problem, accuracy: float | None, budget: Mapping[str, float],
    steps: Sequence[float] | None,
) -> dict[str, Any]:  # fmt: skip
    import finite_strain  # noqa: PLC0415

    planned = finite_strain.plan(problem, model=kinematics, **_accuracy(accuracy), **budget, steps=steps)
    return _slower(planned, slowness())


def _slower(plan: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """Return a plan with its times, and those of its alternatives ("perhaps"), multiplied by ``factor``."""

    def longer(key: str, value: Any) -> Any:
        if key == "perhaps":
            return [_slower(other, factor) for other in value]
        if key.endswith("seconds_of_meshes"):
            return [factor * each for each in value]
        return factor * value if key in ("seconds", "processor_seconds") else value

    return {key: longer(key, value) for key, value in plan.items()}


_HALF_SPACE, _FINITE = frozenset({"substrate"}), frozenset({"finite_strain"})
MODELS = {
    model.name: model
    for model in (
        Model(
            "linear_bem", "small strain, boundary elements", _HALF_SPACE | {"periodic"},
            partial(_stepwise, _linear_bem), leaves_out=_FINITE,
        ),
        Model(
            "finite_strain", "hyperelastic finite elements", _HALF_SPACE | _FINITE, partial(_elements, "finite_strain"),
            called_for_by=_FINITE, plan=partial(_elements_plan, "finite_strain"),
        ),
        Model(
            "small_strain", "small strain, the same finite elements", _HALF_SPACE, partial(_elements, "small_strain"),
            leaves_out=_FINITE, plan=partial(_elements_plan, "small_strain"),
        ),
        Model(
            "point_load", "small strain, balls as point loads", _HALF_SPACE, partial(_stepwise, _point_load),
            leaves_out=_FINITE,
        ),
    )
}  # fmt: skip
"""The default for a scene is the first model here that supports its effects and is selected by them."""


def choose(scene: Scene, asked: str | None = None) -> tuple[Model, Problem, tuple[str, ...]]:
    """Return the model for ``scene``, the problem as that model sees it, and notes for the reader.

    Without ``asked``, the first model that supports every effect of the scene and is selected by them. A model named by
    the user may ignore an effect that it replaces by a simpler law; a note says so. Raises `UnsupportedProblem` for an
    effect that this model, or every model, lacks. Models do not move the balls: ``evolve`` passes them the scene from
    `standing`.
    """
    wanted = frozenset(scene.effects)
    nowhere = wanted.difference(*(model.effects for model in MODELS.values()))
    if "reciprocation" in nowhere:
        raise UnsupportedProblem(
            f"{scene.path}: {_names(nowhere)}: solve and compare do not move the balls; "
            f"use `thirdbody evolve {scene.path}`, or remove the table{'s' if len(nowhere) > 1 else ''}"
        )
    having = [model for model in MODELS.values() if model.called_for_by <= wanted <= model.effects]
    if not (asked or having):
        raise UnsupportedProblem(f"{scene.path}: {_names(nowhere or wanted)}: no model supports this; remove a table")
    model = MODELS[asked] if asked else having[0]
    if lacking := wanted - model.effects - model.leaves_out:
        other = f" or use --model {having[0].name}" if having else ""
        raise UnsupportedProblem(f"{scene.path}: {_names(lacking)}: model {asked} lacks it; remove the table{other}")
    if missing := model.called_for_by - wanted:
        raise UnsupportedProblem(
            f"{scene.path}: model {asked} needs {_names(missing)}, which the scene does not have; add the table"
        )
    dropped: dict[str, Any] = dict.fromkeys(sorted(wanted & model.leaves_out))
    problem = dataclasses.replace(scene.problem, **dropped) if dropped else scene.problem
    notes = (f"[{effect}] left out by --model {asked}: {EFFECTS[effect].without}" for effect in dropped)
    return model, problem, (*scene.doubts, *notes)


def planned_runs(
    model: Model, problems: Sequence[Problem], accuracy: float | None, budget: Mapping[str, float]
) -> dict[str, float] | None:
    """Return total times [s] and largest memories [bytes] of runs to full load; None without runs or a plan.

    Raises the errors of the plan.
    """
    if model.plan is None or not problems:
        return None
    plans = [model.plan(problem, accuracy, budget, (1.0,)) for problem in problems]
    times = {key: sum(plan[key] for plan in plans) for key in ("seconds", "processor_seconds")}
    return times | {key: max(plan[key] for plan in plans) for key in ("memory_bytes", "processor_memory_bytes")}


def time_on(ranks: int, plan: Mapping[str, Any]) -> float:
    """Return the time [s] of a planned run on so many ranks, every doubling gaining as the first."""
    return float(plan["processor_seconds"] * (plan["seconds"] / plan["processor_seconds"]) ** math.log2(ranks))


def as_command(plan: Mapping[str, Any], seconds: float = COMMAND_SECONDS) -> dict[str, Any]:
    """Return a model's plan plus the command's memory and time: ``seconds`` on the machine of the measurements."""
    more = dict.fromkeys(("seconds", "processor_seconds"), slowness() * seconds)
    more |= dict.fromkeys(("memory_bytes", "processor_memory_bytes", "memory_bytes_at_most"), COMMAND_BYTES)
    others = {key: [as_command(other, seconds) for other in plan[key]] for key in ("perhaps",) if key in plan}
    return {**plan, **others} | {key: plan[key] + value for key, value in more.items() if key in plan}


def standing(scene: Scene) -> Scene:
    """Return ``scene`` with fixed balls: the problem at one instant of an evolution."""
    effects = tuple(effect for effect in scene.effects if not EFFECTS[effect].of_drift)
    return dataclasses.replace(scene, effects=effects, drift={})


def at_small_strain(problem: Problem) -> Problem:
    """Return ``problem`` without finite strain."""
    return dataclasses.replace(problem, finite_strain=None)


def _names(effects: frozenset[str]) -> str:
    return ", ".join(f"[{name}] ({EFFECTS[name].words})" for name in sorted(effects))
