r"""Interaction of separate contacts by few equivalent point loads each.

Outside a disc, a pressure on it acts like point loads at the nodes of polynomial interpolation
on that disc, with weights that preserve all its moments up to the degree (multipoles in point form). The
displacement caused from outside is the polynomial through its values at the same nodes. So a pair
costs m x m kernel values instead of (quadrature points)^2. The nearest source is z = (L - a)/a radii away from
the centre, and interpolation on nodes that are dense at the edge, like Chebyshev's, neglects terms of order
(z + sqrt(z^2 - 1))^-(degree + 1). Each pair uses the lowest degree that meets the requested precision; pairs too
close for any degree use the quadrature points themselves. Nodes on concentric circles of 1, 5, 9, ... points
determine polynomials of even degree uniquely [Bos 1991, J. Approx. Theory 64, 271].
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from scipy.spatial.distance import pdist, squareform

from linear_bem.arrays import Array
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.smooth.newton import Nodes
from linear_bem.smooth.polynomials import basis

Points = tuple[Array, Array, Array]
"""x, y [m] and loads."""
DEGREES = (2, 4, 6, 8, 10, 12)
SAFETY = 0.01
"""Factor of that term, from measured errors at the contact's edge; errors of the force are 100 times smaller."""


@lru_cache(maxsize=8)
def disc_nodes(degree: int) -> tuple[Array, Array, Array]:
    """Return interpolation nodes of the unit disc and the matrix from values there to basis coefficients."""
    xi, eta = [np.zeros(1)], [np.zeros(1)]
    for ring in range(1, degree // 2 + 1):
        angle = 2.0 * np.pi * np.arange(4 * ring + 1) / (4 * ring + 1)
        radius = np.sin(np.pi * ring / (degree + 1))
        xi.append(radius * np.cos(angle))
        eta.append(radius * np.sin(angle))
    x, y = np.concatenate(xi), np.concatenate(eta)
    return x, y, np.linalg.inv(basis(x, y, degree).T)


def interpolation(xi: Array, eta: Array, degree: int) -> Array:
    """Return the matrix from values at `disc_nodes` to values at frame points, shape (points, nodes)."""
    return np.asarray(basis(xi, eta, degree).T @ disc_nodes(degree)[2])


def point_displacement(kernel: LayeredKernel, x: Array, y: Array, at_x: Array, at_y: Array, loads: Array) -> Array:
    """Return the displacement [m] at surface points from point loads (over 1/``singular``) at other points."""
    r = np.hypot(x[:, None] - at_x.ravel(), y[:, None] - at_y.ravel())
    return np.asarray(kernel.scaled(r) @ loads.ravel())


class Interaction:
    """Displacement and in-plane force on each of many separate contacts due to the others.

    The degree of every pair follows from the first zones' sizes; ``precision`` bounds the neglected terms of a
    pair's displacement relative to it. Loads and displacements are in the units of `linear_bem.smooth.newton`.
    """

    def __init__(self, kernel: LayeredKernel, nodes: list[Nodes], precision: float) -> None:
        self.kernel = kernel
        centres = np.array([n.zone.centre for n in nodes])
        reach = np.array([1.1 * n.zone.reach for n in nodes])
        apart = squareform(pdist(centres))
        large = np.maximum(reach[:, None], reach)
        away = np.maximum(apart / large - 1.0, 1.0)
        rate = away + np.sqrt(away**2 - 1.0)
        self.level = np.full(apart.shape, len(DEGREES), dtype=np.int8)
        for k in range(len(DEGREES) - 1, -1, -1):
            self.level[rate ** -(DEGREES[k] + 1.0) < SAFETY * precision] = k
        np.fill_diagonal(self.level, -1)
        self.used = [k for k in range(len(DEGREES)) if np.any(self.level == k)]

    def update(self, nodes: list[Nodes]) -> None:
        """Replace zones and pressures."""
        self.nodes = nodes
        self.matrices = [{k: interpolation(n.xi, n.eta, DEGREES[k]) for k in self.used} for n in nodes]
        self.x, self.y, self.loads = {}, {}, {}
        for k in self.used:
            u, v, _ = disc_nodes(DEGREES[k])
            points = np.array([n.zone.points(u, v) for n in nodes])
            self.x[k], self.y[k] = points[:, 0], points[:, 1]
            self.loads[k] = np.array([n.loads @ m[k] for n, m in zip(nodes, self.matrices, strict=True)])

    def _partners(self, i: int) -> Iterator[tuple[Array | None, Points, Points]]:
        """Yield zone i and its partners, as points and loads, and the matrix from those points to i's nodes.

        Partners come together per degree; those too close for any come one by one at their nodes, without a matrix.
        """
        for k in self.used:
            others = np.flatnonzero(self.level[i] == k)
            if others.size:
                here, there = (
                    (self.x[k][m].ravel(), self.y[k][m].ravel(), self.loads[k][m].ravel()) for m in (i, others)
                )
                yield self.matrices[i][k], here, there
        for j in np.flatnonzero(self.level[i] == len(DEGREES)):
            here, there = ((n.x, n.y, n.loads) for n in (self.nodes[i], self.nodes[j]))
            yield None, here, there

    def displacement(self, i: int) -> Array:
        """Return the displacement [m] at the quadrature points of zone i from all others."""
        total = np.zeros(len(self.nodes[i].x))
        for matrix, (x, y, _), there in self._partners(i):
            w = point_displacement(self.kernel, x, y, *there)
            total += w if matrix is None else matrix @ w
        return total

    def force(self, i: int) -> Array:
        """Return T on zone i [N] by the mutual formula."""
        total = np.zeros(2)
        for _, (x, y, here), (at_x, at_y, there) in self._partners(i):
            dx, dy = x[:, None] - at_x, y[:, None] - at_y
            r = np.hypot(dx, dy)
            g = self.kernel.scaled_slope(r) / r
            total += here @ (g * dx) @ there, here @ (g * dy) @ there
        return total / self.kernel.singular
