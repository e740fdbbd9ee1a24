r"""Interaction of separate contacts, each replaced by a few equivalent point loads.

Outside a disc, a pressure on it acts like point loads at the nodes of polynomial interpolation
on that disc, with weights that preserve all its moments up to the degree (multipoles in point form). The
displacement caused from outside is the polynomial through its values at the same nodes. So a pair
costs m x m kernel values instead of (quadrature points)^2. The nearest source is z = (L - a)/a radii away from
the centre, and interpolation on nodes that are dense at the edge, like Chebyshev's, neglects terms of order
(z + sqrt(z^2 - 1))^-(degree + 1). Each pair uses the lowest degree that meets the requested precision; pairs too
close for any degree use the quadrature points themselves. Far pairs act through the mesh of `linear_bem.far_field`, all
by the lowest degree that suffices beyond its cut-off.
"""

from collections.abc import Callable, Iterator

import numpy as np
from scipy.sparse import csr_matrix

from linear_bem.arrays import Array, Indices, hypotenuse
from linear_bem.far_field.pairs_and_mesh import FarField, PointInfluence
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.report import Report, silent
from linear_bem.smooth.newton import Nodes
from linear_bem.smooth.polynomials import basis, disc_nodes
from linear_bem.smooth.zone import CACHED

Radial = Callable[[Array], Array]
"""A function of distances [m]."""
DEGREES = (2, 4, 6, 8, 10, 12)
SAFETY = 0.01
"""Factor on the neglected term, from measured errors at the contact's edge; errors of forces are 100 times smaller."""
FULL = len(DEGREES)
"""Index beyond `DEGREES` that stands for the quadrature points themselves."""
OF_MESH = 6
"""Highest degree through the mesh, which applies to all contacts and all near pairs."""


def point_displacement(kernel: LayeredKernel, x: Array, y: Array, at_x: Array, at_y: Array, loads: Array) -> Array:
    """Return the displacement [m] at surface points from point loads times ``singular`` [m^2] at other points."""
    r = hypotenuse(x[:, None] - at_x.ravel(), y[:, None] - at_y.ravel())
    return np.asarray(kernel.scaled(r) @ loads.ravel())


def equivalent_loads(nodes: Nodes, degree: int) -> Array:
    """Return the point loads at `disc_nodes` that replace the pressures, shape (zones, nodes of the degree)."""
    inverse = disc_nodes(degree)[2]
    out, loads = np.empty((len(nodes), len(inverse))), nodes.loads
    for part in nodes.zone.parts(nodes.x.shape[1] * 4):
        phi = basis(nodes.xi[part], nodes.eta[part], degree)
        out[part] = np.einsum("tnk,nk->nt", phi, loads[part]) @ inverse
    return out


def lowest_degree(distance: Array, size: Array, precision: float) -> Indices:
    """Return the index in `DEGREES` of the lowest sufficient degree, or `FULL`.

    ``distance`` [m] between the centres of contacts, ``size`` [m] of the larger one.
    """
    away = np.maximum(distance / size - 1.0, 1.0)
    rate = away + np.sqrt(away**2 - 1.0)
    level = np.full(rate.shape, FULL, dtype=np.intp)
    for k in range(FULL - 1, -1, -1):
        level[rate ** -(DEGREES[k] + 1.0) < SAFETY * precision] = k
    return level


def least_ratio(precision: float) -> float:
    """Return the distance between the centres of contacts, over the larger size, from which `OF_MESH` suffices."""
    rate = (SAFETY * precision) ** (-1.0 / (OF_MESH + 1.0))
    return 1.001 * (1.0 + 0.5 * (rate + 1.0 / rate))


