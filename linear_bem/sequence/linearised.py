r"""Contacts linearised about a solved state: each ball's own matrices move with it; only pair terms are recomputed.

Near a solution, the equations of `linear_bem.smooth.newton` are linear in the change d of the coefficients,

    A_i d_i + sum_j R_i G(x_i - x_j) [q_j + R_j^T d_j] - t_i D_i = -b_i,

where A_i, b_i (own displacement and profile), R_i, q_i (receiving matrix and loads on interpolation
nodes) and t_i (force) do not change when the ball moves; only G does. A scene with slightly moved balls costs one
kernel evaluation per pair of interpolation nodes and one small linear system; neglected terms are quadratic in d.
"""

from dataclasses import dataclass, replace

import numpy as np

from linear_bem.arrays import Array, Indices, hypotenuse
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.problem import Problem
from linear_bem.profiles import gradient, height
from linear_bem.smooth.newton import Nodes, Rule, own_displacement, solve_grouped
from linear_bem.smooth.polynomials import disc_nodes, interpolation
from linear_bem.smooth.zone import Zone

NEAR_DEGREE, FAR_DEGREE = 10, 6
"""Degrees of interpolation between close and far contacts."""
FAR = 5.0
"""Distance of axes over the sum of contact radii beyond which contacts are far."""


@dataclass(frozen=True, eq=False)
class LinearState:
    """Changes of all coefficients, approaches [m], forces times `singular` [m^2], T [N] by both formulas.

    ``drift`` is the largest change of P relative to P; ``gap`` the largest gap at the quadrature nodes [m], and
    ``gap_share`` the largest of a body's gap over the dent that it makes itself.
    """

    change: Array
    approaches: Array
    forces: Array
    mutual_force: Array
    slope_force: Array
    drift: float
    gap: float
    gap_share: float


