"""One finite-element run: from coarse to fine, each discretisation solves, evaluates and saves all load steps."""

import hashlib
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from mpi4py import MPI

from finite_strain import FORMAT, Inspect, compat
from finite_strain.accuracy.answer import Answers, judge
from finite_strain.accuracy.error_budget import residual
from finite_strain.accuracy.notes import relative_to, result_notes
from finite_strain.accuracy.pairs import LinearTruth
from finite_strain.discretisation.checkpoint import Snapshot
from finite_strain.discretisation.discrete_model import Meshed
from finite_strain.discretisation.regions import pressures
from finite_strain.equilibrium.linear_solver import unused_options
from finite_strain.equilibrium.load_path import EXACT, State
from finite_strain.equilibrium.newton import Effort, StepRecord
from finite_strain.equilibrium.solver_options import solver_notes
from finite_strain.geometry.load_control import prescribed
from finite_strain.mechanics.own_energy import softening
from finite_strain.mechanics.volumetric import describe_forms
from finite_strain.mpi import on_all, on_root
from finite_strain.observer import Observer
from finite_strain.one_discretisation import STIFFER, MeshRun, ModelRun
from finite_strain.output.field_catalogue import FieldChoice
from finite_strain.output.field_writer import FieldWriter
from finite_strain.output.step_files import missing_files, move_steps
from finite_strain.output.top_surface import TopSurface
from finite_strain.planning.records import Answer, ContactState, Record, Row, SolverAccount, save_records, saved_records
from finite_strain.planning.refinement import PATH_FINDER, account, coarser, decide
from finite_strain.planning.run_plan import RunPlan
from linear_bem.counts import grouped
from linear_bem.errors import NotConverged, ThirdBodyError, UnsupportedProblem
from linear_bem.result import Result, Solved

NAMES = ("coarse", "main", "finer")
"""Names of the discretisations of a run: the path finder, the first with results, and all later ones."""


