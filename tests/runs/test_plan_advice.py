"""What a plan advises: changes of T that the linear model computes both ways, held against the accuracy asked."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from linear_bem import Ball, Cone, Elastic, Layer, Load, Periodic, Problem, solve
from runs.advice import Advice, Adviser
from runs.commands import plan as planning
from runs.commands.plan import plan_scene
from runs.comparison.strengthening_fit import CURVES, FITTED_LAW, fit_error, outside, strengthening_at_force
from runs.scene.scene_file import read_scene
from tests.launch import ROOT, environment

SCENES = ROOT / "runs" / "scenes"
SUBSTRATE = Elastic(1e3, 0.3)
TRIANGLE = """[layer]
thickness = "3 mm"
young = "1 MPa"
poisson = 0.49
[balls]
radius = "2.5 mm"
positions = [["-3 mm", 0], ["3 mm", 0], [0, "5.2 mm"]]
[load]
force = "0.5 N"
[finite_strain]
law = "neo_hookean"
[accuracy]
tangential_force = 0.1
unknowns = 45000
"""
PRECISION = 5e-3
"""Of changes that both sides compute to 1e-3 of T."""
KNOWN = (
    (1.16, 0.02634, 1.010, 0.005), (1.16, 0.05926, 1.029, 0.005), (1.16, 0.1333, 1.080, 0.006),
    (1.16, 0.2, 1.136, 0.007), (1.16, 0.3, 1.250, 0.010), (1.16, 0.4, 1.435, 0.012), (1.16, 0.5, 1.773, 0.018),
    (6.0, 0.05926, 0.9962, 0.0013), (6.0, 0.2, 0.9905, 0.0013), (6.0, 0.5, 0.9963, 0.0013),
)  # fmt: skip
"""Thickness and approach over R, S_Q and its error, as the study ``strengthening`` has them."""

CORNERS = (
    (1.0, 0.47, 0.08, 1.0180, 0.0043), (1.0, 0.47, 0.16, 1.0519, 0.0044), (1.0, 0.47, 0.32, 1.1807, 0.0052),
    (1.0, 0.47, 0.5, 1.5154, 0.0076), (1.0, 0.49, 0.16, 1.0478, 0.0063), (1.0, 0.49, 0.5, 1.4713, 0.0074),
    (1.2, 0.47, 0.16, 1.1251, 0.0053), (1.2, 0.47, 0.5, 2.0686, 0.0154), (1.2, 0.49, 0.16, 1.1102, 0.0081),
    (1.2, 0.49, 0.16, 1.1034, 0.0009), (1.2, 0.49, 0.5, 1.7891, 0.0121),
    (1.16, 0.48, 0.16, 1.1020, 0.0050), (1.16, 0.48, 0.5, 1.7641, 0.0126),
    (5.0, 0.47, 0.16, 0.9899, 0.0046), (5.0, 0.47, 0.5, 0.9938, 0.0052),
    (8.0, 0.49, 0.16, 0.9926, 0.0060), (8.0, 0.49, 0.5, 1.0021, 0.0079),
)  # fmt: skip
"""Thickness over R, Poisson's ratio, approach over R, S_Q and its error on a rigid base, by the study `fit_range`."""


def pair(
    approach: float, *, thickness: float = 1.16, shape: str = "sphere", substrate: Elastic | None = SUBSTRATE
) -> Problem:
    balls = (Ball((-1.0, 0.0), 1.0, shape), Ball((1.0, 0.0), 1.0, shape))
    return Problem(Layer(1.0, 0.48, thickness), balls, Load("approach", (approach, approach)), substrate)


rough = cache(partial(solve, accuracy=1e-2))


@cache
def advice(problem: Problem, accuracy: float | None = None) -> dict[str, Advice]:
    return {item.effect: item for item in Adviser(problem, rough(problem), accuracy, ()).advise()}


def of_finite_strain(problem: Problem, accuracy: float | None = None, *effects: str, law: str = FITTED_LAW) -> Advice:
    """Return the advice on finite strain, which takes no further solution."""
    return Adviser(problem, rough(problem), accuracy, effects, patience=0.0, law=law).advise()[0]


@cache
def force(problem: Problem) -> float:
    return solve(problem, 1e-3).balls[0].tangential_force[0]


