"""The output folder of a run, written during the run; only a run with the same identity may resume it."""

import contextlib
import shutil
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, Any

from linear_bem.errors import OutputUnusable
from runs.process import signals
from runs.process.files import DRAFT, read_json, write_csv, write_text
from runs.process.json_values import plain, to_json
from runs.process.locks import RUNNING, take

MARK = "run.json"
RESULT = "result.json"
REPORT = "report.html"
LOCK = ".lock"
FIRST = (MARK, "scene.toml", LOCK)
"""Files that a run writes before it computes."""
FINISHED, INTERRUPTED, FAILED = "finished", "interrupted", "failed"
"""States of a run in its `MARK`, in addition to `RUNNING`."""
FIELDS = "fields"
PICTURES = "pictures"
PATH = "path"
CHANGEABLE = ("cycles", "ensemble")
"""Keys of [reciprocation] with which a saved run goes on although they differ."""
LONG = 60
"""Characters of a list from which a difference in it is named by the place of its items."""
OURS = (
    MARK, "scene.toml", RESULT, "steps.csv", "strengthening.csv", "run.log", "tangential_force.png",
    "tangential_force.svg", "surface.png", "surface.npz", "top_views.png", "top_views.svg", "distances.png",
    "distances.svg", "structure.csv", "structure_factor.csv", "structure.png", "structure.svg", "evolution.gif",
    "ensemble.png", "ensemble.svg", "forces.png", REPORT, LOCK,
)  # fmt: skip


