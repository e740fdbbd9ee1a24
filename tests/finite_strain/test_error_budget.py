"""The terms of the error budget, each against the case of its derivation."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from finite_strain.accuracy.answer import Answers, _others_at, _total, judge
from finite_strain.accuracy.error_budget import (
    FASTEST,
    FEW,
    SLOWEST,
    TERMS,
    discretisation,
    enforcement,
    gain,
    residual,
    transfer,
)
from finite_strain.accuracy.pairs import MEASURED, LinearTruth
from finite_strain.geometry import estimates
from finite_strain.planning.records import (
    ContactState,
    Discretisation,
    Record,
    Row,
    SolverAccount,
    save_records,
    saved_records,
)
from finite_strain.planning.refinement import coarser
from finite_strain.planning.run_plan import plan_run
from linear_bem import Ball, Indenter
from linear_bem.dual import slope
from tests.finite_strain.scenes import CUBIC, QUADRATIC, UNEQUAL, at_small_strain, pair, relatively, single
from tests.finite_strain.test_pairs import linear, state

ROUNDOFF = 1e-12
FINER = Discretisation(3, 1.5)


def test_terms_add_in_quadrature() -> None:
    assert _total(np.array([[value, 0.0] for value in (3.0, 4.0, 12.0, 0.0)])) == relatively([13.0, 0.0], ROUNDOFF)
    assert TERMS == ("discretisation", "enforcement", "transfer", "solver")


QUARTIC = Discretisation(4, 1.0)


@pytest.mark.parametrize(("coarse", "fine"), [(CUBIC, FINER), (QUADRATIC, CUBIC), (CUBIC, QUARTIC)], ids=str)
def test_a_change_bounds_the_error_of_values_that_converge_with_the_slowest_order(
    coarse: Discretisation, fine: Discretisation
) -> None:
    def value(level: Discretisation, order: float) -> np.ndarray:
        return np.array([2.0 + 0.1 * (level.order * level.fineness) ** -order])

    def error(order: float) -> np.ndarray:
        return discretisation([value(coarse, order) - value(fine, order)] * 3, fine, coarse)

    assert error(SLOWEST) == relatively(value(fine, SLOWEST) - 2.0, 1e-9)
    assert error(SLOWEST + 1.0) > value(fine, SLOWEST + 1.0) - 2.0


def test_another_domain_or_penalty_on_the_same_mesh_keeps_the_whole_change() -> None:
    assert gain(CUBIC, CUBIC) == 1.0


def test_a_correction_small_by_chance_is_bounded_below_by_the_coarser_one_and_its_convergence() -> None:
    now, before = np.array([0.001, 0.04]), np.array([0.08, 0.08])
    assert transfer(now, before, QUARTIC, QUADRATIC) == relatively([0.08 * 2.0**-FASTEST, 0.04], ROUNDOFF)
    assert transfer(now, before, FINER, CUBIC) == relatively([0.08 * 1.5**-SLOWEST, 0.04], ROUNDOFF)
    assert transfer(now, before, CUBIC, CUBIC) == relatively(now, ROUNDOFF)  # same resolution: no bound from before


def test_the_error_of_small_strain_elements_is_all_of_their_known_error() -> None:
    """T is R Q^2: where R and Q are both too small, their relative errors a and b give more than a + 2 b."""
    answers = Answers(plan_run(at_small_strain(pair(0.1)), 0.1, "small_strain"), [Record(QUADRATIC), Record(CUBIC)])
    own, truth = state(0.98, 0.1, (-0.018, 0.0)), linear(1.0, 0.1, (-0.02, 0.0))
    for record in (answers.coarse, answers.fine):
        record.rows.append(Row(own))
    nothing = {field.name: 0.0 for field in fields(SolverAccount)}
    account = SolverAccount(**nothing | {"fraction": 1.0, "augmented": True})  # type: ignore[arg-type]
    answer = answers.answer(1, account, truth)
    known = 0.02 - 0.018 * 0.98**2
    assert known <= answer.balls[0].tangential_force_error <= known * (1.0 + 1e-6)


def of_two(forces: tuple[float, float], approaches: tuple[float, float], per_squared: Any = (0.0, 0.0)) -> ContactState:
    """Return a state of two balls with Q, D and T / Q^2 along x."""
    pulls = np.column_stack([np.multiply(per_squared, np.square(forces)), np.zeros(2)])
    return ContactState(1.0, np.array(approaches), np.array(forces), pulls, pulls, *(np.zeros(2) for _ in range(5)))


ACCOUNT = SolverAccount(
    **{field.name: 0.0 for field in fields(SolverAccount)} | {"fraction": 1.0, "augmented": True, "tolerance": 1e-9}  # type: ignore[arg-type]
)


def test_where_one_ball_alone_presses_the_terms_are_those_of_its_force() -> None:
    problem = UNEQUAL.with_load("approach", (0.1, -0.05))
    answers = Answers(plan_run(problem, 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    for record, force in ((answers.coarse, 1.02), (answers.fine, 1.0)):
        record.rows.append(Row(of_two((force, 0.0), (0.1, -0.05))))
    answers.fine.steps.append(answers.answer(1, ACCOUNT, "no linear answer"))
    judge(answers.plan, answers.fine)
    assert answers.fine.scale == 0.0
    assert answers.fine.reached == relatively(0.02 * FEW[1] * gain(CUBIC, QUADRATIC), 1e-6)
    assert math.hypot(*answers.fine.terms.values()) == relatively(answers.fine.reached, ROUNDOFF)


def test_the_pair_corrects_a_single_body_whatever_the_errors_of_its_t() -> None:
    answers = Answers(plan_run(single(0.1), 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    for record in (answers.coarse, answers.fine):  # T of a body that is not its own mirror image: roundoff or more
        record.rows.append(Row(state(0.9, 0.1, (1e-5, 0.0)), state(1.05, 0.1, (-2e-5, 0.0))))
    answer = answers.answer(1, ACCOUNT, linear(1.0, 0.1, (0.0, 0.0)))
    assert answer.pair_weight == [1.0]
    assert answer.balls[0].normal_force == relatively(0.9 / 1.05, ROUNDOFF)


@pytest.mark.parametrize("way", [1.0, 1j, -1.0, -1j])
def test_the_steepest_slope_is_looked_for_on_all_four_sides(way: complex, monkeypatch: pytest.MonkeyPatch) -> None:
    class Side(Indenter):
        apex_radius = 1.0

        def height(self, x: Any, y: Any) -> Any:
            along = way.real * x + way.imag * y
            return 0.5 * (x**2 + y**2) + 0.375 * (along + abs(along)) ** 2

    answers = Answers(plan_run(single(0.01, shape=Side()), 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    own = replace(state(1.0, 0.01, (0.0, 0.0)), contact_area=np.array([0.01 * math.pi]))
    assert answers._steepest(own) == relatively(0.1 * (1.0 + 3.0), ROUNDOFF)

    def ending(body: Indenter, x: Any, y: Any) -> Any:  # without height on the other side
        beyond = way.real * x + way.imag * y < -0.05
        return tuple(np.where(beyond, np.nan, each) for each in slope(body, x, y))

    monkeypatch.setattr(estimates, "slope", ending)
    assert answers._steepest(own) == relatively(0.1 * (1.0 + 3.0), ROUNDOFF)


def test_an_answer_for_positions_and_radii_of_numpys_whole_numbers_is_written(tmp_path: Path) -> None:
    balls = tuple(Ball(place, np.int64(1)) for place in np.array([(-1, 0), (1, 0)]))  # type: ignore[arg-type]
    plan = plan_run(replace(UNEQUAL, balls=balls), 0.1, "finite_strain")
    answers = Answers(plan, [Record(QUADRATIC), Record(CUBIC)])
    for record in (answers.coarse, answers.fine):
        record.rows.append(Row(of_two((0.3, 0.2), (0.1, 0.08))))
    answers.fine.steps.append(answers.answer(1, ACCOUNT, "no linear answer"))
    save_records(tmp_path, "key", [answers.fine])
    assert saved_records(tmp_path, "key")[0][0].steps == answers.fine.steps


@pytest.mark.parametrize(
    ("model", "known"), [("finite_strain", True), ("finite_strain", False), ("small_strain", True)]
)
def test_the_parts_of_a_total_force_have_an_error_which_t_contains(model: str, known: bool) -> None:
    problem = UNEQUAL.with_load("total_force", (0.3,))
    plan = plan_run(problem if model == "finite_strain" else at_small_strain(problem), 0.1, model)
    answers = Answers(plan, [Record(QUADRATIC), Record(CUBIC)])
    true, found, approaches = (0.16, 0.14), (0.1615, 0.1385), (0.1, 0.1)
    pull = np.array([4e-4, -4e-4])  # of linear_bem; the changes from the coarser mesh are as large as the errors
    for record, forces in ((answers.coarse, true), (answers.fine, found)):
        here = of_two(forces, approaches, pull / np.square(true))
        record.rows.append(Row(here, here if known and model == "finite_strain" else None))
    pulls, one = np.column_stack([pull, np.zeros(2)]), np.ones(2)
    truth = LinearTruth(np.array(true), np.array(approaches), pulls, 1e-9 * one, one, one, 0.0 * one, 0.0 * one)
    answer = answers.answer(1, ACCOUNT, truth if known else "no linear answer")
    changed = 0.0 if model == "small_strain" else FEW[1] * gain(CUBIC, QUADRATIC)
    factor = math.hypot(changed, 1.0 if known else 0.0)
    for ball, exact in zip(answer.balls, pull, strict=True):
        assert ball.errors["normal_force"] == relatively(factor * 0.0015, 1e-9)
        assert abs(ball.tangential_force[0] - exact) <= ball.tangential_force_error
    assert answer.normal_force_error == [ball.errors["normal_force"] for ball in answer.balls]


@pytest.mark.parametrize("name", MEASURED)
def test_contact_area_and_peak_pressure_have_an_error(name: str) -> None:
    one, known = np.array([1.0]), {name: np.array([0.98]), f"{name}_error": np.array([0.001])}
    truth = replace(linear(1.0, 0.1, (-0.02, 0.0)), **known)
    change = 0.05 / 1.05 * FEW[1] * gain(CUBIC, QUADRATIC)
    for model, said, value, error in (
        ("finite_strain", truth, 1.05 * 0.98, 1.05 * 0.98 * (change + 0.001 / 0.98)),
        ("finite_strain", "no linear answer", 1.05, 1.05 * math.hypot(change, 0.02 * (name == "peak_pressure"))),
        ("small_strain", truth, 1.05, 0.07 + 1.05 * 0.001 / 0.98),
    ):
        problem = pair(0.1) if model == "finite_strain" else at_small_strain(pair(0.1))
        answers = Answers(plan_run(problem, 0.1, model), [Record(QUADRATIC), Record(CUBIC)])
        for record, size in ((answers.coarse, 1.0), (answers.fine, 1.05)):
            small, own = state(1.0, 0.1, (-0.02, 0.0)), state(1.0, 0.1, (-0.02, 0.0))
            own = replace(own, peak_excess=0.02 * one, **{name: size * one})
            record.rows.append(Row(own, small if model == "finite_strain" else None))
        (ball, mirrored) = answers.answer(1, ACCOUNT, said).balls
        assert getattr(ball, name) == relatively(value, ROUNDOFF)
        assert error * (1.0 - ROUNDOFF) <= ball.errors[name] <= 1.02 * error  # and of what does not carry over
        assert mirrored.errors == ball.errors


def test_a_ball_that_only_the_coarser_mesh_presses_has_an_error_of_its_force() -> None:
    plan = plan_run(UNEQUAL.with_load("total_force", (0.3,)), 0.1, "finite_strain")
    answers = Answers(plan, [Record(QUADRATIC), Record(CUBIC)])
    for record, forces in ((answers.coarse, (0.29, 0.01)), (answers.fine, (0.3, 0.0))):
        record.rows.append(Row(of_two(forces, (0.1, 0.1)), None))
    errors = [ball.errors["normal_force"] for ball in answers.answer(1, ACCOUNT, "no linear answer").balls]
    assert errors == relatively([FEW[1] * gain(CUBIC, QUADRATIC) * 0.01] * 2, ROUNDOFF)


@pytest.mark.parametrize("kind", ["approach", "total_force"])
@pytest.mark.parametrize("model", ["finite_strain", "small_strain"])
def test_a_ball_that_presses_in_the_linear_model_but_not_on_the_mesh_has_errors_that_contain_its_forces(
    model: str, kind: str
) -> None:
    problem = UNEQUAL if kind == "approach" else UNEQUAL.with_load(kind, (0.3,))
    plan = plan_run(problem if model == "finite_strain" else at_small_strain(problem), 0.1, model)
    answers, untouched = Answers(plan, [Record(QUADRATIC), Record(CUBIC)]), of_two((0.3, 0.0), (0.1, 0.1))
    for record in (answers.coarse, answers.fine):
        record.rows.append(Row(untouched, untouched if model == "finite_strain" else None))
    pulls, one = np.array([[1e-4, 0.0], [-1e-4, 0.0]]), np.ones(2)
    truth = LinearTruth(np.array([0.298, 0.002]), untouched.approach, pulls, 0.0 * one, one, one, 0.0 * one, 0.0 * one)
    ball = answers.answer(1, ACCOUNT, truth).balls[1]
    assert ball.normal_force == 0.0
    assert ball.errors["normal_force"] == relatively(0.002, 1e-6)
    assert [ball.errors[name] for name in MEASURED] == relatively([1.0, 1.0], ROUNDOFF)
    assert abs(ball.tangential_force[0] - pulls[1, 0]) <= ball.tangential_force_error * (1.0 + 1e-9) < 2e-4


def test_a_stiffer_or_wider_discretisation_is_compared_with_the_last_one_of_a_lower_resolution() -> None:
    records = [Record(level) for level in (QUADRATIC, CUBIC, replace(CUBIC, penalty=8.0))]
    assert coarser(records) is records[0]
    assert coarser([*records, Record(QUARTIC)]) is records[2]


def test_penetration_acts_like_a_smaller_approach() -> None:
    own, small = state(1.0, 0.1, (0.0, 0.0), gap=-3e-4), state(1.0, 0.1, (0.0, 0.0), gap=-2e-4)
    assert enforcement(own, None, np.array([1.0])) == relatively([3e-3], ROUNDOFF)
    # the pair removes the small-strain part, times its weight
    assert enforcement(own, small, np.array([1.0])) == relatively([1e-3], ROUNDOFF)
    assert enforcement(own, small, np.array([0.5])) == relatively([2e-3], ROUNDOFF)
    assert enforcement(state(0.0, 0.0, (0.0, 0.0)), None, np.array([0.0])) == [0.0]
    # without multipliers: the largest penetration
    soft = replace(own, penetration=np.array([5e-4]))
    assert enforcement(soft, small, np.array([1.0]), augmented=True) == relatively([1e-3], ROUNDOFF)
    assert enforcement(soft, small, np.array([1.0]), augmented=False) == relatively([5e-3], ROUNDOFF)


def test_an_imbalance_of_forces_increases_the_error() -> None:
    answers = Answers(plan_run(UNEQUAL, 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    forces = np.array([[1.0, 0.0], [-0.4, 0.0]])
    imbalance, doubt = answers._imbalance(forces, np.array([0.1, 0.2]))
    assert imbalance == relatively(0.6, ROUNDOFF)
    assert doubt == relatively(math.hypot(1.0, 2.0), ROUNDOFF)
    # forces on mirror images always sum to zero
    answers = Answers(plan_run(pair(0.1), 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    assert answers._imbalance(forces[:1], np.array([0.1])) == (0.0, 1.0)


def test_a_ball_known_worse_than_the_others_together_takes_minus_their_sum() -> None:
    answers = Answers(plan_run(UNEQUAL, 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    assert answers._worst(np.array([3.0, 1.0])) == 0
    assert answers._worst(np.array([1.0, 1.0, 1.9])) is None
    terms = _others_at(2, np.array([[1.0, 2.0, each] for each in (9.0, 8.0, 7.0, 6.0)]))
    assert terms.tolist() == [[1.0, 2.0, 3.0]] * 4
    # the forces on a ball and its mirror image are opposite anyway
    mirrored = Answers(plan_run(pair(0.1), 0.1, "finite_strain"), [Record(QUADRATIC), Record(CUBIC)])
    assert mirrored._worst(np.array([1.0])) is None


@pytest.mark.parametrize(
    ("pulls", "known", "accuracy", "allowed"),
    [
        ((1e-3, -1e-3), None, 1e-3, 1e-8),
        ((1e-3, 2e-4), None, 1e-3, 2e-9),
        ((1e-2, 0.0), None, 0.1, 1e-7),
        ((0.0, 0.0), None, 0.1, 1e-9),
        ((1e-2, 1e-2), (1e-5, -2e-5), 0.1, 1e-8),
        ((1e-3, 1e-3), (1e-2, 1e-2), 1e-3, 1e-8),
    ],
)
def test_the_residual_follows_the_smallest_t_that_counts(
    pulls: tuple[float, float], known: tuple[float, float] | None, accuracy: float, allowed: float
) -> None:
    tangential, truth = (None if each is None else np.array([(2.0 * t, 0.0) for t in each]) for each in (pulls, known))
    coarse = SimpleNamespace(tangential_force=tangential, normal_force=np.array([2.0, 1.0]))
    assert residual(coarse, truth, accuracy, 1e-9) == relatively(allowed, ROUNDOFF)  # type: ignore[arg-type]
