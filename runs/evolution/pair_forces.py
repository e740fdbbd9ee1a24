r"""Forces of many balls from states of one and of two balls: at any positions in a fraction of a millisecond.

One ball gives the relation F of force and approach. Two equal balls at distance L under the
approach D have the forces Q(L) and T(L), which define their influence k and pull c,

    Q = F(D - k(L) Q),     T = c(L) Q^2.

Any number of balls then obey

    d_i + sum_j k(L_ij) Q_j = D_i,   Q_i = F(d_i),   T_i = sum_j c(L_ij) Q_i Q_j n_ij :

exact for one and two balls in the model of the table, and momentum is conserved (sum T = 0). For three and four balls
the deviation from the model is the error, measured in `runs.evolution.pair_table`: nothing is fitted to them. Adding
bare pair forces would be far less accurate, because neighbours reduce each other's load.

Small strain at large distance is the point-load law, k = K and c = -K'. A table holds the differences from it, over
their smooth envelopes, so no quotient contains quantities that change sign. Beyond the last distance these
ratios are constant: T follows the linear decay.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicSpline, make_interp_spline
from scipy.sparse.linalg import LinearOperator

from linear_bem.arrays import Array
from linear_bem.coupled_point_loads import Influence, effective_approaches
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.point_load import neglected, next_terms, on_slopes, unsure
from linear_bem.problem import Problem
from linear_bem.touching import wrapped
from runs.evolution.forces import State
from runs.evolution.pair_list import CUT, DENSE, CutLaw, PairList

FAR = np.geomspace(1.0, 1e3, 288)
"""Distances over the smallest diameter at which the terms that point loads neglect are known."""
FEW = 20
"""Number of balls in a cell up to which their influence is formed as a matrix: a state applies it more often."""


class SingleBall:
    """Force of one ball alone over its approach, from a few states; power laws outside them.

    ``moments`` are the `linear_bem.point_load.moments` of its largest contact, for the error of point loads.
    """

    def __init__(
        self, approaches: Sequence[float], forces: Sequence[float], moments: Sequence[float] = (0.0,) * 3
    ) -> None:
        self.moments = moments
        self._d, self._q = np.log(approaches), np.log(forces)
        self._force = CubicSpline(self._d, self._q)
        self._approach = CubicSpline(self._q, self._d)

    def force(self, approach: Array) -> Array:
        """Return forces [N] at approaches [m]; 0 where those are not positive."""
        return _continued(self._force, self._d, approach)[0]

    def force_and_slope(self, approach: Array) -> tuple[Array, Array]:
        """Return forces [N] and their derivatives [N/m] at approaches [m]."""
        return _continued(self._force, self._d, approach)

    def approach(self, force: Array) -> Array:
        """Return approaches [m] under forces [N]; 0 where those are not positive."""
        return _continued(self._approach, self._q, force)[0]


def _continued(curve: CubicSpline, nodes: Array, values: Array) -> tuple[Array, Array]:
    """Return a curve in double logarithms, continued as power laws, and its derivative; 0 where values are not > 0."""
    values = np.asarray(values, dtype=float)
    pressed = values > 0.0
    at = np.log(np.where(pressed, values, 1.0))
    inside = np.clip(at, nodes[0], nodes[-1])
    power = curve(inside, 1)
    found = np.where(pressed, np.exp(curve(inside) + power * (at - inside)), 0.0)
    return found, np.where(pressed, found * power / np.where(pressed, values, 1.0), 0.0)


class PairLaw:
    """Influence k(L) [m/N] and pull c(L) [1/N]: the point-load law, or corrected to the values of a table.

    ``table``: distances [m], rising, influence, pull and the error of pull there [1/N]. The differences over `linear`'s
    envelopes are interpolated. The error of point loads is what they neglect.
    """

    def __init__(self, problem: Problem, table: tuple[Array, Array, Array, Array] | None = None) -> None:
        self.kernel, self._table = LayeredKernel.of(problem), table
        self._thickness = problem.layer.thickness
        if table is None:
            self._far = 2.0 * min(ball.radius for ball in problem.balls) * FAR
            self._terms = make_interp_spline(self._far, next_terms(self.kernel, self._far).T, k=1)
        else:
            distances, influence, pull, _ = table
            k, c, k_size, c_size = self.linear(distances)
            self._nodes = np.log(distances)
            self._curves = tuple(
                Akima1DInterpolator(self._nodes, v) for v in ((influence - k) / k_size, (pull - c) / c_size)
            )

    def linear(self, distance: Array) -> tuple[Array, Array, Array, Array]:
        """Return K, -K' and the envelopes of both at distances [m]."""
        value, slope = self.kernel.displacement(distance), self.kernel.slope(distance)
        step = 1e-3 * distance
        bend = (self.kernel.slope(distance + step) - self.kernel.slope(distance - step)) / (2.0 * step)
        length = 1.0 / (2.0 / distance + 1.0 / self._thickness)
        return value, -slope, np.hypot(value, length * slope), np.hypot(slope, length * bend)

    def errors(self, distance: Array, pull: Array, moments: Array) -> tuple[Array, Array]:
        """Return the errors of pull [1/N] and influence [m/N] at distances [m].

        That of pull is linear between given ones, as 1/L^2 beyond the last, and contains that of influence.
        ``moments`` (pairs, 3) are the sums of both balls' `SingleBall.moments`, `on_slopes`.
        """
        if self._table is None:
            terms = self._terms(np.clip(distance, self._far[0], self._far[-1])).T
            return neglected(terms, distance, pull, moments)
        at, _, _, errors = self._table
        of_pull = np.interp(distance, at, errors) * np.minimum(1.0, at[-1] / distance) ** 2
        return np.asarray(of_pull), np.zeros(distance.shape)

    def __call__(self, distance: Array) -> tuple[Array, Array]:
        """Return k and c at distances [m], any shape; 0 at infinite ones."""
        near = np.isfinite(distance)
        at = distance[near]
        influence, pull = np.zeros(distance.shape), np.zeros(distance.shape)
        if self._table is None:
            influence[near], pull[near] = self.kernel.displacement(at), -self.kernel.slope(at)
            return influence, pull
        k, c, k_size, c_size = self.linear(at)
        place = np.clip(np.log(at), self._nodes[0], self._nodes[-1])
        influence[near] = k + k_size * self._curves[0](place)
        pull[near] = c + c_size * self._curves[1](place)
        return influence, pull


