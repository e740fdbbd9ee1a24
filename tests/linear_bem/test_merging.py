"""Contacts that need a grid: unequal balls under one holder, contacts that merge, balls that lift."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import gamma

from linear_bem import (
    Ball,
    Cone,
    Elastic,
    InvalidProblem,
    Layer,
    LayeredKernel,
    Load,
    Problem,
    Punch,
    solve,
    solve_contact,
)
from linear_bem.grid.cells import Cells
from linear_bem.grid.contacts import GridContacts
from linear_bem.grid.patches import Patch, Patches
from linear_bem.lifted_balls import rest


@pytest.mark.parametrize(("radius", "distance", "substrate"), [(10.0, 7.0, None), (100.0, 20.0, Elastic(1e3, 0.3))])
def test_unequal_balls_under_one_holder_agree_with_their_common_approach_prescribed(radius, distance, substrate):
    """Cells differ up to tenfold in side; under a prescribed approach there is no force to keep."""
    balls = (Ball((0.0, 0.0), radius, "paraboloid"), Ball((distance, 0.0), 1.0, "paraboloid"))
    held = Problem(Layer(1.0, 0.48, 1.16), balls, Load("total_force", (0.5,)), substrate)
    together = solve_contact(held, 1e-3)
    assert isinstance(together.contacts, GridContacts)
    assert together.contacts.iterations < 20
    depth = float(together.contacts.approaches[0])
    apart = solve_contact(held.with_load("approach", (depth, depth)), 1e-4)
    assert np.sum(together.contacts.normal_forces) == pytest.approx(0.5, rel=1e-10)
    assert together.contacts.normal_forces == pytest.approx(apart.contacts.normal_forces, rel=5e-4)
    size = np.max(np.abs(apart.contacts.mutual_force))
    assert together.contacts.mutual_force == pytest.approx(apart.contacts.mutual_force, abs=1e-3 * size)


@pytest.mark.parametrize("force", [30.0, 40.0])
def test_contacts_that_merge_far_beyond_polynomials_go_to_a_grid(force):
    """Newton's equations become singular during the iteration."""
    balls = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
    solution = solve_contact(Problem(Layer(1.0, 0.48, np.inf), balls, Load("force", (force, force))), 1e-2)
    assert isinstance(solution.contacts, GridContacts)
    left, right = solution.result().balls
    assert left.tangential_force[0] == pytest.approx(left.tangential_force_routes["slope"][0], rel=1e-2)
    assert left.tangential_force[0] == pytest.approx(-right.tangential_force[0], rel=1e-6)


@pytest.mark.parametrize("cell", [0.1, 0.2])
def test_a_ball_whose_cells_all_go_to_others_during_the_iteration_does_not_end_it(cell):
    kernel = LayeredKernel(Layer(1.0, 0.3, 1.0))
    patches = [Patch(kernel, (4.0 * k, 0.0), side, 8, 8, (k,)) for k, side in enumerate((0.1, cell))]
    cells = Cells(Patches(kernel, patches), [np.zeros((1, 8, 8))] * 2, [([0, 1], 1.0), ([2], 1.0)], 3)
    contact, residual = np.ones(128, dtype=bool), np.sin(np.arange(128.0))
    z, slope = cells.descent(residual, contact, np.repeat([0, 1], 64))
    assert slope > 0.0
    assert np.sum(z * cells.area) == pytest.approx(0.0, abs=1e-10 * np.max(np.abs(z)))


def test_a_custom_ball_that_lifts_on_a_grid_has_no_force():
    def sphere(x, y):
        return (x**2 + y**2) / (1.0 + np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0)))

    balls = (Ball((0.0, 0.0), 1.0, "paraboloid"), Ball((2.2, 0.0), 1.0, sphere))
    solution = solve_contact(Problem(Layer(1.0, 0.3, 0.1), balls, Load("approach", (0.05, -0.1))), 1e-2)
    assert isinstance(solution.contacts, GridContacts)
    lifted = solution.result().balls[1]
    assert lifted.normal_force == 0.0
    assert lifted.tangential_force_routes == {"mutual": (0.0, 0.0), "slope": (0.0, 0.0)}


def test_a_punch_that_a_neighbour_lifts_rests_on_its_edge_and_carries_load_from_there_on():
    balls = (Ball((0.0, 0.0), 1.0), Ball((2.2, 0.0), shape=Punch(1.0, 0.1)))
    layer = Layer(1.0, 0.48, 8.0)
    resting = solve_contact(Problem(layer, balls, Load("force", (0.6, 0.0))), 1e-2).contacts
    x = np.linspace(2.2, 3.2, 2001)
    lowest = float(np.min(resting.displacement(x, 0.0 * x) + Punch(1.0, 0.1).height(x - 2.2, 0.0)))
    assert resting.approaches[1] == pytest.approx(lowest, abs=1e-6)
    same = []
    for shape in ("sphere", lambda x, y: 1.0 - np.sqrt(1.0 - x**2 - y**2)):  # the second has no value beyond r = 1
        other = replace(resting.problem, balls=(balls[0], replace(balls[1], shape=shape)))
        same.append(rest(replace(resting, problem=other), 1)[0])
    assert same[1] == pytest.approx(same[0], abs=1e-9)
    forces = [0.0]
    for depth in (0.028, 0.034):  # touching at its edge only, and under its axis too
        found = solve_contact(Problem(layer, balls, Load("approach", (resting.approaches[0], depth))), 1e-2).contacts
        assert found.mutual_force[1, 0] < -1e-4
        forces.append(float(found.normal_forces[1]))
    assert np.all(np.diff(forces) > 5e-3)


