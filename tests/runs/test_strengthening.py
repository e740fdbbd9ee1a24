"""Strengthening factors: their sign, their error, when there is none, and the sentence that answers."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from linear_bem import Ball, Layer, Load, Problem
from linear_bem.result import BallResult, Result, Solved
from runs.comparison.linear_states import LinearStates, accuracy_beside
from runs.comparison.strengthening_factors import answer, compare_steps, strengthening
from runs.display.numbers import (
    Scale,
    attraction,
    line_of,
    percent,
    short_number,
    with_error,
    with_error_in_parentheses,
)
from runs.display.rows import compared_ball_rows, comparison_rows, may_turn
from runs.models import MODELS, Run

SCALE = Scale(1.0, 1.0)


def ball(x: float, force: tuple[float, float], error: float = 0.0, approach: float = 0.3) -> dict[str, Any]:
    return {
        "position": [x, 0.0], "radius": 1.0, "approach": approach, "normal_force": 0.1,
        "tangential_force": list(force), "tangential_force_error": error,
    }  # fmt: skip


def step(*balls: dict[str, Any]) -> dict[str, Any]:
    return {"balls": list(balls), "record": {}}


def pair(force: float, error: float = 0.0) -> dict[str, Any]:
    return step(ball(-1.0, (force, 0.0), error), ball(1.0, (-force, 0.0), error))


def test_the_factor_is_signed_along_the_linear_force() -> None:
    assert strengthening(ball(0, (3.0, 0.0)), ball(0, (2.0, 0.0)))[0] == pytest.approx(1.5)
    assert strengthening(ball(0, (-3.0, 0.0)), ball(0, (2.0, 0.0)))[0] == pytest.approx(-1.5)
    assert strengthening(ball(0, (1.0, 5.0)), ball(0, (0.0, 2.0)))[0] == pytest.approx(2.5)


def test_every_ball_of_three_is_listed_with_the_turn_of_its_force() -> None:
    linear, finite = ((2.0, 0.0), (0.0, 0.0), (0.0, -1.0)), ((0.0, 3.0), (1e-12, 1.0), (1.0, -1.0))
    states = [[step(*(ball(x - 1.0, f, 0.1) for x, f in enumerate(forces)))] for forces in (finite, linear, linear)]
    rows = compared_ball_rows(compare_steps(*states), SCALE)
    assert [row["ball"] for row in rows] == [0, 1, 2]
    # errors: 0.1 of forces of 2 and 3
    assert rows[0]["turned [\u00b0]"] == pytest.approx((90.0, math.degrees(0.1 / 2.0 + 0.1 / 3.0)))
    assert rows[0]["|T| ratio"] == pytest.approx((1.5, 1.5 * (0.1 / 2.0 + 0.1 / 3.0)))
    assert rows[0]["S_Q"][0] == 0.0
    assert rows[1]["|T| finite / E R\u00b2"] == (1.0, 0.1)
    assert rows[1]["|T| ratio"] == rows[1]["turned [\u00b0]"] == (None, None)  # no force in the linear model
    assert rows[2]["turned [\u00b0]"][0] == pytest.approx(45.0)
    assert rows[2]["|T| ratio"][0] == pytest.approx(math.sqrt(2.0))
    unknown = {**compare_steps(*states)[0], "tangential_linear": [None, None], "strengthening_at_force": None}
    assert compared_ball_rows([unknown], SCALE)[0]["|T| linear / E R\u00b2"] is None


def test_the_ratio_of_lengths_is_as_certain_as_the_factor_at_the_same_force() -> None:
    finite, linear = step(ball(0.0, (3.0, 0.0), 0.3)), step(ball(0.0, (2.0, 0.0), 0.02))
    finite["record"]["tangential_force_error_at_force"] = [0.03]
    (row,) = compared_ball_rows(compare_steps([finite], [linear], [linear]), SCALE)
    assert row["|T| ratio"] == pytest.approx((1.5, 0.015 + 1.5 * 0.01))
    assert row["S_Q"] == pytest.approx(row["|T| ratio"])


def test_two_balls_are_listed_only_if_a_force_turns_beyond_its_error() -> None:
    def of_pair(y: float) -> bool:
        finite, linear = (step(ball(-1.0, (2.0, v), 0.1), ball(1.0, (-2.0, -v), 0.1)) for v in (y, 0.0))
        return may_turn(compared_ball_rows(compare_steps([finite], [linear], [linear]), SCALE))

    assert [of_pair(y) for y in (0.0, 0.1, 0.4)] == [False, False, True]


def test_relative_errors_of_both_models_add() -> None:
    ratio, error, note = strengthening(ball(0, (3.0, 0.0), 0.03), ball(0, (2.0, 0.0), 0.04))
    assert ratio == pytest.approx(1.5)
    assert error == pytest.approx(1.5 * (0.03 / 3.0 + 0.04 / 2.0))
    assert note is None


def test_the_error_stays_finite_where_the_finite_force_vanishes() -> None:
    ratio, error, _ = strengthening(ball(0, (0.0, 0.0), 0.1), ball(0, (2.0, 0.0), 0.04))
    assert ratio == 0.0
    assert error == pytest.approx(0.05)


def test_no_factor_where_the_linear_force_is_below_its_error() -> None:
    ratio, error, note = strengthening(ball(0, (3.0, 0.0)), ball(0, (1e-3, 0.0), 2e-3))
    assert ratio is None
    assert error is None
    assert note is not None
    assert "below its own error" in note
    assert strengthening(ball(0, (3.0, 0.0)), ball(0, (0.0, 0.0), 0.0))[0] is None


def test_the_middle_ball_of_three_gets_no_factor_from_roundoff() -> None:
    row = step(ball(-2.0, (1.0, 0.0)), ball(0.0, (1e-15, 0.0)), ball(2.0, (-1.0, 0.0)))
    rows = compare_steps([row], [row], [row])
    assert [r["strengthening_at_force"] for r in rows] == [pytest.approx(1.0), None, pytest.approx(1.0)]


def test_rows_carry_both_ratios_per_step_and_ball() -> None:
    rows = compare_steps([pair(-3e-3, 3e-5)], [pair(-2e-3)], [pair(-1.5e-3)])
    assert [(row["step"], row["ball"]) for row in rows] == [(1, 0), (1, 1)]
    assert rows[0]["strengthening_at_force"] == pytest.approx(1.5)
    assert rows[1]["strengthening_at_approach"] == pytest.approx(2.0)
    assert rows[0]["strengthening_at_force_error"] == pytest.approx(1.5e-2)
    assert rows[0]["tangential_ratio"] == pytest.approx(-3e-2)
    assert rows[1]["tangential_ratio"] == pytest.approx(-3e-2)
    assert rows[1]["approach_error"] == rows[1]["normal_force_error"] == 0.0  # nothing is recorded
    assert rows[0]["note"] is None


def test_an_unsure_approach_is_in_the_row_and_three_times_in_the_ratio_at_equal_approach() -> None:
    finite = pair(-3e-3, 3e-5)
    finite["record"]["approach_error"] = [0.015, 0.0]  # 5 % of the first ball's
    rows = compare_steps([finite], [pair(-2e-3)], [pair(-1.5e-3)])
    assert [row["approach_error"] for row in rows] == [0.015, 0.0]
    assert [row["strengthening_at_approach_error"] for row in rows] == pytest.approx([2.0 * 0.16, 2.0 * 0.01])
    assert rows[0]["strengthening_at_force_error"] == pytest.approx(1.5e-2)


def sentence(finite: dict[str, Any], linear: dict[str, Any]) -> str:
    return answer(compare_steps([finite], [linear], [linear]), finite["balls"], SCALE)


def test_the_sentence_names_separation_and_attraction() -> None:
    assert "D = 0.3 R (Q = 0.1 E R²)" in sentence(pair(-3e-3, 6e-5), pair(-2e-3))
    assert "makes the separation force 1.50 ± 0.03 times the linear one" in sentence(pair(-3e-3, 6e-5), pair(-2e-3))
    assert "makes the attraction force 1.50 ± 0.03 times the linear one" in sentence(pair(3e-3, 6e-5), pair(2e-3))


def test_the_sentence_names_a_reversal() -> None:
    text = sentence(pair(3e-3, 6e-5), pair(-2e-3))
    assert "turns the linear separation force into attraction, 1.50 ± 0.03 times as large" in text


def test_a_force_across_the_line_to_the_others_is_neither_attraction_nor_separation() -> None:
    beside, far = (ball(x, (0.0, -2e-3 * x)) for x in (1.0, 0.1))
    balls = [ball(-1.0, (1e-5, 2e-3)), {**beside, "position": [-1.0, 2.0]}, {**far, "position": [9.0, -2.0]}]
    linear = step(*balls)
    finite = step(*({**b, "tangential_force": [1.5 * v for v in b["tangential_force"]]} for b in balls))
    assert line_of(balls, 0, (1e-5, 2e-3))[1] == "tangential"
    rows = compare_steps([finite], [linear], [linear])
    assert "makes the tangential force on ball 0 1.5 times" in answer(rows, finite["balls"], SCALE)
    (shown,) = comparison_rows(rows, finite["balls"], 0, SCALE)
    assert shown["T linear / E R\u00b2"] == pytest.approx(2e-3, rel=1e-4)
    assert shown["T finite / E R\u00b2"][0] == pytest.approx(3e-3, rel=1e-4)
    assert shown["T / Q"] == pytest.approx(3e-2, rel=1e-4)
    direction, kind = line_of(balls, 0, (-2e-3, 0.0))
    assert (direction, kind) == ((1.0, 0.0), "separation")  # shown as negative


def test_the_sentence_speaks_of_the_ball_that_tables_and_figures_show() -> None:
    finite = step(ball(-2.0, (2e-3, 0.0)), ball(0.0, (3e-3, 0.0)), ball(2.0, (1e-3, 0.0)))
    linear = step(ball(-2.0, (4e-3, 0.0)), ball(0.0, (1e-3, 0.0)), ball(2.0, (1e-3, 0.0)))
    assert "force on ball 1 3 times" in sentence(finite, linear)


def test_the_sentence_says_when_there_is_nothing_to_compare() -> None:
    alone = step(ball(0.0, (0.0, 0.0)))
    assert "nothing to compare" in sentence(alone, alone)
    assert "nothing to compare" in sentence(pair(1e-3), pair(1e-6, 1e-5))


def test_a_missing_linear_state_leaves_no_number() -> None:
    nan = math.nan
    lost = step(ball(-1.0, (nan, nan), nan), ball(1.0, (nan, nan), nan))
    lost["record"]["failure"] = "linear model: not converged"
    rows = compare_steps([pair(1e-3)], [lost], [pair(1e-3)])
    assert rows[0]["strengthening_at_force"] is None
    assert rows[0]["strengthening_at_approach"] == pytest.approx(1.0)
    assert rows[0]["note"] == "linear model: not converged"


def test_attraction_is_positive_towards_the_others() -> None:
    balls = [ball(-1.0, (0, 0)), ball(1.0, (0, 0))]
    assert attraction(balls, 0, (2.0, 1.0)) == 2.0
    assert attraction(balls, 1, (2.0, 1.0)) == -2.0
    assert attraction(balls[:1], 0, (3.0, 4.0)) == 5.0


@pytest.mark.parametrize(
    ("value", "error", "text", "compact"),
    [
        (1.4234, 0.0312, "1.42 ± 0.03", "1.42(3)"),
        (1.00012, 0.00012, "1.00012 ± 0.00012", "1.00012(12)"),
        (1.161292e-7, 2e-9, "(1.161 ± 0.020)e-07", "1.161(20)e-7"),
        (-3e-5, 1e-4, "(-0.3 ± 1.0)e-04", "-0.3(1.0)e-4"),
        (123.4, 12.0, "123 ± 12", "123(12)"),
        (0.0, 0.0, "0", "0"),
        (None, None, "-", "-"),
    ],
)
def test_a_value_is_written_to_the_place_of_its_error(
    value: float | None, error: float | None, text: str, compact: str
) -> None:
    assert with_error(value, error) == text
    assert with_error_in_parentheses(value, error) == compact


def test_a_large_change_is_in_whole_percent() -> None:
    assert [percent(change) for change in (0.0123, -0.05, 0.996, -1.04, 21.7)] == [
        "+1.2 %", "-5 %", "+100 %", "-104 %", "+2170 %",
    ]  # fmt: skip


@pytest.mark.parametrize(("asked", "taken"), [(None, 1e-3), (0.3, 1e-3), (0.01, 5e-4), (1e-3, 1e-4), (1e-5, 1e-5)])
def test_the_linear_force_beside_another_is_known_better_but_not_in_vain(asked: float | None, taken: float) -> None:
    assert accuracy_beside(asked) == pytest.approx(taken)


@pytest.mark.parametrize("accounted", [True, False])
def test_the_account_of_a_resumed_comparison_is_that_of_its_own_states(
    accounted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def solve_linear(problem: Problem, run: Run) -> Result:
        (value,) = problem.load.values
        made.append(value)
        alone = BallResult((0.0, 0.0), 1.0, 0.1, value, (0.0, 0.0), 0.0, 1.0, 1.0)
        return Result("linear_bem", (alone,), Solved(True, round(value), 7, value, notes=(f"at {value:g}",)))

    monkeypatch.setitem(MODELS, "linear_bem", dataclasses.replace(MODELS["linear_bem"], solve=solve_linear))
    problem = Problem(Layer(1.0, 0.45, 1.5), (Ball((0.0, 0.0), 1.0),), Load("force", (1.0,)))
    coarse, fine = ([{"balls": [{"normal_force": value}]} for value in values] for values in ((1.0, 2.0), (1.0, 5.0)))
    saved = {"finite": {"steps": coarse}, "linear": LinearStates(problem, None, {}).along("force", coarse)}
    if not accounted:  # as earlier versions saved them
        saved["linear"]["steps"] = [{**step, "record": {"prescribed": "force"}} for step in saved["linear"]["steps"]]
    solved = LinearStates(problem, None, saved).along("force", fine)["solved"]
    assert made == [1.0, 2.0, *([] if accounted else [1.0]), 5.0]
    assert (solved["iterations"], solved["unknowns"], solved["seconds"]) == (6, 7, 6.0)
    assert solved["notes"] == ["at 1", "at 5"]


def test_a_short_number_keeps_three_digits() -> None:
    assert [short_number(v) for v in (-8.556e-8, -0.00199, 0.32, -2.02e-4, 123456.0, 0.0, None)] == [
        "-8.56e-08", "-0.00199", "0.32", "-2.02e-04", "1.23e+05", "0", "-",
    ]  # fmt: skip
