"""Finds the cell of a mesh that holds a point, and the point's reference coordinates."""

import numpy as np

from finite_strain.discretisation.nodal_values import element_of, outside_by
from linear_bem.errors import OutputUnusable

INSIDE = 1e-8
"""Largest distance outside a cell, in its reference coordinates, at which a point still counts as inside."""
FOREIGN = 1e-3
"""Distance outside every cell, in reference coordinates, from which on a point does not belong to the mesh."""
_ROUNDS = 8
"""Largest number of Newton iterations for the reference coordinates of a point."""
BULGE = 0.05
"""How far a curved cell may extend beyond the bounding box of its nodes, as a fraction of the box's sides."""


class Locations:
    """Finds points in a mesh, and keeps the results for the last mesh."""

    def __init__(self) -> None:
        self._nodes = np.zeros((0, 0, 3))
        self._found: list[tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]] = []

    def find(self, nodes: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the cell (n,) of each point (n, 3) [m], and its reference coordinates (n, 3) there, within [0, 1].

        ``nodes`` (cells, k, 3) [m] are those of the mesh's cells. Points outside their box, as in a wider domain, are
        moved to its surface. Raises `OutputUnusable` if a point then lies in no cell.
        """
        if not np.array_equal(nodes, self._nodes):
            self._nodes, self._found = nodes, []
        for known, found in self._found:
            if np.array_equal(known, points):
                return found
        found = _located(nodes, np.clip(points, nodes.min(axis=(0, 1)), nodes.max(axis=(0, 1))))
        self._found.append((points, found))
        return found


def _located(mesh: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    cells, places = np.full(len(points), -1), np.zeros((len(points), 3))
    violation = np.full(len(points), np.inf)
    low, high = mesh.min(axis=1), mesh.max(axis=1)
    slack = BULGE * (high - low)
    for cell, nodes in enumerate(mesh):
        box = np.all((points >= low[cell] - slack[cell]) & (points <= high[cell] + slack[cell]), axis=1)
        near = np.flatnonzero(box & (violation > INSIDE))
        if not len(near):
            continue
        place = _inverted(nodes, points[near])
        outside = outside_by(place, len(nodes))
        better = outside < violation[near]
        chosen = near[better]
        cells[chosen], places[chosen], violation[chosen] = cell, place[better], outside[better]
    if len(points) and violation.max() > FOREIGN:
        raise OutputUnusable("a saved state belongs to another scene: some nodes lie outside its mesh")
    return cells, np.clip(places, 0.0, 1.0)


def _inverted(nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the reference coordinates (n, 3) of points in a cell with nodes (n, 3), by Newton's method.

    In a curved cell it may end elsewhere, for points outside the cell: their coordinates are infinite.
    """
    place, element = np.full(points.shape, 0.5), element_of(len(nodes))
    for _ in range(_ROUNDS):
        shapes, *slopes = element.tabulate(1, np.clip(place, -0.5, 1.5)).reshape(4, len(points), -1)
        jacobian = np.einsum("kna,ai->nik", slopes, nodes)
        step = np.linalg.solve(jacobian, (shapes @ nodes - points)[..., None])[..., 0]
        place = place - step
        if np.abs(step).max() < 1e-13:
            break
    place[np.abs(step).max(axis=1) > INSIDE] = np.inf
    return place
