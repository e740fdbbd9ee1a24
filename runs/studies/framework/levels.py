"""A case on a fixed list of discretisations (levels); the load steps of each are kept as separate answers.

The mesh may be moved with the balls: then the energies of two runs differ only by the effect of the distance, because
the mesh error cancels.
"""

from __future__ import annotations

import dataclasses
import hashlib
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from linear_bem.problem import Problem
from linear_bem.result import BallResult, Result, Solved, Step
from runs.models import Run
from runs.studies.framework.case import Case

if TYPE_CHECKING:
    from finite_strain.discretisation.checkpoint import Snapshot
    from finite_strain.equilibrium.load_path import State
    from finite_strain.equilibrium.newton import StepRecord
    from finite_strain.one_discretisation import ModelRun
    from finite_strain.planning.records import Discretisation, Record
    from finite_strain.planning.run_plan import RunPlan
    from meshes.box import Zone

STILL = 0.7
"""Fraction of a mesh block's half-width about the ball's axis within which the mesh moves rigidly with the ball."""
Seen = dict[tuple[str, float], "Snapshot"]
"""States by model and load fraction: initial guesses for the next discretisation."""


@dataclass(frozen=True)
class Level:
    """A discretisation without the solver; see `finite_strain.planning.records.Discretisation`."""

    order: int = 3
    fineness: float = 1.0
    extent: float = 1.0
    penalty: float = 1.0

    def discretisation(self) -> Discretisation:
        """Return the discretisation as the solver's record."""
        from finite_strain.planning.records import Discretisation  # noqa: PLC0415

        return Discretisation(**dataclasses.asdict(self))


@dataclass(frozen=True)
class LevelCase(Case):
    """A case solved on ``levels``; the discretisation error of a load step is its change since the previous level.

    ``shift`` [m] moves each ball of a pair outwards, and the mesh with it. If the load path of a level ends early, the
    case has no answer; with ``incomplete`` it keeps the steps so far, the last with the reason ("stopped").
    """

    levels: tuple[Level, ...] = (Level(),)
    shift: float = 0.0
    incomplete: bool = False

    def key(self) -> str:
        """Return the key of `Case`, extended by levels and shift."""
        return hashlib.sha256(
            f"{super().key()} {self.levels} {self.shift}{' incomplete' * self.incomplete}".encode()
        ).hexdigest()[:20]

    def solve(self, run: Run) -> Result:
        """Solve the load path on every level (collective)."""
        from finite_strain import Numerics, compat  # noqa: PLC0415  (finite-element cases only)
        from finite_strain.mpi import working_folder  # noqa: PLC0415
        from finite_strain.planning.records import Record  # noqa: PLC0415
        from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415

        plan = plan_run(self.problem, self.accuracy, self.model, steps=run.steps, numerics=Numerics(**run.numerics))
        records = [Record(level.discretisation()) for level in self.levels]
        steps: list[Step] = []
        seen: Seen = {}
        with working_folder(run.folder, run.comm) as folder:
            for number, record in enumerate(records):
                file = folder / f"mesh_{number}.msh"
                if self.shift:
                    steps += _moved(plan, record, self.shift, file, run)
                else:
                    before = records[max(number - 1, 0)]
                    steps += _answered(plan, record, before, seen, file, run, self.incomplete)
        details = [step.record for step in steps]
        solved = Solved(
            True, sum(d["iterations"] for d in details), max(d["unknowns"] for d in details),
            sum(d["seconds"] for d in details), run.comm.size, compat.versions(),
        )  # fmt: skip
        return Result(self.model, steps[-1].balls, solved, tuple(steps))


