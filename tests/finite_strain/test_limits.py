"""Where a run cannot go: past the load that a mesh stands, past its budget, onto a full disk. What it has is kept."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from mpi4py import MPI

import finite_strain
from finite_strain import spread_arrays
from finite_strain.answer import Answer
from finite_strain.companion import MeshRecord
from finite_strain.loading import LoadPath
from finite_strain.planning import plan_run
from finite_strain.spread_arrays import write_in_turns
from linear_bem import Ball, Layer, Load, NotConverged, Problem
from linear_bem.errors import OutputUnusable
from tests.finite_strain.press import ACCURACY
from tests.finite_strain.scenes import Recorder, light_pair, pair, relatively, single

BREAKS = 0.7
"""Fraction of the load beyond which no equilibrium is found."""


@pytest.fixture
def breaking(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Have load steps beyond `BREAKS` fail, on all meshes or (the list's numbers) at the calls that are named."""
    solve = LoadPath._solve
    only: list[int] = []
    calls = [0]

    def failing(self: Any, fraction: float, *args: Any, **options: Any) -> None:
        calls[0] += 1
        if (only and calls[0] in only) or (not only and fraction > BREAKS):
            raise NotConverged("no equilibrium")
        solve(self, fraction, *args, **options)

    monkeypatch.setattr(LoadPath, "_solve", failing)
    return only


@pytest.mark.slow
def test_what_the_companion_mesh_reached_is_answered_before_the_run_ends(breaking: list[int], tmp_path: Path) -> None:
    for attempts in (12, 0):  # the second time what is known is not tried again
        heard = Recorder()
        with pytest.raises(NotConverged, match="after 8 cut-backs"):
            finite_strain.solve(light_pair(), tangential_force=ACCURACY, folder=tmp_path, observer=heard)
        assert len([a for a in heard.attempts if a["mesh"] == "companion"]) >= attempts
        if not attempts:
            assert {a["mesh"] for a in heard.attempts} == set()
        else:
            fractions = [step.record["fraction"] for step in heard.steps]
            assert fractions == sorted(fractions)
            assert 0.98 * BREAKS < fractions[-1] <= BREAKS
            assert all(step.balls[0].tangential_force[0] < 0.0 for step in heard.steps)
            assert all(step.balls[0].tangential_force_error > 0.0 for step in heard.steps)


@pytest.mark.slow
def test_a_mesh_that_is_cut_back_answers_only_where_its_companion_did(breaking: list[int], tmp_path: Path) -> None:
    breaking.append(99)
    usual = finite_strain.solve(light_pair(), tangential_force=ACCURACY)
    breaking[:] = [len(usual.steps) * 2 + len(usual.steps) + 2]  # of the second run, its main mesh's second step
    heard = Recorder()
    cut = finite_strain.solve(light_pair(), tangential_force=ACCURACY, observer=heard, folder=tmp_path)
    assert any(attempt["cuts"] == 1 and attempt["mesh"] == "main" for attempt in heard.attempts)
    assert [step.record["fraction"] for step in cut.steps] == [step.record["fraction"] for step in usual.steps]
    assert cut.steps[-1].record["iterations"] > usual.steps[-1].record["iterations"]
    for ours, theirs in zip(cut.steps, usual.steps, strict=True):
        a, b = ours.balls[0], theirs.balls[0]
        assert a.tangential_force[0] == relatively(b.tangential_force[0], 1e-4)
        assert a.tangential_force_error == relatively(b.tangential_force_error, 0.05)


@pytest.mark.slow
def test_no_mesh_has_more_unknowns_than_the_budget_allows() -> None:
    free = finite_strain.solve(light_pair(), tangential_force=ACCURACY)
    most = 0.7 * free.solved.unknowns
    bound = finite_strain.solve(light_pair(), tangential_force=ACCURACY, unknowns=most)
    assert all(mesh["unknowns"] <= most for mesh in bound.solved.accuracy["meshes"])
    assert bound.solved.unknowns > 0.6 * most
    assert not any("more than the budget" in note for note in bound.solved.notes)
    a, b = free.balls[0], bound.balls[0]
    difference = abs(a.tangential_force[0] - b.tangential_force[0])
    assert difference <= a.tangential_force_error + b.tangential_force_error


@pytest.mark.slow
def test_seconds_that_were_not_enough_are_said() -> None:
    hasty = finite_strain.solve(light_pair(), tangential_force=0.001, seconds=0.5)
    assert len(hasty.solved.accuracy["meshes"]) == 2
    assert "the budget of 0.5 s is spent" in hasty.solved.accuracy["stopped"]
    assert any(note.endswith("more than the budget of 0.5 s") for note in hasty.solved.notes)


def test_a_full_disk_is_said_before_a_file_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "checkpoint.h5"
    arrays = {"values": np.zeros((1000, 3))}
    write_in_turns(MPI.COMM_SELF, target, arrays, lambda file: None)
    before = target.read_bytes()
    needed = arrays["values"].nbytes + spread_arrays.ROOM
    for free, works in ((needed, True), (needed - 1, False)):
        monkeypatch.setattr(shutil, "disk_usage", lambda _, free=free: SimpleNamespace(free=free))
        if works:
            write_in_turns(MPI.COMM_SELF, target, arrays, lambda file: None)
            continue
        with pytest.raises(
            OutputUnusable, match=r"checkpoint\.h5 cannot be written: No space left on device \(1\.0 MB"
        ):
            write_in_turns(MPI.COMM_SELF, target, arrays, lambda file: None)
    assert len(target.read_bytes()) == len(before)
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint.h5"]


def test_forces_that_do_not_add_up_to_zero_are_doubted_more() -> None:
    balls = (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((2.0, 0.0), 2.0, "sphere"))
    plan = plan_run(Problem(Layer(1.0, 0.3, 2.0), balls, Load("approach", (0.1, 0.1))), 0.1, "finite_strain")
    answer = Answer(plan, plan.far_field(), [MeshRecord(1.4)], 1.0)
    forces = np.array([[1.0, 0.0], [-0.4, 0.0]])
    imbalance, doubt = answer._imbalance(forces, np.array([0.1, 0.2]))
    assert imbalance == relatively(0.6, 1e-12)
    assert doubt == relatively(math.hypot(1.0, 2.0), 1e-12)
    # mirror images add up to zero whatever they are
    plan = plan_run(pair(0.1), 0.1, "finite_strain")
    answer = Answer(plan, plan.far_field(), [MeshRecord(1.4)], 1.0)
    assert answer._imbalance(forces[:1], np.array([0.1])) == (0.0, 1.0)


def test_on_a_film_elements_at_the_contacts_edge_are_measured_by_its_thickness() -> None:
    plan = plan_run(single(0.02, 0.05), 0.1, "finite_strain")
    assert plan.resolution is not None
    answer = Answer(plan, plan.far_field(), [MeshRecord(1.4)], 1.0)
    for radius, factor in ((0.0, 0.0), (0.1, 1.0), (0.2, 2.0), (10.0, 1.0 / plan.resolution.inner)):
        (growth,) = answer._growth_at_edge([{"contact_area": math.pi * radius**2}])
        usual = plan.resolution.at_edge(radius, plan.smallest_contact) if radius > 0.0 else 0.0
        assert growth == relatively(factor * usual, 1e-9)
