r"""Near pairs and a mesh for the smooth far part of the layer's kernel: n loads interact in n log n operations.

The near part of `linear_bem.far_field.kernel_split` is negligible beyond a few of its widths: it is summed over near
pairs. The far part is a convolution on a mesh (Hockney and Eastwood's P3M). On a rigid base K falls exponentially, and
pairs beyond its range are left out. For groups of loads far apart, a coarse mesh over all groups holds a still smoother
far part, and each group has a fine mesh for the difference. The cheapest of these methods is used.

In a periodic cell, pairs include images, each with its shift, and the mesh holds the Fourier series of the far part:
2 pi/k G(k h) less the near part's transform. `linear_bem.layer.cell` defines the whole kernel's value at k = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from linear_bem.arrays import Array, Indices
from linear_bem.counts import grouped
from linear_bem.far_field.groups import Groups, groupings
from linear_bem.far_field.kernel_split import IN_CELL, RULES, Rule, Split, reach_of
from linear_bem.far_field.particle_mesh import ORDER, NestedMesh, ParticleMesh, PeriodicMesh, mesh_shape, periodic_shape
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.memory import require
from linear_bem.touching import near_pairs

NOWHERE = np.zeros((1, 2))
AROUND = 1.5
"""All points of a growing contact stay within this multiple of its first size from its centre."""
PAIR, NODE, BALL, GROUP = 5e-6, 4e-7, 1e-5, 2e-3
"""Processor time [s] per near pair, node of a doubled mesh, ball on a mesh, and group; used to choose the method."""
COUNTED = 2000
"""Number of balls whose near pairs are counted: with a reach across many balls, each count takes long."""
NODE_BYTES = 34.0
"""Memory per node of the doubled mesh: measured, 6.1 GB at 179 million nodes."""


@dataclass(frozen=True, eq=False)
class FarField:
    """Pairs (``first``, ``second``) that are summed one by one, and the mesh for the rest (None: pairs alone).

    ``split`` divides the kernel; nodes farther apart than ``cutoff`` [m] have no near part. In a periodic cell,
    ``shift`` (pairs, 2) [m] moves each second load to its image; otherwise its shape is (1, 2).
    """

    kernel: LayeredKernel
    first: Indices
    second: Indices
    shift: Array
    mesh: NestedMesh | None = None
    split: Split | None = None
    cutoff: float = np.inf

    @classmethod
    def of(
        cls, kernel: LayeredKernel, centres: Array, sizes: Array, precision: float, least_ratio: float = 0.0
    ) -> FarField:
        """Return the cheapest split for loads within `AROUND` ``sizes`` (balls,) [m] of ``centres`` (balls, 2) [m].

        ``precision`` bounds the neglected share of one neighbour's force. Without a periodic cell, pairs of centres
        within ``least_ratio`` sizes of the larger load are summed one by one even if the mesh suffices for them.
        """
        n = len(centres)
        largest = float(np.max(sizes))
        if kernel.cell is not None:
            margin = AROUND * largest
            of_cell, split, cutoff = cell_split(kernel, n, margin, precision)
            first, second, shift = kernel.cell.pairs(centres, cutoff + 2.0 * margin)
            return cls(kernel, first, second, shift, None if of_cell is None else NestedMesh((of_cell,)), split, cutoff)
        choice = _Choice(kernel, centres, np.broadcast_to(sizes, n), precision, least_ratio)
        best = choice.best()
        if best is None:
            first, second = choice.near(np.inf)
            return cls(kernel, first, second, NOWHERE)
        mesh, split, cutoff = best
        return cls(kernel, *choice.near(cutoff), NOWHERE, mesh, split, max(cutoff, least_ratio * largest))

    def offsets(self, points: Array) -> Array:
        """Return the offsets [m] of the first from the second of all pairs of ``points`` (n, 2) [m]."""
        return np.asarray(points[self.first] - points[self.second] - self.shift)


class _Choice:
    """Chooses the cheapest of three methods: pairs alone, one mesh, or a mesh per group and a coarse one over all."""

    def __init__(
        self, kernel: LayeredKernel, centres: Array, sizes: Array, precision: float, least_ratio: float
    ) -> None:
        self.kernel, self.centres, self.sizes, self.least_ratio = kernel, centres, sizes, least_ratio
        self.tree = cKDTree(centres)
        self.range = reach_of(kernel, 0.1 * precision)
        self.rule = next((rule for bound, rule in RULES if precision >= bound), None)

    def reach(self, cutoff: float, one: Any, other: Any) -> Any:
        """Return the largest distance [m] of a near pair of loads of two sizes [m]."""
        around = AROUND * (one + other)
        return np.minimum(np.maximum(cutoff + around, self.least_ratio * np.maximum(one, other)), self.range + around)

    def near(self, cutoff: float) -> tuple[Indices, Indices]:
        """Return the near pairs for a cut-off distance [m] between nodes, each first below its second."""
        reach = self.reach(cutoff, self.sizes, self.sizes)
        first, second = near_pairs(self.centres, reach).T
        apart = np.hypot(*(self.centres[first] - self.centres[second]).T)
        kept = apart < self.reach(cutoff, self.sizes[first], self.sizes[second])
        return first[kept], second[kept]

    def _count(self, cutoff: float) -> float:
        """Return about the number of near pairs, from those of some balls; a pair of unlike loads may count half."""
        n = len(self.centres)
        some = np.arange(n) if n <= COUNTED else np.random.default_rng(0).integers(n, size=COUNTED)
        reach = self.reach(cutoff, self.sizes[some], self.sizes[some])
        if np.isinf(reach[0]):
            return 0.5 * n * (n - 1.0)
        near = self.tree.query_ball_point(self.centres[some], reach, return_length=True)
        return 0.5 * n * (float(np.mean(near)) - 1.0)

    def best(self) -> tuple[NestedMesh, Split, float] | None:
        """Return mesh, split and cut-off distance [m] between nodes; None: pairs alone."""
        n, rule, largest = len(self.centres), self.rule, float(np.max(self.sizes))
        least, found = PAIR * self._count(np.inf), None
        if rule is None or n < 2 or least <= NODE * (2 * ORDER) ** 2 + BALL * n:
            return None
        for groups in groupings(self.centres, AROUND * self.sizes):
            sides = groups.high - groups.low
            apart = max(np.sqrt(np.sum(np.prod(sides, axis=1)) / n), np.sum(np.max(sides, axis=1)) / n)  # or in a row
            if apart <= 0.0:
                continue
            coarse = self._coarse(groups, rule)
            fixed = BALL * n + GROUP * len(sides)
            if coarse is not None:
                fixed += BALL * n + NODE * self._nodes(groups.low.min(axis=0), groups.high.max(axis=0), coarse)
            for size in _sizes(apart, self.kernel.thickness / rule.per_layer, 7):
                split = Split.of(self.kernel, size, rule)
                cutoff = split.step + rule.cut * split.width
                if self.reach(cutoff, largest, largest) >= groups.gap or (coarse is not None and size >= coarse):
                    continue
                cost = fixed + NODE * self._nodes(groups.low, groups.high, size)
                if cost < least:
                    cost += 2.0 * PAIR * self._count(cutoff)
                if cost < least:
                    least, found = cost, (groups, coarse, split, size, cutoff)
        if found is None:
            return None
        groups, coarse, split, size, cutoff = found
        nodes = self._nodes(groups.low, groups.high, size)
        corners = groups.low.min(axis=0), groups.high.max(axis=0)
        nodes += self._nodes(*corners, coarse) if coarse is not None else 0.0
        require(
            NODE_BYTES * nodes,
            f"linear_bem: a mesh of {grouped(int(nodes))} nodes over {n} balls",
            "move the balls closer together, or use a thicker layer",
        )
        if coarse is None:
            return NestedMesh((ParticleMesh(groups.low, groups.high, size, split.far, groups.owners),)), split, cutoff
        wide = Split.of(self.kernel, coarse, rule)
        own = ParticleMesh(groups.low, groups.high, size, lambda r: split.far(r) - wide.far(r), groups.owners)
        return NestedMesh((ParticleMesh(*corners, coarse, wide.far), own)), split, cutoff

    def _coarse(self, groups: Groups, rule: Rule) -> float | None:
        """Return the spacing [m] of the coarse mesh for the kernel between groups; None if groups do not interact."""
        if groups.gap >= self.range:
            return None
        simple = groups.gap * rule.share / rule.cut
        if self.kernel.homogeneous:
            return simple
        return max(min(simple, self.kernel.thickness / rule.per_layer), simple * rule.cut / (rule.cut + rule.step))

    @staticmethod
    def _nodes(low: Array, high: Array, spacing: float) -> float:
        return float(np.sum(np.prod(mesh_shape(low, high, spacing)[1].astype(float), axis=1)))


def cell_split(
    kernel: LayeredKernel, count: int, margin: float, precision: float
) -> tuple[PeriodicMesh | None, Split | None, float]:
    """Return the cheapest mesh for ``count`` contacts in the kernel's cell, the split, and the cut-off [m] of pairs.

    Without a mesh, the cut-off is the range of the kernel. ``margin`` [m] and ``precision`` as in `FarField.of`.
    """
    cell = kernel.cell
    assert cell is not None

    def pairs(reach: float) -> float:
        return 0.5 * count**2 * np.pi * (reach + 2.0 * margin) ** 2 / cell.area

    best, least = None, PAIR * pairs(reach_of(kernel, 0.1 * precision))
    rule = next(rule for bound, rule in IN_CELL if precision >= bound)
    apart = float(np.sqrt(cell.area / count))
    for size in _sizes(apart, kernel.thickness / rule.per_layer, 9):
        split = Split.of(kernel, size, rule)
        cutoff = split.step + rule.cut * split.width
        nodes = float(np.prod(periodic_shape(cell.lengths, size), dtype=float))
        cost = 2.0 * PAIR * pairs(cutoff) + NODE * nodes + BALL * count
        if cost < least:
            best, least = (size, split, cutoff), cost
    if best is None:
        return None, None, reach_of(kernel, 0.1 * precision)
    size, split, cutoff = best
    mesh = PeriodicMesh(cell.lengths, size, lambda waves: split.far_transform(waves, cutoff, cell.uniform))
    return mesh, split, cutoff


def _sizes(apart: float, of_layer: float, count: int) -> list[float]:
    """Return mesh spacings [m] to try, downwards from that of the loads and, if finer, from that of the layer."""
    return [s / 2.0 ** (0.5 * k) for s in {apart, min(apart, of_layer)} for k in range(count)]


class PointInfluence:
    """K(L_ij) over ``singular`` times ``unit`` between many points as a symmetric operator.

    ``own`` is subtracted on the diagonal: at first what the mesh adds there, so that 0 is left, or the own images.
    """

    def __init__(self, field: FarField, points: Array, unit: float = 1.0) -> None:
        n = len(points)
        r = np.hypot(*field.offsets(points).T)
        values = unit * (field.kernel.scaled(r) if field.split is None else field.split.near(r))
        rows, columns = np.concatenate([field.first, field.second]), np.concatenate([field.second, field.first])
        self.near = csr_matrix((np.concatenate([values, values]), (rows, columns)), shape=(n, n))
        self.mesh, self.unit, self.own = field.mesh, unit, 0.0
        if field.mesh is not None and field.split is not None:
            self._points = field.mesh.at(points[:, 0], points[:, 1])
            self.own = unit * float(field.split.far(np.zeros(1))[0])

    def __matmul__(self, loads: Array) -> Array:
        """Return the displacement at every point due to the loads at all other points."""
        out = self.near @ loads - self.own * loads
        if self.mesh is not None:
            out = out + self.unit * self.mesh.potential(self._points, loads)
        return np.asarray(out)
