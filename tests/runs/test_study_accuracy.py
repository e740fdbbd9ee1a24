"""The accuracy study: parameters that exist, errors against the right reference, the Pareto front, the advice."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import finite_strain
import linear_bem
from finite_strain import Numerics
from finite_strain.planning.run_plan import plan_run
from runs.display.style import panels
from runs.models import Run
from runs.studies.accuracy import answer, picture
from runs.studies.accuracy.answer import DEFAULTS, advice, measured, present
from runs.studies.accuracy.matrix import OWN, PARAMETERS, REFERENCES, TRUE, USUAL_CASE, cases
from runs.studies.accuracy.picture import front
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import pair
from runs.studies.framework.saved_cases import Found
from tests.launch import ROOT

TRUTH = -2e-4


def record(force: float, seconds: float, error: float = 1e-6) -> dict[str, Any]:
    ball = {"tangential_force": [force, 0.0], "tangential_force_error": error, "approach": 0.1, "radius": 1.0}
    return {
        "state": "done", "steps": [{"balls": [ball], "record": {"fraction": 1.0}}],
        "cpu_seconds": seconds, "wall_seconds": seconds, "ranks": 2,
        "solved": {"iterations": 3, "unknowns": 100, "seconds": seconds},
    }  # fmt: skip


@pytest.fixture
def found() -> Found:
    estimates = {"point-load": 0.2, "linear-bem-reference": 1e-8}
    errors = {
        "finite-strain-reference": (0.0, 900.0), "finite-strain-0.1": (0.05, 10.0),
        "finite-strain-0.02": (0.004, 100.0), "finite-strain-0.005": (0.06, 140.0), "parameter-usual": (0.05, 10.0),
        "parameter-2-4": (0.05 * 1.001, 15.0),
        "linear-bem-reference": (0.08, 0.3), "linear-bem-0.01": (0.081, 0.02), "linear-bem-0.0001": (0.08, 0.1),
        "point-load": (0.3, 1e-4), "small-strain-0.1": (0.0832, 12.0),
    }  # fmt: skip
    records = {
        name: record(TRUTH * (1 + e), s, estimates.get(name, 3e-3) * abs(TRUTH)) for name, (e, s) in errors.items()
    }
    return Found(tuple(cases(quick=False)), records)


def test_every_parameter_is_there_to_be_turned() -> None:
    for case in cases(quick=False):
        Numerics(**case.numerics)  # refuses what is none of its fields


def test_cases_on_grids_are_solved_by_another_discretisation() -> None:
    named = {case.name: case for case in cases(quick=False)}
    one, other = (named[f"linear-bem{way}-0.1"].solve(Run(0.1)).solved.unknowns for way in ("-grids", ""))
    assert one > 10 * other


def test_the_parameter_of_the_load_steps_makes_fewer_or_more_of_them() -> None:
    def steps(numerics: Numerics) -> int:
        return len(plan_run(pair(0.1), 0.1, "finite_strain", numerics=numerics).path)

    counts = []
    for turned in PARAMETERS["largest load step of the path over the radius (0.07)"].values():
        counts.append(steps(Numerics(**turned["numerics"])))
    assert counts == [3, 1]
    assert steps(Numerics(more_loads=())) == 2


def test_every_parameter_is_away_from_the_default_that_its_name_holds() -> None:
    usual = next(case for case in cases(quick=False) if case.name == USUAL_CASE)
    assert isinstance(usual, LevelCase)
    for parameter, values in PARAMETERS.items():
        default = parameter.rsplit("(", 1)[1].rstrip(")")
        assert default not in values
        assert all(turned not in ({"levels": (Level(),)}, {"numerics": {}}) for turned in values.values())
    turned = [case for case in cases(quick=False) if case.labels["parameter"] in PARAMETERS]
    assert len(turned) == sum(len(values) for values in PARAMETERS.values())
    assert len({case.key() for case in [*turned, usual]}) == len(turned) + 1


def test_what_is_asked_for_by_default_is_among_the_cases() -> None:
    by_name = {case.name: case for case in cases(quick=False)}
    assert {by_name[name].accuracy for name in DEFAULTS if "strain" in name} == {finite_strain.DEFAULT_ACCURACY}
    linear = inspect.signature(linear_bem.solve).parameters["accuracy"].default
    assert {by_name[name].accuracy for name in DEFAULTS if "strain" not in name} == {linear}


def test_errors_are_within_the_model_and_against_finite_strain(found: Found) -> None:
    rows = {row["case"]: row for row in measured(found)}
    assert len(rows) == 11
    assert rows["linear-bem-0.01"][TRUE] == pytest.approx(0.081)
    assert rows["linear-bem-0.01"][OWN] == pytest.approx(1.081 / 1.08 - 1.0)
    assert rows["linear-bem-reference"][OWN] is None
    assert rows["finite-strain-reference"][TRUE] is None
    assert rows["finite-strain-0.02"][OWN] == rows["finite-strain-0.02"][TRUE]
    assert rows["point-load"][OWN] == pytest.approx(1.3 / 1.08 - 1.0)
    lone = Found(found.cases, {"point-load": found.records["point-load"]})
    assert measured(lone)[0][TRUE] is None


def test_the_front_holds_what_nothing_beats(found: Found) -> None:
    best = [row["case"] for row in front(measured(found), TRUE)]
    assert best == [
        "point-load",
        "linear-bem-0.01",
        "linear-bem-0.0001",
        "finite-strain-0.1",
        "finite-strain-0.02",
    ]


def test_the_cheapest_way_to_each_error_is_advised(found: Found) -> None:
    found_for = {row["for"]: row for row in advice(measured(found), TRUE)}
    assert found_for["10 %"]["use"] == "linear_bem, accuracy asked 0.01"
    assert found_for["1 %"]["use"] == "finite_strain, accuracy asked 0.02"
    assert found_for["0.1 %"]["use"] == "no case is known to reach it"


def test_an_error_that_is_small_by_chance_is_not_advised(found: Found) -> None:
    rows = measured(found)
    lucky = [dict(row, **{TRUE: 1e-6}) if row["case"] == "point-load" else row for row in rows]
    found_for = {row["for"]: row["use"] for row in advice(lucky, TRUE)}
    assert found_for["10 %"] == "linear_bem, accuracy asked 0.01"  # point_load itself claims no better than 20 %
    unknown = [dict(row, **{f"{TRUE}, known to": 0.05}) for row in rows]
    assert {row["for"]: row["use"] for row in advice(unknown, TRUE)}["1 %"] == "no case is known to reach it"


def test_the_answer_is_made_from_what_is_there(found: Found, tmp_path: Path) -> None:
    text = present(found, tmp_path)
    assert "finite_strain, accuracy asked 0.02" in text
    assert "1 min 40 s" in text
    assert (tmp_path / "pareto.svg").stat().st_size > 5_000
    assert "no rows yet" in present(Found(found.cases, {}), tmp_path)
    without = {name: record for name, record in found.records.items() if name != "finite-strain-reference"}
    assert "linear_bem" in present(Found(found.cases, without), tmp_path)  # and no empty picture fails


def test_an_estimate_that_is_the_difference_from_the_reference_is_not_judged_by_it(
    found: Found, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(answer, "draw", lambda rows, folder: None)
    said = "have an error above their own"
    assert said in present(found, tmp_path)
    lone = {name: found.records[name] for name in ("small-strain-0.1", "linear-bem-reference")}
    assert said not in present(Found(found.cases, lone), tmp_path)


def test_labels_cover_no_whisker_no_point_and_no_other_label() -> None:
    rows = [{"value": value} for value in (0.1, 0.02, 0.005, 0.001)]
    places = [2.0, 2.1, 8.0, 11.0], [5e-3, 5e-3, 2.3e-4, 2.8e-4]
    labels = picture._labels(rows, *places)
    assert [text for text, _, _ in labels] == ["0.1 to 0.02", "0.005", "0.001"]
    figure, (axis,) = panels(5.0)
    axis.set(xscale="log", yscale="log", xlim=(0.5, 100.0), ylim=(1e-5, 1e-1))
    axis.plot(*places, "o")
    axis.plot([11.0, 11.0], [2.8e-4, 2e-3])  # a whisker
    for text, x, y in labels:
        axis.annotate(text, (x, y), picture.SIDES[0], textcoords="offset points", va="center", fontsize=8)
    figure.draw_without_rendering()
    picture.move_labels(axis)
    boxes = [text.get_window_extent() for text in axis.texts]
    whisker = axis.transData.transform([(11.0, 10.0**power) for power in np.linspace(-3.5, -2.7, 50)])
    points = axis.transData.transform(np.transpose(places))
    for i, box in enumerate(boxes):
        assert box.count_contains(np.vstack([whisker, points])) == 0
        assert box.count_overlaps(boxes[:i]) == 0


def test_every_model_is_measured_against_a_reference_that_is_a_case() -> None:
    for quick in (True, False):
        names = [case.name for case in cases(quick)]
        assert len(set(names)) == len(names)
        assert {REFERENCES[case.model] for case in cases(quick)} <= set(names)
        assert {case.model for case in cases(quick)} == set(REFERENCES)
    together = [case.name for case in cases(quick=False) if case.parallel and not case.alone]
    assert together == ["finite-strain-all-ranks"]  # the last: a part of the study that two ranks take alone
    assert cases(quick=False)[-1].name == together[0]
    count = len(cases(quick=False))
    assert f"--shard {count}/{count}`" in (ROOT / "runs/studies/accuracy/README.md").read_text(encoding="utf-8")


def test_a_parameter_is_judged_by_how_it_moves_the_answer_of_one_mesh(found: Found, tmp_path: Path) -> None:
    text = present(found, tmp_path)
    assert USUAL_CASE in found.records
    row = next(line for line in text.splitlines() if line.startswith("| penalty") and " 4 |" in line)
    moved, _, longer = (cell.strip() for cell in row.strip("|").split("|")[2:])
    assert float(moved) == pytest.approx(0.05 * 0.001 / 1.05, rel=1e-3)
    assert float(longer) == pytest.approx(1.5)
