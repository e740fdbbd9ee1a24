"""The paper's cases against independent reference values, at default accuracy."""

import numpy as np
import pytest

from linear_bem import (
    Ball,
    Elastic,
    Ellipsoid,
    InvalidProblem,
    Layer,
    Load,
    Problem,
    solve,
    solve_contact,
    solve_point_load,
)
from linear_bem.closed_forms import hertz_force
from linear_bem.layer.rectangle_load import deepest_bulge, love_rectangle, uniform_square_displacement
from tests.linear_bem.conftest import PAPER_LOAD

REFERENCE = {1.16: -1.161292e-7, 6.0: 4.098673e-7, np.inf: 4.362335e-7}


@pytest.mark.parametrize("thickness", REFERENCE)
def test_two_balls_feel_the_reference_force(paper_pair, thickness):
    left, right = solve(paper_pair(thickness)).balls
    assert left.tangential_force[0] == pytest.approx(REFERENCE[thickness], rel=1e-5)
    assert right.tangential_force[0] == pytest.approx(-left.tangential_force[0], rel=1e-12)
    assert left.tangential_force_error < 1e-4 * abs(left.tangential_force[0])


@pytest.mark.parametrize("thickness", [0.171697, 1.697711])
def test_force_changes_sign_at_the_reference_thicknesses(paper_pair, thickness):
    below, above = (solve(paper_pair(thickness * (1 + e))).balls[0].tangential_force[0] for e in (-1e-4, 1e-4))
    zero = thickness * (1 + 1e-4 * (below + above) / (below - above))
    assert below * above < 0
    assert zero == pytest.approx(thickness, rel=1e-5)


def test_one_ball_is_hertz():
    layer = Layer(3.0, 0.3, np.inf)
    for load in (1e-8, 1e-2, 1.0):
        ball = solve(Problem(layer, (Ball((0.3, 0.2), 2.0, "paraboloid"),), Load("force", (load,)))).balls[0]
        # Johnson 1985, eqs. 4.22 to 4.24; the force goes like the approach to 3/2
        assert hertz_force(ball.approach, 2.0, layer.contact_modulus) == pytest.approx(load, rel=1.5e-9)
        area = np.pi * 2.0 * ball.approach
        assert ball.contact_area == pytest.approx(area, rel=1e-9)
        assert ball.peak_pressure == pytest.approx(1.5 * load / area, rel=1e-9)
        assert np.hypot(*ball.tangential_force) <= 1e-15 * load


def test_the_three_kinds_of_load_are_one_problem(paper_pair):
    given = solve(paper_pair()).balls[0]
    for load in (Load("approach", (given.approach,) * 2), Load("total_force", (2 * PAPER_LOAD,))):
        ball = solve(paper_pair(load=load)).balls[0]
        assert ball.approach == pytest.approx(given.approach, rel=1e-9)
        assert ball.normal_force == pytest.approx(PAPER_LOAD, rel=1e-9)
        assert ball.tangential_force[0] == pytest.approx(given.tangential_force[0], rel=1e-8)


def test_energy_derivative_at_fixed_approach_is_the_tangential_force(paper_pair):
    """At fixed approaches the elastic energy U = 1/2 <p, w> falls as the pair follows its mutual force."""
    load = Load("approach", (0.0123391, 0.0123391))
    step = 0.02

    def energy(distance):
        s = solve_contact(paper_pair(distance=distance, load=load), 1e-6)
        return sum(0.5 * s.pressure(n.x, n.y) * s.displacement(n.x, n.y) @ n.weights for n in s.contacts.smooth.nodes)

    rise = 8 * (energy(2.2 + step) - energy(2.2 - step)) - (energy(2.2 + 2 * step) - energy(2.2 - 2 * step))
    left = solve(paper_pair(distance=2.2, load=load), 1e-6).balls[0]
    assert rise / (12 * step) == pytest.approx(left.tangential_force[0], rel=1e-4)


def test_the_bulge_beside_a_loaded_square_meets_the_reference():
    where, depth = deepest_bulge(Layer(1.0, 0.48, 1.0), Elastic(1e3, 0.3))
    assert where == pytest.approx(1.675357, rel=1e-6)
    assert depth == pytest.approx(-5.801183e-2, rel=1e-6)