class Interaction:
    """Displacement and in-plane force on each of many separate contacts due to the others.

    The degree of every pair follows from the sizes of the first zones; ``precision`` bounds the neglected terms of a
    pair's displacement relative to it. Loads and displacements are in the units of `linear_bem.smooth.newton`.
    ``report`` receives a line per block of pairs.
    """

    def __init__(self, kernel: LayeredKernel, nodes: Nodes, precision: float, report: Report = silent) -> None:
        self.kernel, self.report = kernel, report
        self.count, zones = len(nodes), nodes.zone
        reach = 1.1 * zones.reach
        largest = float(np.max(reach))
        self.far = FarField.of(kernel, zones.centre, reach, precision, least_ratio(precision))
        first, second = self.far.first, self.far.second
        apart = np.hypot(*self.far.offsets(zones.centre).T)
        shift = np.broadcast_to(self.far.shift, (len(first), 2))
        level = lowest_degree(apart, np.maximum(reach[first], reach[second]), precision)
        levels = [k for k in range(FULL + 1) if np.any(level == k)]
        self.pairs = [(k, *(v[level == k] for v in (first, second, shift))) for k in levels]
        self.gather = [tuple(_incidence(part, self.count) for part in (i, j)) for _, i, j, _ in self.pairs]
        self.mesh_level = -1
        if self.far.split is not None:
            self.split = self.far.split
            self.mesh_level = int(lowest_degree(np.array(self.far.cutoff), np.array(largest), precision))
            assert self.mesh_level < FULL or kernel.cell is not None, "far contacts are far"
        self.influence = PointInfluence(self.far, zones.centre)
        self.update(nodes)

    def update(self, nodes: Nodes) -> None:
        """Replace zones and pressures by those of ``nodes``."""
        self.nodes = nodes
        self.places: dict[int, tuple[Array, Array]] = {}
        self.loads: dict[int, Array] = {}
        for k in {self.mesh_level, *(k for k, *_ in self.pairs)} - {-1}:
            self.places[k] = (nodes.x, nodes.y) if k == FULL else nodes.zone.points(*disc_nodes(DEGREES[k])[:2])
            self.loads[k] = nodes.loads if k == FULL else equivalent_loads(nodes, DEGREES[k])

    def _received(self, level: int, values: Array) -> Array:
        """Return displacements at the quadrature points from those at the nodes of a degree."""
        if level == FULL:
            return values
        n, out = self.nodes, np.empty(self.nodes.x.shape)
        found = values @ disc_nodes(DEGREES[level])[2].T
        for part in n.zone.parts(n.x.shape[1] * 4):
            out[part] = np.einsum("tnk,nt->nk", basis(n.xi[part], n.eta[part], DEGREES[level]), found[part])
        return out

    def _blocks(
        self, first: Indices, second: Indices, shift: Array, level: int
    ) -> Iterator[tuple[slice, Array, Array]]:
        """Yield slices of the pairs, and dx, dy [m] between their nodes, shape (pairs, nodes, nodes)."""
        x, y = self.places[level]
        size = max(1, CACHED // x.shape[1] ** 2)
        for start in range(0, len(first), size):
            self.report(f"{start} of {len(first)} pairs of degree {'p' if level == FULL else DEGREES[level]}")
            part = slice(start, start + size)
            i, j = first[part], second[part]
            dx, dy = (v[i][:, :, None] - v[j][:, None, :] for v in (x, y))
            if self.kernel.cell is not None:
                dx, dy = dx - shift[part, 0, None, None], dy - shift[part, 1, None, None]
            yield part, dx, dy

    def displacement(self) -> Array:
        """Return the displacement [m] at the quadrature points of every zone from all others."""
        total = np.zeros(self.nodes.x.shape)
        sums = {k: np.zeros(q.shape) for k, q in self.loads.items()}
        for (level, first, second, shift), (to_first, to_second) in zip(self.pairs, self.gather, strict=True):
            for k, kernel, _ in self._kernels(level):
                q = self.loads[k]
                at_first, at_second = np.empty((len(first), q.shape[1])), np.empty((len(first), q.shape[1]))
                for part, dx, dy in self._blocks(first, second, shift, k):
                    value = kernel(hypotenuse(dx, dy))
                    at_first[part] = np.einsum("pab,pb->pa", value, q[second[part]])
                    at_second[part] = np.einsum("pab,pa->pb", value, q[first[part]])
                sums[k] += to_first @ at_first + to_second @ at_second
        if self.far.mesh is not None:
            k = self.mesh_level
            x, y = self.places[k]
            sums[k] += self.far.mesh.potential_at(x, y, self.loads[k]).reshape(x.shape)
            own = self.split.far(hypotenuse(x[:, :, None] - x[:, None, :], y[:, :, None] - y[:, None, :]))
            sums[k] -= np.einsum("nab,nb->na", own, self.loads[k])
        for k, values in sums.items():
            total += self._received(k, values)
        return total

    def _kernels(self, level: int) -> list[tuple[int, Radial, Radial]]:
        """Return levels, kernels and their slopes whose sum replaces the mesh's part for near pairs of a level."""
        whole = self.kernel.scaled, self.kernel.scaled_slope
        if self.far.mesh is None:
            return [(level, *whole)]
        if level == self.mesh_level:
            return [(level, self.split.near, self.split.near_slope)]
        less_far = (lambda r: -self.split.far(r)), (lambda r: -self.split.far_slope(r))
        return [(level, *whole), (self.mesh_level, *less_far)]

    def force(self) -> Array:
        """Return T on every zone [N] by the mutual formula, shape (zones, 2).

        T_i = sum_{j != i} int int p_i(x) grad K(x - x') p_j(x') dA dA' (derivation: linear_bem/README.md) has no
        cancelling large terms and makes action equal reaction exactly.
        """
        total = np.zeros((self.count, 2))
        for (level, first, second, shift), (to_first, to_second) in zip(self.pairs, self.gather, strict=True):
            for k, _, slope in self._kernels(level):
                q, pull = self.loads[k], np.empty((len(first), 2))
                for part, dx, dy in self._blocks(first, second, shift, k):
                    r = hypotenuse(dx, dy)
                    g = slope(r) / r
                    here, there = q[first[part]], q[second[part]]
                    pull[part, 0] = np.einsum("pa,pab,pb->p", here, g * dx, there, optimize=True)
                    pull[part, 1] = np.einsum("pa,pab,pb->p", here, g * dy, there, optimize=True)
                total += to_first @ pull - to_second @ pull
        if self.far.mesh is not None:
            q = self.loads[self.mesh_level]
            gradient = self.far.mesh.slope_at(*self.places[self.mesh_level], q)
            total += np.sum(q[:, :, None] * gradient.reshape(*q.shape, 2), axis=1)
        return total / self.kernel.singular


def _incidence(owners: Indices, count: int) -> csr_matrix:
    """Return the matrix that adds up rows by owner."""
    return csr_matrix((np.ones(len(owners)), (owners, np.arange(len(owners)))), shape=(count, len(owners)))
