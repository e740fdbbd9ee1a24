"""The verification study: its quick version on real elements; its tables call right and wrong by their names."""

from __future__ import annotations

import csv
import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from linear_bem.solver import solve
from runs.comparison.linear_states import LinearStates
from runs.models import Run
from runs.studies.framework.pair import PAPER_LOAD
from runs.studies.framework.saved_cases import Found, StudyFolder, pull
from runs.studies.validation.answer import cases as validation_cases
from runs.studies.verification import convergence, nine_balls, one_ball, part, routes, small_load
from runs.studies.verification.answer import PARTS, present
from tests.finite_strain.scenes import at_small_strain
from tests.launch import python

ROUNDOFF = 1e-12
ONE_LOAD = (
    "from functools import partial\n"
    "import finite_strain\n"
    "from runs.cli import main\n"
    "finite_strain.Numerics = partial(finite_strain.Numerics, more_loads=())\n"
    "main()\n"
)
"""The command line whose elements answer at the loads that are asked for alone: here these are all that is judged."""


def case_of(one: part.Part, quick: bool = False, **labels: Any) -> Any:
    return next(c for c in one.cases(quick) if all(c.labels.get(k) == v for k, v in labels.items()))


def found(*entries: tuple[Any, Mapping[str, Any]]) -> Found:
    return Found(tuple(c for c, _ in entries), {c.name: {"state": "done", **r} for c, r in entries})


def pair(depth: float, force: float, pull: float, error: float, **routes: float) -> list[dict[str, Any]]:
    """Return two balls, the left one pulled by ``pull`` towards the right one."""
    return [
        {
            "position": [side, 0.0], "radius": 1.0, "approach": depth, "normal_force": force, "contact_area": depth,
            "peak_pressure": 1.0, "tangential_force": [-side * pull, 0.0], "tangential_force_error": error,
            "tangential_force_routes": {name: [-side * value, 0.0] for name, value in routes.items()},
        }
        for side in (-1.0, 1.0)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, str]]]:
    pytest.importorskip("dolfinx")
    folder = tmp_path_factory.mktemp("verification") / "out"
    done = python("-c", ONE_LOAD, "study", "verification", "--quick", "--out", folder)
    assert done.returncode == 0, done.stderr
    assert "Not there" not in done.stdout
    assert "L = 2.1 R, nu = 0.3)" in done.stdout
    assert (folder / "verification.png").stat().st_size > 20_000
    moved = json.loads((folder / "cases" / f"{routes.APART}.json").read_text(encoding="utf-8"))
    assert moved["steps"][0]["balls"][0]["tangential_force_error"] is None  # energies alone, without small strain
    tables = {}
    for one in PARTS:
        file = folder / f"{one.name}.csv"
        if file.exists():
            with open(file, encoding="utf-8", newline="") as text:
                tables[one.name] = list(csv.DictReader(text))
    return tables


@pytest.mark.slow
def test_real_elements_meet_the_linear_model_within_their_error_bar(quick: Any) -> None:
    (row,) = quick["small-load"]
    assert row["verdict"] == "right"
    assert row["in bar"] == ""
    assert 0.0 < float(row["bar"]) < 5.0


def test_real_routes_to_the_tangential_force_agree_within_the_error_bar(quick: Any) -> None:
    (row,) = quick["routes"]
    assert row["verdict"] == "right", row
    assert 0.0 < abs(float(row["energy off"])) < 0.02


def test_real_elements_converge_to_the_linear_model(quick: Any) -> None:
    force, pull = quick["convergence"]
    assert float(force["fine"]) < 0.002
    # this T is a quarter of what T is measured against where it is near its zero
    assert float(pull["fine"]) < 0.02


def test_real_force_of_one_ball_is_the_linear_model_s(quick: Any) -> None:
    (row,) = quick["one-ball"]
    assert row["verdict"] == "right", row
    assert 0.0 < abs(float(row["off"])) < 3.0  # coarsest meshes


