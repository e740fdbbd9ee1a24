"""The in-plane force: both routes against derivatives of the energy, and against each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.nodal_values import element_of
from finite_strain.equilibrium.newton import NewtonSolver, StepRecord
from finite_strain.force.domain_integral import ramp
from finite_strain.geometry.symmetry import Image, ModelBall, Reduction
from tests.finite_strain.scenes import (
    COARSER,
    CUBIC,
    QUADRATIC,
    SHAPES,
    UNEQUAL,
    Rig,
    coarse_plan,
    coarse_rig,
    in_form,
    pair,
    relatively,
    single,
)

CASES = {
    "finite strain": (pair(0.1, poisson=0.3), "finite_strain"),
    "small strain": (pair(0.1, poisson=0.3, shape="paraboloid"), "small_strain"),
    "unequal pair": (UNEQUAL, "finite_strain"),
    "mixed": (in_form("mixed", pair(0.1)), "finite_strain"),
    "incompressible": (pair(0.1, poisson=0.5), "finite_strain"),
}
SOLVER = 1e-11
"""Residual norm over the normal force to which these equilibria are converged."""


def settle(rig: Rig) -> None:
    """Converge further than a load step does, because energies are differentiated."""
    rig.settle(SOLVER)


@pytest.fixture(scope="module", params=CASES)
def pressed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Rig:
    """A coarse model in equilibrium at full load with its contacts augmented."""
    problem, kind = CASES[request.param]
    rig = coarse_rig(coarse_plan(problem, kind), tmp_path_factory.mktemp("forces"))
    *_, last = rig.press([0.5, 1.0])
    assert rig.path.augment(last)
    settle(rig)
    return rig


@contextmanager
def unharmed(rig: Rig) -> Iterator[None]:
    """Restore state, loads, multipliers, balls and mesh afterwards."""
    model, contact = rig.model, rig.model.contact
    points, values, approaches = model.mesh.geometry.x.copy(), model.fields.copy(), contact.approaches
    earlier, augmented = contact.earlier.x.array.copy(), float(contact.augmented.value)
    try:
        yield
    finally:
        model.mesh.geometry.x[:] = points
        model.fields.restore(values)
        contact.set_approaches(approaches)
        contact.earlier.x.array[:] = earlier
        contact.augmented.value = augmented
        place(rig, 0, 0, 0.0)


def place(rig: Rig, number: int, axis: int, length: float) -> None:
    """Set the balls' positions to the initial ones, and move one of them by ``length`` [m] along an axis."""
    positions = np.array([ball.position for ball in rig.model.contact.balls])
    positions[number, axis] += length
    rig.model.contact.set("x", positions[:, 0])
    rig.model.contact.set("y", positions[:, 1])


def carry(rig: Rig, number: int, axis: int, length: float) -> None:
    """Move a ball, and the mesh with it by the weight q of its domain integral."""
    model = rig.model
    box, points = rig.run.box, model.linear_space.tabulate_dof_coordinates()
    q = ramp(box, box.zones[number], rig.contact_radii()[number], points)
    model.mesh.geometry.x[:, axis] += length * at_mesh_nodes(model, q)
    place(rig, number, axis, length)


def at_mesh_nodes(model: Model, values: np.ndarray) -> np.ndarray:
    """Return a field of the linear space at the nodes of the mesh, which consists of quadratic hexahedra."""
    corners, nodes = (element_of((order + 1) ** 3) for order in (1, 2))
    shapes = corners.tabulate(0, nodes.points)[0].reshape(len(nodes.points), -1)
    answer = np.zeros(len(model.mesh.geometry.x))
    answer[compat.geometry_dofs(model.mesh)] = values[compat.cell_dofs(model.linear_space)] @ shapes.T
    return answer


def energies(rig: Rig, change: Callable[[float], None], step: float) -> tuple[float, float]:
    """Return the potential [J] in equilibrium after a change by +step and by -step, each from the present state."""
    found = []
    for sign in (1.0, -1.0):
        with unharmed(rig):
            change(sign * step)
            settle(rig)
            found.append(rig.model.energy())
    return found[0], found[1]


def free_directions(rig: Rig) -> list[tuple[int, int]]:
    balls = rig.model.contact.balls
    return [(b, axis) for b, ball in enumerate(balls) for axis in (0, 1) if axis not in ball.fixed_axes]


@pytest.mark.parametrize("augmented", [True, False], ids=["multipliers", "penalty"])
def test_the_domain_integral_is_the_derivative_of_the_discrete_energy_by_moving_ball_and_mesh(
    pressed: Rig, augmented: bool
) -> None:
    step = 1e-4
    with unharmed(pressed):
        if not augmented:
            pressed.model.contact.forget_multipliers()
            settle(pressed)
        forces = pressed.in_plane_forces()
        for number, axis in free_directions(pressed):
            up, down = energies_from(pressed, number, axis, step, augmented)
            expected = -pressed.model.contact.balls[number].copies * (up - down) / (2.0 * step)
            # an exact identity of the discretisation; the remainder is the error of the difference quotient
            assert forces[number, axis] == pytest.approx(expected, rel=2e-4, abs=1e-8)


def energies_from(rig: Rig, number: int, axis: int, step: float, augmented: bool) -> tuple[float, float]:
    def change(length: float) -> None:
        if not augmented:
            rig.model.contact.forget_multipliers()
        carry(rig, number, axis, length)

    return energies(rig, change, step)


