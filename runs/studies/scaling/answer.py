"""One table per number of ranks, saved as CSV, and the page that shows all of them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from runs.process import ranks, signals
from runs.process.files import write_csv
from runs.session.progress import tell
from runs.studies import Options
from runs.studies.framework.study import Study
from runs.studies.framework.tables import markdown, written
from runs.studies.scaling.measuring import FORMS, measure

SIZES = (12_000, 25_000, 60_000)
"""Target numbers of unknowns, which meshes meet within about 20 %."""
COUNTS = ("target", "unknowns", "ranks", "krylov_iterations", "fallbacks")
HEADINGS = {
    "form": "form",
    "solver": "solver",
    "unknowns": "unknowns",
    "ranks": "ranks",
    "assembly_seconds": "assembly [s]",
    "first_seconds": "first solve [s]",
    "solve_seconds": "next solve [s]",
    "krylov_iterations": "Krylov iterations",
    "fallbacks": "fallbacks to a direct solver",
    "kilobytes_per_unknown": "memory [kB per unknown, all ranks]",
    "load": "machine load",
}


def compute(folder: Path, options: Options) -> None:
    """Measure what the table for the current number of ranks lacks."""
    comm = ranks.world()
    file = folder / f"ranks_{comm.size}.csv"
    rows = ranks.share([] if options.fresh or not ranks.is_root() else read([file]))
    for target in SIZES[:1] if options.quick else SIZES:
        for form in FORMS:
            signals.check()
            if any((row["form"], row["target"]) == (form, target) for row in rows):
                continue
            for row in measure(form, target, comm):
                rows.append(row)
                if comm.rank == 0:
                    tell(", ".join(f"{key} {written(value)}" for key, value in row.items()))
            if comm.rank == 0:
                write_csv(file, rows)


def read(files: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the rows of the existing files, sorted so that comparable rows are adjacent."""
    rows: list[dict[str, Any]] = []
    for file in files:
        if not file.exists():
            continue
        with open(file, encoding="utf-8", newline="") as text:
            for row in csv.DictReader(text):
                words = {key: row.pop(key) for key in ("form", "solver")}
                counts = {key: int(row.pop(key)) for key in COUNTS}
                rows.append({**words, **counts, **{key: float(value) for key, value in row.items()}})
    return sorted(rows, key=lambda row: (row["form"], row["unknowns"], row["solver"], row["ranks"]))


def page(folder: Path, quick: bool) -> str:
    """Return the table for all numbers of ranks, and the memory per unknown of the largest systems."""
    rows = read(sorted(folder.glob("ranks_*.csv")))
    lines = markdown(rows, HEADINGS)
    largest = max((row["unknowns"] for row in rows), default=0)
    for row in rows:
        if row["unknowns"] > 0.8 * largest and row["ranks"] == 1:
            lines += ["", f"{row['form']}, {row['solver']}, {row['unknowns']} unknowns on one rank: "
                      f"{row['kilobytes_per_unknown']:.1f} kB per unknown."]  # fmt: skip
    return "\n".join(lines)


STUDY = Study("scaling", compute, page, saves="ranks_*.csv")
