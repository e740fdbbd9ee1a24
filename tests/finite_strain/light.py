"""The light pair: solved once for all tests that read its answer, and again on other ranks or after a stop."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import finite_strain
from tests.finite_strain.press import ACCURACY, STEPS
from tests.finite_strain.scenes import COARSER, light_pair
from tests.launch import mpirun


def press(ranks: int, folder: Path, *args: str, code: int = 0, options: str = "") -> Any:
    env = {"PETSC_OPTIONS": options}
    done = mpirun(ranks, "-m", "tests.finite_strain.press", folder, *args, timeout=300.0, env=env)
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout) if code == 0 else done.stdout


def solve(folder: Path, observer: Any) -> Any:
    options = {"tangential_force": ACCURACY, "steps": STEPS, "numerics": COARSER}
    return finite_strain.solve(light_pair(), folder=folder, observer=observer, **options)
