"""Balls that drift pressed nearly through their layer, and what a plan says of the direction of T."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from linear_bem import solve
from linear_bem.errors import UnsupportedProblem
from runs import cli
from runs.commands.plan import plan_scene
from runs.evolution import outcome, pair_table, showing
from runs.evolution.evolving import evolve_scene
from runs.scene.scene_file import InvalidScene, read_scene
from runs.session.session import Options

SCENE = """[layer]
thickness = "10 mm"
young = "1 MPa"
poisson = 0.3
[balls]
radius = "10 mm"
positions = POSITIONS
shape = "sphere"
[load]
approach = APPROACH
"""
SLIDING = """[reciprocation]
amplitude = "20 mm"
cycles = 2
friction = 0.3
"""
PAIR = '[["-12 mm", 0], ["12 mm", 0]]'


def scene(folder: Path, approach: str, positions: str = PAIR, more: str = "") -> Path:
    file = folder / "scene.toml"
    file.write_text(SCENE.replace("POSITIONS", positions).replace("APPROACH", approach) + more, encoding="utf-8")
    return file


@pytest.mark.parametrize("model", ["point_load", "linear_bem"])
def test_balls_pressed_nearly_to_a_rigid_base_drift_with_a_warning(
    model: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    monkeypatch.setattr(outcome, "direct_check", lambda *given: ([], []))
    monkeypatch.setattr(pair_table, "MANY", (1.0, 1.3, 1.7, 2.5))
    file = scene(tmp_path, '"9.7 mm"', more=SLIDING)
    evolve_scene(read_scene(file), model, Options(False, tmp_path / "out", False), tmp_path / "tables")
    notes = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["solved"]["notes"]
    assert [note for note in notes if note.startswith("the largest approach is 0.97 of the layer's thickness")]
    assert "warning: the largest approach is 0.97" in capsys.readouterr().out
    with pytest.raises(InvalidScene, match="must be less than the thickness"):
        read_scene(scene(tmp_path, '"10.1 mm"', more=SLIDING))


@pytest.mark.parametrize(("thickness", "approach", "base"), [("inf", "1.75", ""), ("0.15", "0.06", "14.0")])
def test_a_drift_warns_of_large_strain_where_a_solution_does(
    thickness: str, approach: str, base: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    monkeypatch.setattr(outcome, "direct_check", lambda *given: ([], []))
    monkeypatch.setattr(outcome, "position_error", lambda *given: None)
    monkeypatch.setattr(outcome, "equilibrium", lambda *given: None)
    text = (
        SCENE.replace('thickness = "10 mm"', f"thickness = {thickness}").replace('"10 mm"', "1").replace('"1 MPa"', "1")
    )
    text = text.replace("POSITIONS", "[[-1.0, 0], [1.0, 0]]").replace("APPROACH", approach)
    text += f"[substrate]\nyoung = {base}\npoisson = 0.3\n" if base else ""
    file = tmp_path / "deep.toml"
    file.write_text(text + SLIDING.replace("cycles = 2", "cycles = 1e-4"), encoding="utf-8")
    evolve_scene(read_scene(file), "point_load", Options(False, tmp_path / "out", False))
    notes = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["solved"]["notes"]
    expected = solve(read_scene(file).problem, accuracy=0.01).solved.notes
    assert len(expected) == 1
    # the contact's width, on which the layer's share depends, is estimated
    assert notes[0].split(", of which the layer takes")[0] == expected[0].split(", of which the layer takes")[0]
    assert len(notes) == 2  # that balls act as point loads


def test_a_plan_refused_by_the_elements_names_file_and_key(tmp_path: Path) -> None:
    file = scene(tmp_path, '"1 mm"', more=f"{SLIDING}[finite_strain]\n[accuracy]\ntangential_force = 1e-5\n")
    with pytest.raises(InvalidScene, match=r"scene\.toml: \[accuracy\] tangential_force: must lie between 0\.0001"):
        cli.plan(file, no_advice=True)
    file = scene(tmp_path, '"8.8 mm"', more=f"{SLIDING}[finite_strain]\n")
    with pytest.raises(
        UnsupportedProblem, match=r"9.24 mm \(written .*; lower it: .* one ball alone is pressed to 1.05"
    ):
        cli.plan(file, no_advice=True)


@pytest.mark.parametrize("more", ["", '[periodic]\nlengths = ["60 mm", "60 mm"]\n'])
def test_a_plan_names_a_direction_only_where_there_is_one(
    more: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan_scene(read_scene(scene(tmp_path, '"1 mm"', more=more)), None, as_json=False, advises=False)
    assert (": separation" in " ".join(capsys.readouterr().out.split())) == (not more)


@pytest.mark.parametrize("more", ["", SLIDING])
def test_a_plan_names_what_the_model_ignores(more: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = scene(tmp_path, '"1 mm"', more=f"{more}[accuracy]\nseconds = 5\n")
    plan_scene(read_scene(file), None, as_json=False, advises=False)
    assert "note: [accuracy] seconds left out: linear_bem has no mesh" in " ".join(capsys.readouterr().out.split())


def test_a_misspelt_substrate_is_one_fault(tmp_path: Path) -> None:
    with pytest.raises(InvalidScene) as caught:
        read_scene(scene(tmp_path, '"12 mm"', more='[substrat]\nyoung = "1 MPa"\npoisson = 0.3\n'))
    assert len(caught.value.faults) == 1
