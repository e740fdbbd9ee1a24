"""One case of a study (a problem, the model that solves it, varied numerical parameters), and the cases' records.

A record is one JSON file, written while the case runs, and valid until the case's key changes.
"""

from __future__ import annotations

import hashlib
import importlib
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import linear_bem
from linear_bem.errors import InvalidProblem
from linear_bem.problem import Problem
from linear_bem.result import Result
from runs.display.numbers import attraction
from runs.models import MODELS, Run
from runs.process.files import read_json, write_text
from runs.process.json_values import to_json
from runs.process.locks import RUNNING, seen, take
from runs.studies.framework.study import CASES

FINITE, SMALL, LINEAR, POINT = "finite_strain", "small_strain", "linear_bem", "point_load"
DONE, NOT_RUN = "done", "not run yet"
"""States of a record, in addition to `RUNNING`; all others are reasons for an end without an answer."""
ENDED = (DONE, "refused", "not converged", "failed")
"""Final states."""


@dataclass(frozen=True)
class Case:
    """One solve; ``name`` is unique in the study and names the case's file.

    ``accuracy`` is the relative accuracy requested of T; ``constants`` overrides "module.NAME" of the linear model,
    ``numerics`` fields of `finite_strain.Numerics`; ``labels`` describe the case in the study's tables; ``steps`` are
    the load fractions with output (None: those of a whole load path); ``stop_after`` interrupts the run after that many
    load steps and resumes it from disk; ``budget`` limits refinement ("unknowns", "seconds"); ``alone`` solves on one
    rank even if there are more; ``same_as`` (study, case) names an identical case, whose answer is reused if the
    folders of both studies have the same parent.
    """

    name: str
    problem: Problem
    model: str
    accuracy: float
    constants: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, Any] = field(default_factory=dict)
    steps: Sequence[float] | None = (1.0,)
    stop_after: int | None = None
    budget: Mapping[str, float] = field(default_factory=dict)
    alone: bool = False
    numerics: Mapping[str, Any] = field(default_factory=dict)
    same_as: tuple[str, str] | None = None

    @property
    def parallel(self) -> bool:
        """Whether all ranks solve the case together."""
        return MODELS[self.model].parallel

    def solve(self, run: Run) -> Result:
        """Return the answer (collective if `parallel`); subclasses may compute it differently."""
        return MODELS[self.model].solve(self.problem, run)

    def key(self) -> str:
        """Return a digest that changes whenever a saved answer is no longer valid for this case."""
        varied = sorted({**self.constants, **self.numerics}.items())
        if self.parallel:
            from finite_strain import FORMAT  # noqa: PLC0415  (finite-element cases only)

            code = f"elements {FORMAT}"
        else:
            code = code_of(Path(linear_bem.__file__).parent)
        budget = sorted(self.budget.items())
        steps = None if self.steps is None else tuple(self.steps)
        said = repr((code, self.problem, self.model, self.accuracy, varied, steps, self.stop_after, budget, self.alone))
        return hashlib.sha256(said.encode()).hexdigest()[:20]


@contextmanager
def varied(constants: Mapping[str, float]) -> Iterator[None]:
    """Override module constants, named "package.module.NAME", within the block; raises `InvalidProblem`."""
    with ExitStack() as restored:
        for place, value in constants.items():
            module_name, _, name = place.rpartition(".")
            module = importlib.import_module(module_name)
            if not hasattr(module, name):
                raise InvalidProblem(f"{place}: there is no such constant to vary; correct the study's case")
            restored.callback(setattr, module, name, getattr(module, name))
            setattr(module, name, value)
        yield


@cache
def code_of(*folders: Path) -> str:
    """Return a digest of the code and scenes in ``folders``, computed once per process."""
    digest = hashlib.sha256()
    for folder in folders:
        for file in sorted(folder.rglob("*")):
            if file.suffix in (".py", ".toml"):
                digest.update(file.read_bytes())
    return digest.hexdigest()


