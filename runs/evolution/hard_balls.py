r"""Hard balls: which pairs are near, when they touch, and how a contact opens with the balls' motion.

Balls of different size between a plate and a layer: lowest points on one level (or tops on one level under a flat
plate), so centres differ in height by R_i - R_j. Touching means that the centres are R_i + R_j apart in space, hence

    L_ij = sqrt((R_i + R_j)^2 - (R_i - R_j)^2) = 2 sqrt(R_i R_j)

in the plane, which is R_i + R_j for equal balls only.

A pair (i, j), i < j, of n balls has the number i n + j: rising numbers are the pairs in a fixed order, and no list of
all pairs is kept. In a periodic cell the distance is that to the nearest image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.errors import NotConverged, UnsupportedProblem
from linear_bem.problem import Problem
from linear_bem.touching import to_nearest, wrapped
from runs.evolution.motion import DENSE, Contacts, moved

Pairs = Indices
"""Numbers of pairs, rising, shape (pairs,)."""

TOUCHING = 1e-9
"""Gap over touching distance up to which a pair is in contact."""
CONNECTED = 1e-3
"""Gap over touching distance, beyond the tolerance, up to which a pair belongs to one group and has not parted."""
OVERLAP, UNSETTLED = 1e-12, 5e-10
"""Overlap over touching distance: roundoff; and the overlap accepted with more than `DENSE` near pairs, the accuracy of
the interior-point method: removing it, and computing the forces again, would take a tenth of the time of a path. It is
below the overlap that a `Problem` may have (`linear_bem.touching.ROUNDOFF`)."""
PASSES = 50
"""Largest number of times that overlapping balls are moved apart; 36 that overlap by up to 0.7 R take one or two."""
IN_ONE_FILE = 100
"""Balls up to which a whole path is in one JSON object, and equilibria are sought by dense matrices."""
WITHOUT_LOAD = 1e-6
"""Resistance of a ball without load, over the largest: small, so that pushes move it."""


@dataclass(frozen=True, eq=False)
class HardBalls:
    """Balls of ``radii`` [m]; ``cell`` holds the lengths [m] of a periodic cell along x and y.

    ``rolling`` is the share of its load below which the force on a ball does not move it, ``tolerance`` [m] that of
    the path: a pair with this gap may be in contact.
    """

    radii: Array
    cell: Array | None = None
    rolling: float = 0.0
    tolerance: float = 0.0

    @classmethod
    def of(
        cls, problem: Problem, cell: tuple[float, float] | None = None, rolling: float = 0.0, tolerance: float = 0.0
    ) -> HardBalls:
        """Return the hard balls of ``problem``; raises `UnsupportedProblem` if no flat plate gives its approaches."""
        radii, bottoms = np.array([ball.radius for ball in problem.balls]), np.array(problem.load.values)
        if min(np.ptp(bottoms), np.ptp(bottoms - 2.0 * radii)) > 1e-9 * np.max(radii):
            raise UnsupportedProblem(
                "load.approach: balls that drift under one flat plate have their lowest points on one level (equal "
                f"approaches) or their tops (approach less diameter), got approaches from {np.min(bottoms):.9g} m to "
                f"{np.max(bottoms):.9g} m; give one approach, or each ball's diameter less one length"
            )
        return cls(radii, None if cell is None else np.array(cell), rolling, tolerance)

    @property
    def smallest(self) -> float:
        """Smallest touching distance [m]; 1 for a single ball."""
        if len(self.radii) < 2:
            return 1.0
        first, second = np.partition(self.radii, 1)[:2]
        return float(2.0 * np.sqrt(first * second))

    @property
    def many(self) -> bool:
        """Whether there are too many balls for one JSON object, for dense matrices and for names in pictures."""
        return len(self.radii) > IN_ONE_FILE

    @property
    def all(self) -> Pairs:
        """Numbers of all pairs."""
        i, j = np.triu_indices(len(self.radii), 1)
        return np.asarray(i * len(self.radii) + j)

    def pairs(self, which: Pairs) -> Indices:
        """Return the balls of the pairs numbered ``which``, shape (pairs, 2)."""
        return np.stack(np.divmod(which, len(self.radii)), axis=1)

    def number(self, i: int, j: int) -> int:
        """Return the number of the pair of the balls i and j."""
        return min(i, j) * len(self.radii) + max(i, j)

    def distances(self, which: Pairs) -> Array:
        """Return the touching distances [m] of the pairs numbered ``which``."""
        i, j = np.divmod(which, len(self.radii))
        return np.asarray(2.0 * np.sqrt(self.radii[i] * self.radii[j]))

    def between(self, x: Array, which: Pairs) -> Array:
        """Return the vectors [m] from the first ball to the (nearest image of the) second, shape (pairs, 2)."""
        i, j = np.divmod(which, len(self.radii))
        return to_nearest(x[j] - x[i], self.cell)

    def gaps(self, x: Array, which: Pairs | None = None) -> Array:
        """Return distance less touching distance [m] of all pairs, or of those numbered ``which``."""
        which = self.all if which is None else which
        return np.asarray(np.hypot(*self.between(x, which).T) - self.distances(which))

    def near(self, x: Array, gap: float) -> Pairs:
        """Return the numbers of the pairs with a gap of at most ``gap`` [m]."""
        count = len(self.radii)
        reach = 2.0 * float(np.max(self.radii)) + gap
        if self.cell is not None and reach >= 0.5 * float(np.min(self.cell)):
            which = self.all
        else:
            found = cKDTree(wrapped(x, self.cell), boxsize=self.cell).query_pairs(reach, output_type="ndarray")
            which = np.sort(found.min(axis=1) * count + found.max(axis=1))
        return which[self.gaps(x, which) <= gap]

    def touching(self, x: Array, within: float = 0.0) -> Pairs:
        """Return the numbers of the pairs in contact; a gap of ``within`` [m] counts as contact."""
        which = self.near(x, max(within, TOUCHING * 2.0 * float(np.max(self.radii))))
        return which[self.gaps(x, which) <= np.maximum(within, TOUCHING * self.distances(which))]

    def jacobian(self, x: Array, which: Pairs) -> csc_matrix:
        """Return d(gap)/dx of the pairs numbered ``which``, shape (pairs, 2 balls)."""
        return self._contacts(x, which).jacobian(len(x))

    def _contacts(self, x: Array, which: Pairs, opening: Array | None = None) -> Contacts:
        away = self.between(x, which)
        away /= np.hypot(*away.T)[:, None]
        return Contacts(self.pairs(which), away, np.zeros(len(which)) if opening is None else opening)

    def admissible(
        self, x: Array, force: Array, load: Array, which: Pairs, opening: Array | None = None
    ) -> tuple[Array, Array]:
        """Return velocities (f times displacement per path [-], shape (balls, 2)) and contact forces [N].

        ``force`` T (balls, 2) [N], ``load`` Q [N]; ``which`` numbers the pairs whose gaps must not change at less than
        the rates ``opening`` [-], by default 0. See `runs.evolution.motion`; raises `NotConverged`.
        """
        driving = np.where(load[:, None] > 0.0, force, 0.0)
        contacts = self._contacts(x, which, opening)
        return moved(driving, resistances(load), contacts, self.rolling * np.maximum(load, 0.0))

    def parted(self, x: Array, load: Array, which: Pairs | None = None) -> Array:
        """Return the nearest positions [m] (metric Q) without overlap; ``which`` numbers all pairs that may have one.

        Overlaps up to `OVERLAP`, or `UNSETTLED`, are left. A gap is a convex function of the positions: where its
        linearisation is not negative, it is not either. Without ``which``, pairs that come near in this way are parted
        in further passes, until overlaps are up to `UNSETTLED`; raises `NotConverged` where `PASSES` do not suffice.
        """
        size = self.smallest
        for number in range(PASSES):
            near = self.near(x, 0.25 * size) if which is None else which
            gaps = self.gaps(x, near)
            # parted balls overlap by the roundoff of their positions
            if not np.any(gaps < -(OVERLAP if len(near) <= DENSE and number == 0 else UNSETTLED) * size):
                return x
            contacts = self._contacts(x, near, -gaps / size)
            x = x + size * moved(np.zeros_like(x), resistances(load), contacts)[0]
            if which is not None:
                return x
        raise NotConverged(
            f"hard balls: {len(x)} of them overlap still after they were moved apart {PASSES} times; give the balls "
            "more room, or at the start of evolve a smaller [reciprocation] perturbation"
        )

    def connected(self, x: Array, which: Pairs) -> Mask:
        """Return which of the numbered pairs are together: in contact, or hardly apart."""
        return np.asarray(self.gaps(x, which) <= CONNECTED * self.distances(which) + self.tolerance)

    def groups(self, x: Array) -> list[list[int]]:
        """Return the balls of each group of `connected` pairs."""
        which = self.near(x, CONNECTED * 2.0 * float(np.max(self.radii)) + self.tolerance)
        i, j = self.pairs(which[self.connected(x, which)]).T
        joined = coo_matrix((np.ones(len(i)), (i, j)), shape=(len(x), len(x)))
        _, label = connected_components(joined, directed=False)
        groups = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
        return [group.tolist() for group in groups]


def resistances(load: Array) -> Array:
    """Return the metric of the drift [N]: Q of every ball, or a small share of the largest without load."""
    return np.maximum(load, WITHOUT_LOAD * float(np.max(load)))
