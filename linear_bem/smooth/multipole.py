r"""Interaction of separate contacts by few equivalent point loads each.

Seen from outside, a pressure on a disc acts like point loads at the nodes of polynomial interpolation
on that disc, with weights that keep all its moments up to the degree (multipoles in point form); and the
displacement it receives from outside is the polynomial through its values at the same nodes. So a pair
costs m x m kernel values instead of (quadrature points)^2. The nearest source is z = (L - a)/a radii away from
the centre, and interpolation on nodes that crowd at the edge as Chebyshev's do leaves terms of order
(z + sqrt(z^2 - 1))^-(degree + 1); each pair takes the lowest degree that meets the asked precision, and pairs too
close for any take the quadrature points themselves. Nodes on concentric circles of 1, 5, 9, ... points
determine polynomials of even degree uniquely [Bos 1991, J. Approx. Theory 64, 271].
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from linear_bem.layer.kernel import LayeredKernel
from linear_bem.smooth.newton import Nodes
from linear_bem.smooth.zone import basis

Array = NDArray[np.float64]

DEGREES = (2, 4, 6, 8, 10, 12)
SAFETY = 0.01
"""Constant of that order, from measured errors at the contact's edge; the force's are a hundred times smaller."""


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


class Interaction:
    """Displacement and in-plane force that many separate contacts give each other.

    Which degree serves which pair is decided once, from the zones' sizes; ``precision`` bounds the neglected terms of a
    pair's displacement relative to it. Loads and displacements are in the units of `linear_bem.smooth.newton`.
    """

    def __init__(self, kernel: LayeredKernel, nodes: list[Nodes], precision: float) -> None:
        self.kernel = kernel
        centres = np.array([n.zone.centre for n in nodes])
        reach = np.array([1.1 * np.max(np.linalg.svd(n.zone.axes, compute_uv=False)) for n in nodes])
        apart = np.hypot(centres[:, None, 0] - centres[:, 0], centres[:, None, 1] - centres[:, 1])
        large = np.maximum(reach[:, None], reach)
        away = np.maximum(apart / large - 1.0, 1.0)
        rate = away + np.sqrt(away**2 - 1.0)
        self.level = np.full(apart.shape, len(DEGREES), dtype=np.int8)
        for k in range(len(DEGREES) - 1, -1, -1):
            self.level[rate ** -(DEGREES[k] + 1.0) < SAFETY * precision] = k
        np.fill_diagonal(self.level, -1)
        self.used = [k for k in range(len(DEGREES)) if np.any(self.level == k)]

    def update(self, nodes: list[Nodes]) -> None:
        """Take new zones and pressures."""
        self.nodes = nodes
        self.matrices = [{k: interpolation(n.xi, n.eta, DEGREES[k]) for k in self.used} for n in nodes]
        self.x, self.y, self.loads = {}, {}, {}
        for k in self.used:
            u, v, _ = disc_nodes(DEGREES[k])
            points = np.array([n.zone.points(u, v) for n in nodes])
            self.x[k], self.y[k] = points[:, 0], points[:, 1]
            loads = [(n.weights * n.pressure) @ m[k] for n, m in zip(nodes, self.matrices, strict=True)]
            self.loads[k] = np.array(loads)

    def displacement(self, i: int) -> Array:
        """Return the displacement at the quadrature points of zone i from all others."""
        here = self.nodes[i]
        total = np.zeros(len(here.x))
        for k in self.used:
            others = np.flatnonzero(self.level[i] == k)
            if others.size:
                r = np.hypot(
                    self.x[k][i][:, None] - self.x[k][others].ravel(), self.y[k][i][:, None] - self.y[k][others].ravel()
                )
                total += self.matrices[i][k] @ ((1.0 / r + self.kernel.smooth(r)) @ self.loads[k][others].ravel())
        for j in np.flatnonzero(self.level[i] == len(DEGREES)):
            there = self.nodes[j]
            r = np.hypot(here.x[:, None] - there.x, here.y[:, None] - there.y)
            total += (1.0 / r + self.kernel.smooth(r)) @ (there.weights * there.pressure)
        return total

    def force(self, i: int) -> Array:
        """Return T on zone i [N] by the mutual formula."""
        here, total = self.nodes[i], np.zeros(2)
        for k in self.used:
            others = np.flatnonzero(self.level[i] == k)
            if others.size:
                dx = self.x[k][i][:, None] - self.x[k][others].ravel()
                dy = self.y[k][i][:, None] - self.y[k][others].ravel()
                total += self._pull(dx, dy, self.loads[k][i], self.loads[k][others].ravel())
        for j in np.flatnonzero(self.level[i] == len(DEGREES)):
            there = self.nodes[j]
            dx, dy = here.x[:, None] - there.x, here.y[:, None] - there.y
            total += self._pull(dx, dy, here.weights * here.pressure, there.weights * there.pressure)
        return total / self.kernel.singular

    def _pull(self, dx: Array, dy: Array, left: Array, right: Array) -> Array:
        r = np.hypot(dx, dy)
        g = (self.kernel.smooth_slope(r) - 1.0 / r**2) / r
        return np.array([left @ (g * dx) @ right, left @ (g * dy) @ right])
