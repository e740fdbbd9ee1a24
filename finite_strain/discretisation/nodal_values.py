"""The nodes of hexahedral cells: the lattice that they form, and nodal values of quantities inside the cells.

Gradients jump between cells. Each cell is weighted by its volume at the node, as in a projection onto the nodes with
lumped masses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import dolfinx
import numpy as np
from petsc4py import PETSc

from finite_strain import compat


@dataclass(frozen=True)
class Lattice:
    """The n = (p + 1)^3 nodes of the reference cell, numbered as the cell's dofs are."""

    order: int
    points: np.ndarray
    """(n, 3) coordinates of the nodes."""
    derivatives: np.ndarray
    """(3, n, n) derivatives by each coordinate, at each node, of each shape function."""
    hexahedra: np.ndarray
    """(p^3, 8) nodes of the linear hexahedra between the nodes, in VTK's order."""
    faces: np.ndarray
    """(6, (p + 1)^2) nodes of each face."""
    squares: np.ndarray
    """(6, p^2, 4) nodes of the quadrilaterals that fill each face, one after the other around."""

    @classmethod
    def of(cls, space: Any) -> Lattice:
        """Return the lattice of a Lagrange space of any order on hexahedra."""
        return _lattice(order_of(compat.cell_dofs(space).shape[1]))


def order_of(nodes: int) -> int:
    """Return the order of a hexahedron from the number of its nodes."""
    return round(nodes ** (1.0 / 3.0)) - 1


@cache
def _lattice(order: int) -> Lattice:
    points = compat.lagrange_element(order).points
    slots = np.lexsort(points.round(9).T[::-1]).reshape(3 * [order + 1])  # by places along x, y, z
    low, high = slice(0, order), slice(1, order + 1)
    ring = [(low, low), (high, low), (high, high), (low, high)]
    faces = np.array([slots.take(end, axis) for axis in range(3) for end in (0, order)])
    return Lattice(
        order,
        points,
        derivatives_of(order, points),
        np.stack([slots[x, y, z].ravel() for z in (low, high) for x, y in ring], axis=1),
        faces.reshape(6, -1),
        np.stack([faces[:, x, y].reshape(6, -1) for x, y in ring], axis=2),
    )


def derivatives_of(order: int, points: np.ndarray) -> np.ndarray:
    """Return the derivatives (3, n, m) of the m shape functions of an order by each coordinate at points (n, 3)."""
    return compat.lagrange_element(order).tabulate(1, points)[1:, :, :, 0]


class CellNodes:
    """The n nodes of each of the c cells that this rank owns, in a Lagrange vector space on hexahedra."""

    def __init__(self, space: Any) -> None:
        self.space, self.lattice = space, Lattice.of(space)
        self._work = dolfinx.fem.Function(space)
        mesh = space.mesh
        owned = mesh.topology.index_map(3).size_local
        self.dofs = compat.cell_dofs(space)[:owned]
        nodes = mesh.geometry.x[compat.geometry_dofs(mesh)[:owned]]
        jacobian = _by_reference(derivatives_of(order_of(nodes.shape[1]), self.lattice.points), nodes)
        self.volumes = np.abs(np.linalg.det(jacobian))
        """(c, n) volume per reference volume [m^3]."""
        self._to_reference = np.linalg.inv(jacobian)

    def gradient(self, nodal: np.ndarray) -> np.ndarray:
        """Return the gradient (c, n, 3, 3) of displacements ``nodal`` (local nodes, 3) [m] at the cells' nodes."""
        return _by_reference(self.lattice.derivatives, nodal[self.dofs]) @ self._to_reference

    def averaged(self, regions: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Return averages (local nodes, k), ghosts included, of the cell values of each region at their nodes.

        A region is its owned cells (m,) and values (m, n, k); zero where no region is. Where regions meet, the
        values of the first one are taken (collective).
        """
        answer = np.zeros((len(self._work.x.array) // 3, regions[0][1].shape[2]))
        taken = np.zeros(len(answer), dtype=bool)
        for cells, values in regions:
            weights = self.volumes[cells][:, :, None]
            sums = self._summed(cells, np.concatenate([values * weights, weights], axis=2))
            new = (sums[:, -1] > 0.0) & ~taken
            answer[new] = sums[new, :-1] / sums[new, -1:]
            taken |= new
        return answer

    def _summed(self, cells: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the sums (nodes, k) over all ranks' cells of values (m, n, k) at this rank's nodes."""
        vector, work = compat.vector_of(self._work), self._work.x.array.reshape(-1, 3)
        answer = np.zeros((len(work), values.shape[2]))
        np.add.at(answer, self.dofs[cells], values)
        for begin in range(0, answer.shape[1], 3):
            part = answer[:, begin : begin + 3]
            work[:, : part.shape[1]] = part
            vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
            part[:] = work[:, : part.shape[1]]
        return answer


def _by_reference(derivatives: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return derivatives (c, n, 3, 3) by the reference coordinates, the last index, of cells' values (c, a, 3)."""
    return (derivatives @ values[:, None]).transpose(0, 2, 3, 1)
