"""The measurements of the study and the page that shows them, one table each."""

import importlib.metadata
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from runs.process.files import read_json, write_csv, write_text
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.benchmarks import pair, sphere
from runs.studies.framework.page import markdown
from runs.studies.framework.study import Study, timed

GRIDS = (256, 512, 1024)
COUNTS = (9, 100, 300, 1000)
KEPT = "benchmarks.json"
"""File of the study's folder with the measurements and their conditions."""
TITLES = {
    "sphere": "One sphere on a half-space, tolerance 1e-8, one thread: time and relative errors against Hertz",
    "pair": "The paper's pair: best time to T, its error and the solver's own estimate",
    "growth": "Touching balls under one holder, T to 1e-3",
}


def compute(folder: Path, options: Options) -> None:
    """Measure everything; earlier results are not reused."""
    before = os.getloadavg()[0]
    rows: list[dict[str, Any]] = []
    for cells in GRIDS[:1] if options.quick else GRIDS:
        ours = 0.0
        for code in sphere.CODES:
            with timed(f"{cells} x {cells}, {code}"):
                row = sphere.measure(code, cells)
            ours = ours or row["seconds"]
            rows.append({**row, "over_this_project": row["seconds"] / ours})
            print_status(row["remark"] or f"best time: {row['seconds']:.3f} s")
    tables = {"sphere": rows}
    with timed(TITLES["pair"]):
        tables["pair"] = pair.times_to_accuracy(2 if options.quick else 7)
    with timed(TITLES["growth"]):
        tables["growth"] = pair.growth(list(COUNTS[:2] if options.quick else COUNTS))
    words = (
        f"One run on one thread of {os.cpu_count()} cores; machine load over the last minute "
        f"{before:.1f} before it and {os.getloadavg()[0]:.1f} at its end: above 1 then, other programs ran too, and "
        f"ratios are more reliable than seconds. Codes: {', '.join(_versions())}."
    )
    write_text(folder / KEPT, json.dumps({"words": words, "tables": tables}, indent=1))


def page(folder: Path, quick: bool) -> str:
    """Write one CSV per table; return them as Markdown."""
    kept = read_json(folder / KEPT) or {"words": "Nothing has been measured yet.", "tables": {}}
    lines = [kept["words"]]
    for name, rows in kept["tables"].items():
        write_csv(folder / f"{name}.csv", rows)
        columns = {key: key.replace("_", " ") for key in rows[0]}
        lines += ["", f"## {TITLES[name]}", "", *markdown(rows, columns, digits=3, aligned=False)]
    return "\n".join(lines)


def _versions() -> list[str]:
    found = []
    for name in ("thirdbody", "tamaas", "aspher", "numpy", "scipy"):
        with suppress(importlib.metadata.PackageNotFoundError):
            found.append(f"{name} {importlib.metadata.version(name)}")
    return found


STUDY = Study("benchmarks", compute, page, text="benchmarks.md", resumable=False)
