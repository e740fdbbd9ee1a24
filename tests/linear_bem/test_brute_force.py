"""T against a second solver that shares no code, no discretisation and no kernel table with `linear_bem`."""

import numpy as np
import pytest

from linear_bem import Ball, Elastic, Layer, Load, Problem, solve
from tests.linear_bem.brute_force import fitted, solve_brute, solve_on
from tests.linear_bem.conftest import PAPER_LOAD

STEEL = Elastic(1e3, 0.3)


def saddle(x, y):
    """An ellipsoidal apex whose axes lie askew."""
    return x * x / 2.0 + y * y / 1.2 + 0.3 * x * y


CASES = {
    "paper's thin pair": Problem(
        Layer(1.0, 0.48, 1.16),
        (Ball((-1, 0), 1.0, "paraboloid"), Ball((1, 0), 1.0, "paraboloid")),
        Load("force", (PAPER_LOAD,) * 2),
        STEEL,
    ),
    "three in a triangle": Problem(
        Layer(1.0, 0.48, 1.16),
        (Ball((0, 0), 1.0, "paraboloid"), Ball((2.1, 0), 1.0, "paraboloid"), Ball((1, 1.9), 1.0, "paraboloid")),
        Load("force", (PAPER_LOAD, 2 * PAPER_LOAD, 4 * PAPER_LOAD)),
        STEEL,
    ),
    "askew ellipsoid beside a ball": Problem(
        Layer(1.0, 0.4, 0.7),
        (Ball((-1, 0), 1.0, saddle), Ball((1, 0), 1.0, "paraboloid")),
        Load("force", (2e-2, 1e-2)),
        Elastic(10.0, 0.2),
    ),
    "incompressible, unequal": Problem(
        Layer(1.0, 0.5, 0.6),
        (Ball((-1, 0), 1.0, "paraboloid"), Ball((0.9, 0.4), 0.8, "paraboloid")),
        Load("force", (1e-2, 5e-3)),
        STEEL,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_an_independent_solver_finds_the_same_forces_and_approaches(name):
    problem = CASES[name]
    found = solve(problem, 1e-6).balls
    reference, scatter = solve_brute(problem, (14, 16, 18, 20) if problem.size == 2 else (12, 14, 16), phases=4)
    force = np.array([b.tangential_force for b in found])
    size = np.max(np.abs(force))
    # the scatter of so few cells; finer grids take a minute, and agree to 1e-5
    assert scatter < 3e-4 * size
    assert np.max(np.abs(force - reference.tangential)) < 4.0 * scatter + 1e-5 * size
    assert [b.approach for b in found] == pytest.approx(list(reference.approaches), rel=1e-3)


def test_its_energy_falls_as_the_pair_follows_the_mutual_force():
    """At fixed approaches T = -dU/dx: a route in which no formula for T occurs, on cells that move with the balls."""
    base = CASES["paper's thin pair"]
    depth = solve(base, 1e-6).balls[0].approach
    step = 0.02

    def at(distance):
        balls = (Ball((-0.5 * distance, 0), 1.0, "paraboloid"), Ball((0.5 * distance, 0), 1.0, "paraboloid"))
        return Problem(base.layer, balls, Load("approach", (depth,) * 2), base.substrate)

    kernel, reach = fitted(at(2.5))
    rise = [solve_on(at(2.3 + k * step), kernel, 16, reach).energy for k in (-2, -1, 1, 2)]
    slope = (rise[0] - 8 * rise[1] + 8 * rise[2] - rise[3]) / (12 * step)
    left = solve(at(2.3), 1e-6).balls[0].tangential_force[0]
    assert slope == pytest.approx(left, rel=3e-3)
