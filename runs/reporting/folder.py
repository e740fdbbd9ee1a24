"""The contents of the folder of a run or a study, and the command that reproduces it."""

import json
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linear_bem.errors import OutputUnusable
from runs.process.locks import seen
from runs.session.output_folder import LOCK, MARK, RESULT
from runs.studies.framework.study import command


@dataclass(frozen=True)
class Folder:
    """A run's or a study's folder: its identity, its state, its document and texts."""

    path: Path
    identity: Mapping[str, Any]
    state: str
    document: Mapping[str, Any]
    scene_text: str
    log: str

    @property
    def command(self) -> str:
        """The command that wrote the folder: solve, compare, evolve, study, ..."""
        return str(self.identity.get("command", "run"))

    def words(self) -> str:
        """Return the Markdown text of a study."""
        found = sorted(self.path.glob("*.md"))
        return found[0].read_text(encoding="utf-8") if found else ""

    def cases(self) -> list[dict[str, Any]]:
        """Return the records of a study's cases, in the order of their names."""
        found = {path: json.loads(path.read_text(encoding="utf-8")) for path in (self.path / "cases").glob("*.json")}
        return [
            {**record, "state": seen(record["state"], path.with_name(f".{path.stem}.lock"))}
            for path, record in sorted(found.items())
        ]

    def repeat(self) -> str:
        """Return the command line that reproduces the folder."""
        launcher = f"mpirun -n {ranks} " if (ranks := self.ranks()) > 1 else ""
        if self.command == "study":
            return launcher + command(self.identity["study"], bool(self.identity.get("quick")))
        words = ["thirdbody", self.command, str(self.path / "scene.toml")]
        if self.command in ("solve", "evolve"):
            words += ["--model", str(self.identity.get("model"))]
        return launcher + shlex.join(words) + " --out NEW_FOLDER"

    def ranks(self) -> int:
        """Return the number of MPI ranks of the run."""
        said = re.findall(r"on (\d+) rank\(s\)", self.log)
        recorded = [int(record.get("ranks", 1)) for record in self.cases()]
        return max([*recorded, int(said[-1]) if said else 1])


def read_folder(path: Path) -> Folder:
    """Return the contents of ``path``; raises `OutputUnusable` if it is not the folder of a run or a study."""
    try:
        mark = json.loads((path / MARK).read_text(encoding="utf-8"))
        identity, state = mark["identity"], mark["state"]
    except (FileNotFoundError, NotADirectoryError):
        raise OutputUnusable(
            f"{path}: holds no run and no study ({MARK} is missing); name a folder written by "
            "thirdbody solve, compare, evolve or study"
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise OutputUnusable(
            f"{path / MARK}: is damaged ({error}), and its run cannot be identified; run the same command again with "
            "--fresh"
        ) from None
    try:
        document = json.loads((path / RESULT).read_text(encoding="utf-8"))
    except FileNotFoundError:
        document = {}
    except ValueError as error:
        raise OutputUnusable(f"{path / RESULT}: is not JSON ({error}); run the same command again") from None
    return Folder(
        path, identity, seen(state, path / LOCK), document, _text(path / "scene.toml"), _text(path / "run.log")
    )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    except (OSError, ValueError) as error:
        raise OutputUnusable(
            f"{path}: cannot be read as text ({error}); remove it and run the same command again"
        ) from None
