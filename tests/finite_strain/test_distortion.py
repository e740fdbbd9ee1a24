"""The smallest volume ratio and surface stretch of a known displacement, and their places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from mpi4py import MPI

from finite_strain import compat
from finite_strain.force.distortion import distortion, film_left
from finite_strain.own_mesh import FLAT
from tests.finite_strain.scenes import pair, quadratic_rig

ROUNDOFF = 1e-12


@pytest.mark.parametrize("order", [2, 3, 4])
def test_the_smallest_values_of_a_quadratic_displacement_are_found_at_their_corners(order: int) -> None:
    from dolfinx.mesh import CellType, create_box  # noqa: PLC0415

    mesh = create_box(MPI.COMM_SELF, [np.zeros(3), np.array([1.0, 2.0, 1.5])], [2, 3, 2], CellType.hexahedron)
    space = compat.function_space(mesh, order, (3,))
    x, y, z = space.tabulate_dof_coordinates().T
    top, axes = z > 1.5 - ROUNDOFF, [(1.0, 2.0), (9.0, 9.0)]
    still = distortion(space, np.zeros((len(x), 3)), top, axes)
    least = still.smallest_volume_ratio, still.smallest_surface_stretch, still.smallest_seen_area
    assert least == pytest.approx((1.0, 1.0, 1.0), abs=ROUNDOFF)
    bent = distortion(space, np.column_stack([-0.3 * x**2 + 0.2 * z, 0.05 * y**2, -0.1 * z + 0.3 * y]), top, axes)
    # det = (1 - 0.6 x)(1 + 0.1 y)(1 - 0.1) with the rows and columns of y and z triangular: least at x = 1, y = 0
    assert bent.smallest_volume_ratio == pytest.approx(0.4 * 0.9, abs=ROUNDOFF)
    assert bent.distorted_at["volume_ratio"][0] == pytest.approx(2.0, abs=ROUNDOFF)
    places = bent.distorted_at
    assert (bent.smallest_surface_stretch, places["surface_stretch"][1]) == pytest.approx((0.4, 0.0), abs=ROUNDOFF)
    assert (bent.smallest_seen_area, places["seen_area"][1]) == pytest.approx((0.4, 0.0), abs=ROUNDOFF)
    assert "folds into a crease" in bent.describe()
    assert "overhangs" not in bent.describe()
    below = distortion(space, np.column_stack([-0.3 * x**2 * (1.5 - z), 0.0 * y, 0.0 * z]), top, axes)
    assert below.smallest_volume_ratio == pytest.approx(0.1, abs=ROUNDOFF)  # at the bottom; the top is as it was
    assert below.distorted_at["volume_ratio"][1] == pytest.approx(1.5, abs=ROUNDOFF)
    assert below.smallest_surface_stretch > 0.7
    folded = distortion(space, np.column_stack([-0.6 * x**2, np.zeros_like(y), np.zeros_like(z)]), top, axes)
    assert folded.smallest_volume_ratio == pytest.approx(-0.2, abs=ROUNDOFF)
    assert folded.smallest_seen_area == pytest.approx(-0.2, abs=ROUNDOFF)
    assert "it overhangs" in folded.describe()
    assert folded.surface_crossing == 0.0
    leaning = distortion(space, np.column_stack([-0.1 * z, np.zeros_like(y), np.zeros_like(z)]), top, axes)
    assert leaning.surface_crossing == pytest.approx(0.15, abs=ROUNDOFF)
    assert "passes through a plane of symmetry by 0.15 m" in leaning.describe()
    for free in range(4):  # a free side moves as it likes; the top leaves the low side of x
        mirrors = np.arange(4).reshape(2, 2) != free
        leaning = distortion(space, np.column_stack([-0.1 * z, np.zeros_like(y), np.zeros_like(z)]), top, axes, mirrors)
        assert leaning.surface_crossing == pytest.approx(0.15 * (free != 0), abs=ROUNDOFF)
    wave = distortion(space, np.column_stack([np.zeros_like(x), np.zeros_like(y), 40.0 * x**2]), top, axes)
    assert wave.smallest_seen_area == pytest.approx(1.0, abs=ROUNDOFF)  # steep, yet a graph


def test_the_film_under_a_ball_is_what_the_substrate_below_it_leaves() -> None:
    from dolfinx.mesh import CellType, create_box  # noqa: PLC0415

    mesh = create_box(
        MPI.COMM_SELF, [np.array([0.0, 0.0, -2.0]), np.array([1.0, 1.0, 0.0])], [2, 2, 4], CellType.hexahedron
    )
    space = compat.function_space(mesh, 2, (3,))
    x, y, z = space.tabulate_dof_coordinates().T
    moved = np.column_stack([0.0 * y, 0.0 * y, -0.1 * (2.0 + z) * x])
    # under the ball at x = 1 the bottom of the layer, at z = -1/2, moves down by 0.15
    for balls, film in ((1, 1.0 - 0.25 / 0.5), (2, 1.0 - 0.3 / 0.5)):
        found = film_left(space, moved, [(1.0, 0.5), (0.0, 0.5)][:balls], np.array([0.4, 0.3])[:balls], 0.5)
        assert found == pytest.approx(film, abs=ROUNDOFF)


def test_nodes_of_the_top_need_not_be_level(tmp_path: Path) -> None:
    rig = quadratic_rig(pair(0.1, poisson=0.3), tmp_path)
    x, _, z = rig.model.space.tabulate_dof_coordinates().T
    rig.model.nodal[:, 0] = -0.1 * x**2 * (1.0 + z)
    level, corners = rig.path.distorted(), rig.model.mesh.geometry.x
    corners[corners[:, 2] == 0.0, 2] -= FLAT * np.random.default_rng(0).uniform(size=np.sum(corners[:, 2] == 0.0))
    uneven = rig.path.distorted()
    assert level.smallest_surface_stretch == pytest.approx(1.0 - 0.2 * x.max(), abs=ROUNDOFF)
    assert uneven.smallest_surface_stretch == pytest.approx(level.smallest_surface_stretch, abs=1e-5)
    assert uneven.smallest_seen_area == pytest.approx(level.smallest_seen_area, abs=1e-5)
