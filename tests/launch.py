"""Run the project's Python in a child process, alone or on several MPI ranks."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from multiprocessing import forkserver
from pathlib import Path
from unittest.mock import patch

ROOT = Path(__file__).resolve().parent.parent
PRELOADED = ["runs.cli", "runs.commands.solve", "linear_bem", "matplotlib.pyplot", "finite_strain.planning.run_plan"]
"""What `thirdbody` has imported before it is asked: nothing that starts MPI."""
LAUNCHED_BY_MPI = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "ORTE_", "HYDI_", "MPI_LOCAL")


STAND_IN = "tests.runs.elements"
"""The command line with a stand-in for the finite elements, as ``program`` of `thirdbody`."""


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
    # Open MPI 5.0.7 mixes a rank's two streams: its messages go past it, into a file
    with tempfile.NamedTemporaryFile("r", encoding="utf-8") as said:
        rank = ["sh", "-c", 'exec "$@" 2>>"$0"', said.name, sys.executable, *map(str, args)]
        done = _run([launcher, *options, *rank], timeout, env, cwd)
        return subprocess.CompletedProcess(done.args, done.returncode, done.stdout, said.read() + done.stderr)


def thirdbody(
    *args: str | Path,
    ranks: int = 1,
    timeout: float = 900.0,
    env: Mapping[str, str] | None = None,
    cwd: Path = ROOT,
    program: str = "runs.cli",
) -> subprocess.CompletedProcess[str]:
    """Run the command line (or another module's ``main``) with ``args`` and return the completed process.

    One rank is a fork of a process that has imported the command line already, which saves a second. Runs of the real
    finite elements need a process of their own, for MPI: use `python`.
    """
    if ranks > 1:
        return mpirun(ranks, "-m", program, *args, timeout=timeout, env=env, cwd=cwd)
    words, context = [program, *map(str, args)], multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    with patch.dict(os.environ, environment(), clear=True):
        forkserver.ensure_running()
    with tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as errors:
        outputs = [f"/proc/{os.getpid()}/fd/{file.fileno()}" for file in (said, errors)]
        child = context.Process(target=_forked, args=(words, environment(env), str(cwd), outputs))
        child.start()
        child.join(timeout)
        if child.is_alive():
            child.kill()
            child.join()
            raise subprocess.TimeoutExpired(words, timeout)
        texts = [Path(output).read_text(encoding="utf-8") for output in outputs]
        assert child.exitcode is not None
        return subprocess.CompletedProcess(words, child.exitcode, *texts)


def _forked(words: list[str], env: dict[str, str], cwd: str, outputs: list[str]) -> None:
    for number, output in enumerate(outputs, start=1):
        os.dup2(os.open(output, os.O_WRONLY | os.O_APPEND), number)
    os.environ.clear()
    os.environ.update(env)
    os.chdir(cwd)
    sys.argv = words
    importlib.import_module(words[0]).main()


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
