"""One part of the study: numbers computed once, saved in the output folder, and from there drawn and described."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import linear_bem
from runs.process.files import read_json, write_csv, write_text
from runs.process.json_values import to_json
from runs.studies.figures.pair import scene
from runs.studies.framework.case import code_of

Columns = Mapping[str, Sequence[float] | np.ndarray]


@dataclass(frozen=True)
class Findings:
    """Results of a part: curves as named tables of equal columns, and the numbers of its features."""

    tables: Mapping[str, Columns]
    numbers: Mapping[str, Any]
    seconds: float = 0.0
    """Processor time [s] of the computation."""


@dataclass(frozen=True)
class Part:
    """A figure: ``compute(quick)`` and ``draw(findings)``; ``stem`` names its files and its text, STEM.md.jinja."""

    stem: str
    title: str
    compute: Callable[[bool], Findings]
    draw: Callable[[Findings], Any]


def saved(folder: Path, part: Part, quick: bool) -> Findings | None:
    """Return the saved results of an earlier run of the same code and scene."""
    document = read_json(folder / f"{part.stem}.json")
    if document is None or document.get("identity") != _identity(quick):
        return None
    return Findings(document["tables"], document["numbers"], document["seconds"])


def save(folder: Path, part: Part, quick: bool, found: Findings, seconds: float) -> None:
    """Write STEM_TABLE.csv for every table, and finally STEM.json, which marks the part as complete."""
    for name, columns in found.tables.items():
        rows = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
        write_csv(folder / f"{part.stem}_{name}.csv", [dict(zip(columns, row, strict=True)) for row in rows])
    document = {"identity": _identity(quick), "seconds": seconds, "numbers": found.numbers, "tables": found.tables}
    write_text(folder / f"{part.stem}.json", to_json(document))


def _identity(quick: bool) -> dict[str, Any]:
    """Return the version, with digests of the code and the scene that produce the numbers."""
    code = code_of(Path(linear_bem.__file__).parent, Path(__file__).parent)
    return {"quick": quick, "code": code[:16], "scene": hashlib.sha256(scene().text.encode()).hexdigest()[:16]}
