r"""Hard balls: when they touch, which velocities they allow, and the forces by which they push each other.

Balls of different size between a plate and a layer: lowest points on one level (or tops on one level under a flat
plate), so centres differ in height by R_i - R_j. Touching means that the centres are R_i + R_j apart in space, hence

    L_ij = sqrt((R_i + R_j)^2 - (R_i - R_j)^2) = 2 sqrt(R_i R_j)

in the plane, which is R_i + R_j for equal balls only.

Velocities. A contact that pushes ball i with N moves it by N/(f Q_i) per unit path, as T does. So the velocity is the
one nearest the free drift in the metric f Q_i that opens or keeps every touching pair, and the contact
forces N >= 0 are its multipliers:

    f Q_i v_i = T_i + sum_c N_c dg_c/dx_i,     N_c >= 0,   dg_c/ds >= 0,   N_c dg_c/ds = 0.

Its dual is a problem of non-negative least squares. [Moreau 1988, doi 10.1007/978-3-7091-2624-0_1]
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from linear_bem.errors import NotConverged, UnsupportedProblem
from linear_bem.problem import Problem

Array = NDArray[np.float64]
Pairs = NDArray[np.intp]
"""Index pairs, shape (pairs, 2)."""

TOUCHING = 1e-9
"""Gap over touching distance up to which a pair is in contact."""
WITHOUT_LOAD = 1e-6
"""Resistance of a ball without load, over the largest: small, so that pushes move it."""


@dataclass(frozen=True)
class HardBalls:
    """All pairs of balls and the distances [m] of their axes at which they touch."""

    pairs: Pairs
    distances: Array

    @classmethod
    def of(cls, problem: Problem) -> HardBalls:
        """Return the hard balls of ``problem``; raises `UnsupportedProblem` for levels that no flat plate imposes."""
        levels = np.array([ball.radius for ball in problem.balls]), np.array(problem.load.values)
        bottoms, tops = levels[1], levels[1] - 2.0 * levels[0]
        if min(float(np.ptp(bottoms)), float(np.ptp(tops))) > 1e-9 * float(np.max(levels[0])):
            raise UnsupportedProblem(
                "load.approach: balls that drift under one flat plate have their lowest points on one level (equal "
                f"approaches) or their tops (approach less diameter), got approaches {problem.load.values} m"
            )
        pairs = np.array(np.triu_indices(problem.size, 1), dtype=np.intp).T.reshape(-1, 2)
        radii = np.array([ball.radius for ball in problem.balls])
        return cls(pairs, np.asarray(2.0 * np.sqrt(radii[pairs[:, 0]] * radii[pairs[:, 1]])))

    def gaps(self, x: Array, which: Pairs | None = None) -> Array:
        """Return distance less touching distance [m] of all pairs, or of those numbered ``which``."""
        pairs = self.pairs if which is None else self.pairs[which]
        touch = self.distances if which is None else self.distances[which]
        return np.asarray(np.hypot(*(x[pairs[:, 1]] - x[pairs[:, 0]]).T) - touch)

    def touching(self, x: Array) -> Pairs:
        """Return the numbers of the pairs in contact."""
        return np.flatnonzero(self.gaps(x) <= TOUCHING * self.distances)

    def jacobian(self, x: Array, which: Pairs) -> Array:
        """Return d(gap)/dx of the pairs numbered ``which``, shape (pairs, 2 balls)."""
        out = np.zeros((len(which), x.size))
        for row, (i, j) in enumerate(self.pairs[which]):
            away = (x[j] - x[i]) / math.dist(x[j], x[i])
            out[row, 2 * i : 2 * i + 2] = -away
            out[row, 2 * j : 2 * j + 2] = away
        return out

    def admissible(self, x: Array, force: Array, load: Array, which: Pairs) -> tuple[Array, Array]:
        """Return velocities (f times displacement per path [-], shape (balls, 2)) and contact forces [N].

        ``force`` T (balls, 2) [N], ``load`` Q [N]; ``which`` numbers the pairs in contact.
        """
        resistance = resistances(load)
        free = np.where(load[:, None] > 0.0, force / resistance[:, None], 0.0)
        if len(which) == 0:
            return free, np.zeros(0)
        root = np.sqrt(np.repeat(resistance, 2))
        jacobian = self.jacobian(x, which)
        size = float(np.max(np.abs(force), initial=0.0)) or 1.0
        push, _ = nnls((jacobian / root).T, -root * free.ravel() / size, maxiter=50 * len(which) + 100)
        moved = (push * size @ jacobian / root**2).reshape(x.shape)
        return free + moved, push * size

    def restored(self, x: Array, load: Array, held: Pairs) -> Array:
        """Return the nearest positions (metric Q) at which the pairs ``held`` touch and none overlaps.

        Raises `NotConverged` where there are none near.
        """
        weight = 1.0 / np.repeat(resistances(load), 2)
        shut = set(map(int, held))
        scale = float(np.max(self.distances, initial=1.0))
        for _ in range(40):
            gaps = self.gaps(x)
            shut |= set(np.flatnonzero(gaps < -1e-12 * scale).tolist())
            which = np.array(sorted(shut), dtype=np.intp)
            if len(which) == 0 or float(np.max(np.abs(gaps[which]))) <= 1e-12 * scale:
                return x
            jacobian = self.jacobian(x, which)
            matrix = (jacobian * weight) @ jacobian.T
            push = np.linalg.lstsq(matrix, -gaps[which], rcond=1e-10)[0]
            # an overlap is pushed apart; only a pair that is held may be drawn together
            x = x + (weight * (push @ jacobian)).reshape(x.shape)
            shut = set(map(int, held)) | {k for k, p in zip(which.tolist(), push, strict=True) if p > 0.0}
        raise NotConverged(
            f"hard balls: {len(held)} contacts cannot all be kept without an overlap; "
            f"gaps of {float(np.min(self.gaps(x))):.1e} m are left"
        )

    def groups(self, x: Array, reach: float = 1e-3) -> list[list[int]]:
        """Return the balls of each connected group; pairs closer than ``reach`` touching distances are connected."""
        label = list(range(len(x)))
        for k in np.flatnonzero(self.gaps(x) <= reach * self.distances):
            i, j = (label[b] for b in self.pairs[k])
            label = [i if v == j else v for v in label]
        return [[b for b, v in enumerate(label) if v == name] for name in dict.fromkeys(label)]


def resistances(load: Array) -> Array:
    """Return the metric of the drift [N]: Q of every ball, or a small share of the largest without load."""
    return np.maximum(load, WITHOUT_LOAD * float(np.max(load)))
