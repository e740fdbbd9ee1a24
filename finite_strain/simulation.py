"""One run: companion mesh, main mesh and finer ones, every load step answered, written and handed on."""

from __future__ import annotations

import hashlib
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from finite_strain import FORMAT, compat
from finite_strain.answer import Answer
from finite_strain.catalogue import FieldChoice
from finite_strain.checkpoint import read_checkpoint, write_checkpoint
from finite_strain.companion import NAME, MeshRecord, saved_records, text_of
from finite_strain.extent import scale_of_force
from finite_strain.loading import StepRecord
from finite_strain.mesh_run import MeshRun
from finite_strain.output import FieldWriter
from finite_strain.planning import COARSENING, COARSEST, RunPlan, plan_run
from finite_strain.refinement import LEAST_RATIO, Budget, Decision, account, decide, first_ratio
from finite_strain.solver_choice import solver_notes, solvers_of
from finite_strain.together import on_root, replace_text, working_folder
from finite_strain.top_surface import gather_surface
from finite_strain.volumetric import describe_forms, form_notes
from linear_bem.errors import NotConverged
from linear_bem.problem import Problem
from linear_bem.result import Result, Solved, Step

NAMES = ("companion", "main", "finer")
"""What the meshes are called that run first, second, and after."""
MAIN_GROWTH = 2.0
"""How many times the companion's unknowns the main mesh has: 1.6 to 2.1 were seen."""
NEAR_ZERO = "a tenth of the half-space's mutual force"


class Silence:
    """The observer that watches nothing."""

    def started(self, info: dict[str, Any]) -> None:
        """Hear size and setting of the run."""

    def attempt(self, info: dict[str, Any]) -> None:
        """Hear that a load step begins."""

    def newton(self, info: dict[str, Any]) -> None:
        """Hear that a Newton iteration was done."""

    def step_done(self, step: Step, fields: Any) -> None:
        """Take a finished, written load step."""


def simulate(
    problem: Problem,
    model: str,
    tangential_force: float,
    comm: MPI.Comm | None,
    folder: Path | None,
    observer: Any,
    fields: FieldChoice | None = None,
    budget: Budget | None = None,
) -> Result:
    """Run a problem; see `finite_strain.solve`."""
    comm = MPI.COMM_WORLD if comm is None else comm
    plan = plan_run(problem, tangential_force, model, budget)
    with working_folder(folder, comm) as where:
        return MeshSequence(plan, where, comm, observer or Silence(), fields, keep=folder is not None).run()


