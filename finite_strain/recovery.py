"""Node values of what is known inside the cells: extended from Gauss points, averaged over the cells of a region.

Gradients of a quadratic displacement are linear on a cell and jump between cells. At the four Gauss points of
degree 2 they are most accurate; from there they are extended linearly: a linear field is met up to the boundary.
"""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
from petsc4py import PETSc

from finite_strain import compat

_NEAR, _FAR = (5.0 + 3.0 * np.sqrt(5.0)) / 20.0, (5.0 - np.sqrt(5.0)) / 20.0
GAUSS_POINTS = np.where(np.eye(4)[:, 1:] > 0.0, _NEAR, _FAR)
"""(4, 3) reference points of the rule of degree 2 on the tetrahedron."""
EDGES = np.array([[2, 3], [1, 3], [1, 2], [0, 3], [0, 2], [0, 1]])
"""Corners of the edges that nodes 4 to 9 of a quadratic cell halve, in the order of DOLFINx."""
_CORNER_SHARES = np.concatenate([np.eye(4), 0.5 * (np.eye(4)[EDGES[:, 0]] + np.eye(4)[EDGES[:, 1]])])
_GAUSS_SHARES = np.column_stack([1.0 - GAUSS_POINTS.sum(axis=1), GAUSS_POINTS])
EXTENSION = _CORNER_SHARES @ np.linalg.inv(_GAUSS_SHARES)
"""(10, 4): values of a linear function at the nodes of a quadratic cell from those at the Gauss points."""


def on_nodes(corner_values: np.ndarray, vertex_dofs: np.ndarray, node_dofs: np.ndarray, nodes: int) -> np.ndarray:
    """Return a linear function (vertices,) at the nodes of the quadratic space, by the dofs of every local cell."""
    values = np.zeros(nodes)
    values[node_dofs] = corner_values[vertex_dofs] @ _CORNER_SHARES.T
    return values


class NodeAverage:
    """Averages at the nodes of a quadratic vector space; collective."""

    def __init__(self, space: Any) -> None:
        self.space = space
        self._work = dolfinx.fem.Function(space)
        mesh = space.mesh
        owned = mesh.topology.index_map(3).size_local
        corners = mesh.geometry.x[compat.geometry_dofs(mesh)[:owned]]
        self.volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
        self.dofs = compat.cell_dofs(space)

    def of(self, regions: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Return node values (local nodes, k) of what the cells of each region have at their Gauss points.

        A region is its owned cells (m,) and values (m, 4, k). Where regions meet, the first one's values count.
        """
        answer = np.zeros((len(self._work.x.array) // 3, regions[0][1].shape[2]))
        taken = np.zeros(len(answer), dtype=bool)
        for cells, values in regions:
            weights = np.broadcast_to(self.volumes[cells][:, None, None], (len(cells), 10, 1))
            extended = np.einsum("aq,mqk->mak", EXTENSION, values) * weights
            sums = self._summed(cells, np.concatenate([extended, weights], axis=2))
            new = (sums[:, -1] > 0.0) & ~taken
            answer[new] = sums[new, :-1] / sums[new, -1:]
            taken |= new
        return answer

    def _summed(self, cells: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the sums over all ranks' cells of values (cells, 10, k) at this rank's nodes, ghosts included."""
        nodes = len(self._work.x.array) // 3
        local = np.zeros((nodes, values.shape[2]))
        np.add.at(local, self.dofs[cells], values)
        vector = compat.vector_of(self._work)
        for begin in range(0, local.shape[1], 3):
            part = local[:, begin : begin + 3]
            work = self._work.x.array.reshape(-1, 3)
            work[:] = 0.0
            work[:, : part.shape[1]] = part
            vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
            part[:] = work[:, : part.shape[1]]
        return local
