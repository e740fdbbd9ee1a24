"""The study's answer as text: every figure with its sentences and numbers, in Markdown."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from runs.process.files import replacing
from runs.studies.figures.part import Findings, Part

SOURCE = "Materials 2021, 14(19), 5689, doi 10.3390/ma14195689"


def report(folder: Path, done: Sequence[tuple[Part, Findings]], *, quick: bool) -> str:
    """Write figures.md and return its text; pictures are linked from the file."""
    versions = f"thirdbody {importlib.metadata.version('thirdbody')}, numpy {np.__version__}, scipy {scipy.__version__}"
    lines = [
        f"# Figures 8 to 12 of {SOURCE}, and maps of the sign of T",
        "",
        f"Made by `thirdbody study figures{' --quick' if quick else ''}` in "
        f"{sum(found.seconds for _, found in done):.1f} s of processor time; {versions}, "
        f"Python {platform.python_version()}.",
        "Lengths are over R (figure 8: over a), forces over E1 R^2; T > 0 on the left ball attracts. T at features is "
        "asked to 1e-5, on curves to 1e-3.",
    ]
    for part, found in done:
        lines += ["", f"## {part.title}", "", f"![{part.title}]({part.stem}.png)", ""]
        lines += [f"- {sentence}" for sentence in part.sentences(found.numbers)]
        lines += ["", "| number | value |", "|---|---|"]
        lines += [f"| {key} | {_written(value)} |" for key, value in _flat(found.numbers)]
    text = "\n".join(lines) + "\n"
    with replacing(folder / "figures.md") as draft:
        draft.write_text(text, encoding="utf-8")
    return text


def _flat(numbers: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for key, value in numbers.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            continue  # rows of a check: the sentences hold what they show
        rows.append((f"{prefix}{key}".replace("_", " "), value))
    return rows


def _written(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_written, value))
    if isinstance(value, float) and not isinstance(value, bool):
        return f"{value:.7g}"
    return str(value)
