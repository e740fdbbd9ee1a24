"""The discretisation's error from the changes along a load path, and what may remain of the pair's error."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from finite_strain.accuracy.answer import Answers
from finite_strain.accuracy.error_budget import (
    FASTEST,
    FEW,
    discretisation,
    gain,
    remaining,
)
from finite_strain.accuracy.pairs import Paired
from finite_strain.planning.records import (
    Record,
    Row,
    save_records,
    saved_records,
)
from finite_strain.planning.run_plan import plan_run
from tests.finite_strain.scenes import CUBIC, QUADRATIC, pair, relatively
from tests.finite_strain.test_error_budget import ACCOUNT, ROUNDOFF
from tests.finite_strain.test_pairs import linear, state


def test_the_largest_change_of_nearby_load_steps_counts() -> None:
    path = [np.array([0.3, 0.0]), np.array([0.0, 0.1]), np.zeros(2)]
    factor = gain(CUBIC, QUADRATIC)
    assert discretisation(path, CUBIC, QUADRATIC) == relatively([0.3 * factor, 0.1 * factor], ROUNDOFF)
    # one or two may be small by chance; three count as they are
    assert discretisation(path[:1], CUBIC, QUADRATIC) == relatively([0.3 * FEW[1] * factor, 0.0], ROUNDOFF)
    assert discretisation(path[:2], CUBIC, QUADRATIC) == relatively(
        [0.3 * FEW[2] * factor, 0.1 * FEW[2] * factor], ROUNDOFF
    )
    for number, few in FEW.items():
        assert few == relatively(1.0 / math.sin(0.5 * math.pi * 3.0 ** (-1.0 / number)), 1e-2)


KNOWN = [np.array([[0.1], [1.1]])] * 3
"""Errors of small strain on order 3 and 2: a tenth of their change remains."""


def test_the_mean_of_changes_converges_as_at_small_strain_and_the_rest_slowly() -> None:
    slowest, even, uneven = gain(CUBIC, QUADRATIC), [np.array([0.4])] * 3, [np.array([c]) for c in (0.3, -0.3, 0.0)]
    assert discretisation(even, CUBIC, QUADRATIC, KNOWN) == relatively([0.1 * 0.4], ROUNDOFF)
    assert discretisation(uneven, CUBIC, QUADRATIC, KNOWN) == relatively([FEW[2] * slowest * 0.3], ROUNDOFF)
    both = [a + b for a, b in zip(even, uneven, strict=True)]
    expected = 0.1 * 0.4 + FEW[2] * slowest * 0.3
    assert discretisation(both, CUBIC, QUADRATIC, KNOWN) == relatively([expected], ROUNDOFF)
    along = [np.array([[change.item(), 0.0]]) for change in both]  # of vectors
    known = [np.array([[[0.1, 0.0]], [[1.1, 0.0]]])] * 3
    assert discretisation(along, CUBIC, QUADRATIC, known) == relatively([expected], ROUNDOFF)
    # two loads do not show both parts, and errors of truncation do not converge
    assert discretisation(even[:2], CUBIC, QUADRATIC, KNOWN[:2]) == relatively([FEW[2] * slowest * 0.4], ROUNDOFF)
    truncated = [np.array([[1.0], [1.1]])] * 3
    assert discretisation(even, CUBIC, QUADRATIC, truncated) == relatively([slowest * 0.4], ROUNDOFF)
    # no more than if nothing were known of the mean, and no less than with the fastest convergence
    opposite = [np.array([change]) for change in (-0.2, 0.25, 0.25)]
    assert discretisation(opposite, CUBIC, QUADRATIC, truncated) == relatively([FEW[2] * slowest * 0.25], ROUNDOFF)
    exact = [np.array([[0.0], [1.1]])] * 3
    fastest = gain(CUBIC, QUADRATIC, FASTEST)
    assert discretisation(even, CUBIC, QUADRATIC, exact) == relatively([fastest * 0.4], ROUNDOFF)


def test_of_known_errors_as_much_remains_as_of_their_changes() -> None:
    known = [np.array([[error], [error + 0.01]]) for error in (0.002, -0.004, 0.001)]
    for change, left in ((0.0, 0.0), (0.005, 0.002), (0.01, 0.004), (0.02, 0.004)):
        path = [np.array([0.0]), np.array([-change]), np.array([0.0])]
        assert remaining(path, known) == relatively([left], 1e-9)
    assert remaining([np.array([0.01])], known[:1]) == relatively([FEW[1] * 0.002], 1e-9)


def out_of_phase(own: float, first: float = 1.0) -> float:
    """Return the relative error of Q at full load, with 1 % of known error and the finite-strain error ``own``.

    ``first`` is the exact Q at the first of three loads for the states of the mesh.
    """
    answers = Answers(plan_run(pair(0.1), 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    truth, loads = linear(1.0, 0.1, (-0.02, 0.0)), (0.8, 0.9, 1.0)
    for record, wrong in ((answers.coarse, 2.0), (answers.fine, 1.0)):
        for load in loads:
            size = 1.0 if load > loads[0] else first
            models = (state(size * (1.0 + wrong * off), 0.1, (-0.02, 0.0)) for off in (own, 0.01))
            record.rows.append(Row(*(replace(model, fraction=load) for model in models)))
    for load in loads:
        answers.compare(load, truth)
    ball = answers.answer(1, ACCOUNT, truth).balls[0]
    return ball.errors["normal_force"] / ball.normal_force


@pytest.mark.parametrize(("own", "least", "most"), [(0.0, 0.01, 0.0131), (0.01, 0.0, 0.003)])
def test_an_error_of_the_force_that_oscillates_out_of_phase_with_its_pair_remains(
    own: float, least: float, most: float
) -> None:
    assert least <= out_of_phase(own) <= most


def test_the_force_of_a_ball_that_the_mesh_missed_at_a_smaller_load_says_nothing_of_this_load() -> None:
    assert 0.01 <= out_of_phase(0.0, first=0.0) <= 0.015


def at_loads(*fractions: float) -> Answers:
    """Return answers whose finer discretisation has results at some load fractions."""
    answers = Answers(plan_run(pair(0.1), 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    answers.fine.rows += [Row(SimpleNamespace(fraction=fraction)) for fraction in fractions]  # type: ignore[arg-type]
    return answers


def test_changes_at_much_smaller_loads_do_not_count() -> None:
    answers, factor = at_loads(0.1, 0.4, 0.5, 0.9, 1.0), gain(CUBIC, QUADRATIC)
    for fraction, change, counted in (
        (0.1, 5.0, 5.0 * FEW[1]), (0.4, 1.0, 5.0 * FEW[2]), (0.5, 0.2, 1.0 * FEW[2]), (0.9, 0.3, 1.0), (1.0, 0.1, 1.0)
    ):  # fmt: skip
        assert answers._change("R", fraction, np.array([change])) == relatively([counted * factor], ROUNDOFF)


def test_later_loads_count_where_there_are_few_smaller_ones() -> None:
    answers, factor = at_loads(0.25, 0.5, 0.75, 1.0), gain(CUBIC, QUADRATIC)
    changes = {0.25: 0.06, 0.5: 0.03, 0.75: 0.9, 1.0: 0.5}
    for fraction, change in changes.items():
        answers._change("R", fraction, np.array([change]))
    # 0.25 and 0.5 are small by chance; 0.25 is not near enough to 1.0 to count there
    for fraction, counted in ((0.25, 0.9), (0.5, 0.9), (0.75, 0.9), (1.0, 0.9)):
        assert answers._change("R", fraction, np.array([np.nan])) == relatively([counted * factor], ROUNDOFF)
    assert answers.fine.changes == {"R": [[change] for change in changes.values()]}


def test_where_changes_grow_with_the_load_the_line_through_those_next_to_a_load_counts() -> None:
    answers, factor = at_loads(0.3, 0.4, 0.5, 0.6, 0.9, 1.0), gain(CUBIC, QUADRATIC)
    changes = {0.3: 0.02, 0.4: 0.01, 0.5: 0.005, 0.6: 0.3, 0.9: 0.8, 1.0: 0.1}
    for fraction, change in changes.items():
        answers._change("R", fraction, np.array([change]))
    for fraction, counted in ((0.3, 0.02), (0.4, 0.02), (0.5, 0.155), (0.6, 0.3), (0.9, 0.8), (1.0, 0.8)):
        assert answers._change("R", fraction, np.array([np.nan])) == relatively([counted * factor], ROUNDOFF)


def seen(force: float, pull: float) -> Paired:
    ball, none = np.array([force]), np.zeros(1)
    per_squared = np.array([[pull / force**2 if force else 0.0, 0.0]])
    return Paired(ball, np.array([0.1]), per_squared, none, none, none, ball, ball, none, none, np.full((1, 3), np.nan))


def test_the_change_of_the_force_itself_counts_where_both_parts_of_it_have_one_sign() -> None:
    answers = at_loads(0.8, 0.9, 1.0)
    now, before = seen(1.0, 1.0), seen(1.01, 1.01**3)  # 1 % in T / Q^2 and in Q: 3 % in T
    for fraction in (0.8, 0.9):
        answers._changed(fraction, now, now, None)
    apart, moved, pulled, *_ = answers._changed(1.0, now, before, None)
    assert math.hypot(apart[0], 2.0 * moved[0]) < pulled[0]
    assert pulled == relatively([(1.01**3 - 1.0) * gain(CUBIC, QUADRATIC)], ROUNDOFF)


def test_a_ball_that_only_the_coarser_discretisation_presses_has_an_error() -> None:
    _, moved, pulled, *_ = at_loads(1.0)._changed(1.0, seen(0.0, 0.0), seen(0.2, 0.01), None)
    assert moved == relatively([FEW[1] * gain(CUBIC, QUADRATIC)], ROUNDOFF)
    assert pulled == relatively([FEW[1] * 0.01 / 0.2**2 * gain(CUBIC, QUADRATIC)], ROUNDOFF)


def test_a_load_with_a_known_error_keeps_its_place_among_the_changes() -> None:
    problem = replace(pair(0.1), finite_strain=None)
    answers = Answers(plan_run(problem, 0.1, "small_strain"), [Record(QUADRATIC), at_loads(0.5, 1.0).fine])
    known = SimpleNamespace()
    assert answers._changed(0.5, seen(1.0, 1.0), seen(1.1, 1.0), known)[0] == [0.0]  # type: ignore[arg-type]
    answers._changed(1.0, seen(1.0, 1.0), seen(1.1, 1.0), None)
    assert [len(path) for path in answers.fine.changes.values()] == [2, 2, 2, 2]


def test_a_resumed_run_restores_the_changes_of_earlier_steps(tmp_path: Path) -> None:
    answers = at_loads(0.5)
    answers._change("R", 0.5, np.array([0.2]))
    answers.fine.rows.clear()
    save_records(tmp_path, "key", [answers.coarse, answers.fine])
    resumed, _ = saved_records(tmp_path, "key")
    assert resumed[-1].changes == {"R": [[0.2]]}


def test_changes_that_were_not_saved_count_as_twice_the_present_one() -> None:
    answers = at_loads(0.8, 0.9, 1.0)
    assert answers._change("parts", 1.0, np.array([0.2])) == relatively([0.4 * gain(CUBIC, QUADRATIC)], ROUNDOFF)
    np.testing.assert_equal(answers.fine.changes, {"parts": [[np.nan], [np.nan], [0.2]]})
    # and are known when their loads are answered again
    assert answers._change("parts", 0.8, np.array([0.1])) == relatively(
        [0.2 * FEW[2] * gain(CUBIC, QUADRATIC)], ROUNDOFF
    )
    np.testing.assert_equal(answers.fine.changes, {"parts": [[0.1], [np.nan], [0.2]]})


def test_changes_that_earlier_versions_saved_without_a_sign_do_not_count() -> None:
    answers = at_loads(0.8, 0.9, 1.0)
    answers.fine.changes.update({"R": [[5.0]] * 2, "Q": [[5.0]] * 2})
    apart, moved, *_ = answers._changed(1.0, seen(1.0, 1.0), seen(1.01, 1.01**2), None)
    assert moved == relatively([0.01 * FEW[1] * gain(CUBIC, QUADRATIC)], 1e-9)
    assert apart == [0.0]
