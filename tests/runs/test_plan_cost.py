"""What a plan says of time and memory: evolutions with their table, budgets beyond the machine."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import finite_strain
from linear_bem.errors import UnsupportedProblem
from runs import cli, models
from runs.commands import plan as planning
from runs.commands.plan import plan_scene
from runs.display.plan_words import memory_words
from runs.evolution import expectation, pair_table
from runs.evolution.providers import table_of
from runs.models import MODELS, as_command, planned_runs, time_on
from runs.process import machine
from runs.scene.scene_file import Scene, read_scene
from runs.session import session
from runs.session.session import Options, Session
from tests.launch import ROOT
from tests.scenes import thin_pair

DRIFTING = ROOT / "runs" / "scenes" / "experiment_pair_16mm_finite_strain.toml"

COARSER = 2.5 * 0.1 ** (1 / 3)
"""Time of the coarser path and of its comparison with a path, over that of the path."""


def scene(folder: Path, accuracy: str) -> Scene:
    path = folder / "scene.toml"
    path.write_text(thin_pair(accuracy), encoding="utf-8")
    return read_scene(path)


def followed(steps: int, seconds: float, sigma: float, *, ended: bool) -> tuple[SimpleNamespace, float]:
    return SimpleNamespace(steps=steps, sigma=sigma, resting=ended), seconds


def paths_of(drift: Scene, known: tuple[SimpleNamespace, float], monkeypatch: pytest.MonkeyPatch) -> float:
    """Return the planned time [s] of all paths, of one of which the beginning is ``known``."""
    monkeypatch.setattr(expectation, "_path", lambda *_: known)
    monkeypatch.setattr(expectation, "_missing", lambda *_: [])
    return float(expectation.expectation(drift, MODELS["point_load"], drift.problem, 0.0)["parts"]["paths"])


def test_a_path_that_is_followed_for_a_while_bounds_the_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    drift = read_scene(ROOT / "runs" / "scenes" / "layer_of_36_balls.toml")
    assert drift.reciprocation is not None
    end, both = drift.reciprocation.end, 1.0 + COARSER
    for steps, share, expected in ((20, 0.5, 40.0), (20, 1e-9, 198.0 / 1.06), (400, 1e-9, 400.0)):
        partly = followed(steps, 1.0 * steps, share * end, ended=False)
        later = 1.0 + 36 / expectation.TOUCHING
        assert paths_of(drift, partly, monkeypatch) == pytest.approx(expected * later * both)
    whole = followed(50, 5.0, end, ended=True)
    assert paths_of(drift, whole, monkeypatch) == pytest.approx(5.0 * both)


def test_direct_forces_are_planned_with_the_search_for_an_equilibrium(monkeypatch: pytest.MonkeyPatch) -> None:
    given = read_scene(ROOT / "runs" / "scenes" / "experiment_pair_16mm.toml")
    assert given.reciprocation is not None
    drift = {**given.drift, "reciprocation": given.reciprocation.model_copy(update={"forces": "direct"})}
    model, direct = MODELS["linear_bem"], dataclasses.replace(given, drift=drift)
    path = followed(10, 1e-3, given.reciprocation.end, ended=True)
    monkeypatch.setattr(expectation, "_path", lambda *_: path)
    timed = followed(6, 3.0, 0.1 * path[0].sigma, ended=False)
    monkeypatch.setattr(expectation, "_followed", lambda *_: timed)
    parts = expectation.expectation(direct, model, direct.problem, 10.0)["parts"]
    assert parts["table"] == 0.0
    assert parts["check"] == 30.0
    assert 0.0 < parts["equilibrium"] < 8.0 * 4 * 2 * 5.0  # next to a known state T takes less than half of a solution
    # ten steps, by point loads, of half a second each, by direct forces
    assert parts["paths"] == pytest.approx((1.0 + COARSER) * 10 * 0.5)
    monkeypatch.setattr(expectation, "IN_ONE_FILE", 1)  # not solved for the plan
    many = expectation.expectation(direct, model, direct.problem, 10.0)["parts"]
    assert many["equilibrium"] == 0.0
    assert many["paths"] == pytest.approx(46 * 3.5)  # in ten steps forces are evaluated 46 times


def test_a_run_takes_the_time_of_its_own_ranks() -> None:
    plan = {"seconds": 10.0, "processor_seconds": 16.0}
    assert [time_on(ranks, plan) for ranks in (1, 2, 4)] == pytest.approx([16.0, 10.0, 6.25])


def test_an_evolution_is_planned_with_the_runs_of_its_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(planning, "PATIENCE", 0.0)  # the advice is another test's
    plan_scene(read_scene(DRIFTING), None, as_json=False)
    printed = " ".join(capsys.readouterr().out.split())
    said = r"evolve: about [^,]* on two idle cores \(mpirun -n 2\), .* GB; on one \(without mpirun\) [^,]*, about"
    assert re.search(
        rf"{said} [^:]* GB: [^,]* for 13 runs by finite_strain for the table of pairs, .* [^,]* for pictures", printed
    )
    # nothing of a mesh that evolve does not make
    assert "finite_strain: hyperelastic finite elements evolve" in printed


def test_an_evolution_by_the_linear_model_is_planned_with_its_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(planning, "PATIENCE", 0.0)
    plan_scene(read_scene(ROOT / "runs" / "scenes" / "experiment_pair_16mm.toml"), None, as_json=False)
    printed = " ".join(capsys.readouterr().out.split())
    said = re.search(r"evolve: about ([\d.]+) s on one idle core, [^:]*: ([\d.]+) s for 27 runs by linear_bem", printed)
    assert said is not None
    assert 0.5 < float(said[2]) < float(said[1]) < 120.0  # 2 to 3.3 s for the runs of a pair on rubber
    assert re.search(r"s for 1 path of \d+ steps, [\d.]+ s for the full linear model at start", printed)


def test_a_plan_counts_no_runs_of_a_ready_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pair_table, "MANY", (1.0, 1.5, 2.5, 4.0))
    drift, model = read_scene(ROOT / "runs" / "scenes" / "experiment_pair_16mm.toml"), MODELS["linear_bem"]
    ready = tmp_path / "ready"
    table_of(model, drift.problem, drift.tangential_force, ready).complete()
    capsys.readouterr()
    runs = []
    monkeypatch.chdir(tmp_path)
    for more in ([], ["--tables", str(ready)]):
        words = ["plan", str(drift.path), "--model", model.name, "--json", "--no-advice", *more]
        cli.app(words, standalone_mode=False)
        runs.append(json.loads(capsys.readouterr().out)["evolution"])
    assert [found["runs"] for found in runs] == [7, 0]
    assert runs[1]["parts"]["table"] == 0.0


@pytest.mark.parametrize(
    ("tolerance", "ensemble", "times"), [(1e-9, 1, 10.0), (1e-6, 5, (5 + COARSER) / (1 + COARSER))]
)
def test_the_drift_takes_longer_for_a_finer_path_and_for_more_paths(
    tolerance: float, ensemble: int, times: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = read_scene(ROOT / "runs" / "scenes" / "experiment_pair_16mm.toml")
    assert given.reciprocation is not None
    more = given.reciprocation.model_copy(update={"tolerance": tolerance, "ensemble": ensemble})
    asked = dataclasses.replace(given, drift={**given.drift, "reciprocation": more})
    assert given.reciprocation.tolerance == 1e-6
    assert given.reciprocation.ensemble == 1
    partly = followed(1, 1.0, 1e-12, ended=False)
    here, there = paths_of(asked, partly, monkeypatch), paths_of(given, partly, monkeypatch)
    assert here == pytest.approx(times * there)


@pytest.mark.parametrize(("name", "model"), [("separation_16mm", None), ("experiment_pair_16mm", "point_load")])
def test_a_plan_says_that_it_needs_no_tables(
    name: str, model: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = read_scene(ROOT / "runs" / "scenes" / f"{name}.toml")
    plan_scene(given, model, as_json=True, advises=False, pair_tables=tmp_path)
    assert any(note.startswith("--tables left out: ") for note in json.loads(capsys.readouterr().out)["notes"])


def test_the_drift_of_point_loads_is_planned_without_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(planning, "PATIENCE", 0.0)
    plan_scene(read_scene(ROOT / "runs" / "scenes" / "experiment_pair_16mm.toml"), "point_load", as_json=True)
    found = json.loads(capsys.readouterr().out)["evolution"]
    assert found["runs"] == 1  # the ball alone
    assert found["steps"] > 10
    assert found["parts"].keys() == {"table", "paths", "check", "equilibrium", "pictures"}
    assert found["seconds"] > sum(found["parts"].values())


def test_runs_of_a_table_are_planned_one_by_one(tmp_path: Path) -> None:
    problem = scene(tmp_path, "").problem
    model = MODELS["finite_strain"]
    one = planned_runs(model, [problem], None, {})
    assert one is not None
    three = {key: (3.0 if "seconds" in key else 1.0) * value for key, value in one.items()}
    assert planned_runs(model, [problem] * 3, None, {}) == pytest.approx(three)
    assert planned_runs(MODELS["linear_bem"], [problem], None, {}) is None


def test_the_command_around_a_run_takes_its_time_with_any_number_of_meshes() -> None:
    plan = as_command({"seconds": 1.0, "perhaps": [{"meshes": 3, "seconds": 2.0}]})
    assert plan["perhaps"] == [{"meshes": 3, "seconds": plan["seconds"] + 1.0}]
    assert "perhaps" not in as_command({"seconds": 1.0})


def test_times_are_those_of_this_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = scene(tmp_path, "").problem
    monkeypatch.setattr(models, "slowness", lambda: 2.5)
    elements = MODELS["finite_strain"].plan
    assert elements is not None
    said, measured = elements(problem, 0.005, {}, None), finite_strain.plan(problem, 0.005, steps=None)
    assert said.keys() == measured.keys()
    assert said["perhaps"]
    for here, there in ((said, measured), *zip(said["perhaps"], measured["perhaps"], strict=True)):
        assert here["seconds"] == 2.5 * there["seconds"]
        assert here["processor_seconds"] == 2.5 * there["processor_seconds"]
        assert here["memory_bytes"] == there["memory_bytes"]
    assert said["seconds_of_meshes"] == [2.5 * value for value in measured["seconds_of_meshes"]]
    assert as_command({"seconds": 1.0})["seconds"] == 1.0 + 2.5 * models.COMMAND_SECONDS


def test_pictures_take_as_much_longer_as_the_machine_is_slower(monkeypatch: pytest.MonkeyPatch) -> None:
    drift = read_scene(ROOT / "runs" / "scenes" / "experiment_nine_30mm.toml")
    parts = []
    for factor in (1.0, 2.5):
        monkeypatch.setattr(expectation, "slowness", lambda factor=factor: factor)
        monkeypatch.setattr(expectation, "_path", lambda *_: followed(0, 0.0, 1.0, ended=True))
        monkeypatch.setattr(expectation, "_missing", lambda *_: [])
        parts.append(expectation.expectation(drift, MODELS["point_load"], drift.problem, 0.0)["parts"]["pictures"])
    assert parts[1] == pytest.approx(2.5 * parts[0])


def test_this_machine_is_timed_once() -> None:
    assert 0.01 < machine.slowness() < 100.0
    assert machine.slowness() is machine.slowness()


def test_a_budget_beyond_the_memory_is_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedProblem, match=r"\[accuracy\] unknowns: 1 000 000 000 unknowns need about .* GB"):
        Session("solve", scene(tmp_path, "unknowns = 1e9"), None, Options(out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_first_mesh_beyond_the_memory_is_refused_and_the_default_budget_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = dataclasses.replace(scene(tmp_path, ""), budget={})
    for here, refused in ((1e8, True), (1.5e9, False)):
        monkeypatch.setattr(session, "memory_bytes", lambda here=here: here)
        if refused:
            with pytest.raises(UnsupportedProblem, match=r"GB of memory, got 0\.1 GB"):
                Session("solve", small, None, Options(out=tmp_path / "out"))
        else:
            with Session("solve", small, None, Options(out=tmp_path / "out")) as begun:
                assert begun.plan["memory_bytes_at_most"] > here


def test_memory_is_the_containers_where_that_is_less(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = machine.memory_bytes()
    limit = tmp_path / "memory.max"
    monkeypatch.setattr(machine, "LIMITS", (tmp_path / "none", limit))
    limit.write_text("max\n", encoding="ascii")
    assert machine.memory_bytes() >= whole
    limit.write_text("1000000\n", encoding="ascii")
    assert machine.memory_bytes() == 1e6
    assert memory_words(7.5e12).startswith("about 7500 GB, more than the")
