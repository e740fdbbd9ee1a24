"""The strengthening study's arithmetic: factors, ladder, slopes, fits, sign changes, and the sentence they make."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from linear_bem import Problem, solve
from runs.studies.framework.pair import THICK, THIN
from runs.studies.framework.saved_cases import Found
from runs.studies.strengthening import fitting, ratios
from runs.studies.strengthening.answer import present
from runs.studies.strengthening.matrix import cases


def small_strain(problem: Problem) -> Problem:
    return dataclasses.replace(problem, finite_strain=None)


def rows(*points: tuple[float, float, float]) -> list[dict[str, Any]]:
    return [{"D": d, "Q": d**1.5, "a": math.sqrt(d), "S_Q": s, "S_Q_error": e} for d, s, e in points]


def test_factors_follow_a_case_that_is_answered_again_and_the_code_behind_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, *_ = cases(quick=True)
    monkeypatch.setattr(ratios, "_rows", lambda _, steps: [{"of": steps}])
    for pull, force, error in ((1.0, 1.0, 0.1), (1.0, 1.0, 0.1), (2.0, 1.0, 0.1), (2.0, 3.0, 0.1), (2.0, 3.0, 0.2)):
        balls = [{"tangential_force": [pull, 0.0], "tangential_force_error": 0.1, "normal_force": force}]
        steps = [{"balls": balls, "record": {"tangential_force_error_at_force": [error]}}]
        found = Found((case,), {case.name: {"steps": steps}})
        assert ratios.load_paths(found, tmp_path) == [(case, [{"of": steps}])]
    monkeypatch.setattr(ratios, "_rows", lambda *_: [{"of": "other code"}])
    assert ratios.load_paths(found, tmp_path) == [(case, [{"of": steps}])]
    monkeypatch.setattr(ratios, "code_of", lambda *_: "another")
    assert ratios.load_paths(found, tmp_path) == [(case, [{"of": "other code"}])]


def test_every_case_has_a_name_of_its_own_and_a_curve_enough_small_loads_for_its_slope() -> None:
    for quick in (True, False):
        every = cases(quick)
        assert len({case.name for case in every}) == len(every)
        for case in every:
            assert case.steps is not None
            deepest = case.problem.load.values[0]
            small = [step for step in case.steps if step * deepest <= fitting.SMALL_LOAD]
            assert len(small) >= 3 or case.labels["group"] in ("deeper",)
            assert case.steps[-1] == 1.0


def test_the_matrix_holds_what_the_question_asks() -> None:
    labels = [case.labels for case in cases(quick=False)]
    assert {label["L"] for label in labels} == {2.0, 3.0, 4.0, 6.0}
    assert {label["nu"] for label in labels} == {0.3, 0.4, 0.48, 0.4999}
    assert {label["shape"] for label in labels} == {"sphere", "paraboloid"}
    deepest = {c.labels["h"]: max(c.problem.load.values) for c in cases(quick=False) if c.labels["group"] == "headline"}
    assert min(deepest[THIN], deepest[THICK]) >= 0.5


def test_a_fit_finds_the_coefficients_and_says_how_sure_they_are() -> None:
    depths = np.array([0.01, 0.02, 0.03, 0.05, 0.07, 0.2, 0.4])
    exact = rows(*((d, 1.0 - 0.2 * math.sqrt(d) + 1.1 * d, 0.01) for d in depths))
    found = fitting.fit(fitting.points(exact, "sqrt(D/R)", THIN), "sqrt(D/R)", 2)
    assert found is not None
    assert found.coefficients == pytest.approx((-0.2, 1.1), rel=1e-9)
    assert found.misfit < 1e-12
    assert found(0.5) == pytest.approx(1.0 - 0.1 + 0.275)
    assert "1 -0.200 x +1.100 x^2" in found.formula()
    slope = fitting.initial_slope(exact, "sqrt(D/R)", THIN)
    sharper = fitting.initial_slope([row | {"S_Q_error": 1e-4} for row in exact], "sqrt(D/R)", THIN)
    assert slope is not None
    assert sharper is not None
    assert slope.greatest <= math.sqrt(fitting.SMALL_LOAD)
    assert slope.errors[0] == pytest.approx(100.0 * sharper.errors[0], rel=1e-9)
    assert abs(sharper.coefficients[0]) > sharper.errors[0]
    assert fitting.initial_slope(exact[:2], "sqrt(D/R)", THIN) is None


def test_the_simplest_fit_through_all_error_bars_is_taken() -> None:
    def curve(error: float) -> list[tuple[float, float, float]]:
        return [(x, 1.0 + 0.1 * x + x**2 + 3.0 * x**4, error) for x in np.linspace(0.1, 0.7, 12)]

    rough, sharp = (fitting.simplest(curve(error), "sqrt(D/R)") for error in (0.2, 1e-6))
    assert rough is not None
    assert sharp is not None
    assert len(rough.coefficients) == 2
    assert sharp.coefficients == pytest.approx((0.1, 1.0, 0.0, 3.0), abs=1e-6)
    assert fitting.simplest(curve(0.1)[:2], "sqrt(D/R)") is None


def test_the_measure_that_makes_curves_one_is_found() -> None:
    def curve(h: float) -> list[dict[str, Any]]:
        return rows(*((d, 1.0 + 0.9 * d / h, 0.01) for d in (0.02, 0.05, 0.1, 0.2, 0.4)))

    best, *others = fitting.collapse({"thin": (curve(1.16), 1.16), "thick": (curve(6.0), 6.0)})
    assert best.variable == "sqrt(D/h)"
    assert best.misfit < 1e-9 < others[-1].misfit


def test_curves_are_read_between_their_points_and_not_beyond() -> None:
    path = rows((0.04, 1.1, 0.01), (0.16, 1.2, 0.03))  # 1 + sqrt(D) / 2
    assert fitting.at_depth(path, 0.09) == pytest.approx((1.15, 0.02))
    assert fitting.at_depth(path, 0.04) == pytest.approx((1.1, 0.01))
    assert fitting.at_depth(path, 0.2) is None
    assert fitting.at_depth(path, 0.16**1.5, measure="Q") == pytest.approx((1.2, 0.03))


def test_the_load_of_a_sign_change_is_interpolated() -> None:
    path = [{"D": d, "Q": 2.0, "T": 4.0 * (0.3 - d)} for d in (0.1, 0.2, 0.4)]
    assert fitting.sign_change(path, "T") == pytest.approx(0.3)
    assert fitting.sign_change(path[:2], "T") is None


def test_the_sentence_says_stronger_weaker_or_undecided(tmp_path: Path) -> None:
    def record(ratio: float, case: Any) -> dict[str, Any]:
        balls = []
        for ball in solve(small_strain(case.problem)).balls:
            state = ball.to_dict()
            state["tangential_force"] = [ratio * t for t in state["tangential_force"]]
            state["tangential_force_error"] = 0.01 * abs(state["tangential_force"][0])
            balls.append(state)
        return {"state": "done", "steps": [{"balls": balls, "record": {}}]}

    chosen = [
        dataclasses.replace(c, problem=c.problem.with_load("approach", (0.02, 0.02)))
        for c in cases(quick=False)
        if c.labels["group"] in ("headline", "distance")
    ][:4]
    found = Found(tuple(chosen), {c.name: record(s, c) for c, s in zip(chosen, (1.2, 0.9, 1.001, 1.3), strict=True)})
    text = present(found, tmp_path)
    assert "**stronger** in 2 case(s): h = 1.16 R, L = 2 R, nu = 0.48: 1.200" in text
    assert "**weaker** in 1 case(s): h = 6 R, L = 2 R, nu = 0.48: 0.900" in text
    assert "**within its error bar of 1** in 1 case(s): h = 1.16 R, L = 3 R" in text
    assert "**of the other sign than at small strain** in 0 case(s)" in text
    assert "for h = 1.16 R from D = 0.02 R on; for h = 6 R at no load up to D = 0.02 R" in text
