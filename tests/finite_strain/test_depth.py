"""What finite strain changes as the balls go deeper, and that forces, energies and loads agree with each other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import finite_strain
import linear_bem
from finite_strain import compat
from finite_strain.domain import Resolution
from finite_strain.loading import LoadPath
from linear_bem import Ball, Load, NotConverged
from linear_bem.closed_forms import long_force
from meshes import layer
from meshes.box import Box
from tests.finite_strain.scenes import (
    SHAPES,
    balls_at,
    coarse_plan,
    coarse_rig,
    on_layer,
    pair,
    relatively,
    single,
)

SINGLE_NU = 0.48
AUGMENTATION = 4e-3
"""Relative change of force times approach by which both paths stop augmenting."""


def strengthening(step: Any, problem: Any) -> float:
    """Return T over the linear model's T at the same normal forces."""
    forces = [ball.normal_force for ball in step.balls]
    linear = linear_bem.solve(problem.with_load("force", forces))
    return step.balls[0].tangential_force[0] / linear.balls[0].tangential_force[0]


@pytest.fixture(scope="module")
def deep() -> Any:
    """The thin pair pressed in by 0.3 R on small meshes."""
    return finite_strain.solve(pair(0.3), tangential_force=0.06)


@pytest.mark.slow
def test_finite_strain_strengthens_the_force_at_depth_and_not_under_light_load(deep: Any) -> None:
    shallow, middle = deep.steps[0], deep.steps[len(deep.steps) // 2]
    ratios = [strengthening(step, pair(0.3)) for step in (shallow, middle, deep.steps[-1])]
    assert ratios[0] < ratios[1] < ratios[2]
    errors = [step.balls[0].tangential_force_error / abs(step.balls[0].tangential_force[0]) for step in deep.steps]
    assert ratios[2] - 1.0 > errors[-1]
    # theory: departures shrink like sqrt(D/R), 0.12 at the first step, times a fifth or less
    assert abs(ratios[0] - 1.0) < 0.02 + errors[0]


@pytest.mark.slow
def test_contact_forces_equal_the_base_reaction_at_every_depth(deep: Any) -> None:
    for step in deep.steps:
        assert step.record["force_balance"] <= 1e-8
    energies = [step.record["strain_energy"] for step in deep.steps]
    assert all(np.diff(energies) > 0.0)
    # the work of the normal forces along the way is the strain energy; trapezoids over the load steps
    d = np.array([0.0, *(step.balls[0].approach for step in deep.steps)])
    q = np.array([0.0, *(step.balls[0].normal_force for step in deep.steps)])
    work = 2.0 * np.sum(0.5 * (q[1:] + q[:-1]) * np.diff(d))
    assert work == relatively(energies[-1], 0.03)


@pytest.fixture(scope="module")
def ball_on_layer() -> Any:
    return finite_strain.solve(single(0.3, thickness=1.0, poisson=SINGLE_NU), tangential_force=0.06)


@pytest.mark.slow
def test_a_single_ball_feels_no_in_plane_force_at_any_depth(ball_on_layer: Any) -> None:
    for step in ball_on_layer.steps:
        (ball,) = step.balls
        assert np.hypot(*ball.tangential_force) <= 1e-9 * ball.normal_force


@pytest.mark.slow
def test_a_single_ball_starts_as_the_linear_model_and_ends_as_the_finite_strain_fit(ball_on_layer: Any) -> None:
    problem = single(0.3, thickness=1.0, poisson=SINGLE_NU)
    first, last = ball_on_layer.steps[0].balls[0], ball_on_layer.steps[-1].balls[0]

    def linear(approach: float, poisson: float = SINGLE_NU) -> float:
        scene = single(approach, thickness=1.0, poisson=poisson)
        return linear_bem.solve(scene).balls[0].normal_force

    # theory: softer by 0.065 sqrt(D/R), 0.7 % at the first step; and the mesh, 2.2 % too stiff with five elements
    # per contact radius (the same at small strain)
    assert first.normal_force == relatively(linear(first.approach), 0.03)
    # the fit holds for incompressible layers (within 1 %): the linear model tells what nu = 0.48 changes
    fit = long_force(0.3, 1.0, problem.layer, 1.0) * linear(0.3) / linear(0.3, 0.5)
    assert last.normal_force == relatively(fit, 0.03)
    assert last.normal_force < linear(0.3)


def share_the_mesh(patch: pytest.MonkeyPatch, box: Box, shift: float) -> None:
    """Let a model have the box's mesh, shifted with its right ball and stretched between the balls.

    Meshes of their own would differ in energy by a tenth of what the distance changes, each version of gmsh otherwise.
    """
    read, write = compat.read_mesh, layer.write_layer_mesh
    still = box.zones[0].position[0] - 0.7  # from here on the mesh moves as a whole

    def read_shifted(path: Path, comm: Any) -> Any:
        mesh, *tags = read(path, comm)
        x = mesh.geometry.x
        x[:, 0] += shift * np.minimum(x[:, 0] / still, 1.0)
        return mesh, *tags

    patch.setattr(layer, "write_layer_mesh", lambda _, path: write(box, path))
    patch.setattr(compat, "read_mesh", read_shifted)


@pytest.mark.slow
@pytest.mark.parametrize("model", SHAPES)
def test_the_tangential_force_is_the_slope_of_the_energy_by_distance(
    model: str, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    distances, resolution = (2.0, 2.3, 2.6), Resolution(0.3, 0.24, 0.3)
    problems = [pair(0.2, distance=distance, shape=SHAPES[model]) for distance in distances]
    plans = [coarse_plan(problem, model, resolution, 0.3, (0.4, 0.7, 1.0)) for problem in problems]
    energies, forces = [], []
    for distance, plan in zip(distances, plans, strict=True):
        with monkeypatch.context() as patch:
            share_the_mesh(patch, plans[1].boxes[1], 0.5 * (distance - distances[1]))
            rig = coarse_rig(plan, tmp_path_factory.mktemp("slope"))
        rig.press()
        energies.append(4.0 * rig.model.strain_energy())
        forces.append(rig.meter.domain(rig.contact_radii())[0, 0])
    # the right ball's force is minus the attraction; Simpson's rule over the distance
    attraction = -np.array(forces)
    work = (attraction[0] + 4.0 * attraction[1] + attraction[2]) * 0.6 / 6.0
    # discretisation: five elements per contact radius
    assert energies[2] - energies[0] == relatively(work, 0.1)


def test_a_prescribed_force_finds_the_approach_that_answers_it(tmp_path_factory: pytest.TempPathFactory) -> None:
    resolution = Resolution(0.6, 0.6, 0.6)
    plan = coarse_plan(pair(0.1), "finite_strain", resolution, 0.35, (0.5, 1.0))
    rig = coarse_rig(plan, tmp_path_factory.mktemp("round"))
    rig.press()
    (force,) = rig.path.normal_forces()
    back = plan.problem.with_load("force", (force, force))
    rig.model.nodal[:] = 0.0
    path = LoadPath(back, rig.model, rig.solver)
    records = list(path.steps([0.25, 1.0]))
    # solver: the force is met to 1e-7 at every step
    assert [record.normal_forces[0] for record in records] == [relatively(f * force, 2e-7) for f in (0.25, 1.0)]
    assert sum(record.force_iterations for record in records) > 0
    # the two paths augment at other loads
    assert rig.model.contacts[0].approach == relatively(0.1, AUGMENTATION)


def test_one_total_force_on_unequal_balls_is_shared_at_a_common_approach(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    balls = (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 0.7, "sphere"))
    problem = on_layer(balls, Load("total_force", (0.1,)))
    plan = coarse_plan(problem, "finite_strain", Resolution(0.8, 0.8, 0.8), 0.35, (0.3, 1.0))
    rig = coarse_rig(plan, tmp_path_factory.mktemp("total"))
    rig.press()
    forces = rig.path.normal_forces()
    # solver: the total is met to 1e-7
    assert forces.sum() == relatively(0.1, 2e-7)
    assert forces[0] > forces[1] > 0.0
    left, right = rig.model.contacts
    assert left.approach == right.approach


@pytest.mark.slow
def test_three_balls_in_an_l_pull_each_other_without_moving_the_whole() -> None:
    problem = on_layer(balls_at((0.0, 0.0), (2.2, 0.0), (0.0, 2.5), shape="paraboloid"), Load("approach", (0.015,) * 3))
    result = finite_strain.solve(problem, model="small_strain", tangential_force=0.3)
    linear = linear_bem.solve(problem)
    total, error = np.zeros(2), 0.0
    for ball, reference in zip(result.balls, linear.balls, strict=True):
        force = np.array(ball.tangential_force)
        total += force
        error += ball.tangential_force_error
        # the model's own error bar, and as much again for meshes of two elements per contact radius
        miss = np.linalg.norm(force - np.array(reference.tangential_force))
        assert miss < 2.0 * ball.tangential_force_error + 0.1 * np.linalg.norm(reference.tangential_force)
    assert np.linalg.norm(total) < error


def test_a_step_that_does_not_converge_leaves_the_last_good_state(tmp_path_factory: pytest.TempPathFactory) -> None:
    plan = coarse_plan(pair(0.08), "finite_strain", Resolution(0.55, 0.55, 0.55), 0.35)
    rig = coarse_rig(plan, tmp_path_factory.mktemp("failure"))
    list(rig.path.steps([0.25, 0.5]))
    good = replace(rig.path.history[-1], penalised=tuple(rows.copy() for rows in rig.path.history[-1].penalised))
    rig.solver.max_iterations = 0
    with pytest.raises(NotConverged, match=r"DIVERGED_MAX_IT.*last good state is at 0\.5 of the full load"):
        list(rig.path.steps([0.25, 0.5, 1.0]))
    # the one without multipliers, which the next try starts from
    for rows, kept in zip(rig.model.fields.copy(), good.penalised, strict=True):
        assert np.array_equal(rows, kept)
    assert rig.model.contacts[0].approach == good.approaches[0] == 0.04
    rig.solver.max_iterations = 25
    (record,) = rig.path.steps([0.25, 0.5, 1.0])
    assert record.fraction == 1.0
    assert record.normal_forces[0] > good.forces[0]


@pytest.mark.parametrize("poisson", [0.3, 0.48])
def test_unloading_and_loading_again_go_the_way_of_the_first_loading(poisson: float, tmp_path: Path) -> None:
    plan = coarse_plan(pair(0.3, poisson=poisson), "finite_strain", Resolution(0.55, 0.55, 0.55), 0.35)
    rig = coarse_rig(plan, tmp_path)
    fractions = [0.25, 0.5, 1.0, 0.5, 0.25, 1.0, 0.5]
    seen: dict[float, list[tuple[float, float, float]]] = {}
    for record in rig.path.steps(fractions):
        pull = rig.meter.domain(rig.contact_radii())[0, 0]
        state = (record.normal_forces[0], pull, rig.model.strain_energy())
        seen.setdefault(record.fraction, []).append(state)
    assert [len(seen[fraction]) for fraction in (0.25, 0.5, 1.0)] == [2, 3, 2]
    for states in seen.values():  # elastic and without friction: no hysteresis beyond Newton's tolerance
        for again in states[1:]:
            assert again == relatively(states[0], 1e-6)
