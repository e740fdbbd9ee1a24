"""Energy, residual, tangent and forces of contact against each other; areas and pressures against exact values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from finite_strain.compat import geometry_dofs
from finite_strain.discretisation.nodal_values import on_top
from finite_strain.force.contact_area import contact_areas
from finite_strain.force.contact_pressure import Extremes
from finite_strain.geometry.extent import Extent
from linear_bem import Ball, Ellipsoid, Load
from tests.finite_strain.scenes import balls_at, coarse_plan, coarse_rig, on_layer, pair, relatively

if TYPE_CHECKING:
    from finite_strain.contact.contact_energy import Contact
    from finite_strain.discretisation.discrete_model import Model

CASES = {
    "finite strain, sphere": ("finite_strain", "sphere"),
    "finite strain, paraboloid": ("finite_strain", "paraboloid"),
    "small strain, paraboloid": ("small_strain", "paraboloid"),
    "small strain, sphere": ("small_strain", "sphere"),
}
ROUNDOFF = 1e-12
APPROACH, PENALTY = 0.1, 30.0


@pytest.fixture(scope="module", params=CASES)
def model(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Model:
    """A quarter of a pair with some thousand unknowns, unloaded."""
    kind, shape = CASES[request.param]
    plan = coarse_plan(pair(APPROACH, shape=shape, poisson=0.3), kind)
    return coarse_rig(plan, tmp_path_factory.mktemp("contact")).model


def smooth_field(model: Model, seed: int, scale: float) -> np.ndarray:
    """Return nodal values of a random smooth field (nodes, 3), zero where the model is constrained."""
    random = np.random.default_rng(seed)
    points = model.space.tabulate_dof_coordinates()
    waves = random.uniform(-1.5, 1.5, (4, 3))
    field = sum(np.sin(points @ wave)[:, None] * random.uniform(-1.0, 1.0, 3) for wave in waves)
    field = scale * np.asarray(field) * np.exp(-np.abs(points[:, 2]))[:, None]
    field[model.constrained] = 0.0
    return field


def prepare(model: Model, approach: float, *, augmented: bool, turning: bool = False) -> np.ndarray:
    """Set load, penalty, multipliers and area; return a displacement that dents the layer under the ball."""
    u = smooth_field(model, 1, 0.01)
    points = model.space.tabulate_dof_coordinates()
    dent = 0.5 * max(approach, 0.0) * np.exp(-np.sum((points - np.array([1.0, 0.0, 0.0])) ** 2, axis=1) / 0.1)
    u[:, 2] -= np.where(model.constrained[:, 2], 0.0, dent)
    contact = model.contact
    contact.turning.value = float(turning)
    contact.forget_multipliers()
    contact.set_approaches(np.array([approach]))
    contact.set_penalties(np.array([PENALTY]))
    if augmented:
        model.nodal[:] = 1.3 * u + smooth_field(model, 4, 0.002)
        contact.augment(contact.penalised, 1.0)
    model.nodal[:] = u
    return u


def shift_balls(contact: Contact, axis: int, length: float) -> None:
    """Set the balls' positions to the initial ones plus ``length`` [m] along an axis."""
    contact.set("xy"[axis], np.array([ball.position[axis] for ball in contact.balls]) + length)


def residual_at(model: Model, u: np.ndarray) -> np.ndarray:
    model.nodal[:] = u
    b = model.matrix.createVecRight()
    model.residual(b)
    values = b.array.copy()
    b.destroy()
    return values


def energy_at(model: Model, u: np.ndarray) -> float:
    model.nodal[:] = u
    return model.energy()


@pytest.mark.parametrize("state", ["open", "penetrated", "augmented", "turning"])
def test_the_residual_is_the_derivative_of_the_potential(model: Model, state: str) -> None:
    u = prepare(
        model, -0.1 if state == "open" else APPROACH, augmented=state in ("augmented", "turning"),
        turning=state == "turning",
    )  # fmt: skip
    assert (model.forces()[0, 2] > 0.0) == (state != "open")
    v = smooth_field(model, 2, 1.0)
    slope = float(residual_at(model, u) @ v.ravel())
    steps = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    remainders = [abs(energy_at(model, u + s * v) - energy_at(model, u) - s * slope) for s in steps]
    orders = np.diff(np.log(remainders)) / np.diff(np.log(steps))
    # theory: the potential has a continuous first derivative, so Taylor's remainder is of second order
    assert orders == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("state", ["open", "penetrated", "augmented", "turning"])