def test_one_ball_at_finite_strain_is_compared_where_the_other_code_has_an_answer() -> None:
    case = case_of(one_ball.PART, kind="finite")
    assert case.same_as is not None
    other = next(c for c in validation_cases(quick=False) if c.name == case.same_as[1])
    assert other.key() == case.key()
    layer = case.problem.layer
    depths = {0.05: 1.31192, 0.07: 1.4, 0.5: 2.48424 * 1.02}
    steps = [
        {
            "balls": [{"approach": d, "normal_force": factor * 16.0 / 9.0 * d**1.5}],
            "record": {"normal_force_error": [1e-3 * d**1.5]},
        }
        for d, factor in depths.items()
    ]
    rows = one_ball.rows(found((case, {"steps": steps})))
    assert layer.thickness == 1.0
    assert [(row["D"], row["verdict"]) for row in rows] == [(0.05, "right"), (0.5, "WRONG")]


@pytest.mark.parametrize(("wrong", "verdict"), [(0.0, "right"), (-0.09, "WRONG"), (0.15, "WRONG")])
def test_an_answer_whose_error_bar_is_its_difference_from_the_reference_may_be_wrong(
    wrong: float, verdict: str
) -> None:
    def step(case: Any, share: float, force: float) -> dict[str, Any]:
        ball = {"approach": share * case.problem.load.values[0], "normal_force": (1.0 + wrong) * force}
        return {"balls": [ball], "record": {"normal_force_error": [abs(wrong) * force]}}

    entries = []
    for case in one_ball.cases(quick=False)[:2]:
        depths = [share * case.problem.load.values[0] for share in case.steps or ()]
        forces = [solve(case.problem.with_load("approach", (d,))).balls[0].normal_force for d in depths]
        steps = [step(case, share, force) for share, force in zip(case.steps or (), forces, strict=True)]
        entries.append((dataclasses.replace(case, accuracy=1e-5), {"steps": steps}))
    rows = one_ball.rows(found(*entries))
    assert [row["reference"] for row in rows] == ["linear_bem", "linear_bem", "Hertz", "linear_bem"]
    assert {row["verdict"] for row in rows} == {verdict}

    case = case_of(small_load.PART, quick=True)
    steps = [{"balls": pair(0.01, PAPER_LOAD, 0.0, 0.0), "record": {"fraction": 1.0}}]
    (pressed,) = LinearStates(case.problem, None, {}).along("force", steps)["steps"]
    size, _ = pull(pressed["balls"])
    balls = pair(0.01, PAPER_LOAD, (1.0 + wrong) * size, 0.0)
    record = {"fraction": 1.0, "tangential_force_error_at_force": [abs(wrong * size)] * 2}
    (row,) = small_load.rows(found((case, {"steps": [{"balls": balls, "record": record}]})))
    assert (row["in bar"], row["verdict"]) == (None, verdict)


def test_every_case_has_a_name_and_a_part_of_its_own() -> None:
    pytest.importorskip("dolfinx")
    names = []
    for one in PARTS:
        for version in (True, False):
            cases = one.cases(version)
            names += [case.name for case in cases] if not version else []
            assert {case.labels["part"] for case in cases} <= {one.name}
    assert len(names) == len(set(names))


def test_the_parts_hold_what_the_question_asks() -> None:
    places = {(c.labels["h"], c.labels["L"], c.model) for c in small_load.cases(quick=False)}
    models = ("small_strain", "finite_strain")
    assert places == {(h, d, model) for h in (0.5, 1.16, 2.0, 6.0) for d in (2.0, 3.0) for model in models}
    assert case_of(routes.PART).problem.load.values[0] == 0.5


@pytest.mark.parametrize(("order", "verdict"), [(3.0, "right"), (6.0, "right"), (1.0, "WRONG"), (8.0, "WRONG")])
def test_an_observed_order_is_that_of_the_values(order: float, verdict: str) -> None:
    sizes = (2.0, 3.0, 4.0, 6.0)
    row = convergence.judged(sizes, [1e6 * size**-order for size in sizes])
    assert row["order"] == pytest.approx(order, abs=1e-6)
    assert row["verdict"] == verdict
    assert convergence.judged(sizes, [1e-3, -1e-3, 2e-3, 1e-3])["verdict"] == "right"  # small, if without an order