class Refinement:
    """Discretisations of one scene, each along the same load path, until accuracy or budget is reached.

    Every finished step is on disk before the next begins: a restart does not repeat it.
    """

    def __init__(
        self, plan: RunPlan, folder: Path, comm: MPI.Comm, observer: Observer, fields: FieldChoice | None, keep: bool,
        inspect: Inspect | None = None, meshed: Meshed | None = None,
    ) -> None:  # fmt: skip
        self.plan, self.folder, self.comm, self.observer = plan, folder, comm, observer
        self.fields, self.keep, self.inspect, self.meshed = fields or FieldChoice(), keep, inspect, meshed
        self.began = time.monotonic()
        now = time.time_ns() if plan.has_own_functions else None  # functions cannot be compared: never resumed
        parts = (
            FORMAT, plan.problem, plan.model, plan.goals, plan.accuracy, plan.budget, plan.numerics,
            *(each for each in (plan.given, now) if each is not None),
        )  # fmt: skip
        self.key = hashlib.sha256(repr(parts).encode()).hexdigest()
        self.records, damage = on_root(comm, self._saved)
        self.damage = [note for note in damage if note]
        self.truths: dict[float, LinearTruth | str] = {}
        self.unused: list[str] = []
        self.earlier_seconds = sum(record.seconds for record in self.records)

    def _saved(self) -> tuple[list[Record], list[str]]:
        """Return an earlier run's records, without last steps whose states are damaged, and notes (rank 0)."""
        records, note = saved_records(self.folder, self.key)
        notes, number = [note], len(records) - 1
        while records and not records[-1].finished and records[-1].rows:
            record, fraction = records[-1], records[-1].rows[-1].own.fraction
            models = ("own",) if record.rows[-1].small is None else ("own", "small")
            faults = [Snapshot.fault(self._file(number, model, fraction)) for model in models]
            if not any(faults):
                break
            again = f"the load step to {fraction:.3g} of the load was solved again"
            notes += [f"{fault}: {again}" for fault in faults if fault]
            record.rows.pop()
            record.steps = [step for step in record.steps if step.fraction < fraction]
            record.changes = {name: path[: len(record.rows)] for name, path in record.changes.items()}
        return records, notes

    def run(self) -> Result:
        """Run one discretisation after another (collective)."""
        plan = self.plan
        if not self.records:
            self.records.append(Record(PATH_FINDER))
        while True:
            number = len(self.records) - 1
            record = self.records[number]
            if not record.finished:
                self._press(number)
            if record.stopped and number > 1:
                why = f"{record.level} did not reach full load: {record.stopped}"
                break
            level = decide(plan.accuracy, self.records, plan.budget, plan.unknowns, plan.given is not None)
            level = self.comm.bcast(level, root=0)
            if isinstance(level, str):
                why = level
                break
            self.records.append(Record(level))
            self._save()
        answered = self._answered()
        if self._reach(answered) < plan.goals[-1]:
            kept = f"; the steps before are kept in {self.folder}" if self.keep and self.records[answered].steps else ""
            stopped = self.records[-1].stopped
            reasons = [*([why] if stopped in why else [stopped, why]), *softening(plan.problem)]
            raise NotConverged(f"{'; '.join(filter(None, reasons))}{kept}")
        return self._result(answered, why)

    def _reach(self, number: int) -> float:
        steps = self.records[number].steps
        return steps[-1].fraction if steps else 0.0

    def _answered(self) -> int:
        """Return the number of the discretisation with the result: the last of those that reach the largest load.

        Of several of its resolution it is the one with the smallest error: a wider domain may not have helped.
        """
        records, reach = self.records, [self._reach(number) for number in range(len(self.records))]
        last = max(range(len(records)), key=lambda n: (reach[n], n))
        alike = [n for n in range(len(records)) if reach[n] == reach[last]]
        alike = [n for n in alike if records[n].level.resolution == records[last].level.resolution]
        return min(alike, key=lambda n: (records[n].reached, -n))

    def _press(self, number: int) -> None:
        """Follow the load path on one discretisation, from the last saved state of an earlier run (collective)."""
        record, began = self.records[number], time.monotonic()
        name = NAMES[min(number, 2)]
        mesh = self.meshed or self.folder / f"mesh_{number}.msh"
        run = MeshRun(self.plan, record.level, mesh, self.comm, self.observer, name)
        try:
            self._along(run, record, number, began)
        except NotConverged as error:
            record.stopped = f"{name} mesh ({grouped(record.unknowns)} unknowns): {error}"
            last, balls = run.own.path.last, self.plan.reduction.balls
            fault = prescribed(self.plan.problem).ended_by(last.fraction, last.approaches, balls) if not number else ""
            if fault:
                run.close()
                raise UnsupportedProblem(fault) from error
        except ThirdBodyError:
            run.close()
            raise
        self.unused = unused_options()
        run.close()  # after other errors, possibly on one rank only, no collective call is safe
        record.finished = True
        for place, old in enumerate(record.steps):  # again: larger loads now help to judge smaller ones
            record.steps[place] = self._answer(number, old.step, old.account)
        judge(self.plan, record)
        if (fields := self._fields(number)) != self.folder:
            is_answer = number == self._answered()
            on_root(self.comm, lambda: move_steps(fields, self.folder) if is_answer else shutil.rmtree(fields))
        self._save()

    def _along(self, run: MeshRun, record: Record, number: int, began: float) -> None:
        plan, spent = self.plan, record.seconds
        record.unknowns = run.own.model.unknowns
        coarse = self.records[number - 1] if number else None
        writer = None
        if coarse is not None:
            if self.keep:
                writer = FieldWriter(run.own.model, self._fields(number), self.fields)
                writer.forget_after(len(record.steps))
            self.observer.started({
                "model": plan.model, "mesh": run.name, "forms": describe_forms(plan.problem),
                "unknowns": record.unknowns, "ranks": self.comm.size, "load_steps": len(plan.goals),
                "symmetry_planes": len(plan.reduction.planes), "resumed_steps": len(record.steps),
                "states": len(plan.loads) * (1 if run.small is None else 2), "versions": compat.versions(),
            })  # fmt: skip
        self._resume(run, record, number)
        reached = record.rows[-1].own.fraction if record.rows else 0.0
        found = coarse.rows[-1].own.fraction if coarse is not None and coarse.rows else 0.0
        path = [f for f in plan.path if f > reached and (coarse is None or f in plan.loads or f > found)]
        taken, mark = list[StepRecord](), time.monotonic()
        for done in self._steps(run.own, path, number):
            taken.append(done)
            if done.fraction not in plan.loads:
                continue
            run.own.path.augment(done)
            rounds = 0
            if self._is_last(number, done.fraction):
                rounds = record.stiffened = run.own.enforce(done)
            snapshot = run.own.snapshot(done.fraction)
            own = run.own.state(done.fraction)
            small = self._pair(run.small, record, number, done.fraction, rounds)
            record.rows.append(Row(own, small))
            record.seconds = spent + time.monotonic() - began
            self._keep(snapshot, number, "own")
            is_compared = coarse is not None and coarser(self.records[: number + 1]).at(done.fraction) is not None
            if is_compared and done.fraction not in plan.goals:
                self._answers(number).compare(done.fraction, self._truth(number, done.fraction))
            if not is_compared or done.fraction not in plan.goals:
                self._save()
                continue
            answer = self._answer(number, len(record.steps) + 1, run.account(taken, own, mark))
            taken, mark, run.own.solver.effort = [], time.monotonic(), Effort()
            if writer is not None:
                writer.write(answer.step, done.fraction)
            record.steps.append(answer)
            record.seconds = spent + time.monotonic() - began
            self._save()
            if self.inspect is not None:
                model = run.own.model
                functions = {"displacement": model.displacement, **pressures(model.bulks)}
                on_all(self.comm, partial(self.inspect, answer.to_step(), functions))
            self.observer.step_done(answer.to_step(), lambda: TopSurface(run.own.model).gathered())

    def _is_last(self, number: int, fraction: float) -> bool:
        return number > 0 and fraction == self.plan.goals[-1]

    def _steps(self, run: ModelRun, path: list[float], number: int) -> Iterator[StepRecord]:
        """Yield each load step of the run's own model, predicted from the coarser discretisation.

        Full load starts with stiffer penalties if the coarser discretisation needed them there.
        """
        for fraction in path:
            is_stiff = self._is_last(number, fraction) and self.records[number - 1].stiffened > 0
            run.path.ahead = STIFFER if is_stiff else 1.0
            run.path.is_rough, run.path.residual = self._is_last(number, fraction), self._residual(number, fraction)
            yield from run.path.steps([fraction], lambda f: self._predicted(run, number, "own", f))

    def _residual(self, number: int, fraction: float) -> float:
        """Return the residual norm over the largest normal force that T allows at a load fraction (collective)."""
        coarse = self.records[number - 1].at(fraction) if number else None
        if coarse is None:
            return EXACT
        truth = self._truth(number, fraction)
        known = None if isinstance(truth, str) else truth.tangential_force
        return residual(coarse.own, known, self.plan.accuracy, EXACT)

    def _answers(self, number: int) -> Answers:
        return Answers(self.plan, (coarser(self.records[: number + 1]), self.records[number]))

    def _truth(self, number: int, fraction: float) -> LinearTruth | str:
        """Return the result of `linear_bem` at a load fraction, or its error message; solved once (collective)."""
        if fraction not in self.truths:
            self.truths[fraction] = on_root(self.comm, partial(self._answers(number).truth, fraction))
        return self.truths[fraction]

    def _answer(self, number: int, step: int, account: SolverAccount) -> Answer:
        """Return the answer of a discretisation at the load step number ``step`` (collective)."""
        answer = self._answers(number).answer(step, account, self._truth(number, account.fraction))
        return replace(answer, mesh=number)

    def _pair(
        self, run: ModelRun | None, record: Record, number: int, fraction: float, rounds: int
    ) -> ContactState | None:
        """Return the small-strain state at a load fraction; None after it has once found no equilibrium.

        ``rounds`` is how often the hyperelastic contact was stiffened; the pair's is stiffened at most as often, step
        by step: all at once needs up to twice as many new tangents (triangle, nu = 0.49: 4 instead of 2).
        """
        if run is None or (record.rows and record.rows[-1].small is None):
            return None
        try:
            run.path.is_rough, run.path.residual = rounds > 0, self._residual(number, fraction)
            *_, done = run.path.steps([fraction], lambda f: self._predicted(run, number, "small", f))
            run.path.augment(done)
            run.path.stiffen(done, STIFFER, rounds)
            self._keep(run.snapshot(fraction), number, "small")
            return run.state(fraction)
        except NotConverged:
            return None

    def _fields(self, number: int) -> Path:
        """Return the folder for a discretisation's fields; those of a finer one stay apart until it has the result."""
        return self.folder / NAMES[2] if number > 1 and self.keep else self.folder

    def _file(self, number: int, model: str, fraction: float) -> Path:
        return self.folder / f"state_{number}_{model}_{self.plan.loads.index(fraction) + 1:03d}.npz"

    def _keep(self, snapshot: Snapshot, number: int, model: str) -> None:
        on_root(self.comm, lambda: snapshot.save(self._file(number, model, snapshot.fraction)))

    def _predicted(self, run: ModelRun, number: int, model: str, fraction: float) -> State | None:
        """Return the coarser discretisation's state at a load fraction, if it has one."""
        if number == 0 or fraction not in self.plan.loads:
            return None
        return next(iter(self._saved_states(run, number - 1, model, [fraction])), None)

    def _saved_states(self, run: ModelRun, number: int, model: str, fractions: list[float]) -> list[State]:
        """Return a discretisation's states at load fractions, except those with missing or damaged files."""
        files = [self._file(number, model, fraction) for fraction in fractions]
        sound = on_root(self.comm, lambda: [file for file in files if not Snapshot.fault(file)])
        return [run.predicted_by(Snapshot.load(file)) for file in sound]

    def _resume(self, run: MeshRun, record: Record, number: int) -> None:
        for model, each in (("own", run.own), ("small", run.small)):
            if each is None:
                continue
            met = [row.own.fraction for row in record.rows if model == "own" or row.small is not None][-2:]
            each.path.resume(self._saved_states(each, number, model, met))

    def _save(self) -> None:
        on_root(self.comm, lambda: save_records(self.folder, self.key, self.records))

    def _result(self, answered: int, why: str) -> Result:
        plan, record = self.plan, self.records[answered]
        steps = record.steps
        said = account(plan.accuracy, self.records, answered, plan.budget, why, relative_to(record))
        notes = [*self.damage, *result_notes(plan, record, why, sum(each.seconds for each in self.records))]
        solvers = ", then ".join(dict.fromkeys(step.linear_solver for step in steps))  # may change on restart
        if self.keep:
            wanted = [each.step for each in steps if self.fields.wants(each.step, each.fraction)]
            notes += on_root(self.comm, lambda: missing_files(self.folder, wanted, self.fields.names))
        notes += solver_notes(solvers, sum(step.linear_fallbacks for step in steps), self.unused)
        certificate = ("penetration", "force_balance", "residual")
        solved = Solved(
            converged=True, iterations=sum(step.iterations for step in steps), unknowns=record.unknowns,
            seconds=self.earlier_seconds + time.monotonic() - self.began, ranks=self.comm.size,
            versions=compat.versions(), notes=tuple(notes),
            certificate={name: max(getattr(step, name) for step in steps) for name in certificate},
            accuracy=said, linear_solver=solvers,
        )  # fmt: skip
        return Result(plan.model, steps[-1].balls, solved, tuple(step.to_step() for step in steps))
