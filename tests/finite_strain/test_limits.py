"""Limits of a run: a load without equilibrium, its budget, a full disk; finished results are kept."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from mpi4py import MPI

import finite_strain
from finite_strain.equilibrium.load_path import LoadPath
from finite_strain.output import step_files
from finite_strain.output.step_files import write_gathered
from finite_strain.planning.refinement import WIDER
from finite_strain.refinement_loop import Refinement
from linear_bem import NotConverged
from linear_bem.errors import OutputUnusable
from tests.finite_strain.press import ACCURACY, STEPS
from tests.finite_strain.scenes import COARSER, CUBIC, Recorder, light_pair, relatively
from tests.finite_strain.test_refinement import first, record

BREAKS = 0.7
"""Fraction of the load beyond which no equilibrium is found."""
SHORTEST = replace(COARSER, shortest_step=0.3)
"""No step towards `BREAKS` between those asked for."""


@pytest.fixture
def breaking(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Make load steps fail for some element orders and kinematics, beyond `BREAKS` or once at a fraction."""
    solve = LoadPath._solve
    rule: dict[str, Any] = {"orders": (), "small": False, "once": None}

    def failing(self: Any, fraction: float, *args: Any, **options: Any) -> None:
        is_small = not self.model.is_finite
        if self.model.order in rule["orders"] and is_small == rule["small"]:
            if rule["once"] is None and fraction > BREAKS:
                raise NotConverged("no equilibrium")
            if fraction == rule["once"]:
                rule["orders"] = ()
                raise NotConverged("no equilibrium at once")
        solve(self, fraction, *args, **options)

    monkeypatch.setattr(LoadPath, "_solve", failing)
    return rule


def pressed(**options: Any) -> Any:
    given = {"accuracy": ACCURACY, "steps": STEPS, "numerics": COARSER}
    return finite_strain.solve(light_pair(), **given | options)


@pytest.fixture
def usual(result: Any) -> Any:
    """The light pair without limits."""
    return result


def test_steps_before_a_failing_load_are_kept_and_the_load_is_not_tried_again(
    breaking: dict[str, Any], usual: Any, tmp_path: Path
) -> None:
    breaking["orders"] = (2, 3)
    for is_known in (False, True):
        heard = Recorder()
        with pytest.raises(NotConverged, match=r"no equilibrium.*passes the budget.*the steps before are kept in"):
            pressed(folder=tmp_path, observer=heard, unknowns=1.5 * usual.solved.unknowns, numerics=SHORTEST)
        if is_known:
            assert not heard.attempts
        else:
            assert {step.record["fraction"] for step in heard.steps} == {STEPS[0]}
            for early, ball in zip(heard.steps[0].balls, usual.steps[0].balls, strict=True):
                # error bars also hold what later loads show
                assert replace(early, tangential_force_error=ball.tangential_force_error, errors=ball.errors) == ball


def test_a_step_that_is_cut_back_ends_in_the_same_equilibrium(breaking: dict[str, Any], usual: Any) -> None:
    breaking |= {"orders": (2,), "once": 1.0}
    heard = Recorder()
    cut = pressed(observer=heard)
    assert breaking["orders"] == ()
    assert any(attempt["cuts"] == 1 and attempt["mesh"] == "coarse" for attempt in heard.attempts)
    assert [step.record["fraction"] for step in cut.steps] == list(STEPS)
    for ours, theirs in zip(cut.steps, usual.steps, strict=True):
        a, b = ours.balls[0], theirs.balls[0]
        # the multipliers are those of the path's loosely converged equilibrium
        assert a.tangential_force[0] == relatively(b.tangential_force[0], 1e-4)
        assert a.normal_force == relatively(b.normal_force, 1e-6)


def test_a_run_goes_on_without_a_pair_that_fails_and_reports_it(breaking: dict[str, Any], usual: Any) -> None:
    breaking |= {"orders": (2, 3), "small": True}
    alone = pressed(numerics=SHORTEST)
    first, last = alone.steps
    assert first.record["pair_weight"] == [1.0, 1.0]
    assert last.record["pair_weight"] == [0.0, 0.0]
    assert any("the small-strain problem has no equilibrium at full load" in note for note in alone.solved.notes)
    ball, other = last.balls[0], usual.balls[0]
    assert ball.tangential_force == ball.tangential_force_routes["domain_without_pair"]
    assert other.tangential_force != other.tangential_force_routes["domain_without_pair"]


def test_no_discretisation_has_more_unknowns_than_the_budget_allows(usual: Any) -> None:
    bound = pressed(accuracy=1e-3, steps=(1.0,), unknowns=1.5 * usual.solved.unknowns)
    accuracy = bound.solved.accuracy
    assert all(mesh["unknowns"] <= accuracy["budget"]["unknowns"] for mesh in accuracy["meshes"])
    assert not accuracy["met"]
    assert "the budget of" in accuracy["stopped"]
    assert any("was asked for" in note for note in bound.solved.notes)
    assert not any("more than the budget" in note for note in bound.solved.notes)


def test_a_wider_domain_that_did_not_help_is_not_the_answer() -> None:
    run: Any = object.__new__(Refinement)
    wider = record(replace(CUBIC, extent=WIDER), 0.07, transfer=0.05, discretisation=0.05)
    run.records = [*first(0.05, transfer=0.05, discretisation=0.01), wider]
    assert run._answered() == 1
    wider.reached = 0.04
    assert run._answered() == 2
    run.records.append(record(replace(CUBIC, order=4), 0.06, discretisation=0.06))
    assert run._answered() == 3


def test_an_exhausted_time_budget_is_reported() -> None:
    hasty = pressed(accuracy=1e-3, steps=(1.0,), seconds=0.5)
    assert len(hasty.solved.accuracy["meshes"]) == 2  # the fewest that an error estimate needs
    assert "the budget of 0.5 s" in hasty.solved.accuracy["stopped"]
    assert any(note.endswith("more than the budget of 0.5 s") for note in hasty.solved.notes)


def test_a_full_disk_is_reported_before_a_file_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "fields.h5"
    arrays = {"values": np.zeros((1000, 3))}
    write_gathered(MPI.COMM_SELF, target, arrays, lambda file: None)
    before = target.read_bytes()
    needed = arrays["values"].nbytes + step_files.ROOM
    for free, works in ((needed, True), (needed - 1, False)):
        monkeypatch.setattr(shutil, "disk_usage", lambda _, free=free: SimpleNamespace(free=free))
        if works:
            write_gathered(MPI.COMM_SELF, target, arrays, lambda file: None)
            continue
        with pytest.raises(OutputUnusable, match=r"fields\.h5 cannot be written: No space left on device \(1\.0 MB"):
            write_gathered(MPI.COMM_SELF, target, arrays, lambda file: None)
    assert len(target.read_bytes()) == len(before)
    assert [path.name for path in tmp_path.iterdir()] == ["fields.h5"]
