r"""The pairs of balls within reach of each other, and the pair law cut off at that reach.

A pair law decays: exponentially on a layer with a rigid base, as 1/L (displacement) and 1/L^2 (T) on an elastic one.
Beyond ``reach`` both are below a share (`CUT`) of their largest values and are neglected; from `TAPER` of it on, a
polynomial with two continuous derivatives reduces them to zero, so that forces stay smooth when pairs come and go.
`runs.evolution.pair_forces.PairForces.cut_error` measures the effect of the cut. In a periodic cell the point-load law
is not cut: its smooth far part (`linear_bem.far_field.kernel_split`) is computed on a mesh over the cell
(`CutLaw.waves`), so that the reach can be short: slow waves in lattices grow at its rate to 1e-5. The corrections
to it are taken as uniformly distributed beyond the reach, as in the theory of liquids [Allen, Tildesley, Computer
Simulation of Liquids, 2017, sec. 2.8]: they press all balls down equally and exert no T.

Pairs come from a k-d tree of all positions and, in a periodic cell, of their images within reach [Verlet 1967,
doi 10.1103/PhysRev.159.98]: a list with a larger reach is kept until a ball has moved by half the difference. Pairs
beyond the reach add exact zeros, in a fixed order: the sums do not depend on when the list was made.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from linear_bem.arrays import Array, Indices
from linear_bem.errors import UnsupportedProblem
from linear_bem.far_field.kernel_split import RULES, Split
from linear_bem.far_field.particle_mesh import ORDER, PeriodicMesh
from linear_bem.touching import wrapped

if TYPE_CHECKING:
    from runs.evolution.pair_forces import PairLaw

CUT, CORRECTED, ON_MESH = 5e-5, 10.0, 50.0
"""Share of the largest influence and pull below which they are neglected. In a periodic cell the share applies to the
corrections of the law; for their influence it is `CORRECTED` times larger, because the neglected part is taken as
uniformly distributed. Below `ON_MESH` times the share, the point-load law is only on a mesh."""
FARTHEST = 1e5
"""Largest distance of a table over the smallest touching distance: 1/L is below `CUT` from there on."""
STEP = 2e-3
"""Spacing of the table in log L. Cubic splines: 1e-11 of smooth laws, 1e-9 where a law's second derivative jumps."""
TAPER = 0.7
"""Share of the reach from which the law is reduced to zero. A steep end contains few distances of a lattice: rates of
slow waves are up to 4 % off with 0.9 (six lattices, h = 1.5 R to 8 R), 0.6 % with 0.7; 0.5 neglects too much."""
SKIN = 0.1
"""Additional reach of a list over the reach."""
DENSE = 100
"""Balls up to which elimination is quicker than conjugate gradients."""
RULE = RULES[0][1]
"""Rule of the mesh in a periodic cell: field to 5e-7 of a load at one spacing."""
MOST = 40_000_000
"""Pairs that a list may have: 5 GB at about 130 bytes each."""


class CutLaw:
    """A pair law as a table, zero beyond its ``reach`` [m]; ``cut`` is the share (`CUT`) below which it is neglected.

    With ``on_mesh`` the table lacks what `waves` holds.
    """

    def __init__(self, law: PairLaw, touch: float, cut: float = CUT, *, on_mesh: bool = False) -> None:
        start, end = np.log(0.5 * touch), np.log(FARTHEST * touch)
        nodes = start + STEP * np.arange(int(np.ceil((end - start) / STEP)) + 1)
        at = np.exp(nodes)
        values = np.stack(law(at), axis=1)
        least = cut * np.max(np.abs(values[at >= touch]), axis=0)
        linear = np.stack(law.linear(at)[:2], axis=1) if on_mesh else np.zeros_like(values)
        corrected = np.array([CORRECTED, 1.0]) if on_mesh else 1.0
        felt = (np.abs(values - linear) > corrected * least) | (np.abs(linear) > ON_MESH * least)
        above = np.flatnonzero(np.any(felt, axis=1))
        # the reach is a node, so that no cell of the table holds the bend at its beginning
        last = min(int(above[-1]) + 1, len(nodes) - 1) if len(above) else 0
        self.reach, self._law = float(at[last]), law
        part = np.clip((at / self.reach - TAPER) / (1.0 - TAPER), 0.0, 1.0)
        fall = 1.0 - part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        # influence of the neglected balls for one ball per area [m^3/N]
        self._beyond = float(np.sum((1.0 - fall) * (values - linear)[:, 0] * 2.0 * np.pi * at**2) * STEP)
        width = self.reach / (RULE.step + RULE.cut)
        self._split = Split(law.kernel, width, RULE.step * width, thin=True)
        near = self._split.fall(at)
        # the mesh's pull is the slope of its influence
        kept = np.stack([linear[:, 0] * near, linear[:, 1] * near + linear[:, 0] * self._split.rise_slope(at)], axis=1)
        spline = CubicSpline(nodes[: last + 1], ((values - linear) * fall[:, None] + kept)[: last + 1])
        # cubics of influence and pull, shape (4, 2, cells); those of the last cell, beyond the reach, are 0
        self._start, self._cubics = nodes[0], np.pad(spline.c.transpose(0, 2, 1), ((0, 0), (0, 0), (0, 1)))

    def waves(self, cell: Array) -> PeriodicMesh:
        """Return the influence that the table lacks [m/N], on a mesh over a cell of lengths [m]."""

        def transform(waves: Array) -> Array:
            far = self._law.kernel.singular * self._split.far_transform(waves, self.reach, self._law.kernel.uniform)
            return np.asarray(far + np.where(waves > 0.0, 0.0, self._beyond))

        size = min(RULE.share * self._split.width, float(np.min(cell)) / ORDER)
        return PeriodicMesh(cell, size, transform)

    def __call__(self, distance: Array) -> tuple[Array, Array]:
        """Return influence and pull at distances [m]."""
        place = (np.log(distance) - self._start) / STEP  # scipy, which searches for the cells, takes four times as long
        cell = np.clip(place.astype(np.intp), 0, self._cubics.shape[2] - 1)
        rest = (place - cell) * STEP
        influence, pull = np.polyval(np.take(self._cubics, cell, axis=2), rest)
        return influence, pull


