"""A scene with [periodic] and balls that stay: which model solves it, and what is refused in words."""

import dataclasses
import json
from pathlib import Path

import pytest

import finite_strain
from linear_bem import UnsupportedProblem, solve
from linear_bem.problem import Periodic
from runs.advice import Adviser
from runs.commands import plan
from runs.commands.compare import compare_scene
from runs.commands.solve import solve_scene
from runs.comparison import sensitivity
from runs.display.numbers import Scale
from runs.models import MODELS, choose
from runs.scene.scene_file import InvalidScene, read_scene
from runs.session.session import Options
from tests.launch import python

SCENE = """
[layer]
young = 1.0
poisson = 0.4
thickness = 1.0
[balls]
radius = 1.0
positions = [[0.0, 0.0], [2.1, 0.3]]
[load]
approach = 0.1
[accuracy]
tangential_force = 1e-2
"""
CELL = "[periodic]\nlengths = [4.5, 2.4]\n"
SLIDING = "[reciprocation]\namplitude = 1.0\ncycles = 1\nfriction = 0.1\n"
LOADED = """
import sys
from runs.cli import main
try:
    main()
finally:
    print("LOADED", *sys.modules, file=sys.stderr)
"""


def written(folder: Path, text: str = SCENE + CELL) -> Path:
    file = folder / "cell.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_linear_model_solves_a_cell_from_a_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")  # a narrower terminal breaks the headings
    scene = read_scene(written(tmp_path))
    model, problem, notes = choose(scene)
    assert (model.name, problem.periodic, notes) == ("linear_bem", Periodic((4.5, 2.4)), ())
    solve_scene(scene, None, Options(False, tmp_path / "out", False))
    shown = capsys.readouterr().out
    assert "|T| / Q" in shown
    found = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["balls"]
    alone = solve(dataclasses.replace(problem, periodic=None), 1e-2).balls
    # the bulges that images raise on a thin layer carry load
    assert found[0]["normal_force"] > 1.01 * alone[0].normal_force
    assert found[0]["tangential_force"][0] == pytest.approx(-found[1]["tangential_force"][0], rel=1e-3)


def test_the_sensitivity_to_distances_takes_the_images_along(tmp_path: Path) -> None:
    farther = sensitivity._distance(choose(read_scene(written(tmp_path)))[1], 2.0)
    assert farther.periodic == Periodic((9.0, 4.8))
    assert farther.balls[1].position == (4.2, 0.6)


@pytest.mark.parametrize("asked", ["point_load", "finite_strain", "small_strain"])
def test_other_models_refuse_a_cell(asked: str, tmp_path: Path) -> None:
    with pytest.raises(UnsupportedProblem, match=rf"\[periodic\].*model {asked} lacks it.*--model linear_bem"):
        choose(read_scene(written(tmp_path)), asked)
    assert "periodic" not in MODELS[asked].effects


def test_finite_strain_and_a_cell_are_refused_together(tmp_path: Path) -> None:
    with pytest.raises(InvalidScene, match="periodic: the finite elements have no cell that repeats"):
        read_scene(written(tmp_path, SCENE + CELL + "[finite_strain]\n"))
    problem = choose(read_scene(written(tmp_path)))[1]
    with pytest.raises(UnsupportedProblem, match="periodic: small_strain has no cell that repeats; use linear_bem"):
        finite_strain.plan(problem, model="small_strain")


def test_a_scene_without_a_cell_never_loads_its_code(tmp_path: Path) -> None:
    for text, there in ((SCENE, False), (SCENE + CELL, True)):
        done = python("-c", LOADED, "solve", written(tmp_path, text), "--out", tmp_path / f"out_{there}")
        assert done.returncode == 0, done.stderr
        assert ("linear_bem.layer.cell" in done.stderr.split("LOADED")[1].split()) == there


def test_a_comparison_in_a_cell_is_refused_before_any_work(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path))
    with pytest.raises(UnsupportedProblem, match=r"compare needs both models.*does not support \[periodic\]; drop it"):
        compare_scene(scene, Options(False, tmp_path / "out", False))
    drift = read_scene(written(tmp_path, SCENE + CELL.replace("2.4", "4.5") + SLIDING))
    with pytest.raises(UnsupportedProblem, match="use `thirdbody evolve"):  # solve, too, has no use for it
        compare_scene(drift, Options(False, tmp_path / "out", False))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("more", ["", SLIDING])
@pytest.mark.parametrize(
    ("lengths", "says"),
    [
        ("[]", ("must be two lengths, along x and y, got []",)),
        ('["-1 mm", "inf mm"]', ("must be two lengths greater than 0 and finite, got -1 mm and inf mm; for",)),
        (
            '["1900 mm", "8 m"]',
            (
                "ball 0 overlaps its own image: they need at least 2000 mm, got 1900 mm; make the cell longer",
                "must be at least two diameters, 4000 mm, so that no ball touches two images of another, got 1900 mm;",
            ),
        ),
        ('["1e30 mm", "8 m"]', ("must be at most 1e+12 mm, 1e+09 of the largest ball's radius, got 1e+30 mm; check",)),
    ],
)
def test_lengths_of_a_cell_are_reported_in_the_scenes_unit(
    lengths: str, says: tuple[str, ...], more: str, tmp_path: Path
) -> None:
    text = SCENE.replace("radius = 1.0", 'radius = "1000 mm"') + f"[periodic]\nlengths = {lengths}\n{more}"
    if more:
        text = text.replace("[accuracy]\ntangential_force = 1e-2\n", "")
    with pytest.raises(InvalidScene) as caught:
        read_scene(written(tmp_path, text))
    fault = caught.value.faults[0]
    assert says[bool(more) and len(says) > 1] in fault
    assert " m;" not in fault


def test_advice_in_a_cell_is_about_the_nearest_images(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    across = SCENE.replace("[[0.0, 0.0], [2.1, 0.3]]", "[[0.5, 0.5], [10.2, 0.5]]")
    cell = choose(read_scene(written(tmp_path, f"{across}[periodic]\nlengths = [12.0, 12.0]\n")))[1]
    ahead = solve(dataclasses.replace(cell, periodic=None), 1e-2)
    assert Adviser(cell, ahead, None, ("periodic",)).away == pytest.approx([0.0, 2.3])
    inputs = {"ball": 0, "exponents": {"L": -2.0}, "poisson": (0.4, 0.41), "change": 0.1}
    assert sensitivity.rows(inputs, cell, Scale.of(cell))[-1]["value"] == "2.3 R"
    parts = []
    monkeypatch.setattr(plan, "ahead_of", lambda whole, _: (whole, range(2), ahead, 1.0))
    monkeypatch.setattr(plan, "_advice", lambda *given: parts.append(given[2]) or ([], inputs, []))
    text = across.partition("[accuracy]")[0] + f"[periodic]\nlengths = [12.0, 12.0]\n{SLIDING}"
    plan.plan_scene(read_scene(written(tmp_path, text)), None, as_json=False)
    assert "2.3 R" in capsys.readouterr().out
    (alone,) = parts  # a drift's advice is about its balls without the cell
    assert alone.periodic is None
    assert alone.positions[1] == pytest.approx([-1.8, 0.5])
