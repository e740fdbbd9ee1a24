"""Unlike bodies: forces that swap with their places, and an answer beside those of the linear model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import finite_strain
from linear_bem import Ball, Cone, Load, solve
from tests.finite_strain.scenes import COARSER, at_small_strain, coarse_plan, coarse_rig, on_layer

SPHERE, CONE = Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), shape=Cone(0.4, 0.8))
PROBLEM = on_layer((SPHERE, CONE), Load("approach", (0.1, 0.1)), poisson=0.45)
SWAPPED = replace(PROBLEM, balls=(replace(SPHERE, position=(1.0, 0.0)), replace(CONE, position=(-1.0, 0.0))))


def test_bodies_that_swap_their_places_keep_their_forces(tmp_path: Path) -> None:
    forces = []
    for number, problem in enumerate((PROBLEM, SWAPPED)):
        (folder := tmp_path / f"{number}").mkdir()
        model = coarse_rig(coarse_plan(problem), folder).model
        model.contact.set_approaches(np.array([0.1, 0.1]))
        model.contact.set_penalties(np.array([30.0, 30.0]))
        forces.append(model.forces())
    assert forces[0][1, 2] > 1.05 * forces[0][0, 2]
    assert forces[1][:, 2] == pytest.approx(forces[0][:, 2], rel=1e-3)


def test_the_penetration_under_every_kind_of_body_is_measured(tmp_path: Path) -> None:
    rig = coarse_rig(coarse_plan(PROBLEM), tmp_path)
    rig.press()
    penetration = rig.run.extremes()[:, 1]
    assert np.all(penetration > 1e-5)
    assert np.all(penetration < 0.02)


def test_a_surface_that_rises_below_bodies_in_the_air_penetrates_none(tmp_path: Path) -> None:
    # cells that only one body may touch lie in the middle
    balls = (replace(SPHERE, position=(-1.7, 0.0)), replace(CONE, position=(1.7, 0.0)))
    rig = coarse_rig(coarse_plan(replace(PROBLEM, balls=balls)), tmp_path)
    rig.model.contact.set_approaches(np.array([-0.1, -0.1]))
    rig.model.contact.set_penalties(np.array([30.0, 30.0]))
    rig.model.nodal[:, 2] = 0.05
    assert np.all(rig.run.extremes()[:, 1] == 0.0)


def test_the_pull_of_a_sphere_and_a_cone_is_near_that_of_the_linear_model() -> None:
    balls = finite_strain.solve(PROBLEM, accuracy=0.3, numerics=COARSER).balls
    for ball, known in zip(balls, solve(at_small_strain(PROBLEM), 1e-4).balls, strict=True):
        assert ball.normal_force == pytest.approx(known.normal_force, rel=0.15)
        assert ball.tangential_force[0] == pytest.approx(known.tangential_force[0], rel=0.3)
    total = sum(ball.tangential_force[0] for ball in balls)
    assert abs(total) < 2.0 * balls[0].tangential_force_error < 0.2 * abs(balls[0].tangential_force[0])