def planned(scene: Path, capsys: pytest.CaptureFixture[str], *, as_json: bool = False, advises: bool = True) -> str:
    with patch.dict(os.environ, environment()):  # as wide a terminal as a child process has
        plan_scene(read_scene(scene), None, as_json=as_json, advises=advises)
    return capsys.readouterr().out


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out advice that takes more solutions."""
    monkeypatch.setattr(planning, "PATIENCE", 0.0)


def test_balls_beside_another_body_are_outside_the_fit_of_pairs() -> None:
    balls = (*pair(0.1).balls, Ball((6.0, 0.0), shape=Cone(0.3, 1.0)))
    found = of_finite_strain(Problem(Layer(1.0, 0.48, 1.16), balls, Load("approach", (0.1,) * 3)))
    assert found.change is None
    assert "the fit is for spheres and paraboloids only" in found.text


def test_the_fit_meets_what_is_known_within_its_error() -> None:
    for thickness, approach, ratio, error in KNOWN:
        assert abs(strengthening_at_force(approach, thickness) - ratio) <= fit_error(approach) + error
        assert not outside(approach, thickness, 2.0, 0.48)
    assert strengthening_at_force(0.0, 1.0) == 1.0
    assert len(outside(0.6, 2.0, 4.0, 0.3)) == 4


def test_the_fit_is_the_published_one() -> None:
    page = (ROOT / "runs" / "studies" / "strengthening" / "README.md").read_text(encoding="utf-8")
    for thickness, coefficients in CURVES.items():
        terms = "".join(f" {c:+.3f} x{f'^{k}' if k > 1 else ''}" for k, c in enumerate(coefficients, start=1))
        assert f"- h = {thickness:g} R, L = 2 R, nu = 0.48: S_Q = 1{terms}, x = D/R" in page


def test_the_fit_holds_at_every_measured_state_of_its_range() -> None:
    page = (ROOT / "runs" / "studies" / "fit_range" / "README.md").read_text(encoding="utf-8")
    states = re.findall(
        r"^\| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) ± ([\d.]+) \|", page, re.MULTILINE
    )
    inside = [
        row for row in (tuple(map(float, state)) for state in states) if not outside(row[3], row[0], row[2], row[1])
    ]
    assert len(inside) == 22
    for h, nu, distance, depth, ratio, error in inside:
        missed = abs(strengthening_at_force(depth, h, nu, distance) - ratio)
        assert missed <= fit_error(depth, h, nu, distance) + error


def test_limits_of_the_fit_are_kept_to_roundoff_and_no_layer_is_outside() -> None:
    for radius in (1.5e-3, 1.7e-3, 2.3e-3):
        assert not outside(0.2, 1.2 * radius / radius * (1.0 + 1e-15), 2.1, 0.49, 4.1e6 / 4.1e3 * (1.0 - 1e-15))
    assert "(here 0 R)" in outside(0.2, 0.0, 2.0, 0.48)[0]
    bare = Problem(Layer(1.0, 0.48, 0.0), pair(0.1).balls, Load("approach", (0.1, 0.1)), SUBSTRATE)
    assert of_finite_strain(bare).matters is None


def test_the_fit_is_of_one_law() -> None:
    found = of_finite_strain(pair(0.2), None, "finite_strain", law="gent")
    assert (found.change, found.matters) == (None, None)
    assert "the fit is for the law neo_hookean (here gent)" in found.text


def test_the_fit_holds_its_error_over_its_range_on_a_rigid_base() -> None:
    for thickness, poisson, approach, ratio, error in CORNERS:
        missed = abs(strengthening_at_force(approach, thickness, poisson) - ratio)
        assert missed <= fit_error(approach, thickness, poisson) + error
        assert not outside(approach, thickness, 2.0, poisson)
    assert fit_error(0.16, 1.2, 0.49) > 2.0 * fit_error(0.16)
    assert outside(0.5, 1.3, 2.0, 0.47)  # S_Q = 3.65 +- 0.05
    assert "(here 100)" in outside(0.16, 1.2, 2.0, 0.48, 100.0)[0]


def test_an_absent_finite_strain_that_would_matter_is_named_with_its_size() -> None:
    found = of_finite_strain(pair(0.32))
    assert found.change == pytest.approx(0.28, abs=0.01)
    assert found.matters is True
    assert not found.present
    assert found.text.endswith("add [finite_strain]")
    deep = of_finite_strain(pair(0.32), 0.28)
    assert deep.matters is None  # its error bar reaches over the accuracy asked
    loose = of_finite_strain(pair(0.02), 0.05)
    assert loose.matters is False
    assert loose.text.endswith("not needed")


def test_a_present_finite_strain_that_does_not_matter_can_be_dropped() -> None:
    found = of_finite_strain(pair(0.02), 0.05, "finite_strain")
    assert found.present
    assert found.matters is False
    assert found.text.endswith("it can be left out")


def test_outside_its_range_the_fit_decides_nothing() -> None:
    found = of_finite_strain(pair(0.55))
    assert found.matters is None
    assert "the fit is for D up to 0.5 R (here 0.5" in found.text


@pytest.mark.parametrize("shape", ["sphere", "paraboloid"])
def test_the_shape_is_judged_by_solving_both(shape: str) -> None:
    other = "paraboloid" if shape == "sphere" else "sphere"
    scene = pair(0.2, shape=shape)
    found = advice(scene)["sphere"]
    assert found.present == (shape == "sphere")
    assert found.change == pytest.approx(force(pair(0.2, shape=other)) / force(scene) - 1.0, abs=PRECISION)
    assert found.matters == (abs(found.change or 0.0) > 0.02)
    assert advice(pair(0.005, shape=shape))["sphere"].matters is False


def test_a_stiff_substrate_can_be_dropped_and_a_soft_one_cannot() -> None:
    stiff = advice(pair(0.02))["substrate"]
    assert stiff.present
    assert stiff.matters is False
    soft = advice(pair(0.02, substrate=Elastic(10.0, 0.3)))["substrate"]
    assert soft.matters is True
    rigid = force(pair(0.02, substrate=None)) / force(pair(0.02, substrate=Elastic(10.0, 0.3))) - 1.0
    assert soft.change == pytest.approx(rigid, rel=0.02)


def test_a_plan_of_a_rigid_base_says_how_soft_a_substrate_would_be_felt() -> None:
    found = advice(pair(0.02, substrate=None))["substrate"]
    assert not found.present
    assert found.matters is None
    assert "a substrate 100 times as stiff" in found.text
    changed = force(pair(0.02, substrate=Elastic(100.0, 0.3))) / force(pair(0.02, substrate=None)) - 1.0
    assert found.change == pytest.approx(changed, abs=PRECISION)
    assert abs(force(pair(0.02, substrate=SUBSTRATE)) / force(pair(0.02, substrate=None)) - 1.0) < 0.02


def test_incompressibility_and_point_loads_are_judged_against_the_full_solution() -> None:
    scene = pair(0.02)
    found = advice(scene)
    other = dataclasses.replace(scene, layer=Layer(1.0, 0.5, 1.16))
    assert found["poisson"].change == pytest.approx(force(other) / force(scene) - 1.0, abs=PRECISION)
    assert found["contact size"].matters is False
    assert advice(pair(0.32))["contact size"].matters is True


def test_far_neighbours_that_add_nothing_are_named() -> None:
    balls = tuple(Ball((2.0 * i, 0.0), 1.0, "paraboloid") for i in range(6))
    row = Problem(Layer(1.0, 0.48, 1.16), balls, Load("force", (1e-3,) * 6), SUBSTRATE)
    found = advice(row)["neighbours"]
    assert found.matters is False
    assert 0.0 < (found.change or 0.0) <= 0.02
    strict = advice(row, 1e-3)["neighbours"]
    assert strict.text != found.text
    assert "neighbours" not in advice(pair(0.02))


def test_the_drift_of_a_sliding_ball_is_quoted_and_one_ball_gets_no_advice() -> None:
    scene = pair(0.02)
    ball = rough(scene).balls[0]
    ratio = math.hypot(*ball.tangential_force) / ball.normal_force / 0.3
    assert f"{100.0 * ratio:.2g} % of the sliding path (|T|/(0.3 Q))" in advice(scene)["reciprocation"].text
    assert "reciprocation" not in {
        item.effect for item in Adviser(scene, rough(scene), None, ("reciprocation",), 0.0).advise()
    }
    alone = Problem(scene.layer, scene.balls[:1], Load("approach", (0.02,)), SUBSTRATE)
    assert advice(alone) == {}


def test_plan_prints_its_advice_and_holds_it_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    said = planned(SCENES / "paper_thin_pair_linear.toml", capsys)
    assert "whether they change T by more than the usual accuracy of 2 % (finite strain by a fit" in said
    assert "% at equal force, by a fit" in said
    assert "time on one idle core: about" in said
    assert "|T| / Q = 4.35e-05: separation" in said
    assert "below 2 %: the substrate's compliance" in said
    done = planned(SCENES / "paper_thin_pair_linear.toml", capsys, as_json=True)
    items: list[dict[str, Any]] = json.loads(done)["advice"]
    assert {"finite_strain", "substrate", "sphere", "poisson", "contact size"} <= {item["effect"] for item in items}
    for item in items:
        assert item["text"] in said


def test_a_plan_without_advice_warns_first_where_small_strain_does_not_hold(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "deep.toml"
    text = TRIANGLE.replace('[finite_strain]\nlaw = "neo_hookean"\n', "").replace("unknowns = 45000\n", "")
    scene.write_text(text.replace('force = "0.5 N"', 'approach = "2 mm"'), "utf-8")
    said = planned(scene, capsys, advises=False)
    assert said.splitlines()[1].startswith("warning: the largest approach is 0.67 of the layer's thickness")
    assert "would change T" not in said
    assert "what the inputs do to T" not in said


@pytest.mark.usefixtures("hasty")
def test_a_plan_does_not_ask_for_the_finite_strain_that_the_scene_has(capsys: pytest.CaptureFixture[str]) -> None:
    said = planned(SCENES / "paper_thin_pair.toml", capsys)
    assert "finite strain changes T by" in said
    assert "add [finite_strain]" not in said
    assert "time on two idle cores (mpirun -n 2): about" in said
    assert "time on one (without mpirun): about" in said
    assert "states solved: 8" in said  # compare: two in each of four load steps


@pytest.mark.usefixtures("hasty")
def test_a_budget_that_suffices_for_solve_is_planned_where_compare_refuses_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "triangle.toml"  # compare's first load steps are light and need a finer mesh
    scene.write_text(TRIANGLE, encoding="utf-8")
    said = planned(scene, capsys)
    assert re.search(
        r"in compare: refused: \[accuracy\] unknowns: the coarsest mesh .* \d\d \d{3} unknowns, got 45 000", said
    )
    assert "by more than the required accuracy of 10 %" in said


def test_outside_the_fits_range_no_number_is_given() -> None:
    found = of_finite_strain(dataclasses.replace(pair(0.16), layer=Layer(1.0, 0.45, 1.2)))
    assert (found.change, found.error, found.matters) == (None, None, None)
    assert "the fit is for nu = 0.47 to 0.49 (here 0.45)" in found.text
    assert "`thirdbody compare` computes it" in found.text
    assert "%" not in found.text


def test_advice_writes_per_cents_without_an_exponent() -> None:
    said = of_finite_strain(pair(0.2)).text
    assert re.search(r"by \+1\d ± \d(\.\d+)? % at equal force", said), said


def test_the_advice_on_balls_that_drift_in_a_cell_is_about_these_balls_alone(tmp_path: Path) -> None:
    text = TRIANGLE.partition("[finite_strain]")[0].replace("force = ", "approach = ").replace("0.5 N", "0.3 mm")
    text += '[reciprocation]\namplitude = "50 mm"\ncycles = 5\nfriction = 0.3\n'
    alone, cell = tmp_path / "alone.toml", tmp_path / "cell.toml"
    alone.write_text(text, encoding="utf-8")
    cell.write_text(f'{text}[periodic]\nlengths = ["12 mm", "11 mm"]\n', encoding="utf-8")
    found = []
    for file in (alone, cell):
        scene = read_scene(file)
        lengths = scene.drift["periodic"].lengths if file is cell else None
        whole = dataclasses.replace(scene.problem, periodic=lengths and Periodic(lengths))
        advice, *_ = planning._advice(scene, scene.problem, scene.problem, solve(whole, 1e-3), range(3), 60.0)
        found.append([item.change for item in advice if item.effect != "periodic" and item.change is not None])
    assert found[1] == pytest.approx(found[0], rel=2e-2)
