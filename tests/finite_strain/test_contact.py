"""Energy, residual and tangent of contact and bulk against each other; surface geometry against exact values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from finite_strain.domain import Resolution
from tests.finite_strain.scenes import STIFF_SUBSTRATE, coarse_plan, coarse_rig, in_form, pair, relatively

if TYPE_CHECKING:
    from finite_strain.model import Model

COARSE = Resolution(0.5, 0.5, 0.5)
CASES = {
    "finite strain, sphere": ("finite_strain", "sphere"),
    "finite strain, paraboloid": ("finite_strain", "paraboloid"),
    "small strain, paraboloid": ("small_strain", "paraboloid"),
    "small strain, sphere": ("small_strain", "sphere"),
}
ROUNDOFF = 1e-12
APPROACH = 0.1


@pytest.fixture(scope="module", params=CASES)
def model(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Model:
    """A quarter of a pair on a substrate, a thousand unknowns, no load yet."""
    kind, shape = CASES[request.param]
    problem = in_form("displacement", pair(APPROACH, shape=shape, substrate=STIFF_SUBSTRATE))
    plan = coarse_plan(problem, kind, COARSE, 0.35)
    return coarse_rig(plan, tmp_path_factory.mktemp("contact")).model


def smooth_field(model: Model, seed: int, scale: float) -> np.ndarray:
    """Return nodal values of a random smooth field (nodes, 3), zero where the model is held."""
    random = np.random.default_rng(seed)
    points = model.space.tabulate_dof_coordinates()
    waves = random.uniform(-1.5, 1.5, (4, 3))
    field = sum(np.sin(points @ wave)[:, None] * random.uniform(-1.0, 1.0, 3) for wave in waves)
    field = scale * np.asarray(field) * np.exp(-np.abs(points[:, 2]))[:, None]
    field[model.constrained] = 0.0
    return field


def prepare(model: Model, approach: float, *, augmented: bool) -> np.ndarray:
    """Set load, penalty and multipliers; return a displacement that dents the layer under the ball."""
    u = smooth_field(model, 1, 0.01)
    points = model.space.tabulate_dof_coordinates()
    dent = 0.5 * max(approach, 0.0) * np.exp(-np.sum((points - np.array([1.0, 0.0, 0.0])) ** 2, axis=1) / 0.1)
    u[:, 2] -= np.where(model.constrained[:, 2], 0.0, dent)
    for contact in model.contacts:
        contact.approach, contact.penalty = approach, 30.0
        contact.multiplier[:] = 0.0
        if augmented:
            contact.multiplier = 0.7 * contact.pressure(u) * (contact.reference[..., 0] > -0.1)
    return u


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


@pytest.mark.parametrize("state", ["open", "penetrated", "augmented"])
def test_the_residual_is_the_derivative_of_the_potential(model: Model, state: str) -> None:
    u = prepare(model, -0.1 if state == "open" else APPROACH, augmented=state == "augmented")
    pressed = any(np.any(contact.pressure(u) > 0.0) for contact in model.contacts)
    assert pressed == (state != "open")
    v = smooth_field(model, 2, 1.0)
    slope = float(residual_at(model, u) @ v.ravel())
    steps = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    remainders = [abs(energy_at(model, u + s * v) - energy_at(model, u) - s * slope) for s in steps]
    orders = np.diff(np.log(remainders)) / np.diff(np.log(steps))
    # theory: the potential has a continuous first derivative, so Taylor's remainder is of second order
    assert orders == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("state", ["open", "penetrated", "augmented"])
def test_the_tangent_is_the_derivative_of_the_residual(model: Model, state: str) -> None:
    u = prepare(model, -0.1 if state == "open" else APPROACH, augmented=state == "augmented")
    v, step = smooth_field(model, 3, 1.0), 1e-6
    plus, minus = (residual_at(model, u + s * step * v) for s in (1.0, -1.0))
    signs = [
        [np.sign(contact.pressure(u + s * step * v)) for s in (1.0, -1.0)] for contact in model.contacts
    ]  # off the kink: no point gains or loses contact on the way
    assert all(np.array_equal(a, b) for a, b in signs)
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


def test_held_displacements_have_no_residual_and_a_row_of_the_identity(model: Model) -> None:
    u = prepare(model, APPROACH, augmented=False)
    residual = residual_at(model, u).reshape(-1, 3)
    assert not np.any(residual[model.constrained])
    model.tangent()
    for row in np.flatnonzero(model.constrained.ravel())[::97]:
        columns, values = model.matrix.getRow(row)
        assert values[columns == row] == 1.0
        assert np.count_nonzero(values) == 1


def test_the_normal_force_is_the_derivative_of_the_contact_potential_by_the_approach(model: Model) -> None:
    u = prepare(model, APPROACH, augmented=True)
    (contact,) = model.contacts
    force, stiffness = contact.force(u)[2], contact.stiffness(u)
    changed = np.zeros((len(u), 3))
    contact.approach_derivative(u, changed)
    step = 1e-6
    energies, forces, residuals = [], [], []
    for sign in (1.0, -1.0):
        contact.approach = APPROACH + sign * step
        energies.append(contact.energy(u))
        forces.append(contact.force(u)[2])
        residuals.append(np.zeros((len(u), 3)))
        contact.add_residual(u, residuals[-1])
    contact.approach = APPROACH
    assert force > 0.0
    # a central difference with a step of 1e-6
    assert (energies[0] - energies[1]) / (2 * step) == relatively(force, 1e-7)
    assert (forces[0] - forces[1]) / (2 * step) == relatively(stiffness, 1e-6)
    assert changed == pytest.approx((residuals[0] - residuals[1]) / (2 * step), rel=1e-6, abs=1e-8)


def test_the_in_plane_force_is_minus_the_derivative_of_the_potential_by_the_balls_position(model: Model) -> None:
    u = prepare(model, APPROACH, augmented=False)
    (contact,) = model.contacts
    force, reference, step = contact.force(u), contact.reference, 1e-6
    for axis in (0, 1):
        energies = []
        for sign in (1.0, -1.0):
            contact.reference = reference - sign * step * np.eye(3)[axis]
            energies.append(contact.energy(u))
        contact.reference = reference
        assert -(energies[0] - energies[1]) / (2 * step) == pytest.approx(force[axis], abs=1e-7 * force[2])


def test_contact_and_bulk_forces_cancel_on_the_whole(model: Model) -> None:
    u = prepare(model, APPROACH, augmented=False)
    (contact,) = model.contacts
    pushed = np.zeros((len(u), 3))
    contact.add_residual(u, pushed)
    assert pushed[:, 2].sum() == relatively(contact.force(u)[2], ROUNDOFF)
    model.nodal[:] = u
    # a rigid shift strains nothing
    internal = model.bulk_residual()
    assert abs(internal[:, 2].sum()) < ROUNDOFF * np.abs(internal).sum()


def test_a_trial_state_far_inside_the_ball_has_no_finite_potential(model: Model) -> None:
    u = prepare(model, 0.5, augmented=False) * 0.0
    assert energy_at(model, u) == np.inf


def quadratic(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a quadratic vector field (..., 3) and its in-plane gradient (..., 3, 2)."""
    x, y = points[..., 0], points[..., 1]
    value = np.stack([0.1 * x * x - 0.2 * x * y, 0.05 * y * y + 0.1 * x, 0.3 * x - 0.1 * y + 0.2 * x * y], axis=-1)
    zero = np.zeros_like(x)
    slopes = [
        [0.2 * x - 0.2 * y, -0.2 * x],
        [0.1 + zero, 0.1 * y],
        [0.3 + 0.2 * y, -0.1 + 0.2 * x],
    ]
    return value, np.stack([np.stack(row, axis=-1) for row in slopes], axis=-2)


