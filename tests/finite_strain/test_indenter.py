"""The gap of points to a ball: exact values, and derivatives by the form language against finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("ufl")

from finite_strain.contact.contact_energy import gap
from linear_bem import Cone, Ellipsoid, Indenter, Punch

SHAPES: dict[str, str | Indenter] = {
    "sphere": "sphere",
    "paraboloid": "paraboloid",
    "ellipsoid": Ellipsoid((1.3, 0.8, 1.0)),
    "cone": Cone(math.radians(20.0), 0.3),
    "punch": Punch(0.7, 0.2),
}
RADIUS, APPROACH = 1.3, 0.2
STEP = 1e-5
DIFFERENCE = 1e-8
"""Of a central difference with that step, of functions whose third derivatives are of order a hundred."""
RANDOM = np.random.default_rng(7)
OFFSETS = np.vstack([RANDOM.uniform(-0.6, 0.6, (2, 40)), np.zeros((1, 40))])
DISPLACEMENTS = RANDOM.uniform(-0.15, 0.15, (3, 40))
STILL = np.zeros((3, 40))


@pytest.mark.parametrize("finite", [True, False], ids=["finite strain", "small strain"])
@pytest.mark.parametrize("name", SHAPES)
def test_an_approach_closes_the_gap_at_the_apex_by_its_own_length(name: str, finite: bool) -> None:
    for approach in (-0.1, 0.0, 0.2):
        assert gap(SHAPES[name], RADIUS, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), approach, finite) == pytest.approx(
            -approach,
            abs=1e-8,  # the indenters' own roots are kept from zero by 1e-9
        )
    assert gap(SHAPES[name], RADIUS, (0.0, 0.0, 0.0), (0.0, 0.0, -0.2), 0.2, finite) == pytest.approx(0.0, abs=1e-8)


def test_points_on_the_ball_have_no_gap() -> None:
    directions = RANDOM.normal(size=(3, 30))
    directions /= np.linalg.norm(directions, axis=0)
    centre = np.array([[0.0], [0.0], [RADIUS - APPROACH]])
    found = gap("sphere", RADIUS, np.zeros((3, 30)), centre + RADIUS * directions, APPROACH, True)
    assert np.abs(found).max() < 1e-14


def test_linearised_and_exact_spheres_share_their_profile() -> None:
    profile = gap("sphere", RADIUS, OFFSETS, STILL, 0.0, False)
    assert profile == pytest.approx(RADIUS - np.sqrt(RADIUS**2 - OFFSETS[0] ** 2 - OFFSETS[1] ** 2), abs=1e-15)
    lifted = np.vstack([np.zeros((2, 40)), profile])
    assert np.abs(gap("sphere", RADIUS, OFFSETS, lifted, 0.0, True)).max() < 1e-14


@pytest.mark.parametrize("name", SHAPES)
def test_a_linearised_gap_knows_only_the_vertical_displacement(name: str) -> None:
    sideways = DISPLACEMENTS * np.array([[1.0], [1.0], [0.0]])
    args = SHAPES[name], RADIUS, OFFSETS
    assert np.array_equal(gap(*args, sideways, APPROACH, False), gap(*args, STILL, APPROACH, False))
    lifted = gap(*args, DISPLACEMENTS, APPROACH, False)
    assert lifted == pytest.approx(gap(*args, STILL, APPROACH, False) - DISPLACEMENTS[2], abs=1e-15)


def test_a_paraboloid_is_scaled_by_its_radius() -> None:
    expected = (OFFSETS[0] ** 2 + OFFSETS[1] ** 2) / (2.0 * RADIUS) - APPROACH
    assert gap("paraboloid", RADIUS, OFFSETS, STILL, APPROACH, False) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("finite", [True, False], ids=["finite strain", "small strain"])
@pytest.mark.parametrize("name", SHAPES)
def test_the_form_language_differentiates_the_gap_by_displacement_and_position(name: str, finite: bool) -> None:
    pytest.importorskip("dolfinx")
    import dolfinx  # noqa: PLC0415
    import ufl  # noqa: PLC0415
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import compat  # noqa: PLC0415

    mesh = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    place, moved = (dolfinx.fem.Constant(mesh, np.zeros(3)) for _ in range(2))
    X, u = ufl.variable(place), ufl.variable(moved)
    value = gap(SHAPES[name], RADIUS, X, u, APPROACH, finite)
    every = ufl.as_vector([value, *(ufl.diff(value, by)[axis] for by in (X, u) for axis in range(3))])
    compiled = compat.compile_expression(every, np.full((1, 3), 0.25), MPI.COMM_SELF)

    def at(offset: np.ndarray, displacement: np.ndarray) -> float:
        return float(gap(SHAPES[name], RADIUS, offset, displacement, APPROACH, finite))

    for offset, displacement in zip(OFFSETS.T[:6], DISPLACEMENTS.T, strict=False):
        place.value[:], moved.value[:] = offset, displacement
        found = compat.evaluate(compiled, mesh, np.zeros(1, dtype=np.int32), (7,))[0, 0]
        assert found[0] == pytest.approx(at(offset, displacement), abs=1e-13)
        for axis in range(2 if not finite else 3):
            step = STEP * np.eye(3)[axis]
            by_place = (at(offset + step, displacement) - at(offset - step, displacement)) / (2 * STEP)
            assert found[1 + axis] == pytest.approx(by_place, abs=DIFFERENCE)
        for axis in range(3):
            step = STEP * np.eye(3)[axis]
            by_displacement = (at(offset, displacement + step) - at(offset, displacement - step)) / (2 * STEP)
            assert found[4 + axis] == pytest.approx(by_displacement, abs=DIFFERENCE)


def test_the_linearised_sphere_stays_finite_beyond_its_own_edge() -> None:
    found = gap("sphere", RADIUS, (5.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1, False)
    assert np.isfinite(found)
    assert found > 1.0