class Listed:
    """Pairs of ``count`` balls, each once: first and second ball, and the shift [m] of the second to its image.

    ``_columns``, ``_ends`` and ``_order`` are the pattern of a symmetric sparse matrix with an entry for each pair.
    """

    def __init__(self, first: Indices, second: Indices, shift: Array, count: int) -> None:
        self.first, self.second, self.shift, self.count = first, second, shift, count
        rows, columns = np.concatenate([first, second]), np.concatenate([second, first])
        order = np.argsort(rows, kind="stable")
        self._columns, self._order = columns[order], order % max(len(first), 1)
        self._ends = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=count))])

    def between(self, x: Array) -> Array:
        """Return the vectors [m] from the first to the second balls."""
        between = np.take(x, self.second, axis=0)  # a third of the time of x[self.second]
        between -= np.take(x, self.first, axis=0)
        between += self.shift
        return between

    def matrix(self, values: Array) -> csr_matrix:
        """Return the symmetric matrix of one value per pair, shape (balls, balls)."""
        return csr_matrix((values[self._order], self._columns, self._ends), shape=(self.count, self.count))

    def summed(self, values: Array) -> Array:
        """Return for each ball the sum of the values of the pairs it is first in, less those it is second in."""
        ahead, behind = (np.bincount(which, values, self.count) for which in (self.first, self.second))
        return np.asarray(ahead - behind, dtype=float)


class PairList:
    """Pairs of balls within ``reach`` [m], images in a periodic ``cell`` [m] included."""

    def __init__(self, reach: float, cell: Array | None = None) -> None:
        self.reach, self.cell = reach, cell
        self._skin = SKIN * reach
        self._kept: tuple[Array, Listed] | None = None

    def __call__(self, x: Array) -> Listed:
        """Return a superset of the pairs within reach at positions ``x`` [m]."""
        if self._kept is not None and len(x) == len(self._kept[0]):
            made, pairs = self._kept
            if 2.0 * float(np.max(np.hypot(*(x - made).T))) <= self._skin:
                return pairs
        pairs = Listed(*self._list(x), len(x))
        self._kept = x.copy(), pairs
        return pairs

    def _list(self, x: Array) -> tuple[Indices, Indices, Array]:
        radius = self.reach + self._skin
        if self.cell is None:
            tree = cKDTree(x)
            _refuse_more_than(0.5 * float(tree.count_neighbors(tree, radius)))
            first, second = tree.query_pairs(radius, output_type="ndarray").T
            shift = np.zeros((len(first), 2))
        else:
            from linear_bem.layer.cell import Cell  # noqa: PLC0415  (only where balls repeat)

            _refuse_more_than(float(len(x) ** 2 * np.pi * radius**2 / np.prod(self.cell) / 2.0))
            first, second, shift = Cell(self.cell, 0.0).pairs(x, radius)
        shift[first > second] *= -1.0
        first, second = np.minimum(first, second), np.maximum(first, second)
        order = np.lexsort((*shift.T[::-1], second, first))
        return first[order], second[order], shift[order]


def images(x: Array, cell: Array) -> Array:
    """Return positions in the cell and in the eight cells around it [m], those in the cell first, in the order of x."""
    shifts = np.array([(i, j) for i in (0, -1, 1) for j in (0, -1, 1)])
    return np.asarray((wrapped(x, cell)[None] + cell * shifts[:, None]).reshape(-1, 2))


def _refuse_more_than(pairs: float) -> None:
    if pairs > MOST:
        raise UnsupportedProblem(
            f"pair forces: {pairs:.1e} pairs of balls act on each other, at most {MOST:.0e} fit (about "
            f"{130.0 * pairs / 1e9:.0f} GB); take fewer balls, a thinner layer or a rigid base"
        )
