"""Periodic cells on bases softer than the layer, or of its material."""

from dataclasses import replace

import numpy as np
import pytest

from linear_bem import (
    Ball,
    Elastic,
    Layer,
    Load,
    Periodic,
    Problem,
    solve_contact,
)
from tests.linear_bem.test_periodic_cell import ACCURACY, FORCES, LAYER, cell, numbers


def test_given_approaches_on_a_base_softer_than_the_layer_give_their_forces():
    # one ball's force moves the others by more than itself: sweeps diverge where a ball feels forces of the last sweep
    problem = replace(cell(Load("force", FORCES)), substrate=Elastic(0.3, 0.3))
    force, state = numbers(solve_contact(problem, ACCURACY))
    again = solve_contact(replace(problem, load=Load("approach", tuple(state[:, 0]))), ACCURACY)
    np.testing.assert_allclose(numbers(again)[0], force, atol=2e-5 * np.max(np.abs(force)))
    np.testing.assert_allclose(numbers(again)[1], state, rtol=2e-5)


def test_balls_on_a_very_soft_base_have_the_state_of_two_such_cells():
    # images cancel all but 1e-3 of the dent of the base; sweeps diverged
    balls = tuple(Ball(place, radius) for place, radius in (((1.0, 2.0), 1.0), ((4.0, 9.0), 0.7), ((5.0, 4.5), 0.8)))
    one = Problem(
        Layer(1.0, 0.5, 6.0), balls, Load("approach", (0.076, 0.09, 0.082)), Elastic(1.5e-5, 0.3),
        periodic=Periodic((7.0, 14.0)),
    )  # fmt: skip
    twice = tuple(replace(ball, position=(x + 7.0, y)) for ball in balls for x, y in [ball.position])
    two = replace(one, balls=balls + twice, load=Load("approach", one.load.values * 2), periodic=Periodic((14.0, 14.0)))
    (force, state), (forces, states) = (numbers(solve_contact(problem, ACCURACY)) for problem in (one, two))
    np.testing.assert_allclose(forces, np.tile(force, (2, 1)), atol=1e-4 * np.max(np.abs(force)))
    np.testing.assert_allclose(states, np.tile(state, (2, 1)), rtol=1e-5)


@pytest.mark.parametrize(("thickness", "substrate"), [(1.4, None), (3.0, Elastic(6e-4, 0.3))])
def test_a_lattice_whose_t_is_hardly_resolved_is_solved(thickness, substrate):
    # T vanishes, and its error is above the one requested: forces and approaches are as accurate as ever
    balls = Ball((1.0, 1.0), 1.0), Ball((8.0, 1.0), 1.0)
    periodic = Periodic((14.0, 5.0))
    two = Problem(Layer(1.0, 0.49, thickness), balls, Load("force", (0.01, 0.01)), substrate, periodic=periodic)
    one = replace(two, balls=balls[:1], load=Load("force", (0.01,)), periodic=Periodic((7.0, 5.0)))
    (_, state), (_, states) = (numbers(solve_contact(problem, 1e-4)) for problem in (one, two))
    np.testing.assert_allclose(states, np.tile(state, (2, 1)), rtol=1e-4)


def test_a_thin_layer_of_the_material_of_its_base_is_part_of_it():
    load = Load("force", FORCES)
    half_space = replace(cell(load), layer=replace(LAYER, thickness=np.inf))
    thin = replace(cell(load), layer=replace(LAYER, thickness=0.05), substrate=Elastic(LAYER.young, LAYER.poisson))
    found = [numbers(solve_contact(problem, ACCURACY)) for problem in (half_space, thin)]
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-9)
    np.testing.assert_allclose(found[1][1][:, 1:], found[0][1][:, 1:], rtol=1e-9)


def test_errors_on_a_very_soft_base_contain_those_of_the_sums_over_images():
    problem = Problem(
        Layer(1.0, 0.3, 0.72), (Ball((0.6, 1.1), 1.0, "paraboloid"),), Load("force", (1.4e-4,)), Elastic(2.8e-4, 0.3),
        periodic=Periodic((13.0, 13.0)),
    )  # fmt: skip
    rough, fine = (solve_contact(problem, accuracy).result().balls[0] for accuracy in (1e-4, 1e-8))
    assert abs(rough.approach - fine.approach) <= rough.errors["approach"] < 1e-6 * fine.approach
