"""A solved contact: pressures, displacement anywhere on the surface, outlines, forces, residuals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem
from linear_bem.profiles import height
from linear_bem.smooth.displacement import FEW, displacement_around, displacement_of_many, zone_displacement
from linear_bem.smooth.newton import Nodes, SmoothSolution
from linear_bem.smooth.tangential_forces import mutual_force, slope_force

Array = NDArray[np.float64]

EVALUATED = 1e-7
"""Relative exactness of the displacement that residuals are recomputed with."""
RINGS = (1.12, 2.0)
"""Where penetration outside a contact is looked for, over its outline's distance; nearer takes finer quadrature."""


@dataclass(frozen=True)
class SmoothContacts:
    """Separate smooth contacts; ``touching`` lists the loaded balls in the order of the zones.

    All numbers are SI. ``normal_forces``, ``approaches`` and the tangential forces have one entry per ball of
    the problem, zero for balls that do not touch.
    """

    problem: Problem
    kernel: LayeredKernel
    touching: tuple[int, ...]
    smooth: SmoothSolution
    approaches: Array
    precision: float = 1e-11

    @property
    def unknowns(self) -> int:
        """Number of pressure coefficients."""
        return sum(len(n.zone.coefficients) for n in self.smooth.nodes)

    @property
    def iterations(self) -> int:
        """Newton steps taken."""
        return self.smooth.iterations

    @cached_property
    def normal_forces(self) -> Array:
        """Normal force on every ball [N]."""
        return self._scatter([n.force / self.kernel.singular for n in self.smooth.nodes])

    @cached_property
    def mutual_force(self) -> Array:
        """T on every ball [N] by the mutual formula, shape (balls, 2)."""
        return self._scatter(mutual_force(self.kernel, self.smooth.nodes, self.precision))

    @cached_property
    def slope_force(self) -> Array:
        """T on every ball [N] by the paper's slope integral, shape (balls, 2)."""
        balls = [self.problem.balls[i] for i in self.touching]
        return self._scatter(slope_force(self.kernel, balls, self.smooth.nodes))

    @cached_property
    def peak_pressures(self) -> Array:
        """Largest contact pressure under every ball [Pa]."""
        peaks = []
        for n in self.smooth.nodes:
            best = int(np.argmax(n.pressure))
            peaks.append(_maximum(n, best) / self.kernel.singular)
        return self._scatter(peaks)

    @cached_property
    def contact_areas(self) -> Array:
        """Contact area of every ball [m^2]."""
        return self._scatter([float(np.sum(n.weights)) for n in self.smooth.nodes])

    def heights(self, ball: int, x: Array, y: Array) -> Array:
        """Return one ball's height f [m] over its lowest point at surface points [m]."""
        return height(self.problem.balls[ball])(x, y)

    def outline(self, ball: int, count: int = 64) -> tuple[Array, Array]:
        """Return points x, y [m] on the edge of one ball's contact (empty where it does not touch)."""
        if ball not in self.touching:
            return np.empty(0), np.empty(0)
        return self.smooth.nodes[self.touching.index(ball)].zone.outline(count)

    def pressure(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the contact pressure [Pa] at surface points [m]."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        total = np.zeros(np.broadcast(x, y).shape)
        for n in self.smooth.nodes:
            total = total + n.zone.pressure(x, y)
        return total / self.kernel.singular

    def displacement(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the surface displacement [m], positive into the layer, at any surface points [m]."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        flat_x, flat_y = x.ravel(), y.ravel()
        nodes = self.smooth.nodes
        if len(nodes) <= FEW:
            total = sum(zone_displacement(self.kernel, n, flat_x, flat_y) for n in nodes)
        else:
            total = displacement_of_many(self.kernel, nodes, flat_x, flat_y)
        return np.asarray(total).reshape(x.shape)

    @cached_property
    def certificate(self) -> dict[str, float]:
        """Residuals recomputed around every ball, at points and by nodes that the solver did not use.

        ``gap_in_contact`` max |gap| where p > 0 and ``penetration_outside`` max overlap outside, both over the
        largest approach; ``complementarity`` max p |gap| over peak pressure and approach; ``load`` the relative
        error of the prescribed forces; ``negative_pressure`` is 0: p is a square root. The displacement is exact to
        `EVALUATED` of itself.
        """
        scale = float(np.max(np.abs(self.approaches)))
        xs, ys, depths, pressures = [], [], [], []
        for ball, n in zip(self.touching, self.smooth.nodes, strict=True):
            zone = n.zone
            xi, eta, _, p = zone.quadrature(3, 5)
            x, y = zone.points(xi, eta)
            ox, oy = zone.outline(7)
            for ring in RINGS:
                x = np.append(x, zone.centre[0] + ring * (ox - zone.centre[0]))
                y = np.append(y, zone.centre[1] + ring * (oy - zone.centre[1]))
            xs.append(x)
            ys.append(y)
            depths.append(self.approaches[ball] - height(self.problem.balls[ball])(x, y))
            pressures.append(np.append(p / np.max(n.pressure), np.zeros(len(x) - len(p))))
        p = np.concatenate(pressures)
        gap = np.concatenate(displacement_around(self.kernel, self.smooth.nodes, xs, ys, EVALUATED))
        gap = gap - np.concatenate(depths)
        free = (p == 0.0) & ~self._covered(xs, ys)
        inside = float(np.max(np.abs(gap[p > 0.0])))
        outside = float(np.max(-gap[free], initial=0.0))
        product = float(np.max(np.abs(gap) * p))
        prescribed = self.problem.load
        load = 0.0
        if prescribed.kind != "approach":
            got = self.normal_forces if prescribed.kind == "force" else np.sum(self.normal_forces, keepdims=True)
            want = np.array(prescribed.values)
            load = float(np.max(np.abs(got - want)) / np.max(want))
        return {
            "gap_in_contact": inside / scale,
            "penetration_outside": outside / scale,
            "complementarity": product / scale,
            "negative_pressure": 0.0,
            "load": load,
        }

    def _covered(self, xs: list[Array], ys: list[Array]) -> NDArray[np.bool_]:
        """Return which of the points around each zone lie in the contact of any zone."""
        zones = [n.zone for n in self.smooth.nodes]
        centres = np.array([z.centre for z in zones])
        size = np.array([1.4 * np.max(np.linalg.svd(z.axes, compute_uv=False)) for z in zones])
        out = []
        for x, y, centre in zip(xs, ys, centres, strict=True):
            spread = float(np.max(np.hypot(x - centre[0], y - centre[1])))
            inside = np.zeros(len(x), dtype=bool)
            for j in np.flatnonzero(np.hypot(*(centres - centre).T) < spread + size):
                inside |= zones[j].pressure(x, y) > 0.0
            out.append(inside)
        return np.concatenate(out)

    def _scatter(self, values: ArrayLike) -> Array:
        values = np.asarray(values, dtype=float)
        out = np.zeros((self.problem.size, *values.shape[1:]))
        out[list(self.touching)] = values
        return out


def _maximum(n: Nodes, near: int) -> float:
    """Return the largest pressure of a zone, by a quadratic model of P about its centre and the best node."""
    zone = n.zone
    xi, eta = n.xi[near], n.eta[near]
    e = 1e-3
    for _ in range(20):
        px = np.array([xi, xi + e, xi - e, xi, xi, xi + e, xi - e])
        py = np.array([eta, eta, eta, eta + e, eta - e, eta + e, eta - e])
        v = zone.squared_pressure(px, py)
        grad = np.array([v[1] - v[2], v[3] - v[4]]) / (2 * e)
        mixed = (v[5] + v[6] - v[1] - v[2] - v[3] - v[4] + 2 * v[0]) / (2 * e * e)
        hess = np.array([[(v[1] + v[2] - 2 * v[0]) / e**2, mixed], [mixed, (v[3] + v[4] - 2 * v[0]) / e**2]])
        move = -np.linalg.solve(hess, grad)
        if not np.all(np.isfinite(move)) or np.max(np.abs(move)) > 0.5:
            break
        xi, eta = xi + move[0], eta + move[1]
        if np.max(np.abs(move)) < 1e-9:
            break
    best = float(zone.squared_pressure(np.array([xi]), np.array([eta]))[0])
    return float(np.sqrt(max(best, float(np.max(n.pressure)) ** 2)))
