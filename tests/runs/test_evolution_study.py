"""The study of the experiments: what a run must show for each report, with cases enough to tell."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from linear_bem import Load, Result, solve
from linear_bem.result import Solved, Step
from runs import studies
from runs.evolution import evolving, pair_table, showing
from runs.evolution.providers import provider
from runs.models import MODELS, choose, standing
from runs.scene.scene_file import read_scene
from runs.studies.experiments import answer, cases, points, side_by_side

NAMES = {"line of four, 25 mm", "line of four, 30 mm", "pair, 16 mm balls", "pair, 10 mm balls", "pair, 7 mm balls"}


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "CASES", tuple(case for case in cases.CASES if case.name in NAMES))
        patch.setattr(cases, "QUICK_ENSEMBLE", 2)
        patch.setattr(cases, "TABLES", folder / "tables")
        patch.setattr(evolving, "TABLES", folder / "tables")
        patch.setattr(pair_table, "MANY", pair_table.FEW[::2])
        patch.setattr(showing, "draw", lambda *given: None)  # the pictures of single runs: test_evolution_command.py
        studies.run_study("experiments", studies.Options(quick=True, out=folder / "out"))
    return folder / "out"


@pytest.fixture(scope="module")
def documents(out: Path) -> dict[str, Any]:
    found = {}
    for case in cases.CASES:
        stem = case.name.replace(", ", "-").replace(" ", "_")
        file = out / f"{stem}-linear_bem" / "result.json"
        if case.name in NAMES:
            found[case.name] = json.loads(file.read_text(encoding="utf-8"))
    return found


def point(title: str) -> points.Point:
    return next(p for p in points.POINTS if p.title.startswith(title))


@pytest.mark.parametrize(
    ("title", "verdict"),
    [
        ("edge balls carry", None),
        ("a wider line", points.YES),
        ("four balls", points.YES),
        ("16 mm balls separate", points.YES),
        ("they stay there", points.NO),
        ("10 mm and 7 mm", points.YES),
        ("nine balls", None),
    ],
)
def test_the_reports_of_these_observations(title: str, verdict: str | None, documents: dict[str, Any]) -> None:
    found = answer.findings(point(title), documents)
    assert (found.verdict if found else None) == verdict


def test_a_verdict_turns_with_what_the_runs_show(documents: dict[str, Any]) -> None:
    swapped = {
        **documents,
        "line of four, 25 mm": documents["line of four, 30 mm"],
        "line of four, 30 mm": documents["line of four, 25 mm"],
        "pair, 16 mm balls": documents["pair, 10 mm balls"],
        "pair, 10 mm balls": documents["pair, 16 mm balls"],
    }
    for title in ("a wider line", "16 mm balls separate", "10 mm and 7 mm"):
        found = answer.findings(point(title), swapped)
        assert found is not None
        assert found.verdict == points.NO, title


def test_the_answer_names_verdicts_errors_and_missing_tables(out: Path) -> None:
    text = (out / "answer.md").read_text(encoding="utf-8")
    assert "reproduces" in text.splitlines()[0]
    assert text.count("| no table yet |") == len(points.POINTS)
    assert "mpirun -n 2 thirdbody evolve runs/scenes/experiment_pair_16mm_finite_strain.toml" in text
    assert "bare sum of pairs" in text
    assert "Forces side by side" not in text
    assert (out / "experiments.svg").stat().st_size > 10_000
    with open(out / "experiments.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["case"] for row in rows} == NAMES
    assert {row["first_pairs"].split()[0] for row in rows if row["case"].startswith("line")} <= {"0-1", "2-3"}


def test_the_answer_states_additivity_for_every_material_of_balls_of_one_size(documents: dict[str, Any]) -> None:
    foam = documents["line of four, 25 mm"]
    identity = foam["pair_table"]["identity"]
    other = {**identity, "layer": {**identity["layer"], "poisson": 0.45}}
    twin = {**foam, "pair_table": {**foam["pair_table"], "identity": other}}
    text = answer.answer({"linear_bem": {"foam": foam, "twin": twin}, "finite_strain": {}}, {}, [], "", {})
    assert [f"R = 10 mm, nu = {nu}: three in a line" in text for nu in ("0.3", "0.45")] == [True, True]


def test_a_finite_strain_table_is_used_where_it_exists(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The linear model with a stronger T replaces the finite elements: this is about the table."""
    asked: list[int] = []

    def stand_in(problem: Any, run: Any) -> Result:
        asked.append(problem.size)
        path = []
        for share in (0.1, 0.2, 0.4, 0.7, 1.0) if problem.size == 1 else (1.0,):
            values = tuple(share * v for v in problem.load.values)
            linear = dataclasses.replace(problem, finite_strain=None, load=Load("approach", values))
            balls = solve(linear, accuracy=1e-2).balls
            strong = [
                dataclasses.replace(b, tangential_force=(1.25 * b.tangential_force[0], 1.25 * b.tangential_force[1]))
                for b in balls
            ]
            path.append(Step(tuple(strong)))
        return Result("finite_strain", path[-1].balls, Solved(True, 1, 1, 0.0), tuple(path))

    monkeypatch.setitem(MODELS, "finite_strain", dataclasses.replace(MODELS["finite_strain"], solve=stand_in))
    monkeypatch.setattr(cases, "TABLES", tmp_path)
    monkeypatch.setattr(pair_table, "FEW", pair_table.FEW[::3])
    monkeypatch.setattr(pair_table, "MANY", pair_table.FEW)
    case = next(case for case in cases.CASES if case.name == "pair, 16 mm balls")
    scene = case.read(quick=True)
    assert [model for model, _ in cases.runs_of(case, quick=True)] == ["linear_bem"]
    written = read_scene(cases.SCENES / f"experiment_{case.finite}.toml")
    model, problem, _ = choose(standing(written))
    assert model.name == "finite_strain"
    provider(model, problem, written.tangential_force, "pairs", tmp_path)
    assert asked == [1, *[2] * len(pair_table.FEW), 3, 4]
    # the table that the shipped scene makes is the one that the study looks for
    assert [model for model, _ in cases.runs_of(case, quick=True)] == ["linear_bem", "finite_strain"]
    given = provider(model, problem, written.tangential_force, "pairs", tmp_path)
    assert len(asked) == 3 + len(pair_table.FEW)
    x = np.array([ball.position for ball in problem.balls])
    linear = solve(dataclasses.replace(problem, finite_strain=None), accuracy=1e-3).balls[0]
    state = given.forces(x)
    assert state.tangential[0, 0] == pytest.approx(1.25 * linear.tangential_force[0], rel=1e-3)
    # side by side: four fifths of the elements' T, the same Q, and no change of sign in either
    small = standing(scene)
    assert side_by_side.comparisons() == []
    provider(MODELS["linear_bem"], small.problem, small.tangential_force, "pairs", tmp_path)
    (compared,) = side_by_side.comparisons()
    assert compared.strength == pytest.approx((1.25,) * len(side_by_side.PLACES), rel=0.02)
    assert compared.load == pytest.approx((1.0,) * len(side_by_side.PLACES), rel=1e-3)
    assert compared.finite[0] == pytest.approx(state.tangential[0, 0] / state.normal[0], rel=1e-6)
    assert compared.rests == [[], []]
    assert "(1.25)" in side_by_side.forces([compared])[0]["L = 1 L0"]
    assert "(+25 %), Q +0 %" in side_by_side.sentence(compared)
    # beyond the table it follows the linear decay
    far = np.array([[0.0, 0.0], [0.07, 0.0]])
    weak = spread(problem, far)
    assert given.forces(far).tangential[0, 0] == pytest.approx(1.25 * weak, rel=0.03)