def test_half_space_does_not_bulge():
    assert deepest_bulge(Layer(1.0, 0.48, np.inf), None) == (np.inf, 0.0)


def test_rectangle_is_a_point_load_far_away():
    assert love_rectangle(300.0, 400.0, 0.5, 0.25) == pytest.approx(0.5 / 500.0, rel=1e-6)
    w = uniform_square_displacement(Layer(1.0, 0.3, 2.0), None, 0.5, 7.0, np.array([0.0, 0.4, 3.0]))
    assert w.shape == (3,)


@pytest.mark.parametrize(
    ("layer", "half_side", "words"),
    [
        (Layer(1.0, 0.3, 0.0), 1.0, "layer.thickness: must be greater than 0, got 0 m"),
        (Layer(-1.0, 0.3, 1.0), 1.0, "layer.young: must be greater than 0 and finite, got -1 Pa"),
        (None, 1.0, "layer: must be a Layer or a SurfaceResponse, got None"),
        (Layer(1.0, 0.3, 1.0), -1.0, "half_side: must be a number greater than 0 and finite, got -1.0 m"),
        (Layer(1.0, 0.3, 1.0), 0.0, "half_side: must be a number greater than 0 and finite, got 0.0 m"),
    ],
)
def test_a_square_or_layer_without_size_is_refused(layer, half_side, words):
    with pytest.raises(InvalidProblem, match=words):
        deepest_bulge(layer, None, half_side)


def test_point_load_law_is_within_a_per_cent_of_the_full_model(paper_pair):
    for thickness in (1.16, 6.0):
        for load in (None, Load("approach", (0.0125, 0.0125)), Load("total_force", (2 * PAPER_LOAD,))):
            full, law = solve(paper_pair(thickness, load=load)), solve_point_load(paper_pair(thickness, load=load))
            assert law.model == "point_load"
            for a, b in zip(full.balls, law.balls, strict=True):
                assert b.tangential_force[0] == pytest.approx(a.tangential_force[0], rel=0.01)
                assert abs(b.tangential_force[0] - a.tangential_force[0]) <= b.tangential_force_error
                assert b.approach == pytest.approx(a.approach, rel=1e-4)
                assert b.normal_force == pytest.approx(a.normal_force, rel=1e-4)


@pytest.mark.parametrize(
    ("thickness", "depth", "distance"),
    [(0.6, 0.1, 2.0), (0.6, 0.3, 2.0), (0.6, 0.3, 3.0), (1.16, 0.5, 2.0), (2.0, 0.5, 3.0), (6.0, 0.3, 2.0)],
)
def test_the_error_estimate_of_the_point_load_law_holds_for_deep_balls(thickness, depth, distance):
    balls = tuple(Ball((side * distance / 2.0, 0.0), 1.0, "sphere") for side in (-1.0, 1.0))
    problem = Problem(Layer(1.0, 0.48, thickness), balls, Load("approach", (depth, depth)), Elastic(1e3, 0.3))
    exact, law = solve(problem, 1e-3).balls[0], solve_point_load(problem).balls[0]
    assert abs(law.tangential_force[0] - exact.tangential_force[0]) <= law.tangential_force_error
    assert law.tangential_force_error < abs(law.tangential_force[0])


@pytest.mark.parametrize(("base", "distance"), [(0.1, 2.2), (0.02, 3.0)])
def test_the_error_estimate_of_the_point_load_law_holds_on_a_soft_base_where_contacts_lie_on_slopes(base, distance):
    balls = (Ball((0.0, 0.0), 1.0, "sphere"), Ball((distance, 0.0), 1.0, "sphere"))
    problem = Problem(Layer(1.0, 0.3, 0.5), balls, Load("force", (0.02, 0.02)), Elastic(base, 0.3))
    exact, law = solve(problem, 1e-3).balls[0], solve_point_load(problem).balls[0]
    assert abs(law.tangential_force[0] - exact.tangential_force[0]) <= law.tangential_force_error
    assert law.tangential_force_error < 0.05 * law.tangential_force[0]


