import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from linear_bem import (
    Ball,
    Elastic,
    InvalidProblem,
    Layer,
    LayeredKernel,
    Load,
    NotConverged,
    Periodic,
    Problem,
    UnsupportedProblem,
    solve,
    solve_contact,
    solve_point_load,
)
from linear_bem.closed_forms import (
    bonded_compressible_force,
    bonded_incompressible_force,
    hertz_force,
    sneddon_sphere,
)
from linear_bem.grid.contacts import GridContacts
from linear_bem.lifted_balls import rest
from linear_bem.problem import FiniteStrain
from linear_bem.smooth.contacts import SmoothContacts


def pair(layer, substrate=None, distance=2.0, force=2.66666e-3):
    balls = (Ball((-0.5 * distance, 0.0), 1.0, "paraboloid"), Ball((0.5 * distance, 0.0), 1.0, "paraboloid"))
    return Problem(layer, balls, Load("force", (force, force)), substrate)


def pull(problem, accuracy=1e-4):
    result = solve(problem, accuracy)
    assert not result.solved.notes
    return result.balls[0].tangential_force[0]


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1.0, 1e2])
def test_a_vanishing_layer_leaves_the_substrates_force(ratio):
    substrate = Elastic(1.0 / ratio, 0.3)
    force = 2.66666e-3 / ratio * 1e-3
    solution = solve(pair(Layer(1.0, 0.48, 1e-5), substrate, force=force), 1e-4)
    # the softest film alone is pressed in by many times its thickness, which is said
    assert bool(solution.solved.notes) == (ratio == 1e-6)
    film = solution.balls[0].tangential_force[0]
    bare = pull(pair(Layer(substrate.young, 0.3, np.inf), force=force))
    assert film == pytest.approx(bare, rel=2e-3)


def test_no_layer_at_all_is_the_substrate_alone_and_needs_one():
    substrate = Elastic(1e3, 0.3)
    none, bare = pair(Layer(1.0, 0.48, 0.0), substrate, force=2.0), pair(Layer(1e3, 0.3, np.inf), force=2.0)
    assert solve(none).balls == solve(bare).balls
    assert solve_point_load(none).balls == solve_point_load(bare).balls
    with pytest.raises(InvalidProblem, match="must be greater than 0, got 0 m"):
        pair(Layer(1.0, 0.48, 0.0))
    with pytest.raises(InvalidProblem, match="must not be negative, got -1 m"):
        pair(Layer(1.0, 0.48, -1.0), substrate)


@pytest.mark.parametrize("ratio", [1e-6, 1.0, 1e6])
def test_a_thousand_radii_of_layer_are_a_half_space(ratio):
    # the bond's contribution falls like (L/h)^2 times the contrast
    deep = pull(pair(Layer(1.0, 0.48, 1e3), Elastic(1.0 / ratio, 0.3)))
    half = pull(pair(Layer(1.0, 0.48, np.inf)))
    assert deep == pytest.approx(half, rel=1e-4)


