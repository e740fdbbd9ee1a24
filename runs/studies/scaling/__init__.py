"""The study ``scaling``: time and memory of Newton's linear systems by size, solver and number of ranks."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from linear_bem.errors import InvalidProblem
from runs.studies import Options

SIZES = (12_000, 25_000, 60_000)
"""Unknowns aimed at; meshes meet them within some 20 %."""
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
    from runs import interrupt, ranks  # noqa: PLC0415
    from runs.progress import tell  # noqa: PLC0415
    from runs.studies import tables  # noqa: PLC0415
    from runs.studies.publishing import publish  # noqa: PLC0415

    if options.shard != (1, 1):
        raise InvalidProblem("--shard: study scaling compares times on one machine; start it whole")
    folder = options.out or Path("out/study-scaling" + ("-quick" if options.quick else ""))
    if not options.tables:
        from runs.studies.scaling.measuring import FORMS, measure  # noqa: PLC0415

        comm, rows = ranks.world(), list[dict[str, Any]]()
        for target in SIZES[:1] if options.quick else SIZES:
            for form in FORMS:
                for row in measure(form, target, comm):
                    interrupt.check()
                    rows.append(row)
                    if comm.rank == 0:
                        tell(", ".join(f"{key} {tables.written(value)}" for key, value in row.items()))
                        folder.mkdir(parents=True, exist_ok=True)
                        tables.save_csv(folder / f"ranks_{comm.size}.csv", rows)
    if not ranks.is_root():
        return
    text = answer(read(folder))
    (folder / "answer.md").write_text(text, encoding="utf-8")
    print(text, end="")
    if options.publish:
        tell(f"published in {publish('scaling', text, [])}")


def read(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of all runs in the folder, sorted so that what is to be compared stands together."""
    rows: list[dict[str, Any]] = []
    for file in sorted(folder.glob("ranks_*.csv")):
        with open(file, encoding="utf-8", newline="") as text:
            for row in csv.DictReader(text):
                words = {key: row.pop(key) for key in ("form", "solver")}
                counts = {key: int(row.pop(key)) for key in ("unknowns", "ranks", "krylov_iterations", "fallbacks")}
                rows.append({**words, **counts, **{key: float(value) for key, value in row.items()}})
    return sorted(rows, key=lambda row: (row["form"], row["unknowns"], row["solver"], row["ranks"]))


def answer(rows: list[dict[str, Any]]) -> str:
    """Return the table, and what it says of many unknowns."""
    from runs.studies import tables  # noqa: PLC0415

    lines = tables.markdown(rows, HEADINGS)
    largest = max((row["unknowns"] for row in rows), default=0)
    for row in rows:
        if row["unknowns"] > 0.8 * largest and row["ranks"] == 1:
            lines += ["", f"{row['form']}, {row['solver']}, {row['unknowns']} unknowns on one rank: "
                      f"{row['kilobytes_per_unknown']:.1f} kB per unknown."]  # fmt: skip
    return "\n".join(lines) + "\n"
