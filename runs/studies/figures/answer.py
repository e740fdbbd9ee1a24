"""Every figure with its sentences and numbers: parts are computed once, and drawn from what is saved of them."""

from __future__ import annotations

import importlib.metadata
import platform
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from runs.display.style import look, save_figure
from runs.process import signals
from runs.process.files import write_text
from runs.session.progress import tell
from runs.studies import Options
from runs.studies.figures import bulge, distance, map_lengths, map_materials, modulus, pressure, thickness
from runs.studies.figures.pair import scene
from runs.studies.figures.part import save, saved
from runs.studies.framework.study import Study, command
from runs.studies.framework.tables import markdown

SOURCE = "Materials 2021, 14(19), 5689, doi 10.3390/ma14195689"
PARTS = (
    bulge.PART, pressure.PART, thickness.PART, modulus.PART, distance.PART, map_lengths.PART, map_materials.PART,
)  # fmt: skip
"""In the order of the page."""


def compute(folder: Path, options: Options) -> None:
    """Compute every part that the same code has not computed before."""
    write_text(folder / "scene.toml", scene().text)
    for part in PARTS:
        signals.check()
        if not options.fresh and saved(folder, part, options.quick) is not None:
            tell(f"{part.title}: taken from {folder}")
            continue
        begun = time.process_time()
        found = part.compute(options.quick)
        seconds = time.process_time() - begun
        save(folder, part, options.quick, found, seconds)
        tell(f"{part.title}: {seconds:.1f} s")


def page(folder: Path, quick: bool) -> str:
    """Draw every part that is there; return its sentences and numbers as Markdown."""
    there = [(part, found) for part in PARTS if (found := saved(folder, part, quick)) is not None]
    versions = f"thirdbody {importlib.metadata.version('thirdbody')}, numpy {np.__version__}, scipy {scipy.__version__}"
    lines = [
        f"# Figures 8 to 12 of {SOURCE}, and maps of the sign of T",
        "",
        f"Made by `{command('figures', quick)}` in {sum(found.seconds for _, found in there):.1f} s of processor time; "
        f"{versions}, Python {platform.python_version()}.",
        "Lengths are over R (figure 8: over a), forces over E1 R^2; T > 0 on the left ball attracts. T at features is "
        "asked to 1e-5, on curves to 1e-3.",
    ]
    for part, found in there:
        with look():
            save_figure(part.draw(found), folder, part.stem)
        lines += ["", f"## {part.title}", "", f"![{part.title}]({part.stem}.png)", ""]
        lines += [f"- {sentence}" for sentence in part.sentences(found.numbers)]
        lines += ["", *markdown(_rows(found.numbers), aligned=False)]
    return "\n".join(lines)


def _rows(numbers: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return names and values, groups one row each number; rows of a check are left to the sentences."""
    rows = []
    for key, value in numbers.items():
        if isinstance(value, Mapping):
            rows += [{**row, "number": f"{key.replace('_', ' ')}: {row['number']}"} for row in _rows(value)]
        elif not (isinstance(value, list) and value and isinstance(value[0], dict)):
            rows.append({"number": key.replace("_", " "), "value": _written(value)})
    return rows


def _written(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_written, value))
    return f"{value:.7g}" if isinstance(value, float) else str(value)


STUDY = Study("figures", compute, page, text="figures.md", saves="figure_*.json")
