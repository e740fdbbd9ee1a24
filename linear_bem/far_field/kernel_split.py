r"""Near pairs and a smooth far part of the layer's kernel, so that n loads interact in n log n operations.

    K(r)/singular = [erfc(alpha r)/r] + [erf(alpha r)/r + s(r/h)/h].

The first part is negligible beyond a few 1/alpha: it is summed over near pairs. The second is smooth on the scale
1/alpha and, because s falls in wave numbers like exp(-2 k h), on that of h: it is a convolution on a mesh of spacing H
= 0.4/alpha, at most h/3. The tail 1/r of the half-space and of an elastic substrate is part of it, without cut-off. On
a rigid base K falls exponentially, and pairs beyond its range are left out. Ewald's split [Ewald 1921, Ann. Phys. 369,
253, doi 10.1002/andp.19213690304] in the form of Hockney and Eastwood's P3M.

In a cell that repeats, pairs include images, each with its shift, and the mesh holds the Fourier series of the second
part, whose transform is 2 pi/k [erfc(k/(2 alpha)) + G(k h) - 1]. At k = 0 it is what the whole kernel has there
(`linear_bem.layer.cell`) without the first part's integral 2 pi^(1/2)/alpha.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree
from scipy.special import erf, erfc

from linear_bem.arrays import Array, Indices
from linear_bem.counts import grouped
from linear_bem.far_field.particle_mesh import ORDER, ParticleMesh, PeriodicMesh, mesh_shape, periodic_shape
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.memory import require

MESHED = ((1e-5, 0.4, 3.7), (1e-7, 0.3, 4.5))
"""Least precision, alpha H, and alpha r of the last near pair.

