"""The cache of compiled forms: runs share it, and what a killed run leaves does not stop the next one."""

import multiprocessing
import os
import time
from pathlib import Path
from typing import Any

import pytest


def _hold(folder: str, begun: Any, seconds: float) -> None:
    os.environ["XDG_CACHE_HOME"] = folder
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import compat  # noqa: PLC0415

    with compat._compiler_cache(MPI.COMM_SELF):
        begun.set()
        time.sleep(seconds)


def test_runs_use_the_cache_side_by_side_and_remove_what_a_killed_run_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import compat  # noqa: PLC0415

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    forms = tmp_path / "thirdbody" / "forms"
    forms.mkdir(parents=True)
    left, old, kept = (forms / name for name in ("left.c", "old.c", "kept.c"))
    for file in (left, old, kept, forms / "kept.c.cached"):
        file.touch()
    spawned = multiprocessing.get_context("spawn")
    begun = spawned.Event()
    other = spawned.Process(target=_hold, args=(str(tmp_path), begun, 600.0))
    other.start()
    try:
        assert begun.wait(60.0)
        assert not left.exists()
        assert kept.exists(), "alone, a run removes every source that was not compiled, and no other"
        left.touch()
        old.touch()
        long_ago = time.time() - 2.0 * compat._COMPILER_SECONDS
        os.utime(old, (long_ago, long_ago))
        began = time.monotonic()
        with compat._compiler_cache(MPI.COMM_SELF):
            assert time.monotonic() - began < 300.0, "waited for the other run"
            assert left.exists(), "the other run may be compiling it"
            assert not old.exists()
    finally:
        other.terminate()
        other.join()


def test_a_form_costs_no_status_call_for_each_of_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import compat  # noqa: PLC0415

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    forms = tmp_path / "thirdbody" / "forms"
    forms.mkdir(parents=True)
    for number in range(200):
        (forms / f"{number}.c").touch()
        (forms / f"{number}.c.cached").touch()
    asked, status = list[object](), os.stat
    monkeypatch.setattr(os, "stat", lambda path, **options: asked.append(path) or status(path, **options))
    with compat._compiler_cache(MPI.COMM_SELF):
        assert len(asked) < 20