def test_thousands_of_cycles_are_written_in_full() -> None:
    members = [{"cycles_one_group": 2061.0, "positions": [[0.0, 0.0]] * 7, "contacts": 11}]
    document = {"ensemble": members, "path": [{"positions": [[0.0, 0.0], [0.06, 0.0]]}]}
    (row,) = side_by_side.outcomes({"seven": document}, {"seven": document})
    assert row["cycles to one group (median)"] == "2060 / 2060"
    bent = [
        {"cycle": cycle, "positions": [[0.0, 0.0], [0.02, 0.01], [0.04, y], [0.06, 0.0]], "contacts": touch}
        for cycle, y, touch in ((0.0, 0.03, []), (1004.0, 0.02, [(1, 2)]))
    ]
    (bends,) = (point for point in points.POINTS if point.title.startswith("the line bends"))
    assert bends.judge({points.SEVENS[0]: {"path": bent}}).numbers.endswith("in 1000 cycles")


def spread(problem: Any, x: Any) -> float:
    linear = dataclasses.replace(problem.at(x), finite_strain=None)
    return solve(linear, accuracy=1e-3).balls[0].tangential_force[0]


def test_the_experiments_are_the_papers() -> None:
    names = {path.stem.removeprefix("experiment_") for path in cases.SCENES.glob("experiment_*.toml")}
    thick = {"line_of_four_25mm", "line_of_four_30mm", "line_of_six", "line_of_seven", "nine_20mm", "nine_30mm"}
    thin = {"pair_16mm", "pair_10mm", "pair_7mm"}
    assert thick | thin <= names
    for name in thick:
        scene = read_scene(cases.SCENES / f"experiment_{name}.toml")
        assert scene.problem.layer.thickness == pytest.approx(0.08)
        assert scene.problem.layer.young == pytest.approx(57.4e3)
        assert {ball.radius for ball in scene.problem.balls} == {0.01}
        assert set(scene.problem.load.values) == {0.012}
    for name in thin:
        scene = read_scene(cases.SCENES / f"experiment_{name}.toml")
        radius = 0.5e-3 * int(name.split("_")[1].removesuffix("mm"))
        assert scene.problem.layer.thickness == pytest.approx(0.01)
        assert scene.problem.load.values == pytest.approx((1.5e-3, 1.5e-3))
        assert np.ptp([ball.position[0] for ball in scene.problem.balls]) == pytest.approx(2.0 * radius)
