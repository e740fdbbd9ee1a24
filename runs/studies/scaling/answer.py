"""Measurements, saved as one CSV table per number of ranks, and the page that shows all of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.counts import grouped
from linear_bem.errors import TooLarge
from linear_bem.memory import give_back, require
from runs.process import ranks
from runs.process.files import read_csv, write_csv
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.framework.page import render, written
from runs.studies.framework.study import Study, timed
from runs.studies.scaling import whole_runs
from runs.studies.scaling.measuring import BYTES, FORMS, measure, pressed

SIZES = (12_000, 50_000, 100_000)
"""Numbers of unknowns; the mesh nearest to each is used."""
LARGE = (500_000, 1_050_000)
"""Further numbers of unknowns on more than one rank, for multigrid and for whole runs, which hold two models."""
COUNTS = ("target", "unknowns", "ranks", "krylov_iterations", "fallbacks")
FITTED = ("krylov_iterations", "first_seconds")
AHEAD = (1e7, 1e8)
"""Unknowns to which the fits are extrapolated."""
FITTED_FROM = 40_000
"""Smaller systems are not fitted: the set-up once per mesh dominates the time of their first solve."""


def compute(folder: Path, options: Options) -> None:
    """Make the measurements that the table for the current number of ranks lacks."""
    comm = ranks.world()
    file = folder / f"ranks_{comm.size}.csv"
    rows = ranks.share([] if options.fresh or not ranks.is_root() else read([file]))
    for form in FORMS:
        sizes = SIZES[:1] if options.quick else SIZES + LARGE * (comm.size > 1)
        left = [size for size in sizes if not any((row["form"], row["target"]) == (form, size) for row in rows)]
        if not left:
            continue
        state = pressed(form, comm)
        for target in left:
            if not fits(BYTES[form] * target, f"a system of {grouped(target)} unknowns ({form} form)", comm):
                continue
            with timed(f"{form} form, {grouped(target)} unknowns"):
                for row in measure(form, target, state, comm):
                    rows.append(row)
                    if comm.rank == 0:
                        print_status(", ".join(f"{key} {written(value)}" for key, value in row.items()))
            if comm.rank == 0:
                write_csv(file, rows)
    for target in () if options.quick or comm.size == 1 else LARGE:
        same = [row for row in read_whole(folder) if (row["target"], row["ranks"]) == (target, comm.size)]
        known = ranks.share(bool(same) and not options.fresh)
        if not known and fits(whole_runs.BYTES * target, f"a run of {grouped(target)} unknowns", comm):
            with timed(f"a run of {grouped(target)} unknowns"):
                found = whole_runs.run(target, comm)
            if comm.rank == 0:
                write_csv(folder / f"whole_{target}_ranks_{comm.size}.csv", found)


def fits(needed: float, what: str, comm: Any) -> bool:
    """Return whether the bytes that ``what`` needs are free on rank 0; if not, print a line about it (collective)."""
    fault = ""
    give_back()
    comm.barrier()
    try:
        require(needed, what, "take a larger machine")
    except TooLarge as error:
        fault = str(error)
    fault = ranks.share(fault)
    if fault and comm.rank == 0:
        print_status(f"left out: {fault}")
    return not fault


def read(files: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the rows of the existing files, sorted so that comparable rows are adjacent."""
    rows = []
    for row in (row for file in files if file.exists() for row in read_csv(file)):
        words = {key: row.pop(key) for key in ("form", "solver")}
        counts = {key: int(row.pop(key)) for key in COUNTS}
        rows.append({**words, **counts, **{key: float(value) for key, value in row.items()}})
    return sorted(rows, key=lambda row: (row["form"], row["unknowns"], row["solver"], row["ranks"]))


def read_whole(folder: Path) -> list[dict[str, float]]:
    """Return the rows of whole runs; of two with equal size, ranks and load that of the file with its ranks counts."""
    rows = [row for file in sorted(folder.glob("whole_*.csv")) for row in read_csv(file, float)]
    return list({(row["target"], row["ranks"], row["fraction"]): row for row in rows}.values())


def page(folder: Path, quick: bool) -> str:
    """Return the table for all numbers of ranks, and the exponents of the growth of multigrid's cost with the size."""
    rows = read(sorted(folder.glob("ranks_*.csv")))
    whole = [{**row, "unknowns": int(row["unknowns"])} for row in read_whole(folder)]
    whole.sort(key=lambda row: (row["unknowns"], row["ranks"], row["fraction"]))
    return render(__file__, rows=rows, whole=whole, fits=powers(rows))


def powers(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return for each form the fits in logarithms by the number of unknowns, and their extrapolation to `AHEAD`."""
    found = []
    for form in dict.fromkeys(row["form"] for row in rows):
        count = max(row["ranks"] for row in rows if row["form"] == form)
        taken = [row for row in rows if (row["form"], row["solver"], row["ranks"]) == (form, "multigrid", count)]
        taken = [row for row in taken if row["unknowns"] >= FITTED_FROM]
        if len(taken) < 2:
            continue
        sizes = np.log([row["unknowns"] for row in taken])
        slopes, starts = np.polyfit(sizes, np.log([[row[key] for key in FITTED] for row in taken]), 1)
        ahead = [(n, *np.exp(starts + slopes * np.log(n))) for n in AHEAD]
        ends = [grouped(row["unknowns"]) for row in (taken[0], taken[-1])]
        found.append({"form": form, "ranks": count, "ends": ends, "powers": slopes, "ahead": ahead})
    return found


STUDY = Study("scaling", compute, page, saves="ranks_*.csv")
