"""Runs a study of many cases: splits it into shards, resumes it, records failed cases and goes on.

Every rank runs this. All ranks solve finite-element cases together, rank 0 solves the others. Each record is written
while its case runs; tables and figures are made from the records that exist.
"""

import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from linear_bem.errors import MissingDependency, NotConverged, OutputUnusable, ThirdBodyError
from linear_bem.result import Result, Step
from runs.display.numbers import Scale
from runs.models import Run
from runs.process import ranks, signals
from runs.process.locks import RUNNING, STOPPED
from runs.session.progress import Progress, print_status
from runs.session.session import path_so_far
from runs.studies import Options
from runs.studies.framework.case import Case
from runs.studies.framework.page import render
from runs.studies.framework.saved_cases import DONE, NOT_RUN, Found, StudyFolder
from runs.studies.framework.study import OUTDATED, Study, command


def study_of_cases(
    name: str,
    cases: Callable[[bool], Sequence[Case]],
    present: Callable[[Found, Path], str],
    publishes: Sequence[str] = (),
    answers: Sequence[str] = (DONE,),
) -> Study:
    """Return a study of ``cases`` (quick or full); ``present`` makes tables and figures and returns the text.

    ``answers``: states of a case that count as an answer to the study's question.
    """

    def compute(path: Path, options: Options) -> None:
        run_cases(name, cases(options.quick), path, options)

    def page(path: Path, quick: bool) -> str:
        found = Found.of(StudyFolder(path, name), cases(quick))
        states = [found.state(case.name) for case in found.cases]
        ended = sum(state not in (RUNNING, STOPPED, NOT_RUN) for state in states)
        made = render(
            __file__, "cases.md.jinja", command=command(name, quick), found=found, ended=ended,
            done=states.count(DONE), missing=found.missing(answers),
        )  # fmt: skip
        return f"{present(found, path)}\n\n{made}"

    return Study(name, compute, page, publishes)


def run_cases(name: str, cases: Sequence[Case], path: Path, options: Options) -> None:
    """Complete this run's share of ``cases`` in the folder ``path`` of the study ``name`` (collective)."""
    folder = StudyFolder(path, name) if ranks.is_root() else None
    part, parts = options.shard
    mine = cases[part - 1 :: parts]
    comm = ranks.world() if any(case.parallel and not case.alone for case in mine) else None
    for number, case in enumerate(mine, start=1):
        signals.check()
        if folder is not None and options.fresh:
            folder.forget(case)
        _run_case(case, folder, comm, f"{number}/{len(mine)} {case.name}")


def _run_case(case: Case, folder: StudyFolder | None, comm: Any, title: str) -> None:
    with ExitStack() as stack:
        saved, free = None, True
        if folder is not None:
            free = stack.enter_context(folder.claim(case))
            saved = folder.record(case)
        saved, free = ranks.share((saved, free))
        if not free or (saved is not None and saved["state"] != RUNNING):
            if folder is not None:
                print_status(f"{title}: {saved['state'] if saved and free else 'another run is computing it'}")
            return
        if folder is not None:
            print_status(f"{title}{OUTDATED * (saved is None and folder.file(case).exists())}")
        together = case.parallel and not case.alone
        if together or folder is not None:
            if case.parallel and not together:
                from mpi4py import MPI  # noqa: PLC0415  (finite-element cases have imported it)

                comm = MPI.COMM_SELF
            _Attempt(case, folder, comm if case.parallel else None, saved).run()


class _Stopped(Exception):
    """Interrupts a run deliberately."""


class _Attempt:
    """One attempt at a case, which keeps its record on disk up to date."""

    def __init__(self, case: Case, folder: StudyFolder | None, comm: Any, saved: dict[str, Any] | None) -> None:
        self.case, self.folder, self.comm = case, folder, comm
        self.ranks = 1 if comm is None else comm.size
        self.steps = [Step.from_dict(step) for step in (saved or {}).get("steps", [])]
        self.spent = float((saved or {}).get("cpu_seconds", 0.0)), float((saved or {}).get("wall_seconds", 0.0))
        self.began = time.process_time(), time.monotonic()
        self.stop_after = case.stop_after

    def run(self) -> None:
        """Solve the case and save the outcome (collective); raises only errors that end the whole study."""
        state, reason, result = DONE, None, None
        try:
            result = self._solve()
        except (MissingDependency, OutputUnusable):
            raise
        except NotConverged as error:
            state, reason = "not converged", str(error)
        except ThirdBodyError as error:
            state, reason = "refused", str(error)
        except Exception as error:
            # the ranks can continue with the next case only if all of them failed
            if self.comm is not None and self.comm.size > 1 and not ranks.all_arrive(self.comm):
                raise
            state, reason = "failed", "".join(traceback.format_exception_only(error)).strip()
        mine = time.process_time() - self.began[0]
        cpu = self.spent[0] + (mine if self.comm is None else self.comm.allreduce(mine))
        if self.folder is None:
            return
        record = self._record(state, cpu)
        if result is not None:
            found = result.to_dict()
            record |= {"steps": found["steps"] or [{"balls": found["balls"], "record": {}}], "solved": found["solved"]}
        self.folder.save(self.case, record | {"reason": reason})
        print_status(f"{self.case.name}: {state}{f': {reason}' if reason else ''} ({cpu:.0f} s of processor time)")

    def _solve(self) -> Result:
        case = self.case
        workspace = self.folder.workspace(case) if self.folder is not None else None
        if self.comm is not None:
            workspace = self.comm.bcast(workspace, root=0)
        goal = max(case.problem.load.values) if case.problem.load.kind == "approach" else None
        while True:
            observer = _Stopper(Scale.of(case.problem), goal, root=self.folder is not None, take=self._take)
            observer.left = self.stop_after
            try:
                run = Run(case.accuracy, self.comm, workspace, observer, None, case.budget, case.steps, case.numerics)
                return case.solve(run)
            except _Stopped:
                self.stop_after = None

    def _take(self, step: Step) -> None:
        assert self.folder is not None
        self.steps[:] = path_so_far(self.steps, step)
        # the other ranks spend about as much as this one: they wait for each other without a pause
        spent = self.ranks * (time.process_time() - self.began[0])
        self.folder.save(self.case, self._record(RUNNING, self.spent[0] + spent))

    def _record(self, state: str, cpu: float) -> dict[str, Any]:
        return {
            "name": self.case.name,
            "state": state,
            "model": self.case.model,
            "accuracy": self.case.accuracy,
            "labels": dict(self.case.labels),
            "ranks": self.ranks,
            "cpu_seconds": cpu,
            "wall_seconds": self.spent[1] + time.monotonic() - self.began[1],
            "steps": [step.to_dict() for step in self.steps],
        }


class _Stopper(Progress):
    """Interrupts the run after a number of load steps."""

    left: int | None = None

    def step_done(self, step: Step, surface: Callable[[], Any]) -> None:
        """Record the step; interrupt the run after the requested number."""
        super().step_done(step, surface)
        if self.left is not None:
            self.left -= 1
            if self.left == 0:
                raise _Stopped
