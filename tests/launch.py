"""Run the project's Python in a child process, alone or on several MPI ranks."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LAUNCHED_BY_MPI = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "ORTE_", "HYDI_", "MPI_LOCAL")


def environment(extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return this process's environment without variables of an MPI launcher, with one thread per rank."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(LAUNCHED_BY_MPI)}
    env |= {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_mpi_yield_when_idle": "1",
        "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
        "OMPI_MCA_btl": "^tcp",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONFAULTHANDLER": "1",
        "COLUMNS": "160",
    }
    return env | dict(extra or {})


def python(
    *args: str | Path, timeout: float = 900.0, env: Mapping[str, str] | None = None, cwd: Path = ROOT
) -> subprocess.CompletedProcess[str]:
    """Run this Python with ``args`` and return the completed process; kill it after ``timeout`` seconds and raise."""
    return _run([sys.executable, *map(str, args)], timeout, env, cwd)


def mpirun(
    n: int, *args: str | Path, timeout: float = 900.0, env: Mapping[str, str] | None = None, cwd: Path = ROOT
) -> subprocess.CompletedProcess[str]:
    """Run this Python with ``args`` on ``n`` ranks; n = 1 runs it without a launcher."""
    if n == 1:
        return python(*args, timeout=timeout, env=env, cwd=cwd)
    launcher = shutil.which("mpirun")
    if launcher is None:
        raise FileNotFoundError("mpirun is not on PATH: apt-get install openmpi-bin")
    options = ["-n", str(n), "--bind-to", "none", "--oversubscribe"]
    return _run([launcher, *options, sys.executable, *map(str, args)], timeout, env, cwd)


def headless_browser() -> str | None:
    """Return the path of a headless Chromium, or None."""
    names = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), None)


def launcher_forwards_last_words() -> bool:
    """Return whether a terminated mpirun forwards the last output of its ranks; Open MPI 5 kills them after 0.3 s."""
    said = subprocess.run(["mpirun", "--version"], capture_output=True, text=True, check=True, timeout=60.0).stdout
    version = re.search(r"\(Open MPI\) (\d+)", said)
    return version is None or int(version[1]) < 5


def _run(
    command: Sequence[str], timeout: float, env: Mapping[str, str] | None, cwd: Path
) -> subprocess.CompletedProcess[str]:
    # coreutils' timeout sends TERM to the launcher, which then ends its ranks
    guarded = ["timeout", "--kill-after=10", str(timeout), *command]
    began = time.monotonic()
    done = subprocess.run(
        guarded, capture_output=True, text=True, env=environment(env), cwd=cwd, timeout=timeout + 30, check=False
    )
    if done.returncode in (124, 137) and time.monotonic() - began >= timeout:
        raise subprocess.TimeoutExpired(command, timeout, done.stdout, done.stderr)
    return done