def test_the_error_estimate_of_the_point_load_law_contains_that_of_the_force_on_a_ball_in_the_dent_of_another():
    balls = (Ball((0.0, 0.0), 1.0), Ball((2.3, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.5, 1.16), balls, Load("approach", (0.15, 0.06)), Elastic(0.07, 0.3))
    exact, law = solve(problem, 1e-3).balls[0], solve_point_load(problem).balls[0]
    assert abs(law.tangential_force[0] - exact.tangential_force[0]) <= law.tangential_force_error
    assert law.tangential_force_error < 0.2 * law.tangential_force[0]


@pytest.mark.parametrize("aspect", [1.5, 3.0])
def test_the_error_estimate_of_the_point_load_law_holds_for_ellipsoids(aspect):
    body = Ellipsoid((aspect, 1.0, 1.0))
    balls = tuple(Ball((x, 0.0), shape=body) for x in (-3.0, 3.0))
    problem = Problem(Layer(1.0, 0.3, np.inf), balls, Load("force", (0.02, 0.02)))
    exact, law = solve(problem, 1e-3).balls[0], solve_point_load(problem).balls[0]
    assert abs(law.tangential_force[0] - exact.tangential_force[0]) <= law.tangential_force_error
    assert law.tangential_force_error < 0.05 * law.tangential_force[0]


def test_the_point_load_law_finds_the_force_of_a_body_that_is_no_ball_at_a_given_approach():
    balls = tuple(Ball((x, 0.0), 1.0, lambda x, y: (x**2 + y**2) * (0.1 + x**2 + y**2)) for x in (-5.0, 5.0))
    problem = Problem(Layer(1.0, 0.48, 8.0), balls, Load("approach", (0.1, 0.1)))
    exact, law = solve(problem, 1e-3).balls[0], solve_point_load(problem).balls[0]
    assert law.normal_force == pytest.approx(exact.normal_force, rel=1e-3)
    assert abs(law.tangential_force[0] - exact.tangential_force[0]) <= law.tangential_force_error


def test_certificate_is_recomputed_and_small(paper_pair):
    solved = solve(paper_pair()).solved
    certificate = solved.certificate
    assert set(solved.tolerances) == set(certificate)
    assert all(residual <= solved.tolerances[name] for name, residual in certificate.items())
    assert solved.to_dict()["tolerances"] == solved.tolerances
    assert set(certificate) == {
        "gap_in_contact", "penetration_outside", "complementarity", "negative_pressure", "load",
    }  # fmt: skip
    assert max(certificate.values()) < 1e-7


@pytest.mark.parametrize(
    ("layer", "base", "places", "approaches"),
    [
        (Layer(1.0, 0.3, 0.2431), 0.1, ((0.0, 0.0), (-0.12, -2.02), (2.03, 0.0)), (2.28e-5, 2.57e-5, 7.28e-4)),
        (Layer(1.0, 0.2, 0.0595), 0.1, ((0.0, 0.0), (-3.39, -3.66), (3.65, -0.97)), (7.25e-6, 1.5e-7, 9.76e-6)),
        (Layer(1.0, 0.2, 0.0204), 0.92, ((0.0, 0.0), (-1.2, -1.62)), (4.875e-6, 2.88e-5)),
        (Layer(1.0, 0.3, 0.0402), 0.302, ((0.0, 0.0), (3.75, -1.44)), (2.444e-4, 1.759e-4)),
    ],
)
def test_the_error_estimate_of_the_point_load_law_contains_that_of_forces_at_given_approaches(
    layer, base, places, approaches
):
    """The errors were up to 100 times too small: a light ball's force is less certain than the law.

    In the last scene the forces are off by 2e-5, as the estimate that they correct is a table.
    """
    balls = tuple(Ball(place, 1.0, "paraboloid") for place in places)
    problem = Problem(layer, balls, Load("approach", approaches), Elastic(base, 0.3))
    for exact, law in zip(solve(problem, 1e-5).balls, solve_point_load(problem).balls, strict=True):
        off = np.max(np.abs(np.subtract(exact.tangential_force, law.tangential_force)))
        assert off <= law.tangential_force_error <= 0.01 * np.hypot(*exact.tangential_force)
