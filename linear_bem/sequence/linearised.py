r"""Contacts near a solved state: each ball's own equations as matrices that travel with it, neighbours anew.

About a solution at one place the equations of `linear_bem.smooth.newton` are linear in the coefficients' change,

    A_i d_i + sum_j R_i G(x_i - x_j) [q_j + Q_j d_j] - t_i D_i = -b_i,

where A_i, b_i (own displacement and profile), R_i, q_i, Q_i (how a ball receives and exerts, on interpolation
nodes) and t_i (force) do not change when the ball moves. Only G does. So a scene whose balls moved a little costs one
kernel evaluation per pair of interpolation nodes and one small linear system; what is neglected is quadratic in d.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem
from linear_bem.profiles import gradient, height
from linear_bem.smooth.multipole import disc_nodes, interpolation
from linear_bem.smooth.newton import Nodes, Rule
from linear_bem.smooth.zone import Zone

Array = NDArray[np.float64]

NEAR_DEGREE, FAR_DEGREE = 10, 4
"""Degrees of interpolation between close and far contacts."""
FAR = 3.0
"""Distance of axes over the sum of contact radii beyond which contacts are far."""


Numbers = NDArray[np.intp]
Pair = tuple[int, Numbers, Numbers, Array, Array, Array, Array]


@dataclass(frozen=True)
class LinearState:
    """Changes of all coefficients, approaches [m], forces over `singular`, and what they imply.

    ``drift`` is the largest change of P relative to P; ``gap`` the largest gap at the quadrature nodes [m].
    """

    change: Array
    approaches: Array
    forces: Array
    mutual_force: Array
    slope_force: Array
    drift: float
    gap: float


class LinearisedContacts:
    """The equations of touching balls linearised about their ``zones``; ``touching``: their numbers."""

    def __init__(self, problem: Problem, kernel: LayeredKernel, touching: tuple[int, ...], zones: list[Zone]) -> None:
        self.kernel, self.touching, self.zones = kernel, touching, zones
        self.places = np.array([problem.balls[i].position for i in touching], dtype=float)
        rule = Rule.of(zones, kernel.thickness)
        self.nodes = [Nodes.of(z, rule) for z in zones]
        self.terms = len(zones[0].coefficients)
        parts = []
        for i, n in zip(touching, self.nodes, strict=True):
            potential, derivative = n.zone.half_space(n.xi, n.eta, rule.directions, rule.along)
            if not kernel.homogeneous:
                smooth = kernel.smooth(np.hypot(n.x[:, None] - n.x, n.y[:, None] - n.y)) * n.weights
                potential = potential + smooth @ n.pressure
                derivative = derivative + smooth @ n.variations
            ball = problem.balls[i]
            parts.append((potential + height(ball)(n.x, n.y), derivative, np.stack(gradient(ball, n.x, n.y))))
        self.rise = [p[0] for p in parts]
        self.derivative = [p[1] for p in parts]
        self.tests = [n.variations.T * n.weights for n in self.nodes]
        self.own = [t @ d for t, d in zip(self.tests, self.derivative, strict=True)]
        self.right = np.array([-t @ v for t, v in zip(self.tests, self.rise, strict=True)])
        self.total = np.array([t.sum(axis=1) for t in self.tests])
        self.force = np.array([n.force for n in self.nodes])
        self.slope = np.array([-g @ (n.weights * n.pressure) for n, (_, _, g) in zip(self.nodes, parts, strict=True)])
        self.slope_change = np.array([-g @ t.T for t, (_, _, g) in zip(self.tests, parts, strict=True)])
        self.radius = np.array([np.max(np.linalg.svd(z.axes, compute_uv=False)) for z in zones])
        self.links = {d: self._links(d) for d in (FAR_DEGREE, NEAR_DEGREE)}

    def _links(self, degree: int) -> tuple[Array, Array, Array, Array, list[Array]]:
        """Return node places from the ball's axis, receiving rows, loads, their changes, and interpolation matrices."""
        u, v, _ = disc_nodes(degree)
        matrices = [interpolation(n.xi, n.eta, degree) for n in self.nodes]
        place = np.array([n.zone.points(u, v) for n in self.nodes]) - self.places[:, :, None]
        receive = np.array([t @ m for t, m in zip(self.tests, matrices, strict=True)])
        loads = np.array([(n.weights * n.pressure) @ m for n, m in zip(self.nodes, matrices, strict=True)])
        return place, receive, loads, receive, matrices

    def solve(self, places: Array, approaches: Array, groups: list[tuple[list[int], float]]) -> LinearState:
        """Return the state with the balls' axes at ``places`` [m], shape (balls, 2); ``groups`` as in `newton`."""
        count, terms, free = len(self.zones), self.terms, len(groups)
        pairs = self._pairs(places)
        size = count * terms
        matrix, right = np.zeros((size + free, size + free)), np.zeros(size + free)
        blocks = matrix[:size, :size].reshape(count, terms, count, terms)
        rows = self.right + self.total * approaches[:, None]
        outside = {d: np.zeros_like(link[2]) for d, link in self.links.items()}
        for degree, i, j, g, _, _, _ in pairs:
            _, receive, loads, change, _ = self.links[degree]
            np.add.at(outside[degree], i, np.einsum("pab,pb->pa", g, loads[j]))
            np.add.at(outside[degree], j, np.einsum("pab,pa->pb", g, loads[i]))
            there = receive[i] @ g @ change[j].transpose(0, 2, 1)
            blocks[i, :, j, :] = there
            blocks[j, :, i, :] = there.transpose(0, 2, 1)
        for degree, (_, receive, _, _, _) in self.links.items():
            rows = rows - np.einsum("nta,na->nt", receive, outside[degree])
        for k in range(count):
            blocks[k, :, k, :] = self.own[k]
        right[:size] = rows.ravel()
        for k, (members, force) in enumerate(groups):
            for m in members:
                at = slice(m * terms, (m + 1) * terms)
                matrix[at, size + k] = -self.total[m]
                matrix[size + k, at] = self.total[m]
            right[size + k] = force - float(np.sum(self.force[members]))
        scale = np.sqrt(np.abs(np.diag(matrix)))
        for k in range(free):
            scale[size + k] = float(np.max(np.abs(matrix[size + k, :size]) / scale[:size]))
        try:
            answer = np.linalg.solve(matrix / scale[:, None] / scale, right / scale) / scale
        except np.linalg.LinAlgError as error:
            raise NotConverged(f"contact sequence: {error}") from error
        delta = answer[:size].reshape(count, terms)
        level = approaches.copy()
        for k, (members, _) in enumerate(groups):
            level[members] += answer[size + k]
        return self._state(delta, level, pairs)

    def _pairs(self, places: Array) -> list[Pair]:
        """Return per degree: balls i < j, kernel, its slope over r, dx and dy between their nodes."""
        first, second = np.triu_indices(len(places), 1)
        apart = np.hypot(*(places[first] - places[second]).T)
        far = apart > FAR * (self.radius[first] + self.radius[second])
        out = []
        for degree, chosen in ((FAR_DEGREE, far), (NEAR_DEGREE, ~far)):
            i, j = first[chosen], second[chosen]
            if i.size == 0:
                continue
            place = self.links[degree][0] + places[:, :, None]
            dx = place[i, 0][:, :, None] - place[j, 0][:, None, :]
            dy = place[i, 1][:, :, None] - place[j, 1][:, None, :]
            r = np.hypot(dx, dy)
            inverse = 1.0 / r
            slope = -inverse * inverse
            kernel = inverse
            if not self.kernel.homogeneous:
                s, ds = self.kernel.smooth_and_slope(r)
                kernel = inverse + s
                slope = slope + ds
            out.append((degree, i, j, kernel, slope * inverse, dx, dy))
        return out

    def _state(self, delta: Array, approaches: Array, pairs: list[Pair]) -> LinearState:
        loads = {d: link[2] + np.einsum("nt,nta->na", delta, link[3]) for d, link in self.links.items()}
        pull = np.zeros((len(delta), 2))
        outside = {d: np.zeros_like(v) for d, v in loads.items()}
        for degree, i, j, g, s, dx, dy in pairs:
            q = loads[degree]
            np.add.at(outside[degree], i, np.einsum("pab,pb->pa", g, q[j]))
            np.add.at(outside[degree], j, np.einsum("pab,pa->pb", g, q[i]))
            both = s * (q[i][:, :, None] * q[j][:, None, :])
            force = np.stack([np.sum(both * dx, axis=(1, 2)), np.sum(both * dy, axis=(1, 2))], axis=1)
            np.add.at(pull, i, force)
            np.add.at(pull, j, -force)
        gap = 0.0
        for k, (v, d) in enumerate(zip(self.rise, self.derivative, strict=True)):
            w = v + d @ delta[k] - approaches[k]
            for degree, link in self.links.items():
                w = w + link[4][k] @ outside[degree][k]
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
        """Return the zones with a change of coefficients, carried along to the axes' new ``places`` [m]."""
        out = []
        for zone, old, new, delta in zip(self.zones, self.places, places, change, strict=True):
            length = min(1.0, 0.6 * float(np.max(np.abs(zone.coefficients)) / max(np.max(np.abs(delta)), 1e-300)))
            here = replace(zone, centre=zone.centre + new - old, coefficients=zone.coefficients + length * delta)
            out.append(here.reframed(zone.degree))
        return out
