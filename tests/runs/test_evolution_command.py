"""The command evolve: every scene starts, what it prints and draws, what its keys and models change."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from linear_bem import FiniteStrain, Load, Problem, Result, solve
from linear_bem.result import Solved, Step
from runs.evolution import outcome, pair_table
from runs.evolution.drawing import COLORS, FRAMES, SECONDS
from runs.evolution.evolving import evolve_scene
from runs.models import MODELS, Run, standing
from runs.scene.scene_file import OutputTable, Scene, read_scene
from runs.session.session import Options, left_out
from tests.launch import ROOT, python, thirdbody
from tests.runs.three_balls import TEXT, evolved, leave_out_pictures_and_check, sliding, three
from tests.test_architecture import HEAVY, LOADED

SCENES = sorted((ROOT / "runs" / "scenes").glob("experiment_*.toml"))
DIMENSIONLESS = """
[layer]
thickness = 8.0
young = 1.0
poisson = 0.3
[balls]
radius = 1.0
positions = [[-1.5, 0], [1.5, 0]]
[load]
approach = 0.3
[reciprocation]
amplitude = 2.0
cycles = 1
friction = 0.3
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return three(tmp_path_factory.mktemp("three"))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the pictures and the comparison with the full model, which take longest."""
    leave_out_pictures_and_check(monkeypatch)


def test_one_command_gives_path_pictures_and_sentences(tmp_path: Path) -> None:
    file = tmp_path / "three.toml"
    file.write_text(TEXT, encoding="utf-8")
    out = tmp_path / "out"
    done = thirdbody("evolve", file, "--model", "point_load", "--out", out)
    assert done.returncode == 0, done.stderr
    assert "at rest after" in done.stdout
    assert "the first of 3 members (seed 3): at rest after " in done.stdout
    assert "3 of 3 members end with 3 contacts in 1 cluster of 3" in done.stdout
    for words in ("are in one cluster", "are at rest"):
        assert re.search(rf"3 of 3 members {words} after [\d.e+]+ ± [\d.e+-]+ cycles \([\d.]+ to [\d.]+\)", done.stdout)
    assert "320 mm of path a cycle" in done.stdout
    error = 1e3 * json.loads((out / "result.json").read_text(encoding="utf-8"))["position_error"]
    assert f"error of the positions by the steps alone: {error:.2g} mm" in " ".join(done.stdout.split())
    assert "shape: sphere, radius" in done.stdout
    assert "T > 0: towards the other balls" in done.stdout
    document = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert document["solved"]["converged"]
    assert {"scene", "model", "balls", "steps", "path", "events", "ensemble", "rest", "equilibrium"} <= set(document)
    assert all(" ".join(sentence.split()) in " ".join(done.stdout.split()) for sentence in document["sentences"])
    assert document["equilibrium"]["verdict"] == "stable"
    assert document["equilibrium"]["distance_from_end"] < 1e-8
    with open(out / "steps.csv", encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))
    assert len(rows) == 3 * len(document["path"])
    assert float(rows[-1]["position_x"]) == document["path"][-1]["positions"][2][0]
    assert float(rows[-1]["tangential_force_error"]) == document["path"][-1]["tangential_force_error"][2]
    for name in ("top_views.png", "top_views.svg", "distances.png", "ensemble.png", "evolution.gif"):
        assert (out / name).stat().st_size > 5_000, name
    sizes = re.findall(r"font(?:-size)?: ([\d.]+)px", (out / "top_views.svg").read_text(encoding="utf-8"))
    assert min(map(float, sizes)) >= 8.5
    with Image.open(out / "evolution.gif") as animation:
        shown = [(f.info["duration"], np.asarray(f.convert("L"), float)) for f in ImageSequence.Iterator(animation)]
    assert sum(duration for duration, _ in shown) == pytest.approx(1e3 * SECONDS * (1.0 + 8.0 / FRAMES))
    assert len(np.unique([picture for _, picture in shown])) <= COLORS  # which keep the file small
    first, last = shown[0][1], shown[-1][1]
    changed = np.abs(first - last) > 50.0
    assert 0.005 < changed.mean() < 0.5  # the balls have moved, the axes have not
    with open(out / "structure.csv", encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))
    assert len(rows) == len(document["path"])
    assert float(rows[-1]["coordination"]) == 2.0  # three in contact
    assert not list(out.glob("structure[._]*[gf]*"))  # pictures and S(k) of layers of many balls
    again = thirdbody("evolve", file, "--model", "point_load", "--out", out, "--json")
    assert json.loads(again.stdout) == document
    assert "complete already" in again.stderr


def test_the_outcome_of_a_scene_in_radii_is_in_radii(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(outcome, "direct_check", lambda *given: ([], []))
    file = tmp_path / "radii.toml"
    file.write_text(DIMENSIONLESS, encoding="utf-8")
    evolve_scene(read_scene(file), "point_load", Options(False, tmp_path / "out", False), tmp_path / "tables")
    said = " ".join(capsys.readouterr().out.split())
    assert "8 R of path a cycle" in said
    assert " mm " not in said
    names = ("top_views.svg", "distances.svg")
    views, away = ((tmp_path / "out" / name).read_text(encoding="utf-8") for name in names)
    assert views.count(">x / R<") == 6
    assert ">distance of the axes / R<" in away
    assert "mm]" not in views + away


@pytest.mark.usefixtures("undrawn")
def test_friction_and_direction_leave_the_path_alone_and_friction_sets_the_clock(scene: Scene, tmp_path: Path) -> None:
    one = evolved(sliding(scene, ensemble=1, cycles=40.0), tmp_path / "one")
    slow = evolved(
        sliding(scene, ensemble=1, friction=60.0, cycles=120.0, amplitude=0.08, direction=(0.0, 1.0)),
        tmp_path / "slow",
    )
    assert len(one["path"]) == len(slow["path"])
    for here, there in zip(one["path"], slow["path"], strict=True):
        assert there["positions"] == pytest.approx(np.array(here["positions"]), abs=1e-12)
        assert there["cycle"] == pytest.approx(3.0 * here["cycle"], rel=1e-12)
    wide = evolved(sliding(scene, ensemble=1, cycles=20.0, amplitude=0.16), tmp_path / "wide")
    assert wide["path"][-1]["cycle"] == pytest.approx(0.5 * one["path"][-1]["cycle"], rel=1e-12)


@pytest.mark.usefixtures("undrawn")
def test_cycles_seed_and_rest_end_the_path_where_they_say(scene: Scene, tmp_path: Path) -> None:
    short = evolved(sliding(scene, ensemble=1, cycles=3.0), tmp_path / "short")
    assert short["path"][-1]["cycle"] == pytest.approx(3.0, rel=1e-12)
    assert not short["rest"]["at_rest"]
    other = evolved(sliding(scene, ensemble=1, cycles=3.0, seed=4), tmp_path / "other")
    moved = np.abs(np.array(short["path"][0]["positions"]) - np.array(other["path"][0]["positions"]))
    assert 0.0 < np.max(moved) <= 2e-4
    threshold = short["path"][0]["speed"] * 1.01
    still = evolved(sliding(scene, ensemble=1, rest=threshold), tmp_path / "still")
    assert len(still["path"]) == 1
    assert still["rest"]["at_rest"]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_every_experiment_starts(path: Path, tmp_path: Path) -> None:
    start = sliding(read_scene(path), ensemble=1, cycles=0.5)
    document = evolved(start, tmp_path / "out")
    assert document["path"]
    assert document["solved"]["converged"]


@pytest.mark.usefixtures("undrawn")
def test_direct_forces_ask_the_full_model_at_every_step(
    tmp_path: Path, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_table, "MANY", (1.0, 1.3, 1.6, 2.2, 3.0, 4.0))
    short = sliding(scene, ensemble=1, cycles=0.5, forces="direct", tolerance=1e-2)
    direct = evolved(short, tmp_path / "direct", "linear_bem")
    pairs = evolved(sliding(short, forces="pairs"), tmp_path / "pairs", "linear_bem")
    assert direct["pair_table"] is None
    assert direct["path"][0]["tangential_force"] != pairs["path"][0]["tangential_force"]
    moved = np.array(direct["path"][-1]["positions"]) - np.array(direct["path"][0]["positions"])
    apart = np.array(direct["path"][-1]["positions"]) - np.array(pairs["path"][-1]["positions"])
    # the table's error in T on three balls, over the path
    assert 0.0 < np.max(np.abs(apart)) < 0.03 * np.max(np.abs(moved))


@pytest.mark.usefixtures("undrawn")
def test_a_budget_bounds_every_run_of_a_table_and_names_the_table(
    tmp_path: Path, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    bounds: list[dict[str, float]] = []

    def stand_in(problem: Problem, run: Run) -> Result:
        bounds.append(dict(run.budget))
        assert run.output is not None
        assert run.output.fields == ()  # nobody reads fields of a table's runs
        path = []
        for share in (0.1, 0.2, 0.4, 0.7, 1.0) if problem.size == 1 else (1.0,):
            load = Load("approach", tuple(share * v for v in problem.load.values))
            path.append(Step(solve(replace(problem, finite_strain=None, load=load), accuracy=1e-2).balls))
        return Result("finite_strain", path[-1].balls, Solved(True, 1, 1, 0.0), tuple(path))

    monkeypatch.setitem(MODELS, "finite_strain", replace(MODELS["finite_strain"], solve=stand_in))
    monkeypatch.setattr(pair_table, "FEW", (1.0, 1.3, 1.7, 2.5))
    short = sliding(replace(scene, effects=(*scene.effects, "finite_strain")), ensemble=1, cycles=0.5)
    short = replace(short, problem=replace(scene.problem, finite_strain=FiniteStrain()))
    evolved(short, tmp_path / "free", "finite_strain")
    assert bounds == [{}] * 7
    bounds.clear()
    bounded = replace(short, budget={"unknowns": 4e4, "seconds": 60.0})
    document = evolved(bounded, tmp_path / "bounded", "finite_strain")
    assert bounds == [{"unknowns": 4e4, "seconds": 60.0}] * 7
    assert document["pair_table"]["identity"]["budget"] == {"unknowns": 4e4, "seconds": 60.0}
    # no bound, no word of it: tables from before there were budgets keep their names
    free = json.loads((tmp_path / "free" / "result.json").read_text(encoding="utf-8"))
    assert "budget" not in free["pair_table"]["identity"]
    linear = evolved(replace(short, budget={"unknowns": 4e4}), tmp_path / "linear")
    assert "[accuracy] unknowns left out: point_load has no mesh" in linear["solved"]["notes"]


def test_what_point_loads_ignore_is_noted(scene: Scene) -> None:
    asked, point_load = replace(scene, tangential_force=1e-6), MODELS["point_load"]
    at_one_instant, moving = (left_out(each, point_load) for each in (standing(asked), asked))
    assert at_one_instant == ["[accuracy] tangential_force left out: point_load has the accuracy of its law"]
    assert "tangential_force serves the comparison with the full linear model alone" in moving[0]
    (direct,) = left_out(sliding(scene, forces="direct"), point_load)
    assert direct.startswith('[reciprocation] forces = "direct" left out')
    assert left_out(sliding(asked, forces="direct"), MODELS["linear_bem"]) == []
    written = replace(scene, output=OutputTable())
    assert left_out(written, MODELS["small_strain"]) == ["[output] left out: a drift keeps no fields"]
    assert left_out(standing(written), MODELS["small_strain"]) == []


def test_an_evolution_by_point_loads_never_loads_dolfinx_the_solver_of_resistance_or_rare_units(tmp_path: Path) -> None:
    file = tmp_path / "three.toml"
    file.write_text(TEXT.replace("ensemble = 3", "").replace("cycles = 400", "cycles = 1"), encoding="utf-8")
    done = python("-c", LOADED, "evolve", file, "--model", "point_load", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    loaded = set(done.stderr.split("LOADED")[1].split())
    assert not loaded & (HEAVY | {"finite_strain", "clarabel", "pint"})
