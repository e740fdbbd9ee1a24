"""The doctor: healthy here, and of use on a Python that lacks DOLFINx or has wheels that break it."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from runs.commands.doctor import SYSTEM_PYTHON, Finding, Package, Report, _blas, _numpy, _package, probe
from tests.launch import mpirun, python

HIDE = """
import sys
from importlib.machinery import PathFinder
find = PathFinder.find_spec
def find_spec(name, path=None, target=None):
    hidden = name.split(".")[0] in {"dolfinx", "ufl", "petsc4py", "mpi4py", "gmsh", "h5py"}
    return None if hidden else find(name, path, target)
if sys.prefix != sys.base_prefix:
    PathFinder.find_spec = find_spec
"""
"""A sitecustomize that makes the virtual environment look like one without the finite elements' libraries."""

DEBIAN = Package("1.0", "/usr/lib/python3/dist-packages/x/__init__.py")
WHEEL = Package("2.0", "/home/user/.venv/lib/python3.11/site-packages/x/__init__.py")


@pytest.fixture
def without_elements(tmp_path: Path) -> dict[str, str]:
    (tmp_path / "sitecustomize.py").write_text(HIDE, encoding="utf-8")
    return {"PYTHONPATH": str(tmp_path)}


@pytest.mark.mpi
def test_the_doctor_reports_every_part_once_on_two_ranks() -> None:
    done = mpirun(2, "-m", "runs.cli", "doctor", "--json", timeout=150.0)
    report = json.loads(done.stdout)
    names = {finding["name"] for finding in report["findings"]}
    needed = {"Python", "numpy", "petsc4py", "mpi4py", "dolfinx", "gmsh", "h5py", "BLAS", "mpirun"}
    assert names == needed | {"clarabel", "jinja2", "pyvista"}
    blocked = any(finding["fault"] and finding["blocks"] for finding in report["findings"])
    assert report["every_model_runs"] is not blocked
    assert done.returncode == (1 if blocked else 0)


def test_a_python_without_dolfinx_gets_the_name_of_one_that_has_it(without_elements: dict[str, str]) -> None:
    done = python("-m", "runs.cli", "doctor", env=without_elements, timeout=150.0)
    assert done.returncode == 1, done.stderr
    assert "linear_bem and point_load can run" in done.stdout
    assert "wrong dolfinx" in done.stdout
    if not probe(SYSTEM_PYTHON, ["dolfinx"]).packages["dolfinx"].error:
        assert f"{SYSTEM_PYTHON} (Python" in done.stdout
        assert f"{SYSTEM_PYTHON} -m venv --system-site-packages .venv" in done.stdout


def test_a_comparison_without_dolfinx_ends_with_one_message(without_elements: dict[str, str], tmp_path: Path) -> None:
    scene = "runs/scenes/paper_thin_pair.toml"
    done = python("-m", "runs.cli", "compare", scene, "--out", tmp_path / "out", env=without_elements)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("thirdbody: error:") == 1
    assert "dolfinx" in done.stderr
    assert "thirdbody doctor" in done.stderr
    assert "Traceback" not in done.stderr


def fault(finding: Finding) -> str:
    return f"{finding.fault} -> {finding.remedy}" if finding.fault else ""


def among(**packages: Package) -> Report:
    return Report("3.11.2", packages)


def test_wheels_beside_debians_dolfinx_are_faults() -> None:
    report = among(dolfinx=DEBIAN, h5py=WHEEL, numpy=WHEEL, scipy=DEBIAN)
    assert "fails once DOLFINx is loaded" in fault(_package("h5py", report, "python"))
    assert "python -m pip uninstall -y h5py" in fault(_package("h5py", report, "python"))
    assert "python -m pip uninstall -y numpy" in fault(_numpy(report, "python"))
    assert not fault(_package("h5py", among(dolfinx=DEBIAN, h5py=DEBIAN), "python"))
    assert not fault(_numpy(among(dolfinx=DEBIAN, numpy=DEBIAN, scipy=DEBIAN), "python"))


def test_what_another_numpy_breaks_is_mended_by_its_removal() -> None:
    broken = Package(error="ValueError: numpy.dtype size changed, may indicate binary incompatibility")
    report = among(dolfinx=broken, petsc4py=broken, numpy=WHEEL, scipy=WHEEL)
    assert "python -m pip uninstall -y numpy scipy" in fault(_numpy(report, "python"))
    for name in ("dolfinx", "petsc4py"):
        assert "apt-get" not in fault(_package(name, report, "python"))


def test_an_old_or_complex_build_is_a_fault() -> None:
    old = replace(DEBIAN, version="0.4.1")
    assert "older than 0.5.2" in fault(_package("dolfinx", among(dolfinx=old), "python"))
    new = replace(DEBIAN, version="0.10.0.post1")
    assert not fault(_package("dolfinx", among(dolfinx=new), "python"))
    petsc = replace(DEBIAN, library="3.18.5", scalar="complex128")
    assert "complex" in fault(_package("petsc4py", among(dolfinx=DEBIAN, petsc4py=petsc), "python"))


def test_the_reference_blas_is_slow_but_blocks_nothing() -> None:
    reference = _blas(Report("", {}, ["/usr/lib/x86_64-linux-gnu/blas/libblas.so.3.11.0"]))
    assert "apt-get install --no-install-recommends libopenblas0-serial" in fault(reference)
    assert not reference.blocks
    assert not fault(_blas(Report("", {}, ["/usr/lib/x86_64-linux-gnu/openblas-serial/libblas.so.3"])))


def test_a_missing_package_is_named_with_the_command_that_installs_it() -> None:
    report = among(dolfinx=DEBIAN, gmsh=Package(error="ModuleNotFoundError: No module named 'gmsh'"))
    found = _package("gmsh", report, SYSTEM_PYTHON)
    assert "No module named 'gmsh'" in found.fault
    prefix = "" if os.geteuid() == 0 else "sudo "
    assert found.remedy == f"{prefix}apt-get install --no-install-recommends python3-gmsh"
