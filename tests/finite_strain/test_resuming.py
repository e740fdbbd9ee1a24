"""The light run again: on four ranks, stopped and resumed, with damaged files."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import h5py
from scipy.spatial import cKDTree

import finite_strain
from finite_strain.equilibrium.newton import StepRecord
from finite_strain.one_discretisation import ModelRun
from finite_strain.output.field_catalogue import CATALOGUE
from finite_strain.planning.records import NAME, Record, save_records, saved_records
from finite_strain.refinement_loop import Refinement
from linear_bem.errors import NotConverged, OutputUnusable
from tests.finite_strain.light import press, solve
from tests.finite_strain.press import ACCURACY, STEPS, Stopped
from tests.finite_strain.scenes import COARSER, QUADRATIC, Keeper, Recorder, light_pair, relatively

PARALLEL = 1e-6
"""Relative: equilibria are converged to 1e-9 of the normal force, and T is a thousandth of that force or less."""


def assert_same_answer(found: Any, expected: Any, tolerance: float) -> None:
    assert len(found["steps"]) == len(expected["steps"])
    for a, b in zip(found["steps"], expected["steps"], strict=True):
        for ball, other in zip(a["balls"], b["balls"], strict=True):
            assert ball["normal_force"] == relatively(other["normal_force"], tolerance)
            assert ball["tangential_force"][0] == relatively(other["tangential_force"][0], tolerance)
            assert ball["contact_area"] == relatively(other["contact_area"], tolerance)


def same_fields(one: Path, other: Path, tolerance: float) -> None:
    with h5py.File(one) as a, h5py.File(other) as b:
        distance, row = cKDTree(b["points"][:]).query(a["points"][:])
        assert distance.max() < 1e-12
        assert len(np.unique(row)) == len(b["points"])
        for name in CATALOGUE:
            x, y = a[f"node_fields/{name}"][:], b[f"node_fields/{name}"][:][row]
            assert np.abs(x - y).max() <= tolerance * np.abs(x).max(), name


@pytest.fixture(scope="module")
def on_four(tmp_path_factory: pytest.TempPathFactory, result: Any, heard: Keeper) -> tuple[Any, Path]:
    """What runs on four ranks said, and the folder of their folders: "whole" continues that of one."""
    base = tmp_path_factory.mktemp("four")
    shutil.copytree(heard.kept / "1", base / "whole")
    (base / "unreadable").mkdir()
    (base / "unreadable" / NAME).write_bytes(b"")
    return press(4, base, "whole", "stopped", "failing", "unreadable"), base


@pytest.mark.mpi
@pytest.mark.slow
def test_four_ranks_that_go_on_with_a_run_of_one_give_its_answer(
    result: Any, folder: Path, on_four: tuple[Any, Path]
) -> None:
    found, other = on_four[0]["whole"], on_four[1] / "whole"
    assert found["solved"]["ranks"] == 4
    assert found["solved"]["linear_solver"] == "cholesky (mumps)"
    assert found["resumed"] == 1
    assert found["meshes_run"] == ["main", "main, small strain"]
    assert_same_answer(found, result.to_dict(), PARALLEL)
    with h5py.File(other / "step_0001.h5") as first, h5py.File(other / "step_0002.h5") as second:
        for name in ("points", "cells", "cell_fields/region"):  # of one rank and of four, numbered alike
            assert np.array_equal(first[name][:], second[name][:])
    same_fields(folder / "step_0002.h5", other / "step_0002.h5", PARALLEL)


@pytest.mark.mpi
@pytest.mark.slow
def test_a_run_on_four_ranks_that_is_stopped_within_a_mesh_resumes_there_on_one_with_the_same_answer(
    result: Any, folder: Path, on_four: tuple[Any, Path], tmp_path: Path
) -> None:
    said, stopped = on_four[0]["stopped"], on_four[1] / "stopped"
    assert said == ["Stopped: "] * 4
    for name in ("mesh_0.msh", "mesh_1.msh"):
        assert (stopped / name).read_bytes() == (folder / name).read_bytes()
    same_fields(folder / "step_0001.h5", stopped / "step_0001.h5", PARALLEL)
    assert not (stopped / "step_0002.h5").exists()
    shutil.copytree(stopped, tmp_path, dirs_exist_ok=True)
    again = Recorder()
    found = solve(tmp_path, again)
    assert again.info["resumed_steps"] == 1
    # the path finder's answers and the first step on this mesh, by four ranks, are kept
    assert {attempt["mesh"] for attempt in again.attempts} == {"main", "main, small strain"}
    assert {attempt["fraction"] for attempt in again.attempts} == {1.0}
    assert_same_answer(found.to_dict(), result.to_dict(), PARALLEL)
    same_fields(folder / "step_0002.h5", tmp_path / "step_0002.h5", PARALLEL)


def test_a_finished_run_is_read_from_its_folder(result: Any, folder: Path) -> None:
    again = Recorder()
    found = solve(folder, again)
    assert not again.attempts
    assert [step.to_dict() for step in found.steps] == [step.to_dict() for step in result.steps]
    assert found.solved.accuracy == result.solved.accuracy
    assert not [note for note in found.solved.notes if "missing" in note]


def test_fields_of_a_finished_run_that_are_missing_or_damaged_are_named(folder: Path, tmp_path: Path) -> None:
    shutil.copy(folder / NAME, tmp_path)
    (tmp_path / "step_0002.h5").write_bytes((folder / "step_0002.h5").read_bytes()[:1000])
    again = Recorder()
    (note,) = [note for note in solve(tmp_path, again).solved.notes if "missing" in note]
    assert not again.attempts
    assert note.startswith(f"{tmp_path}: step_0001.h5 is missing, step_0002.h5 is damaged: ")


def test_fields_that_an_earlier_run_of_the_folder_did_not_write_are_named(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    with h5py.File(tmp_path / "step_0002.h5", "r+") as file:
        del file["node_fields/gap"]
    (note,) = [note for note in solve(tmp_path, Recorder()).solved.notes if "missing" in note]
    assert note.startswith(f"{tmp_path}: field gap is missing: ")


def test_the_fields_are_those_of_the_mesh_that_has_the_result(
    result: Any, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    key = json.loads((tmp_path / NAME).read_text(encoding="utf-8"))["key"]
    records, _ = saved_records(tmp_path, key)
    save_records(tmp_path, key, [*records, Record(QUADRATIC)])  # stands for a finer mesh
    follow = Refinement._steps

    def until_full_load(run: Refinement, own: ModelRun, path: list[float], number: int) -> Iterator[StepRecord]:
        yield from follow(run, own, path[:-1], number)
        raise NotConverged("stopped on purpose")

    monkeypatch.setattr(Refinement, "_steps", until_full_load)
    for _ in range(2):  # and from what the first run has saved
        assert [step.to_dict() for step in solve(tmp_path, None).steps] == [step.to_dict() for step in result.steps]
    for name in ("step_0001.h5", "step_0002.h5", "fields.xdmf"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()
    assert not (tmp_path / "finer").exists()
    (_, coarser, finer), _ = stopped = saved_records(tmp_path, key)
    assert len(finer.steps) == 1
    del coarser.steps[1:]  # as if it had not got any further either
    finer.finished = False
    save_records(tmp_path, key, stopped[0])
    (tmp_path / "finer").mkdir()
    of_finer = (folder / "step_0002.h5").read_bytes()
    (tmp_path / "finer" / "step_0001.h5").write_bytes(of_finer)
    with pytest.raises(NotConverged, match="stopped on purpose"):
        solve(tmp_path, None)
    assert (tmp_path / "step_0001.h5").read_bytes() == of_finer
    assert not (tmp_path / "finer").exists()


class Unwilling(Recorder):
    """Ends a run at its first attempt."""

    def attempt(self, mesh: str, fraction: float, cuts: int) -> None:
        super().attempt(mesh, fraction, cuts)
        raise Stopped


def test_a_run_with_a_higher_accuracy_starts_over(result: Any, folder: Path, tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes((folder / NAME).read_bytes())
    hasty = Unwilling()
    with pytest.raises(Stopped):
        finite_strain.solve(
            light_pair(), accuracy=0.5 * ACCURACY, folder=tmp_path, observer=hasty, steps=STEPS,
            numerics=COARSER,
        )  # fmt: skip
    assert hasty.attempts == [{"mesh": "coarse", "fraction": STEPS[0], "cuts": 0}]


def test_an_unreadable_file_in_the_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"{ truncated")
    with pytest.raises(OutputUnusable, match=rf"{NAME} cannot be read"):
        solve(tmp_path, None)


@pytest.mark.parametrize("damaged", [NAME, "state_1_own_002.npz"])
def test_a_damaged_file_costs_a_load_step_and_not_the_run(
    damaged: str, result: Any, heard: Keeper, tmp_path: Path
) -> None:
    shutil.copytree(heard.kept / "2", tmp_path, dirs_exist_ok=True)
    whole = (tmp_path / damaged).read_bytes()
    (tmp_path / damaged).write_bytes(whole[: len(whole) // 2])
    again = Recorder()
    found = solve(tmp_path, again)
    assert {attempt["mesh"] for attempt in again.attempts} == {"main", "main, small strain"}  # not the path finder's
    assert {attempt["fraction"] for attempt in again.attempts} == {1.0}
    assert again.info["resumed_steps"] == 1
    assert any(damaged in note for note in found.solved.notes)
    assert_same_answer(found.to_dict(), result.to_dict(), PARALLEL)


def test_a_folder_that_cannot_be_made_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    heard = Recorder()
    with pytest.raises(OutputUnusable, match="cannot be written"):
        solve(tmp_path / "file" / "out", heard)
    assert not heard.attempts


@pytest.mark.mpi
def test_an_unreadable_file_stops_every_rank(on_four: tuple[Any, Path]) -> None:
    said = on_four[0]["unreadable"]
    assert len(said) == 4
    for words in said:
        assert words.startswith("OutputUnusable")
        assert NAME in words


@pytest.mark.mpi
def test_a_run_that_does_not_converge_says_so_on_every_rank(on_four: tuple[Any, Path]) -> None:
    said = on_four[0]["failing"]
    assert len(said) == 4
    for words in said:
        assert words.startswith("NotConverged")
        assert "DIVERGED_MAX_IT" in words
        assert "last good state is at 0 of the full load" in words