@pytest.mark.parametrize(("poisson", "limit"), [(0.3, bonded_compressible_force), (0.5, bonded_incompressible_force)])
def test_a_thin_layer_on_a_rigid_base_has_the_asymptotic_stiffness(poisson, limit):
    layer = Layer(1.0, poisson, 4e-3)
    ball = solve(Problem(layer, (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("approach", (3.6e-3,))), 1e-2).balls[0]
    # the edge's correction is of order h/a = 0.05
    assert ball.normal_force == pytest.approx(limit(3.6e-3, 1.0, layer), rel=0.03)


def test_grid_and_polynomials_agree_where_both_apply():
    for problem in (
        pair(Layer(1.0, 0.48, np.inf), force=2.0),
        pair(Layer(1.0, 0.5, 0.4), force=1e-2),
        pair(Layer(1.0, 0.0, 0.3), Elastic(3.0, 0.5), force=2e-2),
    ):
        smooth = solve_contact(problem)
        assert isinstance(smooth.contacts, SmoothContacts)
        grid = solve_contact(problem, on_grids=True)
        assert isinstance(grid.contacts, GridContacts)
        for a, b in zip(smooth.result().balls, grid.result().balls, strict=True):
            assert b.tangential_force[0] == pytest.approx(a.tangential_force[0], rel=1e-4)
            assert b.approach == pytest.approx(a.approach, rel=1e-4)
            assert b.contact_area == pytest.approx(a.contact_area, rel=0.02)
            assert b.peak_pressure == pytest.approx(a.peak_pressure, rel=0.01)
        x, y = np.array([0.1, -0.9, 2.5]), np.array([0.2, 0.0, -1.0])
        assert grid.displacement(x, y) == pytest.approx(smooth.displacement(x, y), rel=1e-3)
        line = np.linspace(-3.0, 3.0, 101)
        away = grid.contacts.drawn_displacement(line, 0.1 * line) - grid.displacement(line, 0.1 * line)
        assert np.max(np.abs(away)) < 2e-3 * grid.result().balls[0].approach


@pytest.mark.parametrize("shape", ["line of four", "three by three"])
def test_rows_and_blocks_under_a_common_approach_agree_on_grids_and_polynomials(shape):
    xy = (
        [(2.0 * i, 0.0) for i in range(4)]
        if shape == "line of four"
        else [(2.0 * (i // 3), 2.0 * (i % 3)) for i in range(9)]
    )
    load = Load("total_force", (2.66666e-3 * len(xy),))
    problem = Problem(Layer(1.0, 0.48, 1.16), tuple(Ball(p, 1.0, "paraboloid") for p in xy), load, Elastic(1e3, 0.3))
    smooth = solve(problem)
    grid = solve_contact(problem, on_grids=True).result()
    assert grid.solved.unknowns > smooth.solved.unknowns
    size = max(abs(t) for b in smooth.balls for t in b.tangential_force)
    for a, b in zip(smooth.balls, grid.balls, strict=True):
        assert b.normal_force == pytest.approx(a.normal_force, rel=1e-4)
        assert b.tangential_force == pytest.approx(a.tangential_force, abs=1e-3 * size)


def test_grids_alone_are_refused_in_a_cell_and_for_a_sample():
    one = Problem(Layer(1.0, 0.48, 1.0), (Ball((0.0, 0.0), 1.0),), Load("approach", (0.1,)))
    for problem, sample in ((replace(one, periodic=Periodic((3, 3))), None), (one, 5)):
        with pytest.raises(UnsupportedProblem, match="on_grids"):
            solve_contact(problem, sample=sample, on_grids=True)


def test_a_stiff_film_on_a_soft_base_is_solved_on_any_grid():
    """The film spreads the load: the pair's force is nearly that of two loads on the bare base."""
    substrate = Elastic(1e-3, 0.0)
    problem = pair(Layer(1.0, 0.48, 0.02), substrate, force=1e-4)
    q = problem.load.values[0]
    assert pull(problem, 1e-3) == pytest.approx(-q * q * LayeredKernel.of(problem).slope(2.0), rel=0.1)


def test_force_is_smooth_over_eight_decades_of_load():
    layer, substrate = Layer(1.0, 0.48, 1.16), Elastic(1e3, 0.3)
    light, heavy = (pull(pair(layer, substrate, force=q)) / q**2 for q in (1e-10, 1e-9))
    assert light == pytest.approx(heavy, rel=1e-5)
    assert pull(pair(layer, substrate, force=1e-2)) / 1e-4 == pytest.approx(light, rel=0.05)


def test_far_balls_obey_the_point_load_law():
    layer, substrate = Layer(1.0, 0.48, 1.16), Elastic(1e3, 0.3)
    for distance in (20.0, 50.0):
        problem = pair(layer, substrate, distance)
        q = problem.load.values[0]
        assert pull(problem) == pytest.approx(-q * q * LayeredKernel.of(problem).slope(distance), rel=2e-3)


def test_the_point_load_law_departs_like_contact_radius_over_thickness_squared():
    """Contacts must also be small against the thickness: a soft film's kernel varies over that length."""
    shares = []
    for force in (1e-3, 1e-5):
        problem = pair(Layer(1.0, 0.48, 0.3), Elastic(1e6, 0.3), force=force)
        full, law = solve(problem, 1e-6).balls[0], solve_point_load(problem).balls[0]
        assert abs(full.tangential_force[0] - law.tangential_force[0]) < 1.1 * law.tangential_force_error
        shares.append((full.tangential_force[0] / law.tangential_force[0] - 1.0) / (full.contact_area / np.pi / 0.3**2))
    # the next order is (a/h)^4, 0.6 % at the larger force
    assert shares[0] == pytest.approx(shares[1], rel=0.03)
    assert shares[1] == pytest.approx(0.115, rel=0.02)


def test_merging_contacts_share_one_grid_and_stay_symmetric():
    problem = pair(Layer(1.0, 0.48, np.inf), force=12.0)
    solution = solve_contact(problem, 1e-2)
    assert isinstance(solution.contacts, GridContacts)
    left, right = solution.result().balls
    assert solution.pressure(0.0, 0.0) > 0.0
    assert left.normal_force == pytest.approx(12.0, rel=1e-9)
    assert left.tangential_force[0] == pytest.approx(-right.tangential_force[0], rel=1e-6)
    slope = left.tangential_force_routes["slope"][0]
    assert left.tangential_force[0] == pytest.approx(slope, rel=2e-2)
    together = solve(problem.with_load("total_force", (24.0,)), 1e-2).balls[0]
    assert together.approach == pytest.approx(left.approach, rel=1e-4)
    assert together.tangential_force[0] == pytest.approx(left.tangential_force[0], rel=1e-3)


def test_a_ball_a_hundred_times_larger_than_its_neighbours():
    balls = (
        Ball((0.0, 0.0), 100.0, "paraboloid"),
        Ball((20.0, 0.0), 1.0, "paraboloid"),
        Ball((0.0, -21.0), 1.0, "paraboloid"),
    )
    result = solve(Problem(Layer(1.0, 0.48, np.inf), balls, Load("approach", (0.1, 0.1, 0.1))))
    t = np.array([b.tangential_force for b in result.balls])
    slope = np.array([b.tangential_force_routes["slope"] for b in result.balls])
    assert np.max(np.abs(t - slope)) < 1e-4 * np.max(np.abs(t))
    assert t[1, 0] < 0.0
    assert t[2, 1] > 0.0


def test_spheres_are_stiffer_to_the_edge_than_paraboloids_and_meet_sneddon():
    approach, force = sneddon_sphere(0.4, 1.0, Elastic(1.0, 0.3).contact_modulus)
    ball = Ball((0.0, 0.0), 1.0, "sphere")
    result = solve(Problem(Layer(1.0, 0.3, np.inf), (ball,), Load("approach", (approach,)))).balls[0]
    assert result.normal_force == pytest.approx(force, rel=1e-5)
    assert result.contact_area == pytest.approx(np.pi * 0.16, rel=1e-3)
    assert result.normal_force < hertz_force(approach, 1.0, 1.0 / 0.91)


def test_an_elliptic_profile_meets_hertz():
    """Curvatures 1 and 1/4: the ellipse and the force of [Johnson 1985, section 4.2] by complete elliptic integrals."""

    def ratio(e2):
        b = 1.0 - e2
        return (ellipe(e2) / b - ellipk(e2)) / (ellipk(e2) - ellipe(e2))

    e2 = brentq(lambda e: ratio(e) - 4.0, 0.1, 0.99)
    load = 1e-3
    modulus = 1.0 / 0.91
    a = (3 * load / (2 * np.pi * modulus) * 2 * (ellipk(e2) - ellipe(e2)) / e2 / 0.25) ** (1 / 3)
    area = np.pi * a * a * np.sqrt(1 - e2)
    approach = 3 * load / (2 * np.pi * modulus * a) * ellipk(e2)
    turned = 0.6

    def profile(x, y):
        u, v = np.cos(turned) * x + np.sin(turned) * y, -np.sin(turned) * x + np.cos(turned) * y
        return 0.5 * u**2 + 0.125 * v**2

    ball = solve(Problem(Layer(1.0, 0.3, np.inf), (Ball((0.2, 0.1), 1.0, profile),), Load("force", (load,)))).balls[0]
    assert ball.contact_area == pytest.approx(area, rel=1e-6)
    assert ball.approach == pytest.approx(approach, rel=1e-6)


def beside_a_deep_ball(overlap):
    """A ball pressed in by ``overlap`` beyond the surface that its deep neighbour has lowered."""
    balls = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
    layer, substrate, deep = Layer(1.0, 0.48, 1.16), Elastic(1e3, 0.3), 0.0768
    lifted = solve_contact(Problem(layer, balls, Load("approach", (deep, -0.5)), substrate), 1e-6)
    height = rest(lifted.contacts, 1)[0]
    return Problem(layer, balls, Load("approach", (deep, height + overlap)), substrate)


@pytest.mark.parametrize("overlap", [1e-8, 1e-6, 1e-4])
def test_a_ball_that_barely_touches_carries_load(overlap):
    light = solve(beside_a_deep_ball(overlap), 1e-4)
    deep, ball = light.balls
    # Hertz on a layer that is thick against so small a contact
    assert ball.normal_force == pytest.approx(hertz_force(overlap, 1.0, 1.0 / (1.0 - 0.48**2)), rel=0.02)
    assert ball.tangential_force[0] == pytest.approx(-deep.tangential_force[0], rel=1e-6)
    # T goes like the force
    heavier = solve(beside_a_deep_ball(2.0 * overlap), 1e-4).balls[1]
    ratio = heavier.tangential_force[0] / ball.tangential_force[0]
    assert ratio == pytest.approx(heavier.normal_force / ball.normal_force, rel=0.01)


def test_the_error_estimate_covers_a_contact_smaller_than_a_cell():
    problem = beside_a_deep_ball(1e-6)
    exact = solve(problem, 1e-4).balls
    on_grids = solve_contact(problem, 1e-2, on_grids=True).result().balls
    for ball, known in zip(on_grids, exact, strict=True):
        off = abs(ball.tangential_force[0] - known.tangential_force[0])
        assert off <= ball.tangential_force_error < 100.0 * abs(known.tangential_force[0])


def test_unsupported_and_invalid_problems_are_refused():
    problem = pair(Layer(1.0, 0.48, 1.0))
    with pytest.raises(UnsupportedProblem, match="or set it to None"):
        solve(Problem(problem.layer, problem.balls, problem.load, None, FiniteStrain()))
    with pytest.raises(InvalidProblem, match="between 0 and 1"):
        solve(problem, accuracy=0.0)
    saddle = Ball((0.0, 0.0), 1.0, lambda x, y: x**2 - y**2)
    with pytest.raises(InvalidProblem, match="convex"):
        solve(Problem(problem.layer, (saddle,), Load("approach", (0.1,))))


@pytest.mark.parametrize(
    ("count", "load", "refusal"),
    [
        (9, "force", "grid contact: a ball under a prescribed force lost its contact"),
        (121, "total_force", "point loads: the effective approaches did not converge"),
        (529, "force", "far field: a contact grew or moved out of the mesh"),
    ],
)
def test_a_load_that_is_too_large_is_refused_with_a_remedy(count, load, refusal):
    places = [(2.6 * i, 2.6 * j) for i in range(round(count**0.5)) for j in range(round(count**0.5))]
    values = (41.0,) * count if load == "force" else (41.0 * count,)
    balls = tuple(Ball(place, 1.0) for place in places)
    with pytest.raises(NotConverged, match=rf"^{refusal}.*press the balls less deep") as refused:
        solve(Problem(Layer(1.0, 0.48, 8.0), balls, Load(load, values)), accuracy=1e-3)
    assert ("up to 500 balls are tried on grids" in str(refused.value)) == (count > 500)


def test_sweeps_that_cycle_are_given_up_early():
    lines = []
    cell = Problem(
        Layer(1.0, 0.45, 2.0), (Ball((0.0, 0.0), 1.0),), Load("approach", (1.6,)), periodic=Periodic((3.0, 3.0))
    )
    with pytest.raises(UnsupportedProblem, match="press the balls less deep"):
        solve(cell, accuracy=1e-3, report=lines.append)
    sweeps = [int(found[1]) for line in lines if (found := re.search(r"degree \d+, sweep (\d+): change", line))]
    assert 10 < max(sweeps) < 30
