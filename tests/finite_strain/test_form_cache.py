"""The cache of compiled forms: runs share it, and what a killed run leaves does not stop the next one."""

import importlib
import multiprocessing
import os
import sys
import time
from importlib import machinery
from pathlib import Path
from typing import Any

import pytest


def _hold(folder: str, begun: Any, seconds: float) -> None:
    os.environ["XDG_CACHE_HOME"] = folder
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import form_cache  # noqa: PLC0415

    with form_cache.compiler_options(MPI.COMM_SELF):
        sys.modules.pop("importlib.abc", None)
        importlib.import_module("importlib.abc")  # as the compiler does, if nothing has before
        begun.set()
        time.sleep(seconds)


def test_runs_use_the_cache_side_by_side_and_remove_what_a_killed_run_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import form_cache  # noqa: PLC0415

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
        long_ago = time.time() - 2.0 * form_cache.COMPILER_SECONDS
        os.utime(old, (long_ago, long_ago))
        began = time.monotonic()
        with form_cache.compiler_options(MPI.COMM_SELF):
            assert time.monotonic() - began < 300.0, "waited for the other run"
            assert left.exists(), "the other run may be compiling it"
            assert not old.exists()
    finally:
        other.terminate()
        other.join()


def test_a_form_costs_no_status_call_for_each_of_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import form_cache  # noqa: PLC0415

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    forms = tmp_path / "thirdbody" / "forms"
    forms.mkdir(parents=True)
    for number in range(200):
        (forms / f"{number}.c").touch()
        (forms / f"{number}.c.cached").touch()
    asked, status = list[object](), os.stat
    monkeypatch.setattr(os, "stat", lambda path, **options: asked.append(path) or status(path, **options))
    with form_cache.compiler_options(MPI.COMM_SELF):
        assert len(asked) < 20


def test_the_name_of_a_form_does_not_depend_on_what_was_compiled_before(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    import dolfinx  # noqa: PLC0415
    import ufl  # noqa: PLC0415
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import compat  # noqa: PLC0415

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    names, listed, fill = [], list[str](), machinery.FileFinder._fill_cache  # type: ignore[attr-defined]
    monkeypatch.setattr(machinery.FileFinder, "_fill_cache", lambda it: listed.append(it.path) or fill(it))
    for _ in range(2):  # compiled first, and then from the cache
        mesh = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1, dolfinx.mesh.CellType.hexahedron)
        field = dolfinx.fem.Function(compat.function_space(mesh, 1))
        for form in (field * ufl.dx, field**2 * ufl.dx):
            compat.compile_form(form, MPI.COMM_SELF)
        names.append({file.name for file in (tmp_path / "thirdbody" / "forms").glob("*.so")})
    assert names[0]
    assert names[1] == names[0]
    assert str(tmp_path / "thirdbody" / "forms") not in listed  # with thousands of forms, a third of building a model


def test_common_scenes_find_every_form_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    import ffcx.codegeneration.jit as compiler  # noqa: PLC0415
    from mpi4py import MPI  # noqa: PLC0415

    import finite_strain  # noqa: PLC0415
    from finite_strain.precompile import precompile  # noqa: PLC0415
    from linear_bem.problem import Ball, FiniteStrain, Layer, Load, Problem  # noqa: PLC0415

    asked, look = set[str](), compiler.get_cached_module

    def noted(name: str, *rest: Any) -> Any:
        asked.add(name)
        return look(name, *rest)

    monkeypatch.setattr(compiler, "get_cached_module", noted)
    precompile(MPI.COMM_SELF)
    there = set(asked)
    asked.clear()
    # other sizes, moduli and load, and no substrate
    balls = tuple(Ball((x, 0.0), radius=2.0) for x in (-2.5, 2.5))
    problem = Problem(Layer(2e6, 0.45, 2.5), balls, Load("approach", (0.1, 0.1)), finite_strain=FiniteStrain())
    few = finite_strain.Numerics(growth=4.0, more_loads=())
    finite_strain.solve(problem, accuracy=0.5, comm=MPI.COMM_SELF, numerics=few)
    assert asked
    assert asked <= there
