"""Positions at rest: where the forces between balls vanish, and whether they hold."""

from __future__ import annotations

import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, Problem
from runs.evolution import equilibria
from runs.evolution.forces import DirectForces, State
from runs.evolution.hard_balls import HardBalls
from runs.evolution.outcome import equilibrium
from runs.evolution.providers import DIRECT_DIFFERENCE
from tests.runs.foam_balls import RADIUS, line, scene
from tests.runs.test_evolution import ROUNDOFF, TOLERANCE, Array, path


def test_a_pair_settles_at_the_distance_where_its_force_vanishes() -> None:
    problem = scene(line(2, 0.03))
    balls = HardBalls.of(problem)

    def spring(x: Array) -> State:
        between = x[1] - x[0]
        distance = float(np.hypot(*between))
        force = (distance - 0.045) * (0.09 - distance) * 100.0 * between / distance
        return State(np.array([force, -force]), np.ones(2), np.zeros(2))

    assert equilibria.of_pair(spring, 0.02, 0.2) == [
        (pytest.approx(0.045), "stable"),
        (pytest.approx(0.09), "unstable"),
    ]
    end = path(spring, problem, 1e3)[-1]
    assert end.resting
    found = equilibria.find(spring, balls, end.positions)
    assert found.verdict == "stable"
    assert np.ptp(found.positions[:, 0]) == pytest.approx(0.045, rel=1e-7)
    assert np.ptp(end.positions[:, 0]) == pytest.approx(0.045, rel=1e-4)


@pytest.mark.parametrize(("thickness", "verdict"), [(1.16, "none"), (2.0, "stable"), (100.0, "stable")])
def test_equilibria_of_the_full_model_are_sought_without_balls_inside_each_other(
    thickness: float, verdict: str
) -> None:
    balls = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
    problem = Problem(Layer(1.0, 0.3, thickness), balls, Load("approach", (0.012, 0.012)))
    forces = DirectForces(problem, 1e-2)
    end = path(forces, problem, 300.0)[-1]
    # the model refuses positions that overlap, so this would raise
    found = equilibrium(forces, HardBalls.of(problem), end.positions, DIRECT_DIFFERENCE, TOLERANCE)
    assert found["verdict"] == verdict
    assert end.resting == (verdict == "stable")
    if verdict == "stable":
        assert found["contacts"] == [[0, 1]]
        assert found["distance_from_end"] < ROUNDOFF
    else:  # they part, and Newton's method looks for T = 0 on the other side of contact
        assert "balls 0 and 1 touch" in found["reason"]


def test_balls_too_far_apart_for_any_force_are_no_equilibrium() -> None:
    def parting(x: Array) -> State:
        between = x[1] - x[0]
        size = max(0.08 - float(np.hypot(*between)), 0.0) ** 3
        force = -1e-2 * size * between / float(np.hypot(*between))
        return State(np.array([force, -force]), np.ones(2), np.zeros(2))

    balls = HardBalls.of(scene([(0.0, 0.0), (0.03, 0.0)]))
    found = equilibrium(parting, balls, np.array([[0.0, 0.0], [0.07, 0.0]]), 1e-4, TOLERANCE)
    assert found["verdict"] == "none"
    assert "too far apart" in found["reason"]


def test_equilibria_hold_a_pair_that_lands_on_the_way() -> None:
    problem = scene([(0.0, 0.0), (0.018, 0.024)])
    balls = HardBalls.of(problem)

    def spring(x: Array) -> State:
        assert np.min(balls.gaps(x)) >= -1e-11 * RADIUS
        between = x[1] - x[0]
        # would vanish with the balls inside each other, 15 mm apart
        force = 100.0 * (float(np.hypot(*between)) - 0.015) * between / float(np.hypot(*between))
        return State(np.array([force, -force]), np.ones(2), np.zeros(2))

    found = equilibria.find(spring, balls, np.array([ball.position for ball in problem.balls]))
    assert found.verdict == "stable"
    assert balls.pairs(found.contacts).tolist() == [[0, 1]]
    assert found.pushes == pytest.approx([0.5], rel=1e-9)
    assert np.hypot(*(found.positions[1] - found.positions[0])) == pytest.approx(0.02, rel=ROUNDOFF)
