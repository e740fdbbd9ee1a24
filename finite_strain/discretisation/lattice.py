"""The nodes of a Lagrange hexahedron of order p as a lattice, and the linear pieces that fill its volume and faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

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