class PairForces:
    """Forces of many balls from a `SingleBall` per kind of ball and a `PairLaw`, neglected beyond its reach.

    ``share`` is the error of adding pairs, over the largest T in a state, as measured on three and four balls: the
    error of T is this plus the law's own errors, summed over the neighbours of a ball. ``cell`` holds the lengths [m]
    of a periodic cell; ``cut`` is the share of the law below which it is neglected, beyond the ``reach`` [m].
    """

    def __init__(
        self,
        problem: Problem,
        singles: Sequence[SingleBall],
        law: PairLaw,
        share: float = 0.0,
        cell: Array | None = None,
        cut: float = CUT,
    ) -> None:
        self.problem, self.singles, self.law, self.share, self.cell = problem, list(singles), law, share, cell
        self._moments = np.array([single.moments for single in self.singles])
        kinds = dict.fromkeys(self.singles)
        self._kinds = [(s, np.array([i for i, t in enumerate(self.singles) if t is s])) for s in kinds]
        self._approaches = np.array(problem.load.values, dtype=float)
        self._cut = cut
        self._table = CutLaw(law, 2.0 * min(ball.radius for ball in problem.balls), cut, on_mesh=cell is not None)
        self.reach = self._table.reach
        self._list = PairList(self.reach, cell)
        self._waves = None if cell is None else self._table.waves(cell)

    def __call__(self, positions: Array) -> State:
        """Return the state at ``positions``; raises `NotConverged`."""
        pairs = self._list(positions)
        between = pairs.between(positions)
        distance = np.sqrt(between[:, 0] ** 2 + between[:, 1] ** 2)
        influence, pull = self._table(distance)
        matrix = pairs.matrix(influence)
        mutual: Influence
        if self._waves is not None:
            x, y = wrapped(positions, self._waves.lengths).T
            points = self._waves.at(x, y, slopes=True)
            far = partial(self._waves.potential, points)
            mutual = LinearOperator(matrix.shape, lambda load: matrix @ load + far(load), dtype=float)
            if len(positions) <= FEW:
                mutual = np.stack([mutual @ load for load in np.eye(len(positions))], axis=1)
        else:
            mutual = matrix.toarray() if len(positions) <= DENSE else matrix
        effective = effective_approaches(mutual, self._force_and_slope, self._approaches, self._approaches)
        normal = self._force_and_slope(effective)[0]
        if not np.any(normal > 0.0):
            raise NotConverged("pair forces: no ball carries load")

        strength = pull * normal[pairs.first] * normal[pairs.second] / distance
        tangential = np.stack([pairs.summed(strength * along) for along in between.T], axis=1)
        if self._waves is not None:
            tangential += normal[:, None] * self._waves.slope(points, normal)
        moments = on_slopes(self._moments, normal, tangential)
        errors, left = self.law.errors(distance, pull, moments[pairs.first] + moments[pairs.second])
        inside = distance < self.reach
        share = unsure(pairs.matrix(np.where(inside, left, 0.0)) @ normal, effective)
        errors = errors + np.abs(pull) * (share[pairs.first] + share[pairs.second])
        own = normal * (pairs.matrix(np.where(inside, errors, 0.0)) @ normal)
        error = self.share * np.max(np.hypot(*tangential.T)) + np.max(own)
        return State(tangential, normal, np.full(len(normal), error))

    def cut_error(self, positions: Array) -> float:
        """Return the largest change of T over the largest T at ``positions`` when a tenth as much is neglected."""
        wider = PairForces(self.problem, self.singles, self.law, self.share, self.cell, 0.1 * self._cut)
        here, there = self(positions).tangential, wider(positions).tangential
        largest = float(np.max(np.hypot(*there.T)))
        return float(np.max(np.hypot(*(here - there).T))) / largest if largest > 0.0 else 0.0

    def _force_and_slope(self, approaches: Array) -> tuple[Array, Array]:
        force, slope = np.zeros(len(approaches)), np.zeros(len(approaches))
        for single, members in self._kinds:
            force[members], slope[members] = single.force_and_slope(approaches[members])
        return force, slope
