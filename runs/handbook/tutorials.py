"""Runs the tutorials: writes their files, runs their commands and Python blocks in order, and inserts the output.

In a page, a fenced block ``toml`` whose first line is ``# NAME.toml`` is a file of that name; ``sh`` holds commands,
``python`` a separate script. An empty block ``output`` after one of these is filled with its output. A block
``picture`` becomes a picture that the blocks before it have written: its first line is the file, its second describes
it. ``sh`` blocks with the first line ``# not run here`` are not run.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```(?P<language>toml|sh|python|output|picture)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
NOT_RUN = "# not run here"
WIDTH = 200
"""Width of the blocks' terminal in columns; pages wrap sentences themselves."""
TABLE = re.compile(r"\u2500{3}|^ *ball {2,}", re.MULTILINE)
"""The line below the heading of a table, or the heading of the table in a printed result."""


class TutorialFailed(Exception):
    """A block of a page ended with an error."""


@dataclass
class Tutorial:
    """One page, run in ``folder``; pages with the same folder share their runs. ``pictures`` receives its pictures."""

    page: Path
    folder: Path
    pictures: Path

    def run(self) -> str:
        """Return the page with the output of its blocks; raises `TutorialFailed`."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._printed = ""
        return BLOCK.sub(self._filled, self.page.read_text(encoding="utf-8"))

    def _filled(self, block: re.Match[str]) -> str:
        language, text = block["language"], block["text"]
        match language:
            case "toml":
                name = re.match(r"# (\S+\.toml)\n", text)
                if name:
                    (self.folder / name[1]).write_text(text, encoding="utf-8")
            case "sh" if not text.startswith(NOT_RUN):
                self._printed = self._stdout(["bash", "-euo", "pipefail", "-c", text], block)
            case "python":
                self._printed = self._stdout([sys.executable, "-c", text], block)
            case "output":
                return _shown(self._printed)
            case "picture":
                return self._picture(*text.splitlines())
            case _:
                return block[0].replace(NOT_RUN + "\n", "")
        return block[0]

    def _picture(self, file: str, description: str) -> str:
        """Return the picture, whose title is its file in the run's folder."""
        copy = self.pictures / f"{self.page.stem}-{file.replace('/', '-')}"
        shutil.copy(self.folder / file, copy)
        return f'![{description}]({copy.name} "{file}")'

    def _stdout(self, command: list[str], block: re.Match[str]) -> str:
        done = subprocess.run(
            command, cwd=self.folder, env=environment(), capture_output=True, text=True, check=False, timeout=600
        )
        if done.returncode:
            line = self.page.read_text(encoding="utf-8")[: block.start()].count("\n") + 1
            raise TutorialFailed(f"{self.page}:{line}: exit code {done.returncode}\n{block['text']}\n{done.stderr}")
        lines = [line.rstrip() for line in done.stdout.strip("\n").splitlines()]
        return "\n".join(lines) + "\n" if lines else ""


def _shown(printed: str) -> str:
    """Return printed output as fenced blocks: sentences as ``text``, which pages wrap, tables as ``none``."""
    kinds = groupby(printed.split("\n\n"), key=lambda part: "none" if TABLE.search(part) else "text")
    blocks = ((kind, "\n\n".join(parts).rstrip("\n") + "\n") for kind, parts in kinds)
    return "\n\n".join(f"```{kind}\n{text if text.strip() else ''}```" for kind, text in blocks)


def environment() -> Mapping[str, str]:
    """Return the environment of the blocks: this Python's commands first, this checkout, plain output."""
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    plain = {
        "NO_COLOR": "1",
        "TERM": "dumb",
        "COLUMNS": str(WIDTH),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    python = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    return {**os.environ, **plain, "PATH": programs, "PYTHONPATH": python, "MPLBACKEND": "Agg"}
