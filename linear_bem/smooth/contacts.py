"""Solved smooth contacts: pressures, displacement anywhere on the surface, outlines, forces, residuals."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from linear_bem.arrays import Array
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import deepest, force_error
from linear_bem.problem import Problem
from linear_bem.profiles import gradient, height
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.displacement import (
    FEW,
    DirectSums,
    displacement_in_cell,
    displacement_of_many,
    zone_displacement,
)
from linear_bem.smooth.multipole import Interaction
from linear_bem.smooth.newton import SmoothSolution
from linear_bem.smooth.zone import Zone
from linear_bem.touching import wrapped

EVALUATED, EVALUATED_OF_MANY = 1e-7, 1e-6
"""Relative error of the displacement in recomputed residuals, and the same for a sample of very many balls."""
CHECKED, SAMPLED, NEIGHBOURS = 100, 16, 6
"""Largest number of balls that are all recomputed by direct sums; sizes of a sample's part and of a neighbourhood."""
FRAME = 1.31
"""Largest distance of a contact from its frame's centre, over the frame's reach; see `Zone.pressure`."""
RINGS = (1.03, 1.12, 2.0)
"""Distances of the checks for penetration outside a contact, over that of its outline; a body may have a kink there."""


@dataclass(frozen=True, eq=False)
class SmoothContacts:
    """Separate smooth contacts; ``touching`` lists the loaded balls in the order of the zones.

    All numbers are SI. ``normal_forces``, ``approaches`` and the tangential forces have one entry per ball of
    the problem; forces are zero for balls that do not touch. ``report`` receives progress lines.
    """

    problem: Problem
    kernel: LayeredKernel
    touching: tuple[int, ...]
    smooth: SmoothSolution
    approaches: Array
    precision: float = 1e-11
    report: Report = field(default=silent, repr=False, compare=False)
    sampled: int | None = None

    @property
    def unknowns(self) -> int:
        """Number of pressure coefficients."""
        return self.zones.coefficients.size

    @property
    def zones(self) -> Zone:
        """The contact zones."""
        return self.smooth.nodes.zone

    @property
    def iterations(self) -> int:
        """Newton steps or sweeps taken."""
        return self.smooth.iterations

    @cached_property
    def normal_forces(self) -> Array:
        """Normal force on every ball [N]."""
        return self._scatter(self.smooth.nodes.forces / self.kernel.singular)

    @cached_property
    def mutual_force(self) -> Array:
        """T on every ball [N] by the mutual formula, see `Interaction.force`, shape (balls, 2)."""
        report = seldom(self.report, "T: ")
        return self._scatter(Interaction(self.kernel, self.smooth.nodes, self.precision, report).force())

    @cached_property
    def slope_force(self) -> Array:
        """T on every ball [N] by the paper's slope integral (eq. 13), -int p grad f dA, shape (balls, 2)."""
        report, total = seldom(self.report, "T: "), []
        for i, n in zip(self.touching, self.smooth.nodes, strict=True):
            total.append([-n.loads @ slope for slope in gradient(self.problem.balls[i], n.x, n.y)])
            report(f"{len(total)} of {len(self.touching)} slope integrals")
        return self._scatter(np.array(total) / self.kernel.singular)

    @cached_property
    def peak_pressures(self) -> Array:
        """Largest contact pressure under every ball [Pa]."""
        nodes = self.smooth.nodes
        best = np.argmax(nodes.pressure, axis=1)[:, None]
        xi, eta = (np.take_along_axis(v, best, 1)[:, 0] for v in (nodes.xi, nodes.eta))
        return self._scatter(np.sqrt(np.maximum(nodes.zone.peaks(xi, eta), 0.0)) / self.kernel.singular)

    @cached_property
    def contact_areas(self) -> Array:
        """Contact area of every ball [m^2]."""
        return self._scatter(np.sum(self.smooth.nodes.weights, axis=1))

    @property
    def elastic_energy(self) -> float:
        """Elastic energy [J], half the work of the contact pressure."""
        total = 0.0
        for i, n in zip(self.touching, self.smooth.nodes, strict=True):
            w = self.approaches[i] - height(self.problem.balls[i])(n.x, n.y)  # the surface follows the ball
            total += 0.5 * float(n.loads @ w) / self.kernel.singular
        return total

    @property
    def resolution(self) -> float:
        """0: the pressure is smooth."""
        return 0.0

    def point_loads(self, depth: float) -> tuple[Array, Array, Array]:
        """Return positions x, y [m] and point loads [N] that replace the pressure for fields at a depth [m]."""
        loads = []
        for zone in self.zones:
            fine = int(np.clip(4.0 * zone.radius / depth, 1.0, 130.0))
            xi, eta, w, p = zone.quadrature(10 + fine, 24 + 6 * fine)
            loads.append((*zone.points(xi, eta), w * p / self.kernel.singular))
        x, y, load = (np.concatenate(parts) for parts in zip(*loads, strict=True))
        return x, y, load

    def outline(self, ball: int, count: int = 64) -> tuple[Array, Array]:
        """Return points x, y [m] on the edge of one ball's contact (empty if it does not touch)."""
        if ball not in self.touching:
            return np.empty(0), np.empty(0)
        return self.zones[self.touching.index(ball)].outline(count)

    def pressure(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the contact pressure [Pa] at surface points [m]."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        flat, total = np.stack([x.ravel(), y.ravel()], axis=1), np.zeros(x.size)
        cell, centres = self.kernel.cell, wrapped(self.zones.centre, self.problem.cell)
        tree = cKDTree(wrapped(flat, self.problem.cell), boxsize=self.problem.cell)
        for zone, close in zip(self.zones, tree.query_ball_point(centres, FRAME * self.zones.reach), strict=True):
            if close:
                at = flat[close] if cell is None else zone.centre + cell.nearest(flat[close] - zone.centre)
                total[close] += zone.pressure(*at.T)
        return total.reshape(x.shape) / self.kernel.singular

    def displacement(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the surface displacement [m], positive into the layer, at any surface points [m]."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        flat_x, flat_y = x.ravel(), y.ravel()
        nodes = self.smooth.nodes
        if self.kernel.cell is not None:
            return displacement_in_cell(self.kernel, nodes, flat_x, flat_y).reshape(x.shape)
        if len(nodes) <= FEW:
            total = sum(zone_displacement(self.kernel, n, flat_x, flat_y) for n in nodes)
        else:
            total = displacement_of_many(self.kernel, nodes, flat_x, flat_y)
        return np.asarray(total).reshape(x.shape)

    @cached_property
    def sample(self) -> tuple[int, ...]:
        """Indices in ``touching`` of the balls whose equations are recomputed by direct sums: all, or some of many.

        Of more than `CHECKED` balls, or if ``sampled`` is set: ``sampled`` balls (by default `SAMPLED`) at equal steps
        of their index, and a quarter as many with the largest of each: T, normal force, contact width, contact width
        over ball radius, and nearness to a neighbour's contact.
        """
        nodes, count = self.smooth.nodes, self.sampled or SAMPLED
        if self.sampled is None and len(nodes) <= CHECKED:
            return tuple(range(len(nodes)))
        reach, places = self.zones.reach, wrapped(self.zones.centre, self.problem.cell)
        among = np.arange(min(NEIGHBOURS + 1, len(nodes))) + 1  # an array, so that even a single contact gives columns
        away, near = cKDTree(places, boxsize=self.problem.cell).query(places, among)
        touching = list(self.touching)
        sizes = (
            np.hypot(*self.mutual_force[touching].T),
            self.normal_forces[touching],
            reach,
            reach / np.array([self.problem.balls[ball].radius for ball in touching]),
            np.max((reach[:, None] + reach[near[:, 1:]]) / away[:, 1:], axis=1, initial=0.0),
        )
        chosen = set(np.linspace(0, len(nodes) - 1, min(count, len(nodes))).astype(int).tolist())
        for size in sizes:
            shares = np.round(size / (np.max(size) or 1.0), 9)  # so that roundoff does not choose between equal balls
            chosen |= set(np.argsort(-shares, kind="stable")[: count // 4].tolist())
        return tuple(sorted(chosen))

    @cached_property
    def direct(self) -> DirectSums:
        """Direct sums over all contacts; its nodes take memory."""
        few = len(self.smooth.nodes) <= CHECKED
        precision = EVALUATED if few else EVALUATED_OF_MANY
        return DirectSums(self.kernel, self.smooth.nodes, precision, seldom(self.report, "direct sums: "))

    @cached_property
    def _checks(self) -> tuple[Array, Array, Array]:
        """Points x, y [m] of checks about every ball of the `sample`, those inside first, and p over its peak there."""
        nodes = self.smooth.nodes[np.array(self.sample)]
        zones, centre = nodes.zone, nodes.zone.centre.T[:, :, None]
        xi, eta, _, p = zones.quadrature(3, 5)
        edge = np.stack(zones.outline(7))
        around = np.concatenate([centre + ring * (edge - centre) for ring in RINGS], axis=2)
        x, y = np.concatenate([np.stack(zones.points(xi, eta)), around], axis=2)
        return x, y, p / np.max(nodes.pressure, axis=1)[:, None]

    def _gaps(self, part: slice) -> Array:
        """Return the gaps [m] at a part of the points of checks, shape (sample, points)."""
        x, y, _ = self._checks
        gap, report = [], seldom(self.report, "residuals: ")
        for done, k in enumerate(self.sample):
            report(f"{done} of {len(self.sample)} contacts")
            ball = self.touching[k]
            depth = self.approaches[ball] - height(self.problem.balls[ball])(x[done, part], y[done, part])
            spread = float(np.max(np.hypot(*(np.stack([x[done], y[done]], axis=1) - self.direct.centres[k]).T)))
            gap.append(self.direct.displacement(k, x[done, part], y[done, part], spread=spread) - depth)
        return np.array(gap)

    @cached_property
    def _gaps_inside(self) -> Array:
        return np.abs(self._gaps(slice(self._checks[2].shape[1])))

    @property
    def gaps_in_contact(self) -> Array:
        """Largest |gap| [m] in the contact of every ball of the `sample`."""
        return np.max(self._gaps_inside, axis=1)

    @property
    def gap_in_contact(self) -> float:
        """That of `certificate`, without the rest of it, which takes longer."""
        return float(np.max(self.gaps_in_contact)) / deepest(self.approaches)

    @cached_property
    def certificate(self) -> dict[str, float]:
        """Residuals recomputed around every ball of the `sample`, at points and nodes that the solver does not use.

        ``gap_in_contact`` max |gap| where p > 0 and ``penetration_outside`` max overlap outside, both over the
        largest approach; ``complementarity`` max p |gap| over peak pressure and approach; ``load`` the relative
        error of the prescribed forces; ``negative_pressure`` is 0: p is a square root. The relative error of the
        displacement is `EVALUATED` (`EVALUATED_OF_MANY`).
        """
        scale = deepest(self.approaches)
        x, y, p = self._checks
        outside = slice(p.shape[1], None)
        free = self.pressure(x[:, outside], y[:, outside]) == 0.0
        return {
            "gap_in_contact": self.gap_in_contact,
            "penetration_outside": float(np.max(-self._gaps(outside)[free], initial=0.0)) / scale,
            "complementarity": float(np.max(self._gaps_inside * p)) / scale,
            "negative_pressure": 0.0,
            "load": force_error(self.problem.load, self.normal_forces),
        }

    def _scatter(self, values: ArrayLike) -> Array:
        values = np.asarray(values, dtype=float)
        out = np.zeros((self.problem.size, *values.shape[1:]))
        out[list(self.touching)] = values
        return out
