r"""Contacts linearised about a solved state: each ball's own matrices move with it; only pair terms are recomputed.

Near a solution, the equations of `linear_bem.smooth.newton` are linear in the change d of the coefficients,

    A_i d_i + sum_j R_i G(x_i - x_j) [q_j + R_j^T d_j] - t_i D_i = -b_i,

where A_i, b_i (own displacement and profile), R_i, q_i (receiving matrix and loads on interpolation
nodes) and t_i (force) do not change when the ball moves; only G does. A scene with slightly moved balls costs one
kernel evaluation per pair of interpolation nodes and one small linear system; neglected terms are quadratic in d.
"""

from dataclasses import dataclass, replace

import numpy as np

from linear_bem.arrays import Array, Indices
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.problem import Problem
from linear_bem.profiles import gradient, height
from linear_bem.smooth.multipole import disc_nodes, interpolation
from linear_bem.smooth.newton import Nodes, Rule, own_displacement, solve_grouped
from linear_bem.smooth.zone import Zone

NEAR_DEGREE, FAR_DEGREE = 10, 4
"""Degrees of interpolation between close and far contacts."""
FAR = 3.0
"""Distance of axes over the sum of contact radii beyond which contacts are far."""


@dataclass(frozen=True)
class LinearState:
    """Changes of all coefficients, approaches [m], forces times `singular` [m^2], T [N] by both formulas.

    ``drift`` is the largest change of P relative to P; ``gap`` the largest gap at the quadrature nodes [m].
    """

    change: Array
    approaches: Array
    forces: Array
    mutual_force: Array
    slope_force: Array
    drift: float
    gap: float


@dataclass(frozen=True)
class _Exchange:
    """Interpolation of one degree: ``places`` of nodes from the axis [m] (balls, 2, nodes), ``loads`` (balls, nodes).

    ``receive`` (balls, terms, nodes) maps displacements at the nodes to the equations, and its transpose maps
    changes of the coefficients to changes of the loads. ``matrices`` map node values to each zone's quadrature points.
    """

    places: Array
    receive: Array
    loads: Array
    matrices: list[Array]


@dataclass(frozen=True)
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

    def __init__(self, problem: Problem, kernel: LayeredKernel, touching: tuple[int, ...], zones: list[Zone]) -> None:
        self.kernel, self.touching, self.zones = kernel, touching, zones
        self.places = problem.positions[list(touching)]
        rule = Rule.of(zones, kernel.thickness)
        self.nodes = [Nodes.of(z, rule) for z in zones]
        self.tests = [n.variations.T * n.weights for n in self.nodes]
        self.rise, self.derivative, slope, slope_change = [], [], [], []
        for i, n, test in zip(touching, self.nodes, self.tests, strict=True):
            w, derivative = own_displacement(kernel, n, rule)
            ball = problem.balls[i]
            profile = np.stack(gradient(ball, n.x, n.y))
            self.rise.append(w + height(ball)(n.x, n.y))
            self.derivative.append(derivative)
            slope.append(-profile @ n.loads)
            slope_change.append(-profile @ test.T)
        self.slope, self.slope_change = np.array(slope), np.array(slope_change)
        self.own = np.array([t @ d for t, d in zip(self.tests, self.derivative, strict=True)])
        self.right = np.array([-t @ v for t, v in zip(self.tests, self.rise, strict=True)])
        self.total = np.array([t.sum(axis=1) for t in self.tests])
        self.force = np.array([n.force for n in self.nodes])
        self.radius = np.array([z.reach for z in zones])
        self.exchanges = {d: self._exchange(d) for d in (FAR_DEGREE, NEAR_DEGREE)}

    def _exchange(self, degree: int) -> _Exchange:
        u, v, _ = disc_nodes(degree)
        matrices = [interpolation(n.xi, n.eta, degree) for n in self.nodes]
        return _Exchange(
            places=np.array([n.zone.points(u, v) for n in self.nodes]) - self.places[:, :, None],
            receive=np.array([t @ m for t, m in zip(self.tests, matrices, strict=True)]),
            loads=np.array([n.loads @ m for n, m in zip(self.nodes, matrices, strict=True)]),
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
        far = apart > FAR * (self.radius[first] + self.radius[second])
        out = []
        for degree, chosen in ((FAR_DEGREE, far), (NEAR_DEGREE, ~far)):
            i, j = first[chosen], second[chosen]
            if i.size == 0:
                continue
            at = self.exchanges[degree].places + places[:, :, None]
            dx, dy = (at[i, axis][:, :, None] - at[j, axis][:, None, :] for axis in (0, 1))
            r = np.hypot(dx, dy)
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
        gap = 0.0
        for k, (v, d) in enumerate(zip(self.rise, self.derivative, strict=True)):
            w = v + d @ delta[k] - approaches[k]
            for degree, exchange in self.exchanges.items():
                w = w + exchange.matrices[k] @ outside[degree][k]
            gap = max(gap, float(np.max(np.abs(w))))
        largest = np.array([np.max(np.abs(z.coefficients)) for z in self.zones])
        return LinearState(
            change=delta,
            approaches=approaches,
            forces=self.force + np.einsum("nt,nt->n", self.total, delta),
            mutual_force=pull / self.kernel.singular,
            slope_force=(self.slope + np.einsum("nct,nt->nc", self.slope_change, delta)) / self.kernel.singular,
            drift=float(np.max(np.abs(delta) / largest[:, None])),
            gap=gap,
        )

    def moved(self, places: Array, change: Array) -> list[Zone]:
        """Return the zones with changed coefficients, moved to the new ``places`` of the axes [m]."""
        out = []
        for zone, old, new, delta in zip(self.zones, self.places, places, change, strict=True):
            length = min(1.0, 0.6 * float(np.max(np.abs(zone.coefficients)) / max(np.max(np.abs(delta)), 1e-300)))
            here = replace(zone, centre=zone.centre + new - old, coefficients=zone.coefficients + length * delta)
            out.append(here.reframed(zone.degree))
        return out