def test_there_is_no_force_across_a_symmetry_plane(pressed: Rig) -> None:
    domain, traction = pressed.in_plane_forces(), pressed.model.forces()
    for number, ball in enumerate(pressed.model.contact.balls):
        assert not np.any(domain[number, list(ball.fixed_axes)])
        assert not np.any(traction[number, list(ball.fixed_axes)])


def test_the_traction_integral_is_the_derivative_of_the_energy_by_moving_the_ball_alone(pressed: Rig) -> None:
    step, traction = 2e-5, pressed.model.forces()
    for number, axis in free_directions(pressed):
        up, down = energies(pressed, lambda length, n=number, a=axis: place(pressed, n, a, length), step)
        copies = pressed.model.contact.balls[number].copies
        # an exact identity, as above, where no quadrature point gains or loses contact; tractions may be small, so
        # they are measured by the normal force
        slope = -copies * (up - down) / (2.0 * step)
        assert slope == pytest.approx(traction[number, axis], abs=5e-6 * traction[number, 2])


def test_the_normal_force_is_the_derivative_of_the_energy_by_the_approach(pressed: Rig) -> None:
    step, contact, forces = 1e-5, pressed.model.contact, pressed.model.part_forces()
    for number in range(len(forces)):

        def deeper(length: float, number: int = number) -> None:
            contact.set_approaches(contact.approaches + length * np.eye(len(forces))[number])

        up, down = energies(pressed, deeper, step)
        # central difference
        assert (up - down) / (2.0 * step) == relatively(forces[number], 1e-6)


def test_the_traction_integral_is_off_by_less_than_a_thousandth_of_the_normal_force(pressed: Rig) -> None:
    domain, traction = pressed.in_plane_forces(), pressed.model.forces()
    for number, axis in free_directions(pressed):
        # discretisation: one quadratic element per contact radius
        assert abs(traction[number, axis] - domain[number, axis]) < 1e-3 * traction[number, 2]


def test_the_balls_of_a_pair_pull_each_other_equally(pressed: Rig) -> None:
    forces = pressed.in_plane_forces()
    if pressed.model.reduction.planes == (0, 1):
        assert forces.shape == (1, 2)  # the other ball is a mirror image
        return
    # discretisation, and sides as near as these
    assert abs(forces[:, 0].sum()) < 3e-4 * pressed.normal_forces().max()


def whole_layer(folder: Path) -> Rig:
    """Press one ball into a square layer without symmetry planes."""
    problem = single(0.1, poisson=0.3)
    ball = ModelBall((0.0, 0.0), 1.0, index=0, copies=1, fixed_axes=())
    plan = replace(coarse_plan(problem), reduction=Reduction((0.0, 0.0), 0.0, (), (ball,), (Image(0, (1, 1)),)))
    rig = coarse_rig(plan, folder)
    *_, last = rig.press([0.5, 1.0])
    rig.path.augment(last)
    settle(rig)
    return rig


def test_a_single_ball_feels_almost_no_in_plane_force_without_imposed_symmetry(tmp_path: Path) -> None:
    rig = whole_layer(tmp_path)
    assert rig.model.reduction.planes == ()
    normal = rig.normal_forces()[0]
    # the block about the ball is mirror-symmetric, the rest of the mesh is not; the smallest T / Q computed for a pair
    # at this approach is a thousand times larger
    assert np.abs(rig.in_plane_forces()).max() < 5e-6 * normal
    assert np.abs(rig.model.forces()[0, :2]).max() < 5e-6 * normal


def shift_by(rig: Rig, length: float) -> None:
    """Move ball and mesh about it by ``length`` [m] away from the mirror plane; the sides stay.

    The energies of separate meshes would differ by a tenth of the change with distance.
    """
    x = rig.model.mesh.geometry.x
    (zone,) = rig.run.box.zones
    middle = zone.position[0]
    x[:, 0] += length * np.interp(x[:, 0], [0.0, middle - 0.5, middle + 0.5, x[:, 0].max()], [0.0, 1.0, 1.0, 0.0])
    (ball,) = rig.model.contact.balls
    place(rig, 0, 0, middle + length - ball.position[0])
    rig.run.box = replace(rig.run.box, zones=(replace(zone, position=(middle + length, 0.0)),))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "poisson"), [("finite_strain", 0.3), ("small_strain", 0.48)])
def test_the_tangential_force_is_the_slope_of_the_energy_by_distance_at_given_approach(
    kind: str, poisson: float, tmp_path: Path
) -> None:
    found, forces, step = [], [], 0.05
    plan = coarse_plan(pair(0.2, shape=SHAPES[kind], poisson=poisson), kind, numerics=COARSER)
    rig = coarse_rig(plan, tmp_path, CUBIC)
    rig.press([0.5, 1.0])
    for shift in (0.0, step, step):
        shift_by(rig, shift)
        rig.settle()
        found.append(4.0 * rig.model.energy())
        forces.append(rig.in_plane_forces()[0, 0])
    # the right ball moves by two steps, the left one as far the other way. Simpson's rule
    attraction = -np.array(forces)
    work = 2.0 * step * (attraction[0] + 4.0 * attraction[1] + attraction[2]) / 3.0
    assert found[2] - found[0] == relatively(work, 0.05)  # discretisation


def test_a_second_solver_finds_the_same_equilibrium(tmp_path: Path) -> None:
    rig: Any = coarse_rig(coarse_plan(pair(0.1, poisson=0.3)), tmp_path, QUADRATIC)
    rig.press()
    before = rig.in_plane_forces()
    other = NewtonSolver(rig.model, rig.path.control)
    other.solve(SOLVER, 1.0, StepRecord(1.0))
    other.close()
    assert rig.in_plane_forces()[0, 0] == relatively(before[0, 0], 1e-5)
