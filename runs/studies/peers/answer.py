"""Runs every code at every size, saves each answer as JSON, and tabulates the errors."""

import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from runs.process.files import read_json, write_csv, write_text
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.framework.page import markdown
from runs.studies.framework.study import OUTDATED, Study, timed
from runs.studies.strengthening.materials import LAW_BY_NAME

SIZES = ("2x1", "3x1", "4x1")
CASES: dict[str, tuple[str, tuple[str, ...]]] = {
    "thirdbody": ("dolfinx", ("0.1", "0.02", "0.005", "0.001")),
    "ngsolve": ("ngsolve", SIZES),
    "felupe": ("felupe", SIZES),
    "getfem": ("getfem", SIZES[:2]),
    "calculix": ("numpy", ("C3D20Rx1", "C3D20x1")),
}
"""By code: its Python package, and the sizes that are run."""
REFERENCE = {0.1: (0.0771335, 9.6459e-5), 0.32: (0.600895, 5.1238e-3)}
"""Q and T by approach, from NGSolve with elements of orders 4 and 5; relative error of T: 2e-4 to 5e-4."""
FAILED = ".failed"
"""Suffix of the file that says why a case has no answer."""
LAW_DEPTH, LAW_CASES = 0.32, (("thirdbody", "0.005"), ("felupe", SIZES[1]), ("felupe", SIZES[2]))
"""Approach over R at which laws are compared; codes and sizes that solve every law (FElupe: two orders)."""


def cases(folder: Path, quick: bool) -> Iterator[tuple[Path, list[str]]]:
    """Yield file and arguments (code, approach, size; a law's name where laws are compared) of every case."""
    for code, (_, sizes) in CASES.items():
        for size in sizes[:1] if quick else sizes:
            for approach in REFERENCE:
                yield folder / f"{code}-{size}-{approach}.json", [code, str(approach), size]
    for law in () if quick else LAW_BY_NAME:
        for code, size in LAW_CASES:
            yield _law_file(folder, law, code, size), [code, str(LAW_DEPTH), size, law]


def compute(folder: Path, options: Options) -> None:
    """Run the cases without a saved answer, in this Python or those of the variable PEERS_PYTHON (a:b:c)."""
    for file, arguments in cases(folder, options.quick):
        if options.fresh or _answer(file, arguments) is None:
            title = f"{file.stem}{OUTDATED * (file.exists() and not options.fresh)}"
            for old in (file, file.with_suffix(FAILED)):
                old.unlink(missing_ok=True)
            with timed(title):
                said = _solve(arguments, file)
                print_status(said)
            if not file.exists():
                write_text(file.with_suffix(FAILED), said)


def page(folder: Path, quick: bool) -> str:
    """Write peers.csv and laws.csv; return their tables as Markdown, with the cases that have no answer."""
    wanted = dict(cases(folder, quick))
    answers = {file: _answer(file, arguments) for file, arguments in wanted.items()}
    without_law = (found for file, found in answers.items() if found and len(wanted[file]) == 3)
    rows = sorted(map(_row, without_law), key=lambda row: (row["D"], row["error of T"]))
    laws = list(_laws(folder, answers))
    write_csv(folder / "peers.csv", rows)
    write_csv(folder / "laws.csv", laws)
    lines = markdown(rows)
    if laws:
        lines += ["", f"## Every law, D = {LAW_DEPTH:g} R", "", *markdown(laws)]
    missing = [file for file, found in answers.items() if found is None]
    if missing:
        failed = [file.with_suffix(FAILED) for file in missing]
        said = [each.read_text(encoding="utf-8") if each.exists() else f"{each.stem}: not run" for each in failed]
        lines += ["", f"{len(missing)} of {len(answers)} cases have no answer:", "", *(f"- {each}" for each in said)]
    return "\n".join(lines)


def _law_file(folder: Path, law: str, code: str, size: str) -> Path:
    return folder / f"{code}-{size}-{LAW_DEPTH:g}-{law}.json"


def _answer(file: Path, arguments: Sequence[str]) -> dict[str, Any] | None:
    """Return the saved answer of a case; None if its law, scene or script has changed since (if the answer says so)."""
    found = read_json(file)
    return found if found is not None and found.get("key") in (None, _key(arguments)) else None


def _key(arguments: Sequence[str]) -> str:
    """Return a digest of what a case solves: its arguments and law, the scene, and the script of its code."""
    digest = hashlib.sha256(repr((arguments, LAW_BY_NAME.get(arguments[-1]))).encode())
    for name in ("scene.py", "energies.py", "pair.inp", "pair.toml", f"{arguments[0]}_pair.py"):
        digest.update(Path(__file__).with_name(name).read_bytes())
    return digest.hexdigest()[:20]


def _laws(folder: Path, answers: Mapping[Path, Mapping[str, Any] | None]) -> Iterator[dict[str, Any]]:
    """Yield the answers of two codes, with their errors or last change, for every law that both have solved."""
    for law in LAW_BY_NAME:
        ours, third, fourth = (answers.get(_law_file(folder, law, *case)) for case in LAW_CASES)
        if not (ours and third and fourth):
            continue
        T, theirs = ours["tangential_force"], fourth["tangential_force"]
        error, change = ours["tangential_force_error"], abs(theirs - third["tangential_force"])
        yield {
            "law": law, "Q": (ours["normal_force"], ours["normal_force_error"]), "Q, FElupe": fourth["normal_force"],
            "T": (T, error), "T, FElupe": (theirs, change),
            "difference of Q": abs(ours["normal_force"] / fourth["normal_force"] - 1),
            "difference of T": abs(T / theirs - 1), "deviation": abs(T - theirs) / math.hypot(error, change),
        }  # fmt: skip


def _row(found: Mapping[str, Any]) -> dict[str, Any]:
    Q, T = REFERENCE[found["approach"]]
    row = {"D": found["approach"], "code": f"{found['code']} {found['version']}"}
    row |= {"discretisation": found["discretisation"], "unknowns": found["unknowns"]}
    row |= {"seconds": round(found["seconds"]), "Q": found["normal_force"], "T": found["tangential_force"]}
    return row | {"error of Q": abs(row["Q"] / Q - 1), "error of T": abs(row["T"] / T - 1)}


def _solve(arguments: list[str], file: Path) -> str:
    """Run one case on one thread in the first Python with the package; return a line about the outcome."""
    root, package = Path(__file__).parents[3], CASES[arguments[0]][0]
    env = os.environ | {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    for python in [sys.executable, *filter(None, os.environ.get("PEERS_PYTHON", "").split(":"))]:
        if subprocess.run([python, "-c", f"import {package}"], check=False, capture_output=True).returncode == 0:
            command = [python, "-m", "runs.studies.peers.scene", *arguments]
            done = subprocess.run(command, cwd=root, env=env, check=False, capture_output=True, text=True)
            if done.returncode:
                *_, why = f"exit code {done.returncode}", *done.stderr.strip().splitlines()
                return f"{file.stem}: failed: {why}"
            found = json.loads(done.stdout.splitlines()[-1])
            write_text(file, json.dumps(found | {"key": _key(arguments)}) + "\n")
            return f"{file.stem}: {done.stdout.splitlines()[-1]}"
    return f"{file.stem}: no Python has {package}"


STUDY = Study("peers", compute, page, saves="*-*.json")
