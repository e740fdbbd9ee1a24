"""The terms of the error budget, each against the case that its derivation is about."""

from __future__ import annotations

import math

import numpy as np
import pytest

from finite_strain.answer import Answers
from finite_strain.error_budget import ORDER, Terms, discretisation, enforcement, exponent, gain
from finite_strain.planning import plan_run
from finite_strain.states import Discretisation, Record
from tests.finite_strain.scenes import CUBIC, QUADRATIC, UNEQUAL, pair, relatively
from tests.finite_strain.test_pairs import state

ROUNDOFF = 1e-12
FINER = Discretisation(3, 1.5)


def test_terms_add_up_as_independent_ones_do() -> None:
    terms = Terms(*(np.array([value, 0.0]) for value in (3.0, 4.0, 12.0, 0.0)))
    assert terms.total == relatively([13.0, 0.0], ROUNDOFF) or terms.total == pytest.approx([13.0, 0.0])
    assert Terms.names() == ["discretisation", "enforcement", "transfer", "solver"]
    assert terms.largest(0) == "transfer"


def test_a_change_between_meshes_bounds_the_error_of_values_that_converge_with_the_order() -> None:
    exact, size = 2.0, {1.0: 1.0, 1.5: 1.0 / 1.5}
    coarse, fine = (np.array([[exact + 0.1 * size[f] ** ORDER, 0.0]]) for f in (1.0, 1.5))
    error = discretisation(fine, coarse, gain(FINER, CUBIC), [], np.array([1.0]))
    assert error == relatively(np.abs(fine[:, 0] - exact), ROUNDOFF)
    faster = np.array([[exact + 0.1 * size[1.5] ** (ORDER + 1.0), 0.0]])
    assert discretisation(faster, coarse, gain(FINER, CUBIC), [], np.array([1.0])) > abs(faster[0, 0] - exact)


def test_between_orders_on_one_mesh_the_change_itself_is_the_error() -> None:
    assert gain(CUBIC, QUADRATIC) == 1.0
    assert gain(CUBIC, CUBIC) == 1.0
    assert gain(Discretisation(3, 2.0), Discretisation(3, 1.0)) == relatively(1.0 / 3.0, ROUNDOFF)
    assert gain(Discretisation(3, 2.0), Discretisation(2, 1.0)) == 1.0


def test_a_chance_agreement_at_one_step_is_not_an_error_of_nothing() -> None:
    same, size = np.array([[2.0, 0.0]]), np.array([2.0])
    path = [np.array([0.01]), np.array([0.03])]
    assert discretisation(same, same, 1.0, path, size) == relatively([0.02], ROUNDOFF)
    # a larger change counts itself, and one before does not raise it
    assert discretisation(same, same + 0.5, 1.0, path, size) == relatively([math.hypot(0.5, 0.5)], ROUNDOFF)


def test_a_surface_inside_the_ball_is_that_of_a_ball_less_deep() -> None:
    own, small = state(1.0, 0.1, (0.0, 0.0), gap=-3e-4), state(1.0, 0.1, (0.0, 0.0), gap=-2e-4)
    assert enforcement(own, None, np.array([1.0])) == relatively([3e-3], ROUNDOFF)
    # the pair takes off what it does at small strain, as far as it counts
    assert enforcement(own, small, np.array([1.0])) == relatively([1e-3], ROUNDOFF)
    assert enforcement(own, small, np.array([0.5])) == relatively([2e-3], ROUNDOFF)
    assert enforcement(state(0.0, 0.0, (0.0, 0.0)), None, np.array([0.0])) == [0.0]


def test_the_exponent_of_the_path_is_found_and_never_below_the_usual_one() -> None:
    def force(approach: float, power: float) -> np.ndarray:
        return np.array([3.0 * approach**power])

    for power, told in ((2.5, 2.5), (1.2, 1.5)):
        assert exponent(force(0.3, power), force(0.2, power), 1.5, 1.5) == relatively([told], ROUNDOFF)
    assert exponent(force(0.3, 2.0), None, 1.5, 1.5) == [1.5]
    assert exponent(force(0.3, 2.0), force(0.3, 2.0), 1.0, 1.5) == [1.5]
    assert exponent(np.zeros(1), np.zeros(1), 1.5, 1.5) == [1.5]


def test_forces_that_do_not_add_up_to_zero_are_doubted_more() -> None:
    answers = Answers(plan_run(UNEQUAL, 0.1, "finite_strain"), Record(QUADRATIC), Record(CUBIC))
    forces = np.array([[1.0, 0.0], [-0.4, 0.0]])
    imbalance, doubt = answers._imbalance(forces, np.array([0.1, 0.2]))
    assert imbalance == relatively(0.6, ROUNDOFF)
    assert doubt == relatively(math.hypot(1.0, 2.0), ROUNDOFF)
    # mirror images add up to zero whatever they are
    answers = Answers(plan_run(pair(0.1), 0.1, "finite_strain"), Record(QUADRATIC), Record(CUBIC))
    assert answers._imbalance(forces[:1], np.array([0.1])) == (0.0, 1.0)
