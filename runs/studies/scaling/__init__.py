"""The study ``scaling``: time and memory of Newton's linear systems by size, solver and number of ranks."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from linear_bem.errors import InvalidProblem
from runs.studies import Options

SIZES = (12_000, 25_000, 60_000)
"""Unknowns aimed at; meshes meet them within some 20 %."""
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
    "fallbacks": "left to factors",
    "kilobytes_per_unknown": "memory [kB per unknown, all ranks]",
    "load": "load of the machine",
}


def run(options: Options) -> None:
    """Measure on the ranks that there are, and show what every run of any number of ranks left in the folder."""
    from runs.process import ranks, signals  # noqa: PLC0415
    from runs.session.progress import tell  # noqa: PLC0415
    from runs.studies.framework import tables  # noqa: PLC0415
    from runs.studies.framework.publishing import publish  # noqa: PLC0415

    if options.shard != (1, 1):
        raise InvalidProblem("--shard: study scaling compares times on one machine; start it whole")
    folder = options.out or Path("out/study-scaling" + ("-quick" if options.quick else ""))
    if not options.tables:
        from runs.studies.scaling.measuring import FORMS, measure  # noqa: PLC0415

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
                        tell(", ".join(f"{key} {tables.written(value)}" for key, value in row.items()))
                if comm.rank == 0:
                    folder.mkdir(parents=True, exist_ok=True)
                    tables.save_csv(file, rows)
    if not ranks.is_root():
        return
    text = answer(read(sorted(folder.glob("ranks_*.csv"))))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "answer.md").write_text(text, encoding="utf-8")
    print(text, end="")
    if options.publish:
        tell(f"published in {publish('scaling', text, [])}")


def read(files: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the rows of those files that exist, sorted so that what is to be compared stands together."""
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


def answer(rows: list[dict[str, Any]]) -> str:
    """Return the table, and what it says of many unknowns."""
    from runs.studies.framework import tables  # noqa: PLC0415

    lines = tables.markdown(rows, HEADINGS)
    largest = max((row["unknowns"] for row in rows), default=0)
    for row in rows:
        if row["unknowns"] > 0.8 * largest and row["ranks"] == 1:
            lines += ["", f"{row['form']}, {row['solver']}, {row['unknowns']} unknowns on one rank: "
                      f"{row['kilobytes_per_unknown']:.1f} kB per unknown."]  # fmt: skip
    return "\n".join(lines) + "\n"