class MeshSequence:
    """Companion mesh, main mesh, and as many finer ones as accuracy and budget ask for, all along one load path.

    Every finished step of every mesh is on disk before the next begins: what a killed run computed is not
    computed again.
    """

    def __init__(
        self, plan: RunPlan, folder: Path, comm: MPI.Comm, observer: Any, fields: FieldChoice | None, keep: bool
    ) -> None:
        self.plan, self.folder, self.comm, self.observer = plan, folder, comm, observer
        self.fields, self.keep = fields, keep
        self.began = time.monotonic()
        parts = (FORMAT, plan.problem, plan.model, plan.accuracy, plan.budget)
        self.key = hashlib.sha256(repr(parts).encode()).hexdigest()
        self.records: list[MeshRecord] = on_root(comm, lambda: saved_records(folder / NAME, self.key))
        self.earlier_seconds = sum(record.seconds for record in self.records)

    def run(self) -> Result:
        """Run mesh after mesh until the accuracy is met or the budget is spent (collective)."""
        if not self.records:
            self.records.append(MeshRecord(COARSENING))
        companion = self.records[0]
        if not companion.finished and not companion.stopped:
            try:
                self._press(0)
            except NotConverged as error:
                if not companion.rows:
                    raise
                companion.stopped = str(error)
                self._save()
        if len(self.records) == 1:
            ratio = self.comm.bcast(first_ratio(COARSENING, self.records[0], self.plan.budget), root=0)
            self.records.append(MeshRecord(COARSENING / ratio))
        while True:
            number = len(self.records) - 1
            try:
                steps = self._press(number)
                if companion.stopped:  # how far T is known has been answered, and by how much
                    raise NotConverged(companion.stopped)
            except NotConverged as error:
                if number < 2:
                    raise
                # the coarser mesh's answer stands: it is whole, and its error bar is its own
                steps = [Step.from_dict(step) for step in self.records[number - 1].steps]
                whose = "; the field files are of that mesh, as far as it came" if self.keep else ""
                return self._result(steps, number - 1, f"the next mesh did not converge: {error}{whose}")
            decision = self._decide(number, steps)
            if decision.size is None:
                return self._result(steps, number, decision.why)
            self.records[number].steps = [step.to_dict() for step in steps]
            self.records.append(MeshRecord(decision.size))
            self._save()

    def _decide(self, number: int, steps: list[Step]) -> Decision:
        last, record = steps[-1], self.records[number]
        forces = np.array([ball.normal_force for ball in last.balls])
        largest = max(math.hypot(*ball.tangential_force) for ball in last.balls)
        record.scale = max(largest, scale_of_force(self.plan.problem, forces))
        error = max(ball.tangential_force_error for ball in last.balls)
        record.reached = error / record.scale if record.scale > 0.0 else 0.0
        far = max(last.record["far_field_error"]) / record.scale if record.scale > 0.0 else 0.0
        # every rank must decide alike, whatever its clock says
        return self.comm.bcast(decide(self.plan.accuracy, self.records, self.plan.budget, far), root=0)

    def _press(self, number: int) -> list[Step]:
        """Drive one mesh along the load path, from where an earlier run left it; return its answers (collective)."""
        record, folder = self.records[number], self.folder
        name = NAMES[min(number, 2)]
        mesh_file = folder / ("companion.msh" if number == 0 else "mesh.msh" if number == 1 else f"mesh_{number}.msh")
        run = self._mesh(number, mesh_file, name)
        try:
            return self._along(run, record, number)
        except NotConverged as error:
            kept = f"; its finished steps are kept in {folder}" if self.keep and run.path.history else ""
            raise NotConverged(f"{name} mesh ({record.unknowns} unknowns): {error}{kept}") from error
        finally:
            run.close()

    def _mesh(self, number: int, file: Path, name: str) -> MeshRun:
        """Return the model on a mesh of the record's size, or of larger elements where it passes a stated budget."""
        record, most = self.records[number], self.plan.budget.unknowns
        # the companion is to leave room for the main mesh, and that to be fine enough to tell a difference
        growth, coarsest = (MAIN_GROWTH, math.inf) if number == 0 else (1.0, self.records[number - 1].size)
        while True:
            run = MeshRun(self.plan, self.plan.box(record.size), file, self.comm, self.observer, name)
            over = 0.0 if most is None else growth * run.model.unknowns / most
            larger = min(record.size * 1.02 * over ** (1.0 / 3.0), coarsest / LEAST_RATIO)
            if over <= 1.0 or record.rows or larger <= record.size or larger > COARSEST * COARSENING:
                return run
            run.close()
            record.size = larger

    def _along(self, run: MeshRun, record: MeshRecord, number: int) -> list[Step]:
        key, began, spent = f"{self.key}, mesh {number}", time.monotonic(), record.seconds
        record.unknowns = run.model.unknowns
        history, steps = read_checkpoint(self.folder, run.model, key)
        reached = history[-1].fraction if history else 0.0
        record.rows = [row for row in record.rows if row["fraction"] <= reached]
        run.path.resume(history)
        goals = list(self.plan.fractions) if number == 0 else self.records[0].goals(self.plan.fractions)
        answer = writer = None
        if number > 0:
            answer = Answer(self.plan, self.plan.far_field(), self.records[:number], record.size)
            if self.keep:
                writer = FieldWriter(run.model, self.folder, self.fields)
                writer.forget_after(len(steps))
            self.observer.started(
                {
                    "model": self.plan.model,
                    "mesh": run.name,
                    "forms": describe_forms(self.plan.problem),
                    "unknowns": record.unknowns,
                    "ranks": self.comm.size,
                    "load_steps": len(goals),
                    "symmetry_planes": len(self.plan.reduction.planes),
                    "resumed_steps": len(steps),
                    "versions": compat.versions(),
                }
            )
        passed: list[StepRecord] = []
        for done in run.path.steps(goals):
            if number > 0 and done.fraction not in goals:  # cut back: no coarser mesh was there to compare with
                passed.append(done)
                if self.keep:
                    write_checkpoint(self.folder, run.model, run.path.history, steps, key)
                continue
            states = run.contact_states()
            row = run.row(done, states)
            record.rows.append(row)
            if answer is not None:
                details = {"mesh": number, **run.details([*passed, done], states)}
                passed.clear()
                step = answer.step(row, states, details, steps, run.solver.tolerance)
                if writer is not None:
                    taken = writer.write(len(steps) + 1, done.fraction)
                    step = replace(step, record={**step.record, "seconds_output": taken})
                steps.append(step)
            record.seconds = spent + time.monotonic() - began
            record.finished = done.fraction >= self.plan.fractions[-1]
            if self.keep:
                self._save()
                write_checkpoint(self.folder, run.model, run.path.history, steps, key)
            if answer is not None:
                self.observer.step_done(steps[-1], gather_surface(run.model))
        return steps

    def _save(self) -> None:
        if self.keep:
            on_root(self.comm, lambda: replace_text(self.folder / NAME, text_of(self.key, self.records)))

    def _overrun(self, record: MeshRecord) -> list[str]:
        """Return where the run passed its budget: companion and main mesh are run whatever they cost."""
        budget, spent = self.plan.budget, sum(each.seconds for each in self.records)
        notes = []
        if budget.unknowns is not None and record.unknowns > budget.unknowns:
            notes.append(f"the mesh has {record.unknowns} unknowns, more than the budget of {budget.unknowns:g}")
        if budget.seconds is not None and spent > budget.seconds:
            notes.append(f"the meshes took {spent:.0f} s, more than the budget of {budget.seconds:g} s")
        return notes

    def _result(self, steps: list[Step], number: int, why: str) -> Result:
        plan, record = self.plan, self.records[number]
        # a force of another kind is a bound to compare with only where T itself is smaller
        near_zero = record.scale > max(math.hypot(*ball.tangential_force) for ball in steps[-1].balls)
        reference = NEAR_ZERO if near_zero else "the largest tangential force"
        said = account(plan.accuracy, self.records, number, plan.budget, why, reference)
        notes = list(form_notes(plan.problem))
        if near_zero and record.scale > 0.0:
            known = ", ".join(
                f"{100 * ball.tangential_force_error / size:.2g} %" if size > 0.0 else "zero"
                for ball in steps[-1].balls
                for size in [math.hypot(*ball.tangential_force)]
            )
            notes.append(
                f"T is near its zero: its accuracy is measured against {NEAR_ZERO}, {record.scale:.3g} N; "
                f"of the balls' own T the error is {known}"
            )
        if not said["met"]:
            notes.append(
                f"tangential force known to {_percent(record.reached, plan.accuracy)} % at full load; "
                f"{100 * plan.accuracy:.2g} % was asked for: {why}"
            )
        notes += self._overrun(record)
        notes += solver_notes([step.record for step in steps])
        certificate = ("penetration", "force_balance", "residual")
        return Result(
            model=plan.model,
            balls=steps[-1].balls,
            steps=tuple(steps),
            solved=Solved(
                converged=True,
                iterations=sum(step.record["iterations"] for step in steps),
                unknowns=record.unknowns,
                seconds=self.earlier_seconds + time.monotonic() - self.began,
                ranks=self.comm.size,
                versions=compat.versions(),
                notes=tuple(notes),
                certificate={name: max(step.record[name] for step in steps) for name in certificate},
                accuracy=said,
                linear_solver=solvers_of([step.record for step in steps]),
            ),
        )


def _percent(value: float, limit: float) -> str:
    """Return a share in per cent, with as many digits as tell it from a limit that it exceeds."""
    texts = [f"{100 * value:.{digits}g}" for digits in range(2, 7)]
    return next((text for text in texts if float(text) > 100 * limit), texts[0])
