import numpy as np
import pytest

from linear_bem import Ball, Elastic, InvalidProblem, Layer, Load, Problem, solve_contact
from linear_bem.interaction_energy import energy_force
from linear_bem.stress import stress_response, vertical_stress


@pytest.fixture(scope="module")
def hertz():
    """One ball on a half-space with contact radius 0.1."""
    return solve_contact(
        Problem(Layer(1.0, 0.3, np.inf), (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("approach", (0.01,)))
    )


@pytest.fixture(scope="module")
def unlike():
    balls = (Ball((-1.1, 0.0), 1.0, "paraboloid"), Ball((1.1, 0.4), 0.8, "paraboloid"))
    return solve_contact(Problem(Layer(1.0, 0.45, 0.6), balls, Load("approach", (0.02, 0.03)), Elastic(5.0, 0.2)), 1e-6)


def test_displacement_is_hertz_inside_and_outside_the_contact(hertz):
    a, d = 0.1, 0.01
    inside = np.array([0.0, 0.03, 0.0999])
    outside = np.array([0.1001, 0.101, 0.105, 0.115, 0.14, 0.3, 3.0])
    assert hertz.displacement(inside, 0 * inside) == pytest.approx(d - inside**2 / 2, rel=1e-9)
    s = a / outside
    exact = d / np.pi * ((2 - s**-2) * np.arcsin(s) + np.sqrt(s**-2 - 1))
    assert hertz.displacement(outside, 0 * outside) == pytest.approx(exact, rel=1e-6)


def test_pressure_and_outline_are_hertz(hertz):
    r = np.array([0.0, 0.05, 0.09, 0.11])
    peak = hertz.result().balls[0].peak_pressure
    assert hertz.pressure(r, 0 * r) == pytest.approx(peak * np.sqrt(np.maximum(1 - (r / 0.1) ** 2, 0)), rel=1e-8)
    assert np.hypot(*hertz.outline(0)) == pytest.approx(np.full(64, 0.1), rel=1e-9)


def test_surface_follows_the_balls_inside_both_contacts(unlike):
    for i, ball in enumerate(unlike.problem.balls):
        x, y = unlike.outline(i)
        x, y = 0.3 * ball.position[0] + 0.7 * x, 0.3 * ball.position[1] + 0.7 * y
        depth = unlike.contacts.approaches[i] - ((x - ball.position[0]) ** 2 + (y - ball.position[1]) ** 2) / (
            2 * ball.radius
        )
        assert unlike.displacement(x, y) == pytest.approx(depth, abs=1e-6 * unlike.contacts.approaches[i])


def test_three_routes_to_the_tangential_force_agree(unlike):
    mutual, slope = unlike.contacts.mutual_force, unlike.contacts.slope_force
    size = np.max(np.abs(mutual))
    assert slope == pytest.approx(mutual, abs=1e-6 * size)
    for ball in (0, 1):
        assert energy_force(unlike, ball) == pytest.approx(tuple(mutual[ball]), abs=1e-5 * size)


def test_the_energy_route_holds_for_touching_balls_too():
    balls = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
    touching = solve_contact(
        Problem(Layer(1.0, 0.48, 1.16), balls, Load("force", (2.66666e-3,) * 2), Elastic(1e3, 0.3)), 1e-6
    )
    mutual = touching.contacts.mutual_force[0, 0]
    assert energy_force(touching, 0)[0] == pytest.approx(mutual, rel=1e-5)


def test_vertical_stress_on_the_axis_is_hertz(hertz):
    peak = hertz.result().balls[0].peak_pressure
    for depth in (0.003, 0.05, 0.3):
        assert vertical_stress(hertz, 0.0, 0.0, depth) == pytest.approx(-peak / (1 + (depth / 0.1) ** 2), rel=1e-6)
    assert vertical_stress(hertz, 0.0, 0.0, 0.0) == pytest.approx(-peak, rel=1e-8)
    assert hertz.pressure(0.2, 0.0) == 0.0


@pytest.mark.parametrize("depth", [0.1, 0.6])
def test_vertical_stress_on_a_plane_carries_the_load(depth):
    problem = Problem(Layer(1.0, 0.45, 0.6), (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("force", (0.01,)))
    z, w = np.polynomial.legendre.leggauss(300)
    r, w = 10.0 * (1 + z), 10.0 * w
    stress = vertical_stress(solve_contact(problem), r, 0 * r, depth)
    assert np.sum(2 * np.pi * r * stress * w) == pytest.approx(-0.01, rel=1e-6)


def test_stress_response_of_equal_materials_is_boussinesqs():
    t, layer = np.geomspace(1e-3, 20, 9), Elastic(1.0, 0.4)
    assert stress_response(layer, layer, t, 0.5) == pytest.approx((1 + 0.5 * t) * np.exp(-0.5 * t), abs=1e-13)
    assert stress_response(layer, None, t, 0.0) == pytest.approx(np.ones(9), abs=1e-12)


def test_stress_outside_the_layer_is_refused(unlike):
    with pytest.raises(InvalidProblem, match=r"between 0 and 0\.6"):
        vertical_stress(unlike, 0.0, 0.0, 0.7)


def test_stress_on_a_grid_meets_polynomials_from_one_cell_on_and_is_refused_above():
    balls = (Ball((0.0, 0.0), 1.0, "paraboloid"), Ball((2.0, 0.0), 1.0, "paraboloid"))
    problem = Problem(Layer(1.0, 0.4, 0.3), balls, Load("force", (0.05, 0.02)))
    grid, smooth = solve_contact(problem, 1e-3), solve_contact(problem, 1e-5)
    cell = max(patch.cell for patch in grid.contacts.patches.patches)
    ball = smooth.result().balls[0]
    r = 1.2 * np.sqrt(ball.contact_area / np.pi) * np.linspace(-1.0, 1.0, 21)
    for depth in (cell, 2.0 * cell):
        stress = [vertical_stress(s, r, 0.3 * r, depth) / ball.peak_pressure for s in (grid, smooth)]
        # pressures that step from cell to cell are felt within a cell or two
        assert stress[0] == pytest.approx(stress[1], abs=0.015 * cell / depth)
    with pytest.raises(InvalidProblem, match=rf"at least one cell .* {cell:g} m, got 0\.001 m; go deeper"):
        vertical_stress(grid, 0.0, 0.0, 0.001)
    assert vertical_stress(grid, 0.01, 0.02, 0.0) == -grid.pressure(0.01, 0.02)
