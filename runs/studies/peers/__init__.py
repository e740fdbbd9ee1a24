"""The study ``peers``: work against precision for two balls at finite strain, this project beside other codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from runs.studies import Options

SIZES = ("2x1", "3x1", "4x1")
CASES: dict[str, tuple[str, tuple[str, ...]]] = {
    "thirdbody": ("dolfinx", ("0.1", "0.02", "0.005", "0.001")),
    "ngsolve": ("ngsolve", SIZES),
    "felupe": ("felupe", SIZES),
    "getfem": ("getfem", SIZES[:2]),
    "calculix": ("numpy", ("C3D20Rx1", "C3D20x1")),
}
"""Scripts, the package that tells whether a Python can run one, and the sizes it is given."""
REFERENCE = {0.1: (0.0771335, 9.6459e-5), 0.32: (0.600895, 5.1238e-3)}
"""Q and T by the approach from NGSolve with elements of orders 4 and 5; T is known to 2e-4 to 5e-4."""


def run(options: Options) -> None:
    """Run what the folder has no answer of yet, in every Python of PEERS_PYTHON (a:b:c), and make the table."""
    from runs.session.progress import tell  # noqa: PLC0415
    from runs.studies.framework import tables  # noqa: PLC0415
    from runs.studies.framework.publishing import publish  # noqa: PLC0415

    folder = options.out or Path("out/study-peers")
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for code, (package, sizes) in CASES.items():
        for size in sizes[:1] if options.quick else sizes:
            for approach in REFERENCE:
                file = folder / f"{code}-{size}-{approach}.json"
                if options.fresh or not (file.exists() or options.tables):
                    tell(_solve(code, package, approach, size, file))
                if file.exists():
                    rows.append(_row(json.loads(file.read_text(encoding="utf-8"))))
    rows.sort(key=lambda row: (row["D"], row["error of T"]))
    tables.save_csv(folder / "peers.csv", rows)
    text = "\n".join(tables.markdown(rows)) + "\n"
    print(text)
    if options.publish:
        tell(f"published in {publish('peers', text, [])}")


def _row(found: dict[str, Any]) -> dict[str, Any]:
    Q, T = REFERENCE[found["approach"]]
    row = {"D": found["approach"], "code": f"{found['code']} {found['version']}"}
    row |= {"discretisation": found["discretisation"], "unknowns": found["unknowns"]}
    row |= {"seconds": round(found["seconds"]), "Q": found["normal_force"], "T": found["tangential_force"]}
    return row | {"error of Q": abs(row["Q"] / Q - 1), "error of T": abs(row["T"] / T - 1)}


def _solve(code: str, package: str, approach: float, size: str, file: Path) -> str:
    """Run one script on one thread in the first Python that has its package; return what came of it."""
    root = Path(__file__).parents[3]
    env = os.environ | {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    for python in [sys.executable, *filter(None, os.environ.get("PEERS_PYTHON", "").split(":"))]:
        if subprocess.run([python, "-c", f"import {package}"], check=False, capture_output=True).returncode == 0:
            command = [python, "-m", f"runs.studies.peers.{code}_pair", str(approach), size]
            done = subprocess.run(command, cwd=root, env=env, check=False, capture_output=True, text=True)
            if done.returncode:
                return f"{file.stem}: failed: {done.stderr.strip().splitlines()[-1]}"
            file.write_text(done.stdout.splitlines()[-1] + "\n", encoding="utf-8")
            return f"{file.stem}: {done.stdout.splitlines()[-1]}"
    return f"{file.stem}: no Python has {package}"