def _answered(
    plan: RunPlan, record: Record, before: Record, seen: Seen, file: Path, run: Run, incomplete: bool
) -> list[Step]:
    """Return the answers on one discretisation, with the small-strain pair as in a full run (collective)."""
    from finite_strain.accuracy.answer import Answers  # noqa: PLC0415
    from finite_strain.equilibrium.newton import Effort  # noqa: PLC0415
    from finite_strain.mpi import on_root  # noqa: PLC0415
    from finite_strain.observer import Silence  # noqa: PLC0415
    from finite_strain.one_discretisation import MeshRun  # noqa: PLC0415
    from finite_strain.planning.records import Row  # noqa: PLC0415

    mesh = MeshRun(plan, record.level, file, run.comm, run.observer or Silence(), str(record.level))
    answers = Answers(plan, [before, record])
    steps: list[Step] = []
    began = time.monotonic()
    try:
        for done in _along(mesh.own, "own", seen, plan.path if before is record else plan.goals):
            if done.fraction not in plan.goals:
                continue
            own, small = mesh.own.state(done.fraction), None
            if mesh.small is not None and (not record.rows or record.rows[-1].small is not None):
                with suppress(NotConverged):
                    for _ in _along(mesh.small, "small", seen, [done.fraction]):
                        small = mesh.small.state(done.fraction)
            record.rows.append(Row(own, small))
            truth = on_root(run.comm, partial(answers.truth, done.fraction))
            account = mesh.account([done], own, began)
            began, mesh.own.solver.effort = time.monotonic(), Effort()
            step = answers.answer(len(steps) + 1, account, truth).to_step()
            steps.append(dataclasses.replace(step, record={**_of(plan, mesh.own, record), **step.record}))
    except NotConverged as error:
        if not incomplete or not steps:
            raise
        steps[-1] = dataclasses.replace(steps[-1], record={**steps[-1].record, "stopped": str(error)})
    finally:
        mesh.close()
    return steps


def _along(run: ModelRun, model: str, seen: Seen, fractions: Any) -> Iterator[StepRecord]:
    """Yield each equilibrium with its multipliers, started from the previous level's, and save it for the next one."""

    def predicted(fraction: float) -> State | None:
        known = seen.get((model, fraction))
        return None if known is None else run.predicted_by(known)

    for done in run.path.steps(list(fractions), predicted):
        run.path.augment(done)
        seen[model, done.fraction] = run.snapshot(done.fraction)
        yield done


def _moved(plan: RunPlan, record: Record, shift: float, file: Path, run: Run) -> list[Step]:
    """Return energies and normal forces on a mesh moved with the balls; T is not computed (collective)."""
    from finite_strain.geometry.symmetry import reduce_scene  # noqa: PLC0415
    from finite_strain.observer import Silence  # noqa: PLC0415
    from finite_strain.one_discretisation import ModelRun, mesh_box  # noqa: PLC0415

    box = plan.box(record.level)
    problem = moved(plan.problem, shift)
    shifted = dataclasses.replace(plan, problem=problem, reduction=reduce_scene(problem))
    meshed = mesh_box(box, file, run.comm)
    (zone,) = box.zones  # mirrored at x = 0
    move_nodes(meshed[0].geometry.x, zone, shift)
    driven = ModelRun(shifted, meshed, box, record.level, run.observer or Silence(), f"{record.level}, moved")
    steps = []
    try:
        for done in _along(driven, "own", {}, plan.path):
            if done.fraction in plan.goals:
                force, nan = float(driven.model.forces()[0, 2]), float("nan")
                balls = tuple(
                    BallResult(ball.position, ball.radius, done.fraction * depth, force, (nan, nan), nan, nan, nan)
                    for ball, depth in zip(problem.balls, problem.load.values, strict=True)
                )
                took = {"iterations": done.newton_iterations, "augmented": done.augmented, "seconds": 0.0}
                steps.append(Step(balls, {**_of(plan, driven, record), "fraction": done.fraction, **took}))
    finally:
        driven.close()
    return steps


def _of(plan: RunPlan, run: ModelRun, record: Record) -> dict[str, Any]:
    """Return a step's discretisation, and energies [J] and normal force [N] of the whole scene on its mesh."""
    copies = 2 ** len(plan.reduction.planes)
    return {
        "order": record.level.order, "fineness": record.level.fineness, "unknowns": run.model.unknowns,
        "strain_energy": copies * run.model.strain_energy(), "potential": copies * run.model.energy(),
        "force_on_mesh": copies * float(run.model.part_forces().sum()),
    }  # fmt: skip


def moved(problem: Problem, shift: float) -> Problem:
    """Return a pair on the x axis with each ball moved outwards by ``shift`` [m]."""
    return problem.at(problem.positions + shift * np.sign(problem.positions))


def move_nodes(points: Array, zone: Zone, shift: float) -> None:
    """Shift nodes (n, 3) near a ball's axis by ``shift`` [m] along x, tapering to zero.

    Nodes outside the ball's block stay. The shift is symmetric about the axis, like the mesh, so it does not disturb
    the ball's own energy, which is orders of magnitude larger than the change with distance.
    """
    distance = np.linalg.norm(points[:, :2] - np.array(zone.position), axis=1) / zone.half_width
    points[:, 0] += shift * np.clip((1.0 - distance) / (1.0 - STILL), 0.0, 1.0)