class StudyFolder:
    """The saved cases in the output folder of ``study``, which several runs may share; use on rank 0 only."""

    def __init__(self, path: Path, study: str) -> None:
        self.path, self.study = path, study
        (path / CASES).mkdir(exist_ok=True)

    def workspace(self, case: Case) -> Path:
        """Return the folder for the case's working files."""
        return self.path / CASES / case.name

    def record(self, case: Case) -> dict[str, Any] | None:
        """Return the case's record if its key is current, from this study or from the other one in ``same_as``."""
        saved = _valid(self.path, case.name, case)
        if saved is None and case.same_as is not None:
            study, name = case.same_as
            saved = _valid(self.path.with_name(self.path.name.replace(self.study, study)), name, case)
            return None if saved is None or saved["state"] == RUNNING else saved
        return saved

    def save(self, case: Case, record: Mapping[str, Any]) -> None:
        """Write a case's record; delete its working files unless it is still running."""
        write_text(self.path / CASES / f"{case.name}.json", to_json({"key": case.key(), **record}))
        if record["state"] != RUNNING:
            shutil.rmtree(self.workspace(case), ignore_errors=True)

    def forget(self, case: Case) -> None:
        """Delete everything saved for a case."""
        (self.path / CASES / f"{case.name}.json").unlink(missing_ok=True)
        shutil.rmtree(self.workspace(case), ignore_errors=True)

    @contextmanager
    def claim(self, case: Case) -> Iterator[bool]:
        """Yield whether this run may compute the case; False if another run has locked it."""
        with open(lock_of(self.path, case.name), "w", encoding="utf-8") as lock:
            yield take(lock) is not False  # permitted if the file system has no locks


@dataclass(frozen=True)
class Found:
    """The cases of a study and their ``records`` by name, complete or not."""

    cases: tuple[Case, ...]
    records: Mapping[str, Mapping[str, Any]]

    @classmethod
    def of(cls, folder: StudyFolder, cases: Sequence[Case]) -> Found:
        """Collect the records of ``cases``."""
        saved = {case.name: folder.record(case) for case in cases}
        records = {
            name: {**record, "state": seen(record["state"], lock_of(folder.path, name))}
            for name, record in saved.items()
            if record is not None
        }
        return cls(tuple(cases), records)

    def steps(self, name: str) -> list[dict[str, Any]]:
        """Return the load steps that a case has finished; empty if it has not run."""
        return list(self.records.get(name, {}).get("steps", []))

    def state(self, name: str) -> str:
        """Return "done", "running", "stopped", how the case ended without an answer, or "not run yet"."""
        return str(self.records.get(name, {}).get("state", NOT_RUN))

    def done(self, part: str) -> list[Case]:
        """Return the cases of one part of the study that have an answer."""
        return [case for case in self.of_part(part) if self.state(case.name) == DONE]

    def of_part(self, part: str) -> list[Case]:
        """Return the cases whose label "part" is ``part``."""
        return [case for case in self.cases if case.labels["part"] == part]

    def missing(self, answers: Collection[str] = (DONE,)) -> list[str]:
        """Return one sentence for every case whose state is not among ``answers``."""
        sentences = []
        for name in (case.name for case in self.cases if self.state(case.name) not in answers):
            reached, reason = len(self.steps(name)), self.records.get(name, {}).get("reason")
            where = f" after {reached} load step(s)" if reached else ""
            sentences.append(f"{name}: {self.state(name)}{where}" + (f": {reason}" if reason else ""))
        return sentences

    def seconds(self) -> float:
        """Return the processor time [s] of all ranks over all cases."""
        return float(sum(record.get("cpu_seconds", 0.0) for record in self.records.values()))

    def versions(self) -> dict[str, str]:
        """Return the library versions that produced the answers; several of one library are joined by "and"."""
        found: dict[str, dict[str, None]] = {}
        for record in self.records.values():
            for name, version in record.get("solved", {}).get("versions", {}).items():
                found.setdefault(name, {})[version] = None
        return {name: " and ".join(versions) for name, versions in found.items()}


def lock_of(folder: Path, name: str) -> Path:
    """Return the file that a run locks while it computes a case."""
    return folder / CASES / f".{name}.lock"


def pull(balls: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """Return T of the first ball towards the others [N], and its error."""
    return attraction(balls, 0, balls[0]["tangential_force"]), float(balls[0]["tangential_force_error"])


def _valid(folder: Path, name: str, case: Case) -> dict[str, Any] | None:
    saved = read_json(folder / CASES / f"{name}.json")
    return saved if saved is not None and saved.get("key") == case.key() else None