def test_surface_functions_reproduce_quadratic_fields_and_their_gradients(model: Model) -> None:
    u, _ = quadratic(model.space.tabulate_dof_coordinates())
    surface = model.contacts[0].surface
    value, gradient = quadratic(surface.points)
    assert np.einsum("fqa,fai->fqi", surface.values, u[surface.dofs]) == pytest.approx(value, abs=ROUNDOFF)
    # roundoff of gradients grows with the inverse of the element size
    assert np.einsum("fqak,fai->fqik", surface.gradients, u[surface.dofs]) == pytest.approx(gradient, abs=1e-11)
    corner = np.einsum(
        "qc,fc->fq", surface.corner_values, model.linear_space.tabulate_dof_coordinates()[surface.corners, 0]
    )
    assert corner == pytest.approx(surface.points[..., 0], abs=ROUNDOFF)


def test_the_area_stretch_is_that_of_the_deformed_tangents(model: Model) -> None:
    u, _ = quadratic(model.space.tabulate_dof_coordinates())
    contact = model.contacts[0]
    gradient = quadratic(contact.surface.points)[1]
    along_x = gradient[..., 0] + np.array([1.0, 0.0, 0.0])
    along_y = gradient[..., 1] + np.array([0.0, 1.0, 0.0])
    stretch = np.linalg.norm(np.cross(along_x, along_y), axis=-1)
    expected = stretch if contact.indenter.deformed else np.ones_like(stretch)
    assert contact.area_stretch(u) == pytest.approx(expected, abs=1e-11)


def test_quadrature_weights_add_up_to_the_top_within_reach(model: Model) -> None:
    surface = model.contacts[0].surface
    points = model.mesh.geometry.x
    assert np.abs(surface.points[..., 2]).max() < ROUNDOFF
    assert surface.weights.min() > 0.0
    corners = model.space.tabulate_dof_coordinates()[model.top_dofs()[:, :3]]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == relatively(np.prod(np.ptp(points[:, :2], axis=0)), ROUNDOFF)
    assert surface.weights.sum() < area


def test_projecting_a_density_keeps_its_integral_and_its_sign(model: Model) -> None:
    contact = model.contacts[0]
    x, y = contact.surface.points[..., 0], contact.surface.points[..., 1]
    density = np.maximum(0.3 - np.hypot(x - x.mean(), y - y.mean()), 0.0)
    projected = model.project(contact, density)
    assert projected.min() == 0.0
    integral = np.sum(contact.surface.weights * (projected[contact.surface.corners] @ contact.surface.corner_values.T))
    assert integral == relatively(np.sum(contact.surface.weights * density), 1e-12)
    assert model.project(contact, np.ones_like(x))[np.unique(contact.surface.corners)] == pytest.approx(1.0)


def test_extremes_describe_a_known_indentation(model: Model) -> None:
    from mpi4py import MPI  # noqa: PLC0415

    contact = model.contacts[0]
    still = np.zeros_like(model.nodal)
    contact.approach, contact.penalty = 0.02, 10.0
    contact.multiplier[:] = 0.0
    found = contact.extremes(still, MPI.COMM_SELF)
    contact.approach = 0.0
    # the flat surface crosses the ball in a circle of radius sqrt(2 R D - D^2), of which the model holds half
    squared = 2.0 * 0.02 - (0.02**2 if model.reduction.balls[0].shape == "sphere" else 0.0)
    # discretisation: quadrature points in or out, and the deepest of them beside the axis
    assert found["contact_area"] == relatively(0.5 * np.pi * squared, 0.05)
    assert found["penetration"] == relatively(0.02, 0.02)
    assert found["peak_pressure"] == relatively(10.0 * found["penetration"], ROUNDOFF)
    assert found["open_gap"] == 0.0