Measured on 400 random loads per (40 H)^2 with splines of order 8: field to 1e-6/H and 6e-8/H, slope
(`ParticleMesh.slope`) to 1e-6/H^2 and 1.5e-7/H^2 of one load (root mean square).
"""
IN_CELL = ((1e-5, 0.4, 3.7, 3.0), (1e-7, 0.3, 4.5, 4.0), (0.0, 0.2, 5.2, 5.0))
"""The same in a cell, and the least thickness of the layer over the spacing."""
NOWHERE = np.zeros((1, 2))
PER_LAYER = 3.0
"""Least thickness of the layer over the spacing: s alone is then known to 2e-6/H."""
PAIR, NODE, BALL = 5e-6, 4e-7, 1e-5
"""Processor time [s] of a near pair, a node of the doubled mesh, and a ball on the mesh; only the choice needs them."""
NODE_BYTES = 34.0
"""Memory per node of the doubled mesh: measured, 6.1 GB at 179 million nodes."""


@dataclass(frozen=True)
class FarField:
    """Pairs (``first``, ``second``) that are summed one by one, and the mesh for the rest (None: there is no rest).

    ``alpha`` [1/m] and ``cutoff`` [m] split the kernel. ``shift`` (pairs, 2) [m] takes the second to its image in a
    cell that repeats; without one it has the shape (1, 2).
    """

    kernel: LayeredKernel
    first: Indices
    second: Indices
    shift: Array
    mesh: ParticleMesh | None = None
    alpha: float = 0.0
    cutoff: float = np.inf

    @classmethod
    def of(
        cls, kernel: LayeredKernel, centres: Array, margin: float, precision: float, least_cutoff: float = 0.0
    ) -> FarField:
        """Return the cheapest split for loads within ``margin`` [m] of ``centres`` (balls, 2) [m].

        ``precision`` bounds what is neglected of the force of one neighbour. Outside a cell, pairs of centres within
        ``least_cutoff`` [m] are summed one by one even where the mesh holds all of their kernel.
        """
        if kernel.cell is not None:
            of_cell, alpha, cutoff = cell_split(kernel, len(centres), margin, precision)
            first, second, shift = kernel.cell.pairs(centres, cutoff + 2.0 * margin)
            return cls(kernel, first, second, shift, of_cell, alpha, cutoff)
        n = len(centres)
        reach = _range(kernel, 0.1 * precision) + 2.0 * margin
        tree = cKDTree(centres)
        low, high = centres.min(axis=0) - margin, centres.max(axis=0) + margin
        within = reach < float(np.hypot(*(high - low)))
        pairs = 0.5 * (tree.count_neighbors(tree, reach) - n) if within else 0.5 * n * (n - 1)
        best, least = None, PAIR * pairs
        rule = next(((a, c) for bound, a, c in MESHED if precision >= bound), None)
        sides = high - low
        apart = max(np.sqrt(np.prod(sides) / n), np.max(sides) / n) if n > 1 else np.inf  # also of balls in a row
        spacing = min(apart, kernel.thickness / PER_LAYER)
        if rule is not None and least > NODE * (2 * ORDER) ** 2 + BALL * n and spacing > 0.0:
            for size in spacing / 2.0 ** (0.5 * np.arange(7)):
                cutoff = max(rule[1] * size / rule[0], least_cutoff)
                near = 0.5 * (tree.count_neighbors(tree, min(cutoff + 2.0 * margin, reach)) - n)
                cost = 2.0 * PAIR * near + NODE * float(np.prod(mesh_shape(low, high, size)[1], dtype=float)) + BALL * n
                if cost < least:
                    best, least = (size, cutoff), cost
        if best is None:
            if not within:
                return cls(kernel, *np.triu_indices(n, 1), shift=NOWHERE)
            first, second = tree.query_pairs(reach, output_type="ndarray").T
            return cls(kernel, first, second, NOWHERE)
        assert rule is not None
        size, cutoff = best
        nodes = int(np.prod(mesh_shape(low, high, size)[1], dtype=float))
        require(
            NODE_BYTES * nodes,
            f"linear_bem: a mesh of {grouped(nodes)} nodes over {n} balls",
            "take balls that are less far apart, or a thicker layer",
        )
        alpha = rule[0] / size
        near_pairs = tree.query_pairs(min(cutoff + 2.0 * margin, reach), output_type="ndarray")
        mesh = ParticleMesh(low, high, size, lambda r: _far(kernel, alpha, r))
        return cls(kernel, near_pairs[:, 0], near_pairs[:, 1], NOWHERE, mesh, alpha, cutoff)

    def offsets(self, points: Array) -> Array:
        """Return the offsets [m] of the first from the second of all pairs of ``points`` (n, 2) [m]."""
        return np.asarray(points[self.first] - points[self.second] - self.shift)

    def far(self, r: Array) -> Array:
        """Return the part of K over ``singular`` that the mesh holds [1/m]; it is finite at r = 0."""
        return _far(self.kernel, self.alpha, r)

    def far_slope(self, r: Array) -> Array:
        """Return its derivative [1/m^2]."""
        a, r = self.alpha, np.maximum(r, 1e-3 / self.alpha)
        bell = 2.0 * a / np.sqrt(np.pi) * np.exp(-((a * r) ** 2))
        return np.asarray((bell - erf(a * r) / r) / r + self.kernel.smooth_slope(r))

    def near(self, r: Array) -> Array:
        """Return the part of K over ``singular`` that the mesh does not hold [1/m], r > 0."""
        return np.asarray(erfc(self.alpha * r) / r)

    def near_slope(self, r: Array) -> Array:
        """Return its derivative [1/m^2]."""
        a = self.alpha
        return np.asarray(-(2.0 * a / np.sqrt(np.pi) * np.exp(-((a * r) ** 2)) + erfc(a * r) / r) / r)


def cell_split(
    kernel: LayeredKernel, count: int, margin: float, precision: float
) -> tuple[PeriodicMesh | None, float, float]:
    """Return the cheapest mesh for ``count`` contacts in the kernel's cell, alpha [1/m], and the cut-off [m] of pairs.

    Without a mesh the cut-off is the range of a kernel that decays. ``margin`` and ``precision`` as in `FarField.of`.
    """
    cell = kernel.cell
    assert cell is not None

    def pairs(reach: float) -> float:
        return 0.5 * count**2 * np.pi * (reach + 2.0 * margin) ** 2 / cell.area

    reach = _range(kernel, 0.1 * precision)
    best, least = (0.0, 0.0, reach), PAIR * pairs(reach)
    _, share, cut, per_layer = next(rule for rule in IN_CELL if precision >= rule[0])
    for halvings in 0.5 * np.arange(9):
        size = min(float(np.sqrt(cell.area / count)), kernel.thickness / per_layer) / 2.0**halvings
        nodes = float(np.prod(periodic_shape(cell.lengths, size), dtype=float))
        cost = 2.0 * PAIR * pairs(cut * size / share) + NODE * nodes + BALL * count
        if cost < least:
            best, least = (size, share / size, cut * size / share), cost
    size, alpha, cutoff = best
    if size == 0.0:
        return None, 0.0, cutoff
    uniform = cell.uniform

    def transform(k: Array) -> Array:
        safe = np.where(k > 0.0, k, 1.0)
        waves = 2.0 * np.pi / safe * (erfc(safe / (2.0 * alpha)) + kernel.response_at(safe) - 1.0)
        return np.where(k > 0.0, waves, uniform - 2.0 * np.sqrt(np.pi) / alpha)

    return PeriodicMesh(cell.lengths, size, transform), alpha, cutoff


def _far(kernel: LayeredKernel, alpha: float, r: Array) -> Array:
    safe = np.maximum(r, 1e-6 / alpha)
    return np.asarray(erf(alpha * safe) / safe + kernel.smooth(r))


def _range(kernel: LayeredKernel, least: float) -> float:
    """Return the distance [m] beyond which the slope of K is below ``least`` of a half-space's; inf without one."""
    if kernel.homogeneous or kernel.far_ratio > 0.0:
        return np.inf
    r = kernel.thickness * np.geomspace(0.1, 100.0, 400)
    felt = np.flatnonzero(np.abs(kernel.scaled_slope(r)) * r * r > least)
    return float(r[min(felt[-1] + 1, len(r) - 1)]) if felt.size else float(r[0])


class PointInfluence:
    """K(L_ij) over ``singular`` times ``unit`` between many points as a symmetric operator, 0 on the diagonal."""

    def __init__(self, field: FarField, points: Array, unit: float = 1.0) -> None:
        n = len(points)
        r = np.hypot(*field.offsets(points).T)
        values = unit * (field.kernel.scaled(r) if field.mesh is None else field.near(r))
        rows, columns = np.concatenate([field.first, field.second]), np.concatenate([field.second, field.first])
        self.near = csr_matrix((np.concatenate([values, values]), (rows, columns)), shape=(n, n))
        self.mesh, self.unit = field.mesh, unit
        if field.mesh is not None:
            self._points = field.mesh.at(points[:, 0], points[:, 1])
            self._own = unit * float(field.far(np.zeros(1))[0])

    def __matmul__(self, loads: Array) -> Array:
        """Return the displacement at every point from the loads at the others."""
        out = self.near @ loads
        if self.mesh is not None:
            grid = self.unit * self.mesh.field(self._points, loads)
            out = out + self._points.value @ grid - self._own * loads
        return np.asarray(out)
