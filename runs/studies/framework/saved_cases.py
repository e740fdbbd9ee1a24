"""Records of a study's cases: one JSON file each, written while the case runs, valid until the case's key changes."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runs.display.numbers import attraction
from runs.process.files import read_json, write_text
from runs.process.json_values import to_json
from runs.process.locks import RUNNING, seen, take
from runs.studies.framework.case import Case
from runs.studies.framework.study import CASES

DONE, NOT_RUN = "done", "not run yet"
"""States of a record, in addition to `RUNNING`; all others are reasons for an end without an answer."""
ENDED = (DONE, "refused", "not converged", "failed")
"""Final states."""


class StudyFolder:
    """The saved cases in the output folder of ``study``, which several runs may share; use on rank 0 only."""

    def __init__(self, path: Path, study: str) -> None:
        self.path, self.study = path, study
        (path / CASES).mkdir(exist_ok=True)

    def workspace(self, case: Case) -> Path:
        """Return the folder for the case's working files."""
        return self.path / CASES / case.name

    def file(self, case: Case) -> Path:
        """Return the file of the case's record."""
        return self.path / CASES / f"{case.name}.json"

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
        write_text(self.file(case), to_json({"key": case.key(), **record}))
        if record["state"] != RUNNING:
            shutil.rmtree(self.workspace(case), ignore_errors=True)

    def forget(self, case: Case) -> None:
        """Delete everything saved for a case."""
        self.file(case).unlink(missing_ok=True)
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
