"""The study ``benchmarks``: seconds and errors against other contact codes, and growth with the number of balls."""

from __future__ import annotations

import csv
import importlib.metadata
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from runs.studies import Options

GRIDS = (256, 512, 1024)
COUNTS = (9, 100, 300, 1000)


def run(options: Options) -> None:
    """Measure, print and save the three tables; nothing is taken from an earlier run."""
    from runs.process import signals  # noqa: PLC0415
    from runs.session.progress import tell  # noqa: PLC0415
    from runs.session.run_folder import RunFolder  # noqa: PLC0415
    from runs.studies.benchmarks import pair, sphere  # noqa: PLC0415
    from runs.studies.framework.publishing import publish  # noqa: PLC0415

    identity = {"command": "study", "study": "benchmarks", "quick": options.quick}
    folder = RunFolder(options.out or Path("out/study-benchmarks"), identity, "", fresh=options.fresh)
    before = os.getloadavg()[0]
    rows: list[dict[str, Any]] = []
    for cells in GRIDS[:1] if options.quick else GRIDS:
        ours = 0.0
        for code in sphere.CODES:
            signals.check()
            row = vars(sphere.measure(code, cells)).copy()
            ours = ours or row["seconds"]
            rows.append({**row, "over_this_project": row["seconds"] / ours})
            tell(f"{cells} x {cells}, {code}: {row['remark'] or format(row['seconds'], '.3f') + ' s'}")
    table = {"seconds": pair.table_seconds(), "aim_seconds": 0.3}
    times = pair.times_to_accuracy(2 if options.quick else 7)
    counts = list(COUNTS[:2] if options.quick else COUNTS)
    growth = pair.growth(counts)
    tables = {"sphere": rows, "kernel_table": [table], "pair": times, "growth": growth}
    titles = {
        "sphere": "One sphere on a half-space, tolerance 1e-8, one thread: time and relative errors against Hertz",
        "kernel_table": "The kernel's table, once per pair of materials",
        "pair": "The paper's pair: best time to T, its error and the solver's own estimate",
        "growth": "Touching balls under one holder, T to 1e-3",
    }
    lines = [
        f"One run on one thread of {os.cpu_count()} cores; load of the machine over the last minute "
        f"{before:.1f} before it and {os.getloadavg()[0]:.1f} at its end: above 1 then, something else ran too, and "
        f"ratios tell more than seconds. Codes: {', '.join(_versions())}.",
    ]
    for name, table_rows in tables.items():
        _save(folder.path / f"{name}.csv", table_rows)
        lines += ["", f"## {titles[name]}", "", *_markdown(table_rows)]
    text = "\n".join(lines) + "\n"
    (folder.path / "benchmarks.md").write_text(text, encoding="utf-8")
    print(text)
    if options.publish:
        tell(f"published in {publish('benchmarks', text, [])}")
    folder.finish()
    folder.close()


def _versions() -> list[str]:
    """Return the codes and the libraries they stand on with their versions, where they are installed."""
    found = []
    for name in ("thirdbody", "tamaas", "aspher", "numpy", "scipy"):
        with suppress(importlib.metadata.PackageNotFoundError):
            found.append(f"{name} {importlib.metadata.version(name)}")
    return found


def _save(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _markdown(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    keys = list(rows[0])
    out = [f"| {' | '.join(k.replace('_', ' ') for k in keys)} |", f"|{'---|' * len(keys)}"]
    return out + [f"| {' | '.join(_written(row[k]) for k in keys)} |" for row in rows]


def _written(value: Any) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.3g}"
    return str(value)
