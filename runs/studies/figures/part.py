"""One part of the study: numbers found once, kept in the output folder, drawn and put into sentences from there."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import linear_bem
from runs.process.files import replacing
from runs.process.json_values import to_json

Columns = dict[str, Sequence[float]]


@dataclass(frozen=True)
class Findings:
    """What a part computed: curves as named tables of equal columns, and the numbers of its features."""

    tables: dict[str, Columns]
    numbers: dict[str, Any]
    seconds: float = field(default=0.0, compare=False)
    """Processor time [s] that it took."""


@dataclass(frozen=True)
class Part:
    """A figure: ``compute(quick)``, ``draw(findings)`` and ``sentences(numbers)``; ``stem`` names its files."""

    stem: str
    title: str
    compute: Callable[[bool], Findings]
    draw: Callable[[Findings], Any]
    sentences: Callable[[Mapping[str, Any]], list[str]]


def saved(folder: Path, stem: str, identity: Mapping[str, Any]) -> Findings | None:
    """Return what an earlier run of the same code has found, where every file of the part is there."""
    try:
        document = json.loads((folder / f"{stem}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    whole = all((folder / f"{stem}.{kind}").exists() for kind in ("png", "svg"))
    if document.get("identity") != dict(identity) or not whole:
        return None
    return Findings(document["tables"], document["numbers"], document["seconds"])


def save(folder: Path, stem: str, identity: Mapping[str, Any], findings: Findings) -> None:
    """Write STEM_TABLE.csv for every table, and STEM.json last: it says that the part is complete."""
    for name, columns in findings.tables.items():
        with (
            replacing(folder / f"{stem}_{name}.csv") as draft,
            open(draft, "w", encoding="utf-8", newline="") as file,
        ):
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))
    document = {
        "identity": dict(identity),
        "seconds": findings.seconds,
        "numbers": findings.numbers,
        "tables": findings.tables,
    }
    with replacing(folder / f"{stem}.json") as draft:
        draft.write_text(to_json(document), encoding="utf-8")


def fingerprint() -> str:
    """Return a digest of the code and scenes that the numbers come from: other code computes them anew."""
    digest = hashlib.sha256()
    for root in (Path(linear_bem.__file__).parent, Path(__file__).parent):
        for file in sorted(root.rglob("*")):
            if file.suffix in (".py", ".toml"):
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
