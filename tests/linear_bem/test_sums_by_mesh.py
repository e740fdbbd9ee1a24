"""Sums over near pairs and a mesh are those over all pairs: kernels, loads, pressures and T."""

import importlib
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse.linalg

from linear_bem import Ball, Elastic, Layer, LayeredKernel, coupled_point_loads, solve, solve_contact
from linear_bem.coupled_point_loads import solve_coupled
from linear_bem.far_field.pairs_and_mesh import FarField, PointInfluence
from linear_bem.smooth.displacement import DirectSums
from linear_bem.smooth.tangential_forces import SUMMED, half_space_pulls, layer_pulls
from tests.linear_bem.random_balls import direct
from tests.linear_bem.sampled_scenes import BASES, errors, forces, scene


@pytest.mark.parametrize("base", BASES)
def test_near_pairs_and_mesh_add_up_to_the_kernel(base):
    thickness, substrate = BASES[base]
    kernel = LayeredKernel(Layer(1.0, 0.48, thickness), substrate)
    rng = np.random.default_rng(2)
    points, loads = rng.uniform(0.0, 100.0, (2500, 2)), rng.uniform(0.5, 1.0, 2500)
    for precision, error in ((1e-5, 3e-6), (1e-7, 3e-7)):
        field = FarField.of(kernel, points, np.array(0.0), precision)
        assert (field.mesh is not None) == (len(field.first) < 2500 * 2499 // 2) or base == "rigid base"
        chosen = np.arange(0, 2500, 50)
        r = np.hypot(*(points[chosen, None] - points).transpose(2, 0, 1))
        r[np.arange(len(chosen)), chosen] = np.inf
        direct = kernel.scaled(r) @ loads
        found = PointInfluence(field, points) @ loads
        # the unit is the displacement of one load at one spacing of the mesh
        spacing = field.mesh.meshes[0].spacing[0] if field.mesh is not None else 1.0
        assert np.max(np.abs(found[chosen] - direct)) * spacing < 5.0 * error


def test_the_coupled_system_is_solved_with_the_mesh_as_without():
    rng = np.random.default_rng(4)
    points = rng.uniform(0.0, 80.0, (1500, 2))
    kernel = LayeredKernel(Layer(1.0, 0.48, np.inf))
    field = FarField.of(kernel, points, np.array(0.0), 1e-7)
    assert field.mesh is not None
    compliance, right = rng.uniform(5.0, 9.0, 1500), rng.uniform(0.5, 1.0, 1500)
    free = rng.uniform(size=1500) < 0.8
    influence = PointInfluence(field, points)
    loads = solve_coupled(influence, compliance, right, free)
    assert np.all(loads[~free] == 0.0)
    residual = compliance * loads + influence @ loads - right
    assert np.max(np.abs(residual[free])) < 1e-8


def test_conjugate_gradients_run_under_every_scipy(monkeypatch):
    def newer(a, b, x0=None, *, rtol=1e-5, atol=0.0, maxiter=None, M=None, callback=None):
        asked.append(rtol)
        return b, 0

    asked = []
    with monkeypatch.context() as patched:
        patched.setattr(scipy.sparse.linalg, "cg", newer)
        module = importlib.reload(coupled_point_loads)
        points = np.stack([np.arange(700.0), np.zeros(700)], axis=1)
        influence = PointInfluence(
            FarField.of(LayeredKernel(Layer(1.0, 0.3, np.inf)), points, np.array(0.0), 1e-5), points
        )
        module.solve_coupled(influence, np.ones(700), np.ones(700), np.ones(700, dtype=bool))
    importlib.reload(coupled_point_loads)
    assert asked == [coupled_point_loads.RESIDUAL]


def test_the_scale_of_the_forces_is_within_five_per_cent_of_the_whole_sum():
    rng = np.random.default_rng(5)
    points, loads = rng.uniform(0.0, 90.0, (SUMMED + 500, 2)), rng.uniform(0.5, 1.0, SUMMED + 500)
    kernel = LayeredKernel(Layer(1.0, 0.48, np.inf))
    r = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    np.fill_diagonal(r, np.inf)
    whole = loads * (kernel.singular / (r + 1.0) ** 2 @ loads)
    assert half_space_pulls(kernel, points, loads, softest=1.0) == pytest.approx(whole, rel=0.05)


@pytest.mark.parametrize("base", [*BASES, "soft base"])
def test_pulls_without_cancellation_bound_those_of_point_loads(base):
    thickness, substrate = {**BASES, "soft base": (0.5, Elastic(0.05, 0.3))}[base]
    kernel = LayeredKernel(Layer(1.0, 0.48, thickness), substrate)
    rng = np.random.default_rng(2)
    for count in (300, SUMMED + 100):
        points, loads = 2.0 * rng.uniform(0.0, np.sqrt(count), (count, 2)), rng.uniform(0.5, 1.0, count)
        r = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
        np.fill_diagonal(r, np.inf)
        with np.errstate(invalid="ignore"):
            slope = np.where(np.isfinite(r), np.abs(kernel.scaled_slope(np.minimum(r, 1e9))), 0.0)
        sums = kernel.singular * loads * (slope @ loads)
        found = layer_pulls(kernel, points, loads, 1e-6)
        assert np.all(found >= 0.95 * sums)
        # where |dK/dr| r^2 falls throughout, the sum is exact
        assert base in ("rigid base", "elastic base") or found == pytest.approx(sums, rel=0.15)
        assert np.all(layer_pulls(kernel, points, loads, 0.2) >= 0.95 * found)


@pytest.fixture(scope="module")
def meshed():
    """Enough balls of revolution for the mesh."""
    problem = scene("approach", "half-space", 240)
    balls = tuple(b if isinstance(b.shape, str) else Ball(b.position, b.radius) for b in problem.balls)
    problem = replace(problem, balls=balls)
    solution = solve_contact(problem, 1e-3)
    assert FarField.of(solution.contacts.kernel, problem.positions, np.array(0.6), 1e-5).mesh is not None
    return problem, solution


def test_direct_sums_over_all_others_give_the_same_forces_on_every_ball(meshed):
    _, solution = meshed
    contacts = solution.contacts
    direct = DirectSums(contacts.kernel, contacts.smooth.nodes, 1e-7)
    found = np.array([direct.force(k, n) for k, n in enumerate(contacts.smooth.nodes)])
    difference = np.max(np.abs(found - contacts.mutual_force), axis=1)
    assert np.all(difference <= solution.tangential_force_error)
    # the mesh: 1e-6 Q^2 / H^2 per pair, and pairs to 1e-5 of their displacement
    assert np.max(difference) < 3e-5 * np.max(np.abs(contacts.mutual_force))


def test_in_plane_forces_cancel_with_the_mesh_too(meshed):
    force = meshed[1].contacts.mutual_force
    assert np.max(np.abs(force.sum(axis=0))) < 1e-12 * np.max(np.abs(force))


def test_the_pressure_of_many_contacts_is_the_sum_over_all(meshed):
    _, solution = meshed
    x, y = np.meshgrid(np.linspace(0.0, 8.0, 30), np.linspace(0.0, 8.0, 30))
    every = sum(n.zone.pressure(x, y) for n in solution.contacts.smooth.nodes) / solution.contacts.kernel.singular
    assert np.max(every) > 0.0
    assert solution.pressure(x, y) == pytest.approx(every, rel=1e-12)


def test_shifting_and_turning_many_balls_changes_nothing_beyond_the_stated_error(meshed):
    problem, solution = meshed
    here = solution.result()
    c, s = np.cos(0.7), np.sin(0.7)
    q = np.array([[c, -s], [s, c]])
    moved = tuple(replace(b, position=tuple(q @ b.position + (13.0, -7.0))) for b in problem.balls)
    there = solve(replace(problem, balls=moved), 1e-3)
    difference = np.max(np.abs(forces(here) @ q.T - forces(there)), axis=1)
    assert np.all(difference <= errors(here) + errors(there))


def test_a_ball_far_from_all_others_has_its_pull_within_the_stated_error():
    problem = scene("approach", "half-space", 240)
    balls = tuple(b if isinstance(b.shape, str) else Ball(b.position, b.radius) for b in problem.balls)
    far = replace(balls[100], position=(3e7, -2e6))
    problem = replace(problem, balls=(*balls[:100], far, *balls[101:]))
    # a smaller force than the others', so that it is not part of the sample
    solution = solve_contact(problem.with_load("approach", [0.1] * 100 + [0.05] + [0.1] * 139), 1e-3)
    contacts = solution.contacts
    assert 100 not in contacts.sample
    assert FarField.of(contacts.kernel, contacts.problem.positions, np.full(240, 0.6), 1e-5).mesh is not None
    direct = DirectSums(contacts.kernel, contacts.smooth.nodes, 1e-9).force(100, contacts.smooth.nodes[100])
    assert np.max(np.abs(direct - contacts.mutual_force[100])) <= solution.tangential_force_error[100]


def test_random_balls_agree_with_the_sum_over_all_pairs():
    # other loads, more balls: `python -m tests.linear_bem.random_balls direct 1000 force rigid`
    found = direct(150, "total_force", "elastic")
    assert found["over the bar"] <= 1.0
    assert found["T"] < 1e-4
    assert found["Q"] < 1e-5