def test_the_tangent_is_the_derivative_of_the_residual(model: Model, state: str) -> None:
    u = prepare(
        model, -0.1 if state == "open" else APPROACH, augmented=state in ("augmented", "turning"),
        turning=state == "turning",
    )  # fmt: skip
    v, step = smooth_field(model, 3, 1.0), 1e-6
    plus, minus = (residual_at(model, u + s * step * v) for s in (1.0, -1.0))
    model.nodal[:] = u
    model.tangent()
    x, y = model.matrix.createVecs()
    x.array[:] = v.ravel()
    model.matrix.mult(x, y)
    difference = (plus - minus) / (2.0 * step)
    assert np.linalg.norm(y.array - difference) < 1e-6 * np.linalg.norm(difference)
    assert model.matrix.isSymmetric(1e-10)
    x.destroy()
    y.destroy()


def test_constrained_displacements_have_zero_residual_and_identity_rows(model: Model) -> None:
    u = prepare(model, APPROACH, augmented=False)
    residual = residual_at(model, u).reshape(-1, 3)
    assert not np.any(residual[model.constrained])
    model.tangent()
    for row in np.flatnonzero(model.constrained.ravel())[::97]:
        columns, values = model.matrix.getRow(row)
        assert values[columns == row] == 1.0
        assert np.count_nonzero(values) == 1


@pytest.mark.parametrize("augmented", [False, True], ids=["penalty", "multipliers"])
def test_the_normal_force_is_the_derivative_of_the_potential_by_the_approach(model: Model, augmented: bool) -> None:
    u = prepare(model, APPROACH, augmented=augmented)
    contact, copies = model.contact, model.contact.balls[0].copies
    border = model.matrix.createVecRight()
    stiffness, changed = model.border(np.ones(1), border), border.array.copy()
    force, step = model.part_forces()[0], 1e-6
    assert force == relatively(model.forces()[0, 2] / copies, ROUNDOFF)
    energies, forces, residuals = [], [], []
    for sign in (1.0, -1.0):
        contact.set_approaches(np.array([APPROACH + sign * step]))
        energies.append(model.energy())
        forces.append(model.part_forces()[0])
        residuals.append(residual_at(model, u))
    assert force > 0.0
    # a central difference with a step of 1e-6
    assert (energies[0] - energies[1]) / (2 * step) == relatively(force, 1e-7)
    assert (forces[0] - forces[1]) / (2 * step) == relatively(stiffness, 1e-6)
    difference = (residuals[0] - residuals[1]) / (2 * step)
    assert np.linalg.norm(changed - difference) < 1e-6 * np.linalg.norm(difference)
    border.destroy()


@pytest.mark.parametrize("augmented", [False, True], ids=["penalty", "multipliers"])
def test_the_in_plane_force_is_minus_the_derivative_of_the_potential_by_the_balls_position(
    model: Model, augmented: bool
) -> None:
    prepare(model, APPROACH, augmented=augmented)
    force, step = model.forces()[0], 1e-6
    energies = []
    for sign in (1.0, -1.0):
        shift_balls(model.contact, 0, sign * step)
        energies.append(model.energy())
    shift_balls(model.contact, 0, 0.0)
    assert -2.0 * (energies[0] - energies[1]) / (2 * step) == pytest.approx(force[0], abs=1e-7 * force[2])
    assert abs(force[0]) > 1e-4 * force[2]
    assert force[1] == 0.0  # zero by the symmetry plane through the ball


def test_contact_forces_sum_to_the_reported_force_and_bulk_forces_to_zero(model: Model) -> None:
    u = prepare(model, APPROACH, augmented=False)
    b = model.matrix.createVecRight()
    held, model.constrained[:] = model.constrained.copy(), False
    model.residual(b)
    forces = b.array_r.reshape(-1, 3).copy()
    weight = model.part_forces()[0]
    model.contact.set_penalties(np.zeros(len(model.contact.balls)))
    model.residual(b)
    model.constrained[:] = held
    internal = b.array_r.reshape(-1, 3)
    pushed = forces - internal
    assert pushed[:, 2].sum() == relatively(weight, ROUNDOFF)
    # a rigid shift strains nothing
    assert abs(internal[:, 2].sum()) < ROUNDOFF * np.abs(internal).sum()
    assert np.array_equal(model.nodal, u)
    b.destroy()


def flat(model: Model, approaches: list[float]) -> None:
    """Press balls into the undeformed surface."""
    model.nodal[:] = 0.0
    model.contact.forget_multipliers()
    model.contact.set_approaches(np.array(approaches))
    model.contact.set_penalties(np.full(len(approaches), PENALTY))


