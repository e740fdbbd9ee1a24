"""What a study's folder holds: one JSON file per case, written as the case goes on, valid as long as its key."""

from __future__ import annotations

import fcntl
import json
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linear_bem.errors import OutputUnusable
from runs.process.files import replacing
from runs.process.json_values import plain, to_json
from runs.session.run_folder import MARK
from runs.studies.framework.case import Case

CASES = "cases"
DONE, RUNNING, NOT_RUN = "done", "running", "not run yet"
"""States of a record; every other one names how the case ended without an answer."""


class StudyFolder:
    """A study's output folder, which several runs may share. Use on rank 0 alone.

    Raises `OutputUnusable` for a folder that holds something else or cannot be written.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any]) -> None:
        self.path = path
        identity = plain(identity)
        try:
            (path / CASES).mkdir(parents=True, exist_ok=True)
            mark = _read(path / MARK)
            strangers = [p.name for p in path.iterdir() if not p.name.startswith(".") and p.name != CASES]
        except OSError as error:
            raise OutputUnusable(f"{path}: cannot write there: {error.strerror or error}; name another --out") from None
        if mark is None and [name for name in strangers if name != MARK]:
            raise OutputUnusable(f"{path}: holds files of no study ({strangers[0]}); name a new or empty --out")
        if mark is not None and mark.get("identity") != identity:
            raise OutputUnusable(
                f"{path}: holds another run, {json.dumps(mark.get('identity'))}, and this one is "
                f"{json.dumps(identity)}; name another --out"
            )
        if mark is None:
            self.write(MARK, to_json({"identity": identity, "state": "running"}))

    def write(self, name: str, text: str) -> None:
        """Write a text file whole or not at all."""
        with replacing(self.path / name) as draft:
            draft.write_text(text, encoding="utf-8")

    def workspace(self, case: Case) -> Path:
        """Return where the case's own files go until it is done."""
        return self.path / CASES / case.name

    def record(self, case: Case) -> dict[str, Any] | None:
        """Return what is saved of a case under its present key."""
        saved = _read(self.path / CASES / f"{case.name}.json")
        return saved if saved is not None and saved.get("key") == case.key() else None

    def save(self, case: Case, record: Mapping[str, Any]) -> None:
        """Write a case's record; drop its own files once it is no longer running."""
        self.write(f"{CASES}/{case.name}.json", to_json({"key": case.key(), **record}))
        if record["state"] != RUNNING:
            shutil.rmtree(self.workspace(case), ignore_errors=True)

    def forget(self, case: Case) -> None:
        """Drop everything that is saved of a case."""
        (self.path / CASES / f"{case.name}.json").unlink(missing_ok=True)
        shutil.rmtree(self.workspace(case), ignore_errors=True)

    @contextmanager
    def claim(self, case: Case) -> Iterator[bool]:
        """Yield whether this run alone may compute the case now."""
        with open(self.path / CASES / f".{case.name}.lock", "w", encoding="utf-8") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                yield False
                return
            except OSError:
                pass  # a file system without locks
            yield True


@dataclass(frozen=True)
class Found:
    """The cases of a study and what is known of each: ``records`` by name, complete or not."""

    cases: tuple[Case, ...]
    records: Mapping[str, Mapping[str, Any]]

    @classmethod
    def of(cls, folder: StudyFolder, cases: Sequence[Case]) -> Found:
        """Collect the records of ``cases``."""
        saved = {case.name: folder.record(case) for case in cases}
        return cls(tuple(cases), {name: record for name, record in saved.items() if record is not None})

    def steps(self, name: str) -> list[dict[str, Any]]:
        """Return the load steps that a case has reached; none where it has not been run."""
        return list(self.records.get(name, {}).get("steps", []))

    def state(self, name: str) -> str:
        """Return "done", "running", how the case ended without an answer, or "not run yet"."""
        return str(self.records.get(name, {}).get("state", NOT_RUN))

    def missing(self, answers: Collection[str] = (DONE,)) -> list[str]:
        """Return one sentence for every case whose state is none of ``answers``."""
        sentences = []
        for case in self.cases:
            state = self.state(case.name)
            if state in answers:
                continue
            reached = len(self.steps(case.name))
            words = [f"{case.name}: {state}"]
            if reached:
                words.append(f"after {reached} load step(s)")
            reason = self.records.get(case.name, {}).get("reason")
            sentences.append(" ".join(words) + (f": {reason}" if reason else ""))
        return sentences

    def seconds(self) -> float:
        """Return the processor time [s] of all ranks over all cases."""
        return float(sum(record.get("cpu_seconds", 0.0) for record in self.records.values()))

    def versions(self) -> dict[str, str]:
        """Return the library versions that the answers were made with."""
        found: dict[str, str] = {}
        for record in self.records.values():
            found |= record.get("solved", {}).get("versions", {})
        return found


def _read(path: Path) -> dict[str, Any] | None:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    return data if isinstance(data, dict) else None
