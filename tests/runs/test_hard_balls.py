"""Balls that touch and do not overlap: the path through their contacts, and the contacts as one convex problem."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, NotConverged, Problem
from runs.evolution import motion
from runs.evolution.drift import Drift, Moment
from runs.evolution.hard_balls import TOUCHING, UNSETTLED, HardBalls
from runs.evolution.providers import Provider
from tests.runs.foam_balls import RADIUS, line, scene, spread
from tests.runs.lattices import lattice, triangular

INTERIOR = 1e-7
"""Of the interior-point method, relative to the largest velocity."""
TOLERANCE = 1e-6 * RADIUS

# the path of nine balls of foam_balls by the algorithm before this one, which stopped at every new contact
BEFORE = {
    0.05: [[1.013251, 1.933261], [1.218352, 21.93221], [2.241943, 41.905999], [21.012874, 1.81054],
           [21.217975, 21.809488], [22.241567, 41.783278], [41.01249, 1.686606], [41.217591, 21.685555],
           [42.241183, 41.659344]],
    0.2: [[1.384731, 1.770141], [-0.684505, 21.66281], [3.322578, 41.25728], [21.383159, 2.020875],
          [19.313924, 21.913544], [23.321006, 41.508015], [41.381777, 2.255989], [39.312542, 22.148658],
          [43.319624, 41.743129]],
    100.0: [[4.030295, 4.712475], [-5.727975, 22.170315], [4.511822, 39.350145], [24.028363, 4.434466],
            [14.270092, 21.892305], [24.509889, 39.072135], [44.026431, 4.156456], [34.26816, 21.614296],
            [44.507957, 38.794126]],
}  # fmt: skip


def test_nine_balls_take_the_path_that_stops_at_every_contact(foam: Provider) -> None:
    places = [(0.021 * i + 0.0003 * j * j, 0.022 * j - 0.0002 * i * j) for i in range(3) for j in range(3)]
    problem = scene(places)
    forces, balls = spread(foam, problem), HardBalls.of(problem)
    for end, expected in BEFORE.items():
        last = list(Drift(forces, balls, TOLERANCE, 1e-6).path(np.array(places), end))[-1]
        # a few steps of the tolerance, and seven printed digits
        assert last.positions == pytest.approx(1e-3 * np.array(expected), abs=5.0 * TOLERANCE)


def test_a_loose_tolerance_takes_many_contacts_in_a_step(foam: Provider) -> None:
    x = np.array(line(4, 0.021)) + np.random.default_rng(5).uniform(-3e-4, 3e-4, (4, 2))
    x = np.concatenate([x + np.array([0.0, 0.021 * j]) for j in range(4)])
    problem = scene([tuple(p) for p in x])
    forces, balls = spread(foam, problem), HardBalls.of(problem)

    def steps(tolerance: float) -> tuple[int, list[Moment]]:
        drift = Drift(forces, balls, tolerance * RADIUS, 1e-4)
        moments = list(drift.path(x, 0.1))
        return moments[-1].steps, moments

    (fine, exact), (coarse, loose) = steps(1e-6), steps(1e-3)
    new = [len(set(b.contacts) - set(a.contacts)) for a, b in pairwise(loose)]
    assert max(new) >= 3
    assert coarse < 0.4 * fine
    assert min(float(np.min(balls.gaps(m.positions))) for m in loose) >= -1e-11 * RADIUS
    assert np.max(np.abs(loose[-1].positions - exact[-1].positions)) < 0.02 * RADIUS


@pytest.mark.parametrize("rolling", [0.0, 0.2])
def test_the_interior_point_method_finds_the_velocity_of_least_squares(
    rolling: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    x, _ = triangular(4, 4, 2.0)
    rng = np.random.default_rng(2)
    force, load = rng.normal(size=x.shape), rng.uniform(0.5, 2.0, len(x))
    balls = HardBalls(np.ones(len(x)), rolling=rolling)
    contacts = balls.touching(x, 1e-9)
    jacobian = balls.jacobian(x, contacts)
    opening = -rng.uniform(0.0, 0.3, len(contacts))
    velocity, pushes = balls.admissible(x, force, load, contacts, opening)
    assert len(contacts) == 33
    slack = jacobian @ velocity.ravel() - opening
    assert np.min(slack) >= -INTERIOR
    assert np.min(pushes) >= 0.0
    assert slack * pushes == pytest.approx(0.0, abs=INTERIOR)
    # the balance of every ball: what the resistance takes is along its motion, and no more than its share
    left = force + (jacobian.T @ pushes).reshape(x.shape) - load[:, None] * velocity
    assert np.all(np.hypot(*left.T) <= rolling * load + INTERIOR)
    power = np.sum(left * velocity, axis=1)
    assert power == pytest.approx(rolling * load * np.hypot(*velocity.T), abs=INTERIOR)
    if rolling == 0.0:
        monkeypatch.setattr(motion, "DENSE", 0)
        assert balls.admissible(x, force, load, contacts, opening)[0] == pytest.approx(velocity, abs=INTERIOR)


def test_small_overlaps_of_thousands_of_balls_are_parted() -> None:
    rng = np.random.default_rng(1)
    balls, load = HardBalls(np.ones(2500), np.array([130.0, 130.0])), np.ones(2500)
    apart = balls.parted(lattice(50, 50, 2.6) + rng.uniform(-0.5, 0.5, (2500, 2)), load)
    x = apart + rng.uniform(-1e-5, 1e-5, apart.shape)
    assert np.min(balls.gaps(x, balls.near(x, 0.0))) < -1e-6
    parted = balls.parted(x, load)
    assert np.min(balls.gaps(parted, balls.near(parted, 0.1))) > -1e-10
    assert np.max(np.abs(parted - x)) < 3e-5


@pytest.mark.parametrize(("count", "kept"), [(20, 5e-13), (60, 3e-10)])
def test_overlaps_within_the_error_of_the_solver_are_left(count: int, kept: float) -> None:
    balls, load = HardBalls(np.ones(count)), np.ones(count)
    line = np.stack([2.0 * np.arange(count), np.zeros(count)], axis=1)
    least = [float(np.min(balls.gaps(balls.parted(line * (1.0 - k * kept), load)))) for k in (1.0, 4.0)]
    assert least[0] == pytest.approx(-2.0 * kept, rel=1e-2)
    assert least[1] > -0.1 * kept


@pytest.mark.parametrize("seed", range(4))
def test_a_start_with_large_overlaps_is_parted_until_none_is_left(seed: int) -> None:
    # parting some pairs pushes others together: one pass leaves overlaps of up to 6 %
    cell = np.array([14.4, 14.4])
    balls = HardBalls(np.ones(36), cell)
    x = np.array([(2.4 * i, 2.4 * j) for i in range(6) for j in range(6)])
    x += np.random.default_rng(seed).uniform(-1.0, 1.0, x.shape)
    parted = balls.parted(x, np.ones(36))
    near = balls.near(x, 0.5)
    assert np.min(balls.gaps(x, near)) < -1.0
    assert np.min(balls.gaps(parted, balls.near(parted, 0.5))) > -1e-9


@pytest.mark.parametrize("away", [3e4, 1e5])
def test_balls_far_from_the_origin_are_parted_to_the_roundoff_of_their_positions(away: float) -> None:
    for seed in range(30):
        balls, x = HardBalls(np.ones(9)), np.random.default_rng(seed).uniform(0.0, 8.0, (9, 2)) + away
        parted = balls.parted(x, np.ones(9))
        assert np.min(balls.gaps(parted, balls.near(parted, 0.5))) > -2.0 * UNSETTLED


@pytest.mark.parametrize(("count", "length"), [(9, 5.33), (100, 19.5)])
def test_balls_without_room_are_not_parted(count: int, length: float) -> None:
    balls = HardBalls(np.ones(count), np.array([length, length]))
    with pytest.raises(NotConverged, match="more room"):
        balls.parted(np.random.default_rng(1).uniform(0.0, length, (count, 2)), np.ones(count))


def test_the_overlaps_that_are_left_are_no_fault_of_a_problem() -> None:
    touching = Load("force", (1.0, 1.0))
    balls = tuple(Ball((x * (1.0 - UNSETTLED), 0.0), 1.0) for x in (0.0, 2.0))
    assert Problem(Layer(1.0, 0.4, 1.5), balls, touching).size == 2
    assert UNSETTLED < TOUCHING