@dataclass(frozen=True, eq=False)
class _Exchange:
    """Interpolation of one degree: ``places`` of nodes from the axis [m] (balls, 2, nodes), ``loads`` (balls, nodes).

    ``receive`` (balls, terms, nodes) maps displacements at the nodes to the equations, and its transpose maps
    changes of the coefficients to changes of the loads. ``matrices`` map node values to each zone's quadrature points.
    """

    places: Array
    receive: Array
    loads: Array
    matrices: Array


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Pairs of balls with one degree of interpolation: kernel, its slope over r, and dx, dy [m] between their nodes."""

    degree: int
    first: Indices
    second: Indices
    kernel: Array
    slope: Array
    dx: Array
    dy: Array


class LinearisedContacts:
    """The equations of touching balls linearised about their ``zones``; ``touching`` are the balls' indices."""

    def __init__(self, problem: Problem, kernel: LayeredKernel, touching: tuple[int, ...], zones: Zone) -> None:
        self.kernel, self.touching, self.zones = kernel, touching, zones
        self.places = problem.positions[list(touching)]
        rule = Rule.of(zones, kernel.thickness)
        self.nodes = Nodes.of(zones, rule)
        self.tests = self.nodes.tests
        at = [(problem.balls[i], x, y) for i, x, y in zip(touching, self.nodes.x, self.nodes.y, strict=True)]
        profile = np.array([gradient(ball, x, y) for ball, x, y in at])
        w, self.derivative = own_displacement(kernel, self.nodes, rule)
        self.dent = np.max(np.abs(w), axis=1)
        self.rise = w + np.array([height(ball)(x, y) for ball, x, y in at])
        self.slope = -np.einsum("nck,nk->nc", profile, self.nodes.loads)
        self.slope_change = -profile @ np.swapaxes(self.tests, 1, 2)
        self.own = self.tests @ self.derivative
        self.right = -np.einsum("ntk,nk->nt", self.tests, self.rise)
        self.total = self.tests.sum(axis=2)
        self.force = self.nodes.forces
        self.largest = np.max(np.abs(zones.coefficients), axis=1)
        self.exchanges = {d: self._exchange(d) for d in (FAR_DEGREE, NEAR_DEGREE)}

    def _exchange(self, degree: int) -> _Exchange:
        matrices = interpolation(self.nodes.xi, self.nodes.eta, degree)
        return _Exchange(
            places=np.stack(self.zones.points(*disc_nodes(degree)[:2]), axis=1) - self.places[:, :, None],
            receive=self.tests @ matrices,
            loads=np.einsum("nk,nka->na", self.nodes.loads, matrices),
            matrices=matrices,
        )

    def solve(self, places: Array, approaches: Array, groups: Groups) -> LinearState:
        """Return the state with the balls' axes at ``places`` [m], shape (balls, 2); raises `NotConverged`."""
        count, terms = self.right.shape
        pairs = self._pairs(places)
        blocks = np.zeros((count, count, terms, terms))
        blocks[np.arange(count), np.arange(count)] = self.own
        for p in pairs:
            receive = self.exchanges[p.degree].receive
            there = receive[p.first] @ p.kernel @ receive[p.second].transpose(0, 2, 1)
            blocks[p.first, p.second], blocks[p.second, p.first] = there, there.transpose(0, 2, 1)
        rows = self.right + self.total * approaches[:, None]
        outside = self._received(pairs, {d: e.loads for d, e in self.exchanges.items()})
        for degree, exchange in self.exchanges.items():
            rows = rows - np.einsum("nta,na->nt", exchange.receive, outside[degree])
        delta, change = solve_grouped(blocks, rows, self.total, self.force, groups)
        return self._state(delta, approaches + change, pairs)

    def _pairs(self, places: Array) -> list[_Pairs]:
        first, second = np.triu_indices(len(places), 1)
        apart = np.hypot(*(places[first] - places[second]).T)
        far = apart > FAR * (self.zones.reach[first] + self.zones.reach[second])
        out = []
        for degree, chosen in ((FAR_DEGREE, far), (NEAR_DEGREE, ~far)):
            i, j = first[chosen], second[chosen]
            if i.size == 0:
                continue
            at = self.exchanges[degree].places + places[:, :, None]
            dx, dy = (at[i, axis][:, :, None] - at[j, axis][:, None, :] for axis in (0, 1))
            r = hypotenuse(dx, dy)
            s, ds = self.kernel.smooth_and_slope(r)
            out.append(_Pairs(degree, i, j, 1.0 / r + s, (ds - 1.0 / r**2) / r, dx, dy))
        return out

    @staticmethod
    def _received(pairs: list[_Pairs], loads: dict[int, Array]) -> dict[int, Array]:
        """Return the displacement [m] at every ball's nodes, per degree, due to the loads of the others."""
        out = {degree: np.zeros_like(q) for degree, q in loads.items()}
        for p in pairs:
            q = loads[p.degree]
            np.add.at(out[p.degree], p.first, np.einsum("pab,pb->pa", p.kernel, q[p.second]))
            np.add.at(out[p.degree], p.second, np.einsum("pab,pa->pb", p.kernel, q[p.first]))
        return out

    def _state(self, delta: Array, approaches: Array, pairs: list[_Pairs]) -> LinearState:
        loads = {d: e.loads + np.einsum("nt,nta->na", delta, e.receive) for d, e in self.exchanges.items()}
        outside = self._received(pairs, loads)
        pull = np.zeros((len(delta), 2))
        for p in pairs:
            q = loads[p.degree]
            both = p.slope * (q[p.first][:, :, None] * q[p.second][:, None, :])
            force = np.stack([np.sum(both * p.dx, axis=(1, 2)), np.sum(both * p.dy, axis=(1, 2))], axis=1)
            np.add.at(pull, p.first, force)
            np.add.at(pull, p.second, -force)
        w = self.rise + np.einsum("nkt,nt->nk", self.derivative, delta) - approaches[:, None]
        for degree, exchange in self.exchanges.items():
            w = w + np.einsum("nka,na->nk", exchange.matrices, outside[degree])
        return LinearState(
            change=delta,
            approaches=approaches,
            forces=self.force + np.einsum("nt,nt->n", self.total, delta),
            mutual_force=pull / self.kernel.singular,
            slope_force=(self.slope + np.einsum("nct,nt->nc", self.slope_change, delta)) / self.kernel.singular,
            drift=float(np.max(np.abs(delta) / self.largest[:, None])),
            gap=float(np.max(np.abs(w))),
            gap_share=float(np.max(np.max(np.abs(w), axis=1) / self.dent)),
        )

    def moved(self, places: Array, change: Array) -> Zone:
        """Return the zones with changed coefficients, moved to the new ``places`` of the axes [m]."""
        length = np.minimum(1.0, 0.6 * self.largest / np.maximum(np.max(np.abs(change), axis=1), 1e-300))
        coefficients = self.zones.coefficients + length[:, None] * change
        zones = replace(self.zones, centre=self.zones.centre + places - self.places, coefficients=coefficients)
        return zones.reframed(zones.degree)
