"""Run every code at every size, keep each answer as JSON, and tabulate the errors."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runs.process.files import read_json, write_csv
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.framework.study import Study
from runs.studies.framework.tables import markdown

SIZES = ("2x1", "3x1", "4x1")
CASES: dict[str, tuple[str, tuple[str, ...]]] = {
    "thirdbody": ("dolfinx", ("0.1", "0.02", "0.005", "0.001")),
    "ngsolve": ("ngsolve", SIZES),
    "felupe": ("felupe", SIZES),
    "getfem": ("getfem", SIZES[:2]),
    "calculix": ("numpy", ("C3D20Rx1", "C3D20x1")),
}
"""By code: the Python package that it needs, and the sizes it runs."""
REFERENCE = {0.1: (0.0771335, 9.6459e-5), 0.32: (0.600895, 5.1238e-3)}
"""Q and T by approach, from NGSolve with elements of orders 4 and 5; relative error of T: 2e-4 to 5e-4."""


def cases(folder: Path, quick: bool) -> Iterator[tuple[Path, str, float, str]]:
    """Yield file, code, approach and size of every case."""
    for code, (_, sizes) in CASES.items():
        for size in sizes[:1] if quick else sizes:
            for approach in REFERENCE:
                yield folder / f"{code}-{size}-{approach}.json", code, approach, size


def compute(folder: Path, options: Options) -> None:
    """Run the cases without a saved answer, in this Python or those of PEERS_PYTHON (a:b:c)."""
    for file, code, approach, size in cases(folder, options.quick):
        if options.fresh or not file.exists():
            print_status(_solve(code, approach, size, file))


def page(folder: Path, quick: bool) -> str:
    """Write peers.csv; return its table as Markdown."""
    answers = (read_json(file) for file, *_ in cases(folder, quick))
    rows = sorted((_row(found) for found in answers if found), key=lambda row: (row["D"], row["error of T"]))
    write_csv(folder / "peers.csv", rows)
    return "\n".join(markdown(rows))


def _row(found: Mapping[str, Any]) -> dict[str, Any]:
    Q, T = REFERENCE[found["approach"]]
    row = {"D": found["approach"], "code": f"{found['code']} {found['version']}"}
    row |= {"discretisation": found["discretisation"], "unknowns": found["unknowns"]}
    row |= {"seconds": round(found["seconds"]), "Q": found["normal_force"], "T": found["tangential_force"]}
    return row | {"error of Q": abs(row["Q"] / Q - 1), "error of T": abs(row["T"] / T - 1)}


def _solve(code: str, approach: float, size: str, file: Path) -> str:
    """Run one case on one thread in the first Python that has the package; return a line on the outcome."""
    root, package = Path(__file__).parents[3], CASES[code][0]
    env = os.environ | {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    for python in [sys.executable, *filter(None, os.environ.get("PEERS_PYTHON", "").split(":"))]:
        if subprocess.run([python, "-c", f"import {package}"], check=False, capture_output=True).returncode == 0:
            command = [python, "-m", "runs.studies.peers.scene", code, str(approach), size]
            done = subprocess.run(command, cwd=root, env=env, check=False, capture_output=True, text=True)
            if done.returncode:
                return f"{file.stem}: failed: {done.stderr.strip().splitlines()[-1]}"
            file.write_text(done.stdout.splitlines()[-1] + "\n", encoding="utf-8")
            return f"{file.stem}: {done.stdout.splitlines()[-1]}"
    return f"{file.stem}: no Python has {package}"


STUDY = Study("peers", compute, page, saves="*-*.json")
