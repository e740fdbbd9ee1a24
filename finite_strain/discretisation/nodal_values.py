"""The nodes of cells: the lattice that they form, and nodal values of quantities inside the cells.

Gradients jump between cells. Each cell is weighted by its volume at the node, as in a projection onto the nodes with
lumped masses.
"""

from dataclasses import dataclass
from functools import cache
from itertools import permutations, product
from typing import Any

import basix
import dolfinx
import numpy as np
from petsc4py import PETSc

from finite_strain import compat
from meshes.box import TAGS


@dataclass(frozen=True, eq=False)
class Lattice:
    """The n nodes of the reference cell, numbered as the cell's dofs are: (p + 1)^3 of a hexahedron."""

    order: int
    points: np.ndarray
    """(n, 3) coordinates of the nodes."""
    derivatives: np.ndarray
    """(3, n, n) derivatives by each coordinate, at each node, of each shape function."""
    cells: np.ndarray
    """(p^3, 8 or 4) nodes of the linear cells between the nodes, in VTK's order."""
    faces: np.ndarray
    """(faces, k) nodes of each face."""
    pieces: np.ndarray
    """(faces, p^2, 4 or 3) nodes of the quadrilaterals or triangles that fill each face, one after the other around."""


_KINDS = {(p + 1) ** 3: ("hexahedron", p) for p in range(1, 6)}
_KINDS |= {(p + 1) * (p + 2) * (p + 3) // 6: ("tetrahedron", p) for p in range(1, 6)}
"""Cell and order of the element with a number of nodes."""


def element_of(nodes: int, variant: str = "gll_warped") -> Any:
    """Return the Lagrange element with a number of nodes."""
    cell, order = _KINDS[nodes]
    kind, variant = getattr(basix.CellType, cell), getattr(basix.LagrangeVariant, variant)
    return basix.create_element(basix.ElementFamily.P, kind, order, variant)


def outside_by(places: np.ndarray, nodes: int) -> np.ndarray:
    """Return how far (n,) places (n, 3) lie outside the reference cell of the element with a number of nodes."""
    beyond = places - 1.0 if _KINDS[nodes][0] == "hexahedron" else places.sum(axis=1, keepdims=True) - 1.0
    return np.asarray(np.maximum(np.maximum(-places, beyond).max(axis=1), 0.0))


@cache
def lattice_of(nodes: int) -> Lattice:
    """Return the lattice of the Lagrange element with a number of nodes."""
    cell, order = _KINDS[nodes]
    points = element_of(nodes).points
    places = np.rint(order * element_of(nodes, "equispaced").points).astype(int)
    slots = np.full(3 * [order + 1], -1)
    slots[tuple(places.T)] = np.arange(nodes)
    parts = _hexahedra(slots) if cell == "hexahedron" else _tetrahedra(slots)
    return Lattice(order, points, derivatives_of(nodes, points), *parts)


def _hexahedra(slots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return linear hexahedra, faces and their quadrilaterals between the nodes at ``slots`` (x, y, z)."""
    order = len(slots) - 1
    low, high = slice(0, order), slice(1, order + 1)
    ring = [(low, low), (high, low), (high, high), (low, high)]
    faces = np.array([slots.take(end, axis) for axis in range(3) for end in (0, order)])
    cells = np.stack([slots[x, y, z].ravel() for z in (low, high) for x, y in ring], axis=1)
    return cells, faces.reshape(6, -1), np.stack([faces[:, x, y].reshape(6, -1) for x, y in ring], axis=2)


def _tetrahedra(slots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return linear tetrahedra, faces and their triangles between the nodes at ``slots`` (x, y, z), -1 for none.

    A tetrahedron is the part a >= b >= c of a cube in a = x + y + z, b = y + z, c = z, and so are the tetrahedra along
    the edges of each of its smaller cubes [Freudenthal 1942, doi 10.2307/1968813].
    """
    order, inside, corners = len(slots) - 1, slots >= 0, []
    for place, way in product(np.ndindex(3 * (order,)), permutations(np.eye(3, dtype=int))):
        walk = np.array(place) + np.cumsum([np.zeros(3, dtype=int), *way], axis=0)
        if np.all(walk[:, :-1] >= walk[:, 1:]):
            corners.append(np.column_stack([walk[:, 0] - walk[:, 1], walk[:, 1] - walk[:, 2], walk[:, 2]]))
    found = np.array(corners)
    turned = np.linalg.det((found[:, 1:] - found[:, :1]).astype(float)) < 0.0
    found[turned] = found[turned][:, [0, 2, 1, 3]]
    cells = slots[tuple(np.moveaxis(found, 2, 0))]
    faces, pieces = [], []
    for normal in (*np.eye(3), -np.ones(3)):
        depth = np.argwhere(inside) @ normal
        face = slots[inside][depth == depth.min()]
        on = np.isin(cells, face)
        faces.append(face)
        pieces.append(cells[on.sum(axis=1) == 3][on[on.sum(axis=1) == 3]].reshape(-1, 3))
    return cells, np.array(faces), np.array(pieces)


def derivatives_of(nodes: int, points: np.ndarray) -> np.ndarray:
    """Return the derivatives (3, n, m) of the m = ``nodes`` shape functions by each coordinate at points (n, 3)."""
    return np.asarray(element_of(nodes).tabulate(1, points)[1:, :, :, 0])


class CellNodes:
    """The n nodes of each of the c cells that this rank owns, in a Lagrange vector space."""

    def __init__(self, space: Any) -> None:
        self.space, self._work = space, dolfinx.fem.Function(space)
        mesh = space.mesh
        owned = mesh.topology.index_map(3).size_local
        self.dofs = compat.cell_dofs(space)[:owned]
        self.lattice = lattice_of(self.dofs.shape[1])
        nodes = mesh.geometry.x[compat.geometry_dofs(mesh)[:owned]]
        jacobian = _by_reference(derivatives_of(nodes.shape[1], self.lattice.points), nodes)
        self.volumes = np.abs(np.linalg.det(jacobian))
        """(c, n) volume per reference volume [m^3]."""
        self._to_reference = np.linalg.inv(jacobian)

    def gradient(self, nodal: np.ndarray) -> np.ndarray:
        """Return the gradient (c, n, 3, 3) of displacements ``nodal`` (local nodes, 3) [m] at the cells' nodes."""
        return _by_reference(self.lattice.derivatives, nodal[self.dofs]) @ self._to_reference

    def averaged(self, regions: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Return averages (local nodes, k), ghosts included, of the cell values of each region at their nodes.

        A region is given by its owned cells (m,) and values (m, n, k); nodes outside all regions get zero. Where
        regions meet, the first one counts (collective).
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


def on_top(space: Any, facet_tags: Any) -> np.ndarray:
    """Return whether each node (nodes,) of this rank, ghosts included, lies on the top."""
    dofs = space.dofmap.index_map
    answer = np.zeros(dofs.size_local + dofs.num_ghosts, dtype=bool)
    answer[dolfinx.fem.locate_dofs_topological(space, 2, facet_tags.find(TAGS["top"]))] = True
    return answer


def _by_reference(derivatives: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return derivatives (c, n, 3, 3) by the reference coordinates, the last index, of cells' values (c, a, 3)."""
    return (derivatives @ values[:, None]).transpose(0, 2, 3, 1)