def test_a_profile_that_starts_above_its_axis_is_refused():
    balls = (Ball((0.0, 0.0), 1.0, "paraboloid"), Ball((2.2, 0.0), 1.0, lambda x, y: 0.5 * (x**2 + y**2) + 0.02))
    with pytest.raises(InvalidProblem, match=r"must be 0 at the ball's axis, .* is 0\.02 m there; subtract it"):
        solve(Problem(Layer(1.0, 0.3, np.inf), balls, Load("total_force", (1e-3,))))


@pytest.mark.parametrize("power", [4, 6, 8])
@pytest.mark.parametrize("load", [Load("approach", (0.05,)), Load("force", (0.01,))])
def test_flat_profiles_meet_the_power_law(power, load):
    """f = r^n on a half-space: D = sqrt(pi) G(n/2 + 1)/G(n/2 + 1/2) a^n, Q = 2 E* n/(n + 1) D a [Sneddon 1965].

    The first guess of a flat contact is up to fifteen times too wide.
    """
    ball = Ball((0.0, 0.0), 1.0, lambda x, y: (x**2 + y**2) ** (power // 2))
    solution = solve(Problem(Layer(1.0, 0.3, np.inf), (ball,), load))
    assert not solution.solved.notes
    found = solution.balls[0]
    radius = (found.approach * gamma(0.5 * power + 0.5) / gamma(0.5 * power + 1.0) / np.sqrt(np.pi)) ** (1.0 / power)
    force = 2.0 / 0.91 * found.approach * radius * power / (power + 1.0)
    # forces and approaches may change by 1e-4 with the last refinement
    assert found.normal_force == pytest.approx(force, rel=4e-4)
    assert found.contact_area == pytest.approx(np.pi * radius**2, rel=0.01)


@pytest.mark.parametrize(("shape", "depth", "base"), [(Cone(0.3, 0.4), 0.9, None), ("sphere", 2.8, Elastic(1e3, 0.3))])
def test_a_pair_that_merges_deep_under_given_approaches_meets_the_same_pair_under_its_forces(shape, depth, base):
    """Coupled point loads have no solution there, so that the first guess needs another one."""
    balls = tuple(Ball((x, 0.0), 1.0 if shape == "sphere" else math.nan, shape) for x in (-1.0, 1.0))
    deep = solve(Problem(Layer(1.0, 0.48, 1.2), balls, Load("approach", (depth, depth)), base), 1e-2).balls[0]
    load = Load("force", (deep.normal_force,) * 2)
    forced = solve(Problem(Layer(1.0, 0.48, 1.2), balls, load, base), 1e-2).balls[0]
    assert forced.approach == pytest.approx(depth, rel=5e-3)
    bars = deep.tangential_force_error + forced.tangential_force_error
    assert abs(forced.tangential_force[0] - deep.tangential_force[0]) < bars


def test_balls_without_load_beside_merging_contacts_do_not_refine_the_grid():
    merging = tuple(Ball((x, 0.0), 10.0, asperity=True) for x in (-2.5, 2.5))
    above = tuple(Ball((6.0 * k - 12.0, 9.0), 10.0, asperity=True) for k in range(5))
    found = []
    for balls in (merging, merging + above):
        depths = (0.8, 0.8, *(len(balls) - 2) * (-0.1,))
        solution = solve_contact(Problem(Layer(1.0, 0.3, 4.0), balls, Load("approach", depths)), 1e-2)
        assert isinstance(solution.contacts, GridContacts)
        found.append(solution.result().balls[0])
    assert found[1].tangential_force[0] == pytest.approx(found[0].tangential_force[0], rel=1e-2)
    assert found[1].normal_force == pytest.approx(found[0].normal_force, rel=1e-3)


def test_a_ball_at_the_undeformed_surface_that_a_bulge_touches_has_no_relative_error_of_its_approach():
    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    result = solve(Problem(Layer(1.0, 0.5, 0.8), balls, Load("approach", (0.2, 0.0))), 1e-10)
    assert result.balls[1].normal_force > 0.0
    found = re.search(r"that of forces and approaches ([\d.e-]+), ", result.solved.notes[0])
    assert found is not None
    assert 0.0 < float(found[1]) < 1e-7
