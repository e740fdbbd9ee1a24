import numpy as np
import pytest

from linear_bem import Ball, Elastic, InvalidProblem, Layer, Load, Problem, solve, solve_height_field
from linear_bem.closed_forms import hertz_force


def paraboloid(count, width=1.0):
    x = width * ((np.arange(count) + 0.5) / count - 0.5)
    return 0.5 * (x[:, None] ** 2 + x**2), width / count


def test_a_ball_on_a_grid_is_hertz_at_second_order():
    layer, errors = Layer(1.0, 0.3, np.inf), []
    for count in (64, 128, 256):
        heights, cell = paraboloid(count)
        contact = solve_height_field(layer, None, heights, cell, approach=0.09)
        errors.append(abs(contact.normal_force / hertz_force(0.09, 1.0, layer.contact_modulus) - 1.0))
        assert max(contact.gap_in_contact, contact.penetration_outside) < 1e-8
        assert np.min(contact.pressure) == 0.0
    assert errors[2] < 2e-5
    # the staircase edge makes single steps uneven; over two halvings the order shows
    assert np.log2(errors[0] / errors[2]) / 2 > 1.4


def test_prescribed_force_and_approach_are_inverse_on_a_layer():
    layer, substrate = Layer(2.0, 0.45, 0.2), Elastic(30.0, 0.3)
    heights, cell = paraboloid(96)
    pressed = solve_height_field(layer, substrate, heights, cell, approach=0.03)
    loaded = solve_height_field(layer, substrate, heights, cell, normal_force=pressed.normal_force)
    assert loaded.approach == pytest.approx(0.03, rel=1e-7)
    ball = Problem(layer, (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("approach", (0.03,)), substrate)
    assert pressed.normal_force == pytest.approx(solve(ball).balls[0].normal_force, rel=2e-3)


def test_separate_summits_are_all_found():
    heights, cell = paraboloid(64, 2.0)
    x = 2.0 * ((np.arange(64) + 0.5) / 64 - 0.5)
    far = 0.5 * ((x[:, None] - 0.8) ** 2 + (x - 0.8) ** 2) + 0.004
    contact = solve_height_field(Layer(1.0, 0.3, np.inf), None, np.minimum(heights, far), cell, approach=0.03)
    assert contact.pressure[32, 32] > 0.0
    assert contact.pressure[57, 57] > 0.0
    assert contact.penetration_outside < 1e-8


def test_a_height_field_without_one_load_is_refused():
    heights, cell = paraboloid(32)
    with pytest.raises(InvalidProblem, match="one of normal_force and approach"):
        solve_height_field(Layer(1.0, 0.3, 1.0), None, heights, cell)
