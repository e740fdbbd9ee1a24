"""The stability study: the cases that it asks for, and its tables."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest

from finite_strain import Numerics
from finite_strain.planning.run_plan import plan_run
from runs.models import MODELS, Run
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.saved_cases import ENDED, Found
from runs.studies.stability.answer import present
from runs.studies.stability.judging import verdict
from runs.studies.stability.matrix import cases, hard_cases
from tests.runs.saved_paths import ball, path


def test_every_case_has_models_that_exist_and_checks_that_are_cases() -> None:
    names = {case.name for case in cases(quick=False)}
    assert len(names) == len(cases(quick=False))
    for hard in hard_cases():
        assert set(hard.models) <= set(MODELS)
        assert set(hard.checks) <= set(hard.models)
        for check in hard.checks.values():
            assert check.other in names
    quick = {case.name: case.labels["words"] for case in cases(quick=True)}
    assert "D = 0.022 R" in quick["usual-finite-strain"]
    assert "first load step" in quick["restart-finite-strain"]
    for case in cases(quick=True):
        check = case.labels["check"]
        assert check is None or check["other"] in {other.name for other in cases(quick=True)}


def test_the_matrix_holds_what_the_question_asks() -> None:
    hard = {h.name: h.problem for h in hard_cases()}
    assert {p.layer.poisson for p in hard.values()} >= {0.0, 0.3, 0.48, 0.4999, 0.5}
    assert min(p.layer.thickness for p in hard.values()) <= 0.1
    assert max(p.layer.thickness for p in hard.values() if p.balls[0].radius == 1.0) >= 20.0
    ratios = {p.substrate.young / p.layer.young for p in hard.values() if p.substrate is not None}
    assert min(ratios) <= 0.1
    assert max(ratios) >= 1e7
    assert any(case.stop_after for case in cases(quick=False))
    assert len({ball.radius for ball in hard["unequal"].balls}) == 2
    scaled, usual = hard["scaled"], hard["usual"]
    unit = scaled.balls[0].radius ** 2 * scaled.layer.young
    check = next(h.checks["finite_strain"] for h in hard_cases() if h.name == "scaled")
    assert check.factor == pytest.approx(unit / (usual.balls[0].radius ** 2 * usual.layer.young))


def test_bad_meshes_are_what_they_are_called() -> None:
    chosen = {c.name: c for c in cases(quick=False) if c.model == "finite_strain"}
    usual, graded = chosen["usual-finite-strain"], chosen["badly-graded-finite-strain"]
    level = Level().discretisation()

    def growth(case: Case) -> float:
        numerics = Numerics(**case.numerics)
        return plan_run(case.problem, case.accuracy, case.model, numerics=numerics).box(level).rate

    assert math.expm1(growth(graded)) == pytest.approx(2.0 * math.expm1(growth(usual)))
    coarse = chosen["coarse-finite-strain"]
    assert isinstance(coarse, LevelCase)
    assert {each.order for each in coarse.levels} == {2}
    at_once = Numerics(**chosen["one-step-finite-strain"].numerics)
    assert len(plan_run(usual.problem, 0.1, usual.model, numerics=at_once).path) == 1


def test_linear_cases_pass_the_load_steps_of_the_elements() -> None:
    case = next(c for c in cases(quick=False) if c.name == "usual-linear-bem")
    elements = next(c for c in cases(quick=False) if c.name == "usual-small-strain")
    result = case.solve(Run(1e-2, steps=case.steps))
    fractions = plan_run(elements.problem, elements.accuracy, elements.model, steps=elements.steps).goals
    assert [step.record["fraction"] for step in result.steps] == list(fractions)
    assert result.steps[-1].balls == result.balls
    assert [step.balls[0].approach for step in result.steps] == pytest.approx([0.1 * f for f in fractions])
    assert case.key() != dataclasses.replace(case, steps=(1.0,)).key()


@pytest.mark.parametrize(("off", "ended"), [(0.09, "right"), (0.11, "WRONG")])
def test_small_strain_is_wrong_beyond_its_tolerance_though_within_its_error_bar(off: float, ended: str) -> None:
    (case,) = (c for c in cases(quick=False) if c.name == "usual-small-strain")
    pulls = {"usual-small-strain": (1e-3, off * 1e-3), "usual-linear-bem": ((1.0 - off) * 1e-3, 1e-9)}
    records = {
        name: {"state": "done", "steps": [{"balls": [ball(0.1, 0.1, pull=-pull, error=error)], "record": {}}]}
        for name, (pull, error) in pulls.items()
    }
    assert verdict(Found((case,), records), case.name, case.labels)[0] == ended


def test_the_table_counts_how_cases_ended(tmp_path: Path) -> None:
    chosen = [c for c in cases(quick=False) if c.labels["case"] in ("usual", "deepest")]
    chosen = [dataclasses.replace(c, labels={**c.labels, "check": None}) for c in chosen]
    records: dict[str, dict[str, Any]] = {
        "usual-finite-strain": {"state": "done", "steps": path(1.5, 0.01, 0.03, 0.1, iterations=5, cuts=0)},
        "deepest-finite-strain": {"state": "refused", "reason": "too deep", "steps": []},
    }
    both = Found(tuple(chosen), records)
    text = present(both, tmp_path)
    assert "1 right" in text
    assert "1 refused with a reason" in text
    assert "4 not run yet" in text
    assert "| too deep |" in text
    with open(tmp_path / "stability.csv", encoding="utf-8") as file:
        row = next(csv.DictReader(file))
    assert (float(row["T"]), float(row["error of T"])) == (-1e-3, 1e-5)
    assert not [s for s in both.missing(ENDED) if s.startswith("deepest-finite")]


def test_a_step_whose_errors_are_unknown_has_none_in_the_table(tmp_path: Path) -> None:
    (case,) = (c for c in cases(quick=False) if c.name == "usual-finite-strain")
    case = dataclasses.replace(case, labels={**case.labels, "check": None})
    steps = path(1.5, 0.01, 0.03, 0.1, iterations=5, cuts=0)
    steps[-1]["balls"] = [ball(0.1, 0.1**1.5, error=None)] * 2
    present(Found((case,), {case.name: {"state": "done", "steps": steps}}), tmp_path)
    with open(tmp_path / "stability.csv", encoding="utf-8") as file:
        assert next(csv.DictReader(file))["error of T [%]"] == ""