def test_extremes_areas_and_gaps_are_those_of_a_known_indentation(model: Model) -> None:
    flat(model, [APPROACH])
    # the flat surface crosses the ball in a circle of radius sqrt(2 R D - D^2)
    squared = 2.0 * APPROACH - (APPROACH**2 if model.contact.balls[0].shape == "sphere" else 0.0)
    # points of the facets in or out
    assert contact_areas(model)[0] == relatively(math.pi * squared, 2e-3)
    ((pressure, penetration, _),) = Extremes(model)()
    assert penetration == relatively(APPROACH, 1e-8)  # a node lies under the apex; the indenters' roots are kept from 0
    # the peak is a mean over the elements about a vertex
    assert 0.6 * PENALTY * penetration < pressure < PENALTY * penetration * (1.0 + ROUNDOFF)
    # the mean of (D - r^2 / 2R)^2 over that of D - r^2 / 2R
    assert model.readings.mean_gaps()[0] == relatively(-2.0 / 3.0 * APPROACH, 0.02)


def test_the_contact_area_is_that_of_the_deformed_surface(model: Model) -> None:
    flat(model, [APPROACH])
    area = contact_areas(model)[0]
    points = model.space.tabulate_dof_coordinates()
    model.nodal[:, :2] = 0.25 * (points - np.array([1.0, 0.0, 0.0]))[:, :2]
    # at finite strain the ball touches two thirds of that part of the body, stretched over the same circle;
    # points of the facets in or out
    assert contact_areas(model)[0] == relatively(area, 5e-3)


def test_penetration_of_a_steep_flank_is_a_distance(tmp_path: Path) -> None:
    plan = coarse_plan(on_layer(balls_at((0.0, 0.0), shape="paraboloid"), Load("approach", (0.5,)), poisson=0.3))
    model = coarse_rig(plan, tmp_path).model
    flat(model, [0.5])
    away = np.linalg.norm(model.space.tabulate_dof_coordinates()[:, :2], axis=1)
    top = on_top(model.space, model.facet_tags) & (away < 1.0)  # the slope of the flank is the distance from the axis
    model.nodal[:, 2] = 0.5 * away**2 - 0.5 + np.where(top, 1e-3 * away, 0.0)
    distances = 1e-3 * away[top] / np.hypot(1.0, away[top])
    assert Extremes(model)()[0, 1] == relatively(distances.max(), 1e-6)


@pytest.mark.parametrize("distance", [1.55, 3.0], ids=["overlapping", "apart"])
def test_contact_forces_of_two_balls_on_a_fixed_surface_are_independent(
    distance: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    balls = (Ball((-0.5 * distance, 0.0), 1.0, "paraboloid"), Ball((0.5 * distance, 0.0), 0.6, "paraboloid"))
    approaches = (0.5, 0.5)  # circles of radius 1 and 0.77
    plan = coarse_plan(on_layer(balls, Load("approach", approaches), poisson=0.3), "small_strain")
    model = coarse_rig(plan, tmp_path_factory.mktemp("between")).model
    flat(model, list(approaches))
    forces = model.forces()
    for ball, approach, force in zip(balls, approaches, forces, strict=True):
        # k int (D - r^2 / 2R) dA over the circle; discretisation: the facet rule across the kink
        assert force[2] == relatively(PENALTY * math.pi * ball.radius * approach**2, 0.03)
    flat(model, [0.5, -0.2])  # what touches the first ball beyond the middle is not under the second
    pressed, lifted = Extremes(model)()
    assert pressed[1] == relatively(0.5, 1e-8)
    assert (lifted == 0.0).all()


def test_the_facets_under_a_long_body_may_touch_it_where_the_axes_of_others_are_nearer(tmp_path: Path) -> None:
    laid = balls_at((0.0, 0.0), (1.4, 0.7), (1.4, -0.72), shape=Ellipsoid((2.0, 0.3, 0.3)))
    problem = on_layer(laid, Load("approach", (0.12, -0.05, -0.05)))
    plan = coarse_plan(problem, "small_strain", extent=Extent(0.5, 0.0))
    contact = coarse_rig(plan, tmp_path).model.contact
    x, y = contact.mesh.geometry.x[geometry_dofs(contact.mesh)[contact.cells, :8], :2].mean(axis=1).T
    x, y = x - contact.balls[0].position[0], y - contact.balls[0].position[1]
    under = contact.cells[(x / 1.6) ** 2 + (y / 0.24) ** 2 < 1.0]
    assert len(under) > 20
    assert np.any([slot.balls[under] == 0 for slot in contact.slots], axis=0).all()
