"""The light pair: solved once for all tests that read its answer, and again on other ranks or after a stop."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import finite_strain
from tests.finite_strain.press import ACCURACY, STEPS
from tests.finite_strain.scenes import COARSER, light_pair
from tests.launch import mpirun


def press(ranks: int, folder: Path, *names: str) -> Any:
    """Return what each run of `tests.finite_strain.press` said."""
    done = mpirun(ranks, "-m", "tests.finite_strain.press", folder, *names, timeout=300.0)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[0])  # PETSc 3.22 lists the options that a stopped run did not use


def solve(folder: Path, observer: Any) -> Any:
    options = {"accuracy": ACCURACY, "steps": STEPS, "numerics": COARSER}
    return finite_strain.solve(light_pair(), folder=folder, observer=observer, **options)
