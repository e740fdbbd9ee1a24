"""Studies: one question each, answered anew by ``thirdbody study NAME``. The list below is all there is to register."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path

from linear_bem.errors import InvalidProblem
from runs import ranks

STUDIES = {
    "figures": "the paper's figures 8-12 and two maps of the sign of T",
    "benchmarks": "seconds and errors against other contact codes; growth with the number of balls",
}
"""Name and question of every study; ``runs.studies.NAME.run`` answers it."""


@dataclass(frozen=True)
class Options:
    """What the command line asks of a study: a coarser version, another output folder, a new start."""

    quick: bool = False
    out: Path | None = None
    fresh: bool = False


def listing() -> str:
    """Return the names of all studies with their questions."""
    return "; ".join(f"{name} ({question})" for name, question in STUDIES.items())


def run_study(name: str, options: Options) -> None:
    """Run the study ``name``; raises `InvalidProblem` for a name that is none."""
    if name not in STUDIES:
        raise InvalidProblem(f'study: there is no study "{name}"; known: {listing()}')
    if ranks.is_root():
        importlib.import_module(f"runs.studies.{name}").run(options)
