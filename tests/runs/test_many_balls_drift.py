"""Many balls as a command: a layer that gathers, resuming after a kill, the plan, faults of the effects' keys."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from linear_bem.errors import UnsupportedProblem
from runs.commands.plan import plan_scene
from runs.evolution import evolving, expectation, motion, outcome, showing
from runs.evolution.evolving import evolve_scene
from runs.models import choose
from runs.process import signals
from runs.scene.scene_file import InvalidScene, read_scene
from runs.session.session import Options
from tests.launch import ROOT
from tests.runs.killing import killed_after
from tests.runs.lattices import lattice

TEXT = """
[layer]
thickness = 2.0
young = 1.0
poisson = 0.48
[balls]
radius = 1.0
positions = [{positions}]
[load]
approach = 0.1
[reciprocation]
amplitude = 300
cycles = {cycles}
friction = 1
tolerance = 1e-3
rest = 1e-5
[periodic]
lengths = [{side}, {side}]
{more}
"""


def written(folder: Path, count: int = 121, cycles: float = 0.3, more: str = "", side: float = 0.0) -> Path:
    columns = round(np.sqrt(count))
    x = lattice(columns, columns, 2.6) + np.random.default_rng(4).uniform(-0.28, 0.28, (columns**2, 2)) + 1.3
    text = TEXT.format(
        positions=", ".join(f"[{a!r}, {b!r}]" for a, b in x.tolist()), cycles=cycles, side=side or 2.6 * columns,
        more=more,
    )  # fmt: skip
    folder.mkdir(exist_ok=True)
    file = folder / "layer.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_shipped_layer_gathers_and_a_larger_resistance_stops_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    monkeypatch.setattr(outcome, "position_error", lambda *given: None)
    monkeypatch.setattr(outcome, "direct_check", lambda *given: ([], []))
    shipped = (ROOT / "runs" / "scenes" / "layer_of_36_balls.toml").read_text(encoding="utf-8")
    file = tmp_path / "layer.toml"
    file.write_text(shipped.replace("cycles = 200", "cycles = 0.1"), encoding="utf-8")
    path = evolved(file, tmp_path / "out")["path"]
    assert len(path[-1]["contacts"]) > len(path[0]["contacts"])
    largest = max(np.hypot(*np.array(path[0]["tangential_force"]).T) / np.array(path[0]["normal_force"]))
    assert largest > 1e-3  # the scene's resistance
    file.write_text(shipped.replace("share = 1e-3", f"share = {1.01 * largest}"), encoding="utf-8")
    stopped = evolved(file, tmp_path / "stopped")
    assert stopped["rest"]["at_rest"]
    assert len(stopped["path"]) == 1


def evolved(file: Path, out: Path) -> dict[str, Any]:
    evolve_scene(read_scene(file), "point_load", Options(False, out, False))
    document: dict[str, Any] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return document


def test_a_killed_run_of_many_balls_goes_on_to_the_same_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written(tmp_path)
    monkeypatch.setattr(motion, "DENSE", 5)
    monkeypatch.setattr(outcome, "direct_check", lambda *given: ([], []))
    whole = evolved(file, tmp_path / "whole")
    assert "positions" not in whole["path"][0]
    assert whole["path"][-1]["contacts"] > 5  # more than nnls is left with
    with monkeypatch.context() as patch:
        patch.setattr(evolving, "SAVE_INTERVAL", -1.0)
        patch.setattr(showing, "draw", lambda *given: None)
        patch.setattr(signals, "check", killed_after(12))
        with pytest.raises(KeyboardInterrupt):
            evolved(file, tmp_path / "killed")
    half = json.loads((tmp_path / "killed" / "result.json").read_text(encoding="utf-8"))
    assert not half["solved"]["converged"]
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    killed = evolved(file, tmp_path / "killed")
    for key in ("path", "events", "balls", "rest", "cut_error"):
        assert killed[key] == whole[key], key
    for name in ("structure.csv", "structure_factor.csv", "steps.csv"):
        assert (tmp_path / "killed" / name).read_text() == (tmp_path / "whole" / name).read_text(), name
    assert (tmp_path / "whole" / "steps.csv").read_text().startswith("cycle,sliding_path_over_friction,contacts,")
    with open(tmp_path / "whole" / "structure.csv", encoding="utf-8", newline="") as table:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(table)]
    assert len(rows) == len(whole["path"])
    assert rows[-1]["coordination"] == pytest.approx(2.0 * whole["path"][-1]["contacts"] / 121)
    assert rows[-1]["cluster_mean"] > rows[0]["cluster_mean"]
    # a moment of many balls takes as much room as its numbers
    sizes = [f.stat().st_size for f in (tmp_path / "whole" / "path").iterdir()]
    assert max(sizes) < 121 * 100
    assert (tmp_path / "whole" / "top_views.png").stat().st_size > 20_000
    assert (tmp_path / "whole" / "structure.svg").stat().st_size > 5_000


def test_a_plan_of_many_balls_says_how_long_they_take(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outcome, "direct_check", lambda *given: ([], []))
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    file = written(tmp_path)
    plan_scene(read_scene(file), None, as_json=True, advises=False)
    found = json.loads(capsys.readouterr().out)["evolution"]
    assert found["steps"] == pytest.approx(evolved(file, tmp_path / "out")["solved"]["iterations"], rel=0.2)
    monkeypatch.setattr(expectation, "PATIENCE", 0.0)
    plan_scene(read_scene(file), None, as_json=False, advises=False)
    printed = " ".join(capsys.readouterr().out.split())
    # what 121 balls usually take
    assert re.search(r"evolve: about .* on one idle core, .* for 1 path of perhaps \d+ steps, .* pictures", printed)


@pytest.mark.parametrize(
    ("count", "change", "says"),
    [
        (4, ("cycles = 0.3", "cycles = 0.3\nforces = \"direct\""), "supports only pair forces"),
        (4, ("[load]", "[substrate]\nyoung = 1e3\npoisson = 0.3\n[load]"), "add up without limit"),
        (4, ("thickness = 2.0", "thickness = inf"), "add up without limit"),
        (4, ("lengths = [5.2, 5.2]", "lengths = [3.0, 5.2]"), "at least two diameters"),
        (4, ("lengths = [5.2, 5.2]", "lengths = [5.2]"), "must be two lengths"),
        (4, ("[periodic]", "[rolling_resistance]\nshare = -1.0\n[periodic]"), "must not be negative"),
    ],
)  # fmt: skip
def test_faults_of_the_effects_are_named(count: int, change: tuple[str, str], says: str, tmp_path: Path) -> None:
    file = written(tmp_path, count)
    text = file.read_text(encoding="utf-8")
    assert change[0] in text
    file.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(InvalidScene, match=says):
        read_scene(file)


def test_models_of_balls_at_rest_refuse_motion_and_resistance_but_no_cell(tmp_path: Path) -> None:
    file = written(tmp_path, 4, more="[rolling_resistance]\nshare = 1e-3")
    named = (
        r"toml: \[reciprocation\] \([^)]*\), \[rolling_resistance\] \([^)]*\): solve and compare .* `thirdbody evolve"
    )
    with pytest.raises(UnsupportedProblem, match=named):
        choose(read_scene(file))


@pytest.mark.parametrize("command", ["plan", "evolve"])
@pytest.mark.parametrize(
    ("count", "model", "change", "says"),
    [
        (
            9, None, ("", ""),
            r"layer.toml: \[balls\] positions: balls \d and \d overlap by 0.\d+ m across the cell's edge, the most of "
            r"\d pairs that do: .* need at least 2 m; move them apart or make them smaller, or the cell larger",
        ),
        (
            9, None, ("radius = 1.0", 'radius = "1000 mm"'),
            r"\[balls\] positions: balls \d and \d overlap by [3-9]\d\d mm across the cell's edge, the most of \d",
        ),
        (1, None, ("", ""), r"layer.toml: one ball alone has no mutual force; evolve needs two or more"),
        (
            4, None, ("approach = 0.1", "approach = [0.1, 0.2, 0.1, 0.1]"),
            r"layer.toml: \[load\] approach: .* on one level .* approaches from 0.1 m to 0.2 m; give one approach",
        ),
        (
            4, None, ("radius = 1.0\n", "radius = [1.0, 0.9, 1.0, 1.0]\n"),
            r"a table of pairs needs equal balls under one approach, got 2 kind",
        ),
        (4, "small_strain", ("[periodic]\nlengths = [7.0, 7.0]", 'forces = "direct"'), "small_strain takes minutes"),
    ],
)  # fmt: skip
def test_plan_refuses_what_evolve_refuses(
    command: str, count: int, model: str | None, change: tuple[str, str], says: str, tmp_path: Path
) -> None:
    file = written(tmp_path, count, side=7.0)
    text = file.read_text(encoding="utf-8")
    assert change[0] in text
    file.write_text(text.replace(*change) if change[0] else text, encoding="utf-8")
    scene = read_scene(file)

    def run() -> None:
        if command == "plan":
            plan_scene(scene, model, as_json=False)
        else:
            evolve_scene(scene, model, Options(False, tmp_path / "out", False))

    with pytest.raises((InvalidScene, UnsupportedProblem), match=says):
        run()
    assert not (tmp_path / "out").exists()


def test_resistance_stops_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    held = evolved(written(tmp_path / "held", 4, more="[rolling_resistance]\nshare = 0.1"), tmp_path / "out_held")
    assert held["rest"]["at_rest"]
    assert len(held["path"]) == 1
    assert held["equilibrium"] is None
