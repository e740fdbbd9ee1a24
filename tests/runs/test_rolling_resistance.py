"""Rolling resistance of balls that drift: closed form, limits, contacts, and the energy along a path."""

from __future__ import annotations

import numpy as np
import pytest

from runs.evolution.drift import Drift, Moment
from runs.evolution.forces import Forces, State
from runs.evolution.hard_balls import HardBalls
from runs.evolution.pair_forces import PairForces
from runs.evolution.providers import Provider
from tests.runs.foam_balls import RADIUS, scene, spread
from tests.runs.lattices import Array, in_cell

INTERIOR = 1e-7
"""Of the interior-point method, relative to the largest velocity."""
TOLERANCE = 1e-6 * RADIUS


def inverse_square(strength: float) -> Forces:
    """Two balls of load 1: T = strength/L^2 [N], positive together."""

    def forces(x: Array) -> State:
        between = x[1] - x[0]
        pull = strength * between / float(np.hypot(*between)) ** 3
        return State(np.array([pull, -pull]), np.ones(2), np.zeros(2))

    return forces


def test_rolling_resistance_brakes_two_balls_as_the_closed_form_says() -> None:
    start = np.array([[-1.5, 0.0], [1.5, 0.0]])
    share, strength = 0.02, -0.5
    balls = HardBalls(np.ones(2), rolling=share)
    moments = list(Drift(inverse_square(strength), balls, 1e-8, 1e-5).path(start, 1e6))
    distance = np.array([np.ptp(m.positions[:, 0]) for m in moments])
    # dL/dsigma = 2 (A/L^2 - s) from L = 3: they part up to L = sqrt(A/s) = 5
    last = np.sqrt(-strength / share)

    def sigma(length: Array) -> Array:
        return np.asarray((last * np.arctanh(length / last) - length) / (2.0 * share))

    assert distance[-1] == pytest.approx(last, rel=1e-3)
    assert np.max(distance) < last
    some = slice(0, -1, max(1, len(moments) // 20))
    expected = sigma(distance[some]) - sigma(np.array([3.0]))
    assert np.array([m.sigma for m in moments])[some] == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_resistance_of_nothing_is_none_and_resistance_above_the_largest_force_stops_all(foam: Provider) -> None:
    problem = scene([(0.0, 0.0), (0.031, 0.004), (0.011, 0.035), (-0.02, 0.027)])
    start, forces = problem.positions, spread(foam, problem)

    def end(share: float) -> Moment:
        balls = HardBalls.of(problem, rolling=share)
        return list(Drift(forces, balls, TOLERANCE, 1e-6).path(start, 0.2))[-1]

    state = forces(start)
    largest = float(np.max(np.hypot(*state.tangential.T) / state.normal))
    assert np.array_equal(end(0.0).positions, list(Drift(forces, HardBalls.of(problem), TOLERANCE, 1e-6).path(
        start, 0.2))[-1].positions)  # fmt: skip
    stopped = end(1.001 * largest)
    assert stopped.resting
    assert stopped.sigma == 0.0
    some = end(0.5 * largest)
    assert some.sigma > 0.0
    moved = [float(np.max(np.abs(end(s * largest).positions - start))) for s in (0.0, 0.5, 0.9)]
    assert moved[0] > moved[1] > moved[2] > 0.0


def test_a_ball_pushes_another_only_with_what_its_own_resistance_leaves() -> None:
    x = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    balls = HardBalls(np.ones(3), rolling=0.6)
    contacts = balls.touching(x)

    def pushed(force: float) -> tuple[Array, Array]:
        return balls.admissible(x, np.array([[force, 0.0], [0.0, 0.0], [0.0, 0.0]]), np.ones(3), contacts)

    velocity, pushes = pushed(1.7)  # three balls resist with 1.8
    assert velocity == pytest.approx(0.0, abs=INTERIOR)
    assert 1.1 - INTERIOR <= pushes[0] <= 1.2 + INTERIOR
    velocity, pushes = pushed(2.1)
    assert velocity[:, 0] == pytest.approx(0.1, abs=INTERIOR)
    assert pushes == pytest.approx([1.4, 0.7], abs=1e-6)


def test_energy_never_grows_with_and_without_resistance(thick: PairForces) -> None:
    x = np.array([(0.0, 0.0), (2.3, 0.4), (0.9, 3.1), (-2.0, 2.7), (3.6, 2.9)])
    problem = in_cell(thick, len(x), np.ones(2)).problem
    forces = PairForces(problem, [thick.singles[0]] * len(x), thick.law)
    balls = HardBalls(np.ones(len(x)))
    depths = np.linspace(0.0, 0.12, 2001)
    work = np.concatenate([[0.0], np.cumsum(np.diff(depths) * 0.5 * np.sum(
        [thick.singles[0].force(depths[:-1]), thick.singles[0].force(depths[1:])], axis=0))])  # fmt: skip

    def energy(moment: Moment) -> float:
        """Return the elastic energy at fixed approaches: of each ball alone, and of what they press each other down."""
        load = moment.state.normal
        which = balls.all
        i, j = balls.pairs(which).T
        k = thick.law(balls.gaps(moment.positions, which) + 2.0)[0]
        dents = np.bincount(i, k * load[j], len(x)) + np.bincount(j, k * load[i], len(x))
        return float(np.sum(np.interp(0.1 - dents, depths, work)) + 0.5 * load @ dents)

    for share in (0.0, 1e-4):
        resisted = HardBalls(balls.radii, rolling=share)
        moments = list(Drift(forces, resisted, 1e-5, 1e-6).path(x, 2e4))
        energies = np.array([energy(m) for m in moments])
        assert len(moments) > 10
        assert np.all(np.diff(energies) <= 1e-9 * energies[0])  # of the sum for the work of one ball
        assert energies[-1] < energies[0] * (1.0 - 1e-6)