def test_two_loads_extrapolate_a_straight_line_to_no_load() -> None:
    x = np.array([0.1, 0.3])
    assert one_ball.extrapolation_weights(x) @ (1.0 + 2.0 * x) == pytest.approx(1.0, abs=ROUNDOFF)


@pytest.mark.parametrize(("strength", "verdict"), [(1.0, "right"), (1.05, "WRONG")])
def test_a_slope_of_the_energy_that_leaves_the_error_bar_is_reported(strength: float, verdict: str) -> None:
    pull = -1e-4
    level = {"fraction": 1.0, "augmented": True, "order": 3, "fineness": 1.5}
    values = {"domain": 0.995 * pull, "domain_without_pair": pull, "traction": 1.001 * pull}
    answer = {"balls": pair(0.1, 0.1, 0.995 * pull, 2e-6, **values), "record": level}

    def moved(sign: float) -> list[dict[str, Any]]:
        stored = 1.0 + sign * strength * pull * 2.0 * routes.SHIFT
        # the contact is compliant: the strain energy has less of it than the potential
        record = {**level, "strain_energy": stored - 1e-3, "potential": stored + 1e-3}
        return [{"balls": pair(0.1, 0.1, pull, 0.0), "record": record}]

    case, apart, together = routes.cases(quick=False)
    (row,) = routes.rows(
        found((case, {"steps": [answer]}), (apart, {"steps": moved(1.0)}), (together, {"steps": moved(-1.0)}))
    )
    assert row["energy off"] == pytest.approx(strength - 1.0, abs=1e-9)
    assert row["verdict"] == verdict


def test_a_stop_is_named_and_no_claim_and_so_is_what_has_not_run(tmp_path: Path) -> None:
    stopped, waiting = convergence.cases(quick=False)
    both = Found(
        (stopped, waiting), {stopped.name: {"state": "not converged", "reason": "load step to 0.9", "steps": []}}
    )
    assert convergence.rows(both) == []
    text = present(both, tmp_path)
    assert "0 right, 0 WRONG, 0 without a claim" in text
    assert "| Order of convergence | 0 of 2 | 0 | 0 | 0 |" in text
    assert both.missing() == [f"{stopped.name}: not converged: load step to 0.9", f"{waiting.name}: not run yet"]


def test_a_case_that_another_study_has_is_computed_there_alone(tmp_path: Path) -> None:
    case = case_of(one_ball.PART, kind="finite")
    assert case.same_as is not None
    for name in ("validation", "verification"):
        (tmp_path / f"study-{name}").mkdir()
    theirs = StudyFolder(tmp_path / "study-validation", "validation")
    mine = StudyFolder(tmp_path / "study-verification", "verification")
    twin = next(other for other in validation_cases(quick=False) if other.name == case.same_as[1])
    for state, known in (("running", False), ("done", True)):
        theirs.save(twin, {"state": state})
        assert (mine.record(case) is not None) == known
    assert mine.record(dataclasses.replace(case, accuracy=0.5)) is None


def test_nine_balls_by_the_law_of_pairs_meet_the_full_model_within_its_error(tmp_path: Path) -> None:
    together, by_pairs = (
        dataclasses.replace(case, problem=at_small_strain(case.problem), model="linear_bem", accuracy=1e-4)
        for case in nine_balls.cases(quick=False)
    )
    answers = [(case, case.solve(Run(case.accuracy, folder=tmp_path))) for case in (together, by_pairs)]
    steps = [(case, {"steps": [{"balls": [b.to_dict() for b in result.balls]}]}) for case, result in answers]
    rows = nine_balls.rows(found(*steps))
    assert len(rows) == 9
    assert all(row["verdict"] == "right" for row in rows)
    assert 0.01 < max(row["off"] for row in rows) < max(row["allowed"] for row in rows) < 15.0
    wrong = [dict(ball, tangential_force=[1.0, 0.0]) for ball in steps[1][1]["steps"][0]["balls"]]
    assert nine_balls.rows(found(steps[0], (by_pairs, {"steps": [{"balls": wrong}]})))[0]["verdict"] == part.WRONG
