"""The smallest volume ratio of a known displacement, anywhere in the cells."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from mpi4py import MPI

from finite_strain import compat
from finite_strain.discretisation.nodal_values import smallest_volume_ratio

ROUNDOFF = 1e-12


@pytest.mark.parametrize("order", [2, 3, 4])
def test_the_smallest_volume_ratio_of_a_quadratic_displacement_is_found_at_its_corner(order: int) -> None:
    from dolfinx.mesh import CellType, create_box  # noqa: PLC0415

    mesh = create_box(MPI.COMM_SELF, [np.zeros(3), np.array([1.0, 2.0, 1.5])], [2, 3, 2], CellType.hexahedron)
    space = compat.function_space(mesh, order, (3,))
    x, y, z = space.tabulate_dof_coordinates().T
    assert smallest_volume_ratio(space, np.zeros((len(x), 3))) == pytest.approx(1.0, abs=ROUNDOFF)
    bent = np.column_stack([-0.3 * x**2 + 0.2 * z, 0.05 * y**2, -0.1 * z + 0.3 * y])
    # det = (1 - 0.6 x)(1 + 0.1 y)(1 - 0.1) with the rows and columns of y and z triangular: least at x = 1, y = 0
    assert smallest_volume_ratio(space, bent) == pytest.approx(0.4 * 0.9, abs=ROUNDOFF)
    folded = np.column_stack([-0.6 * x**2, np.zeros_like(y), np.zeros_like(z)])
    assert smallest_volume_ratio(space, folded) == pytest.approx(-0.2, abs=ROUNDOFF)