class OutputFolder:
    """The folder of one run, for use on rank 0 only.

    ``identity`` describes the run (command, model, problem, accuracy). Raises `OutputUnusable` if the folder belongs to
    another run, holds other files, or cannot be written. ``stopped``: an earlier process of this run was killed;
    ``complete``: the run is; ``saved``: the document that an earlier process saved, complete or not; ``lost``: it is
    unreadable or gone; ``gone``: other files of the complete run that are.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any], scene_text: str, *, fresh: bool = False) -> None:
        self.path = path
        self.identity = plain(identity, infinity="inf")
        self._lock: IO[str] | None = None
        self.stopped = self.complete = self.lost = False
        self.saved: dict[str, Any] | None = None
        self.gone: list[str] = []
        try:
            self._open(scene_text, fresh)
        except OutputUnusable:
            self.close()
            raise
        except OSError as error:
            self.close()
            raise OutputUnusable(f"{path}: cannot write there: {error.strerror or error}; name another --out") from None

    @property
    def fields(self) -> Path:
        """Folder of the finite-element fields and checkpoints."""
        return self.path / FIELDS

    def _open(self, scene_text: str, fresh: bool) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise OutputUnusable(f"{self.path}: is a file, not a folder; name another --out")
        self.path.mkdir(parents=True, exist_ok=True)
        locked = self._take_lock()
        mark = read_json(self.path / MARK)
        # on a full disk, a run may leave only its first files, complete or not
        others = [p.name for p in self.path.iterdir() if p.name not in FIRST and not p.name.startswith(DRAFT)]
        damaged = mark is None and (self.path / MARK).exists()
        if damaged and others and not fresh:
            raise OutputUnusable(
                f"{self.path / MARK}: is damaged, and its run cannot be identified; name another --out, or "
                "replace it with --fresh"
            )
        if mark is None and others and not damaged:
            raise OutputUnusable(
                f"{self.path}: holds files of no run ({', '.join(sorted(others)[:3])}); name a new or empty --out"
            )
        if (mark is not None or damaged) and fresh:
            self._clear()
            mark = None
        elif mark is not None and (fixed := _fixed(mark.get("identity"))) != _fixed(self.identity):
            raise OutputUnusable(
                f"{self.path}: holds another run ({difference(fixed, _fixed(self.identity))}); "
                "name another --out, or replace that run with --fresh"
            )
        if mark is not None:
            result = self.path / RESULT
            self.saved = read_json(result)
            self.lost = self.saved is None and (result.exists() or mark.get("state") == FINISHED)
            self.stopped = locked and mark.get("state") == RUNNING
            # with other cycles or members, or a damaged result, it goes on
            is_same = mark.get("identity") == self.identity
            self.complete = is_same and mark.get("state") == FINISHED and self.saved is not None
            self.gone = [name for name in mark.get("files", ["steps.csv"]) if not (self.path / name).exists()]
        for folder in (self.path, self.fields, self.path / PATH) if locked else ():
            for draft in folder.glob(f"{DRAFT}*"):  # which killed processes left
                draft.unlink(missing_ok=True)
        if not self.complete:
            self._write_mark(RUNNING)
        write_text(self.path / "scene.toml", scene_text)

    def _take_lock(self) -> bool:
        """Return whether this run holds the lock; False where the file system has no locks."""
        self._lock = open(self.path / LOCK, "w", encoding="utf-8")  # noqa: SIM115  (held as long as the run)
        taken = take(self._lock)
        if taken is False:
            raise OutputUnusable(f"{self.path}: another run is writing there now; wait for it or name another --out")
        return bool(taken)

    def _clear(self) -> None:
        for folder in (self.fields, self.path / PICTURES, self.path / PATH):
            shutil.rmtree(folder, ignore_errors=True)
        for name in OURS:
            if name != LOCK:
                (self.path / name).unlink(missing_ok=True)

    def _write_mark(self, state: str, **more: Any) -> None:
        write_text(self.path / MARK, to_json({"identity": self.identity, "state": state, **more}))

    def save(self, document: Mapping[str, Any], rows: Iterable[Mapping[str, Any]]) -> None:
        """Write result.json and steps.csv; each file is replaced atomically."""
        write_text(self.path / RESULT, to_json(document))
        write_csv(self.path / "steps.csv", [_flat(row) for row in rows])

    def finish(self) -> None:
        """Mark the run as complete; from now on, the same command prints the saved document."""
        kept = [name for name in (*OURS, FIELDS, PATH) if name not in (*FIRST, REPORT) and (self.path / name).exists()]
        self._write_mark(FINISHED, files=kept)
        self.complete = True

    def stop(self, error: type[BaseException]) -> None:
        """Mark the run as ended by an error; the same command continues it."""
        with contextlib.suppress(OutputUnusable):  # the error that ends the run is the one to report
            if not self.complete:
                self._write_mark(ended(error))

    def log(self, text: str) -> None:
        """Append lines to run.log, each with a time stamp."""
        stamp = time.strftime("%Y-%m-%d %H:%M:%S")
        try:
            with open(self.path / "run.log", "a", encoding="utf-8", errors="replace") as log:
                log.writelines(f"{stamp}  {line}\n" for line in text.splitlines())
        except OSError as error:
            raise OutputUnusable(f"{self.path / 'run.log'}: cannot be written: {error.strerror or error}") from None

    def close(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def ended(error: type[BaseException]) -> str:
    """Return `INTERRUPTED` or `FAILED`, depending on the error that ends a run."""
    return INTERRUPTED if signals.received() or error is KeyboardInterrupt else FAILED


def _fixed(identity: Any) -> Any:
    """Return an identity without the numbers of an evolution that may change: its finished run continues."""
    if not isinstance(identity, dict) or "reciprocation" not in identity:
        return identity
    return {**identity, "reciprocation": {k: v for k, v in identity["reciprocation"].items() if k not in CHANGEABLE}}


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    flat = {}
    for key, value in plain(row).items():
        if isinstance(value, list) and len(value) == 2:
            flat[f"{key}_x"], flat[f"{key}_y"] = value
        elif not isinstance(value, dict | list):
            flat[key] = value
    return flat


def _is_long(value: Any) -> bool:
    return isinstance(value, list) and len(str(value)) > LONG


def difference(old: Any, new: Any, where: str = "") -> str:
    """Return the difference between two identities, such as "quick is True there and False here"."""
    if _is_long(old) and _is_long(new) and len(old) == len(new):
        old, new = ({f"[{i}]": value for i, value in enumerate(values)} for values in (old, new))
    if isinstance(old, dict) and isinstance(new, dict):
        parts = [
            difference(old.get(k), new.get(k), f"{where}.{k}".strip(".").replace(".[", "["))
            for k in {**old, **new}
            if old.get(k) != new.get(k)
        ]
        return ", ".join(parts[:3]) + (", ..." if len(parts) > 3 else "")
    there, here = (
        f"a list of {len(value)}" if _is_long(value) else "a table" if isinstance(value, dict) else value
        for value in (old, new)
    )
    return f"{where.removeprefix('problem.')} is {there} there and {here} here"
