"""The in-plane force: both routes against what they are derivatives of, and against each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from finite_strain import compat
from finite_strain.contact import Contact, Surface
from finite_strain.domain import Image, ModelBall, Reduction, Resolution
from finite_strain.planning import RunPlan
from linear_bem import Ball, Load, NotConverged
from meshes.box import TAGS, Box, Zone
from tests.finite_strain.scenes import SHAPES, Rig, coarse_plan, coarse_rig, in_form, on_layer, pair, relatively

UNEQUAL = on_layer((Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 0.8, "sphere")), Load("approach", (0.1, 0.08)))
LOPSIDED = on_layer(
    tuple(Ball(p, 1.0, "sphere") for p in ((0.0, 0.0), (2.2, 0.0), (0.0, 2.5))), Load("approach", (0.1, 0.1, 0.1))
)
CASES = {
    "finite strain": (in_form("displacement", pair(0.1)), "finite_strain"),
    "small strain": (in_form("displacement", pair(0.1, shape="paraboloid")), "small_strain"),
    "unequal pair": (in_form("displacement", UNEQUAL), "finite_strain"),
    "three balls": (in_form("displacement", LOPSIDED), "finite_strain"),
    "mixed": (in_form("mixed", pair(0.1)), "finite_strain"),
    "incompressible": (pair(0.1, poisson=0.5), "finite_strain"),
    "incompressible, small strain": (pair(0.1, poisson=0.5, shape="paraboloid"), "small_strain"),
}
SOLVER = 1e-12
"""Residual norm [N] at which these equilibria are closed; forces are of the order of 0.1 N."""


def settle(rig: Rig) -> None:
    """Close the equilibrium by full Newton steps in the end: a line search would stop at its own roundoff."""
    rig.solver.solve(1e-7)
    b, x, state = (rig.solver.new_vector() for _ in range(3))
    for _ in range(20):
        rig.model.residual(b)
        if b.norm() < SOLVER:
            break
        rig.solver.solve_linear(b, x)
        rig.model.get_state(state)
        state.axpy(-1.0, x)
        rig.model.set_state(state)
    assert b.norm() < SOLVER
    for vector in (b, x, state):
        vector.destroy()


@pytest.fixture(scope="module", params=CASES)
def pressed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Rig:
    """A coarse model in equilibrium at full load with its contacts augmented, all of the top in reach of every ball."""
    problem, kind = CASES[request.param]
    crowd = len(problem.balls) > 2
    size = 0.6 if crowd else 0.45
    plan = coarse_plan(problem, kind, Resolution(size, size, size), 0.35, (0.4, 0.7, 1.0))
    if crowd:  # the identities below hold in any box, and a small one is quick
        small = replace(plan.boxes[1], x=(-2.6, 2.6), y=(-2.7, 2.7))
        plan = replace(plan, boxes=(small, small))
    rig = coarse_rig(plan, tmp_path_factory.mktemp("forces"))
    model = rig.model
    for contact, ball in zip(model.contacts, model.reduction.balls, strict=True):
        contact.surface = whole_top(rig, ball.position)
        contact.reference = contact.surface.points - np.array([*ball.position, 0.0])
        contact.multiplier = np.zeros(contact.surface.weights.shape)
    rig.press()
    settle(rig)
    return rig


def whole_top(rig: Rig, position: tuple[float, float]) -> Surface:
    model = rig.model
    return Surface.near(model.space, model.linear_space, model.facet_tags.find(TAGS["top"]), position, np.inf)


@contextmanager
def unharmed(rig: Rig) -> Iterator[None]:
    """Bring state, loads, multipliers and mesh back to what they were."""
    model = rig.model
    points, values = model.mesh.geometry.x.copy(), model.fields.copy()
    kept = [dict(vars(contact)) for contact in model.contacts]
    try:
        yield
    finally:
        model.mesh.geometry.x[:] = points
        model.fields.restore(values)
        for contact, attributes in zip(model.contacts, kept, strict=True):
            vars(contact).update(attributes)


def energies(rig: Rig, change: Callable[[float], None], step: float) -> tuple[float, float]:
    """Return the least potential [J] after a change by +step and by -step, each from the present state."""
    found = []
    for sign in (1.0, -1.0):
        with unharmed(rig):
            change(sign * step)
            settle(rig)
            found.append(rig.model.energy())
    return found[0], found[1]


def shift_ball(contact: Contact, axis: int, length: float) -> None:
    contact.reference = contact.reference - length * np.eye(3)[axis]


def carry(rig: Rig, number: int, axis: int, length: float) -> None:
    """Move a ball, and with it the mesh by the weight q of its domain integral."""
    model = rig.model
    q = rig.meter._ramp(number, rig.contact_radii())
    model.mesh.geometry.x[:, axis] += length * q[compat.vertex_dofs(model.linear_space)]
    for other, (contact, ball) in enumerate(zip(model.contacts, model.reduction.balls, strict=True)):
        contact.surface = whole_top(rig, ball.position)
        contact.reference = contact.surface.points - np.array([*ball.position, 0.0])
        if other == number:
            shift_ball(contact, axis, length)


def free_directions(rig: Rig) -> list[tuple[int, int]]:
    balls = rig.model.reduction.balls
    return [(b, axis) for b, ball in enumerate(balls) for axis in (0, 1) if axis not in ball.fixed_axes]


@pytest.mark.parametrize("augmented", [True, False], ids=["multipliers", "penalty"])
def test_the_domain_integral_is_the_derivative_of_the_discrete_energy_by_moving_ball_and_mesh(
    pressed: Rig, augmented: bool
) -> None:
    step = 1e-4
    with unharmed(pressed):
        if not augmented:
            for contact in pressed.model.contacts:
                contact.multiplier = np.zeros_like(contact.multiplier)
            settle(pressed)
        forces = pressed.meter.domain(pressed.contact_radii())
        for number, axis in free_directions(pressed):
            up, down = energies(pressed, lambda length, n=number, a=axis: carry(pressed, n, a, length), step)
            expected = -pressed.model.reduction.balls[number].copies * (up - down) / (2.0 * step)
            # an exact identity of the discretisation: what is left is the difference quotient's error
            assert forces[number, axis] == relatively(expected, 1e-4)


def test_a_symmetry_plane_lets_no_force_across(pressed: Rig) -> None:
    forces = pressed.meter.domain(pressed.contact_radii())
    for number, ball in enumerate(pressed.model.reduction.balls):
        assert not np.any(forces[number, list(ball.fixed_axes)])


def test_the_traction_integral_is_the_derivative_of_the_energy_by_moving_the_ball_alone(pressed: Rig) -> None:
    step = 2e-5
    model = pressed.model
    for number, axis in free_directions(pressed):
        contact = model.contacts[number]
        up, down = energies(pressed, lambda length, c=contact, a=axis: shift_ball(c, a, length), step)
        # an exact identity, as above; raw tractions may be small, so they are measured by the normal force
        force = contact.force(model.nodal)
        assert -(up - down) / (2.0 * step) == pytest.approx(force[axis], abs=1e-7 * force[2])


def test_the_normal_force_is_the_derivative_of_the_energy_by_the_approach(pressed: Rig) -> None:
    step = 1e-5
    for contact in pressed.model.contacts:

        def deeper(length: float, contact: Contact = contact) -> None:
            contact.approach += length

        up, down = energies(pressed, deeper, step)
        # central difference
        assert (up - down) / (2.0 * step) == relatively(contact.force(pressed.model.nodal)[2], 1e-6)


def test_the_stiffness_by_linearisation_is_that_of_solving_again(pressed: Rig) -> None:
    step = 1e-6
    stiffness = pressed.path._stiffness()
    for column, contact in enumerate(pressed.model.contacts):
        forces = []
        for sign in (1.0, -1.0):
            with unharmed(pressed):
                contact.approach += sign * step
                settle(pressed)
                forces.append(pressed.path.normal_forces())
        slope = (forces[0] - forces[1]) / (2.0 * step)
        # central difference across a few quadrature points that gain or lose contact
        assert stiffness[:, column] == pytest.approx(slope, abs=1e-3 * np.abs(slope).max())


def test_comparing_the_routes_leaves_the_model_as_it_was(pressed: Rig) -> None:
    model = pressed.model
    with unharmed(pressed):
        for contact in model.contacts:
            contact.multiplier = np.zeros_like(contact.multiplier)
        settle(pressed)
        before, places = model.fields.copy(), [contact.reference.copy() for contact in model.contacts]
        pressed.traction.excess(pressed.contact_radii())
        assert pressed.traction.iterations > 0
        for now, then in zip(model.fields.copy(), before, strict=True):
            assert np.array_equal(now, then)
        for contact, place in zip(model.contacts, places, strict=True):
            assert np.array_equal(contact.reference, place)


def pinned_excess(rig: Rig, number: int, axis: int) -> float:
    ball, contact = rig.model.reduction.balls[number], rig.model.contacts[number]
    domain = rig.meter.domain_force(number, ball, rig.contact_radii())[axis]
    return float(ball.copies * contact.force(rig.model.nodal)[axis] - domain)


def test_where_no_equilibrium_is_found_with_moved_balls_the_excess_is_that_of_the_pinned_contact(
    pressed: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_tolerance: float) -> None:
        pressed.model.fields.clear()
        raise NotConverged("told to")

    monkeypatch.setattr(pressed.solver, "solve", fail)
    before, places = pressed.model.fields.copy(), [contact.reference for contact in pressed.model.contacts]
    excess = pressed.traction.excess(pressed.contact_radii())
    assert pressed.traction.pinned
    for number, axis in free_directions(pressed):
        assert excess[number, axis] == pytest.approx(pinned_excess(pressed, number, axis))
    assert all(np.array_equal(now, then) for now, then in zip(pressed.model.fields.copy(), before, strict=True))
    assert all(now.reference is then for now, then in zip(pressed.model.contacts, places, strict=True))


def test_a_contact_far_from_its_balls_axis_stays_pinned(pressed: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("finite_strain.traction.FARTHEST", 0.0)
    excess = pressed.traction.excess(pressed.contact_radii())
    for number, axis in free_directions(pressed):
        assert excess[number, axis] == pytest.approx(pinned_excess(pressed, number, axis))


def test_a_move_in_parts_ends_where_one_at_once_does(pressed: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    model = pressed.model
    with unharmed(pressed):
        for contact in model.contacts:
            contact.multiplier = np.zeros_like(contact.multiplier)
        settle(pressed)
        monkeypatch.setattr(pressed.solver, "tolerance", 1e-10)  # of a load path with such forces
        found = []
        for part in (1.0, 2e-4):
            monkeypatch.setattr("finite_strain.traction.LONGEST_PART", part)
            found.append(pressed.traction.excess(pressed.contact_radii()))
        assert not pressed.traction.pinned
        force = np.abs(pressed.meter.domain(pressed.contact_radii())).max()
        assert np.abs(found[1] - found[0]).max() < 1e-3 * force  # what the solver leaves open, over T


@pytest.mark.parametrize("kind", SHAPES)
def test_routes_agree_far_better_once_the_traction_is_freed_from_the_pinning(
    kind: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    freed, raw = [], []
    for size in (0.4, 0.3, 0.25):
        resolution = Resolution(size, 0.8 * size, size)
        plan = coarse_plan(pair(0.1, shape=SHAPES[kind]), kind, resolution, 0.25, (0.5, 1.0))
        rig = coarse_rig(plan, tmp_path_factory.mktemp("routes"))
        rig.press()
        for contact in rig.model.contacts:
            contact.multiplier[:] = 0.0
        settle(rig)
        (ball,) = rig.model.reduction.balls
        x = ball.copies * rig.model.contacts[0].force(rig.model.nodal)[0]
        domain = rig.meter.domain(rig.contact_radii())[0, 0]
        freed.append(rig.traction.excess(rig.contact_radii())[0, 0] / domain)
        raw.append(x / domain - 1.0)
    # discretisation: two to four elements per contact radius
    assert np.linalg.norm(freed) < 0.3 * np.linalg.norm(raw)
    assert abs(freed[-1]) < 0.005


def test_pressing_the_balls_of_an_unequal_pair_pulls_them_equally(tmp_path_factory: pytest.TempPathFactory) -> None:
    plan = coarse_plan(UNEQUAL, "finite_strain", Resolution(0.3, 0.3, 0.3), 0.3, (0.4, 0.7, 1.0))
    rig = coarse_rig(plan, tmp_path_factory.mktemp("unequal"))
    rig.press()
    forces = rig.meter.domain(rig.contact_radii())
    # discretisation: each ball's integral has a mesh of its own about it
    assert forces[0, 0] == relatively(-forces[1, 0], 0.03)


def test_a_single_ball_on_a_symmetric_mesh_feels_no_in_plane_force(tmp_path_factory: pytest.TempPathFactory) -> None:
    """No symmetry plane is imposed: the whole layer is simulated, and its mesh is its own mirror image."""
    zone = Zone((0.0, 0.0), 0.12, 0.45, 0.4, 0.45, mirror=3.0)
    rig = whole_layer(zone, tmp_path_factory.mktemp("symmetric"))
    normal = rig.path.normal_forces()[0]
    # solver: the residual's norm over the force
    assert np.abs(rig.meter.domain(rig.contact_radii())).max() < 1e-9 * normal
    assert np.abs(rig.model.contacts[0].force(rig.model.nodal)[:2]).max() < 1e-9 * normal


def test_a_symmetric_prism_leaves_a_noise_far_below_the_force_between_balls(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    zone = Zone((0.0, 0.0), 0.12, 0.45, 0.4, 0.45, mirror=0.9)
    rig = whole_layer(zone, tmp_path_factory.mktemp("prism"))
    normal = rig.path.normal_forces()[0]
    noise = np.abs(rig.meter.domain(rig.contact_radii())).max() / normal
    # discretisation: T / Q of the pair at this approach is 1e-3
    assert 0.0 < noise < 5e-5


def whole_layer(zone: Zone, folder: Path) -> Rig:
    """Press one ball into a square of layer without symmetry planes."""
    problem = on_layer((Ball((0.0, 0.0), 1.0, "sphere"),), Load("approach", (0.1,)))
    ball = ModelBall(0, (0.0, 0.0), 1.0, "sphere", 1, ())
    reduction = Reduction((0.0, 0.0), 0.0, (), (ball,), (Image(0, (1, 1)),))
    box = Box((-3.0, 3.0), (-3.0, 3.0), problem.layer.thickness, 0.0, (zone,), 1.5)
    rig = coarse_rig(RunPlan(problem, "finite_strain", reduction, (0.5, 1.0), (box, box)), folder)
    rig.press()
    settle(rig)
    return rig
