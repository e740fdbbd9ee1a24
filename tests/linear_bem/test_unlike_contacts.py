"""More than a hundred contacts far from the usual: deep, of very unlike sizes, on a stiff film, caps close by."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipk

import linear_bem.memory
from linear_bem import Ball, Elastic, Ellipsoid, Layer, LayeredKernel, Load, Problem, Punch, solve, solve_contact
from linear_bem.errors import TooLarge
from linear_bem.far_field.pairs_and_mesh import FarField
from linear_bem.lifted_balls import rest, rests
from linear_bem.profiles import height
from linear_bem.smooth.initial_guess import first_guess
from linear_bem.smooth.newton import Rule
from linear_bem.smooth.polynomials import PARABOLA
from linear_bem.smooth.zone import Zone
from tests.linear_bem.sampled_scenes import scattered


def lattice(count, spacing, shake=0.0):
    rng = np.random.default_rng(1)
    columns = int(np.ceil(np.sqrt(count)))
    x = spacing * np.array([(k % columns, k // columns) for k in range(count)], dtype=float)
    return (x + rng.uniform(-shake, shake, x.shape)).tolist()


def test_the_degree_goes_up_until_the_residuals_are_small_too():
    balls = tuple(Ball(place, 1.0) for place in lattice(102, 2.6, 0.2))
    solution = solve_contact(Problem(Layer(1.0, 0.48, 8.0), balls, Load("approach", (0.5,) * 102)), 1e-2)
    assert solution.contacts.smooth.nodes[0].zone.degree == 6
    assert solution.accuracy["reached"] <= 1e-2


def test_the_approach_under_a_total_force_is_as_well_known_as_stated():
    balls = tuple(Ball(place, 1.0) for place in lattice(102, 2.8, 0.3))
    problem = Problem(Layer(30.0, 0.3, 0.2), balls, Load("total_force", (0.5,)), Elastic(1.0, 0.5))
    quick, sharp = (solve(problem, accuracy).balls[0] for accuracy in (1e-3, 1e-5))
    assert abs(quick.approach - sharp.approach) <= quick.errors["approach"] + sharp.errors["approach"]
    assert quick.errors["approach"] < 1e-4 * quick.approach


def test_contacts_that_are_large_against_the_distances_of_others_are_near_ones():
    x = [(0.0, 0.0), (6.0, 0.0), (0.0, 6.0), (6.0, 6.0)]
    small = np.array(lattice(400, 0.2)) + 1.0
    clear = np.all(np.hypot(*(small[:, None] - np.array(x)).transpose(2, 0, 1)) > 1.05, axis=1)
    balls = tuple(Ball(place, 1.0) for place in x) + tuple(Ball(place, 0.03) for place in small[clear].tolist())
    forces = (0.1,) * 4 + (2e-5,) * int(np.sum(clear))
    result = solve(Problem(Layer(1.0, 0.45, np.inf), balls, Load("force", forces)), 1e-2)
    assert result.balls[0].contact_area > np.pi * 0.3**2
    assert result.solved.accuracy["reached"] <= 1e-2


def test_caps_that_the_others_lift_rest_where_one_alone_would():
    rng = np.random.default_rng(2)
    places, _ = scattered(150, 18.0, low=0.6, high=0.6)
    balls = tuple(Ball(place, 20.0, "paraboloid", asperity=True) for place in places.tolist())
    depths = rng.uniform(0.0, 0.008, 150).tolist()
    solution = solve_contact(Problem(Layer(1.0, 0.4, 6.0), balls, Load("approach", tuple(depths))), 1e-2)
    lifted = np.flatnonzero(solution.contacts.normal_forces == 0.0).tolist()
    assert len(lifted) > 3
    together = [value for value, _ in rests(solution.contacts, lifted)]
    alone = [rest(solution.contacts, ball)[0] for ball in lifted[::5]]
    assert together[::5] == pytest.approx(alone, abs=1e-4 * max(depths))
    flat = Ball(balls[lifted[0]].position, shape=Punch(0.6, 0.1), asperity=True)
    other = replace(solution.problem, balls=(*balls[: lifted[0]], flat, *balls[lifted[0] + 1 :]))
    contacts = replace(solution.contacts, problem=other)
    assert rests(contacts, lifted[:2])[0] == rest(contacts, lifted[0])


def test_a_mesh_that_does_not_fit_is_refused_with_its_size(monkeypatch):
    group = np.array(lattice(1500, 2.5))
    places = np.concatenate([group, group + 1500.0])
    kernel = LayeredKernel(Layer(1.0, 0.45, 4.0), Elastic(5.0, 0.3))
    assert FarField.of(kernel, places, np.array(0.5), 1e-4).mesh is not None
    monkeypatch.setattr(linear_bem.memory, "free_memory", lambda: 1e7)
    with pytest.raises(TooLarge, match=r"a mesh of [\d ]+ nodes over 3000 balls needs about 0\.\d+ GB"):
        FarField.of(kernel, places, np.array(0.5), 1e-4)


@pytest.mark.parametrize("aspect", [1.0, 30.0, 140.0])
def test_a_needle_of_a_contact_feels_itself_as_exactly_as_a_round_one(aspect):
    # Hertz's pressure [Johnson 1985, section 3.3]: its displacement at the centre, and quadratic along every line
    zone = Zone(np.zeros((1, 2)), np.diag([aspect, 1.0])[None], 2, PARABOLA[None])
    xi, eta = np.array([[0.0, 0.5, 1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0, 0.5, 1.0]])
    rule = Rule.of(zone, np.inf)
    found = zone.half_space(xi, eta, rule.directions, rule.along)[0][0]
    assert rule.directions < 150
    assert found[0] == pytest.approx(np.pi * ellipk(1.0 - aspect**-2), rel=1e-9)
    assert found[[1, 3]] == pytest.approx(0.75 * found[0] + 0.25 * found[[2, 4]], rel=1e-9)


@pytest.mark.parametrize("shape", [Ellipsoid((40.0, 1.0, 1.0)), lambda x, y: x**2 / 3200.0 + np.cosh(y) - 1.0])
def test_the_first_guess_of_a_long_contact_ends_where_its_body_is_high(shape):
    long = Ball((1.0, 2.0), 40.0, shape)
    problem = Problem(Layer(1.0, 0.45, 3.0), (long,), Load("approach", (0.1,)))
    reach = first_guess(problem, LayeredKernel.of(problem)).zones.reach
    assert height(long)(1.0 + reach, np.full(1, 2.0)) < 0.21
