r"""Newton's method for smooth contacts: every ball's p^2 is a polynomial, whose zero line is the contact's edge.

The unknowns are the coefficients of P_i (p_i = sqrt(P_i), see `linear_bem.smooth.zone`) and, where forces are
given, the approaches. The equations are stationarity of the complementary energy
1/2 <p, K p> - <p, D - f> in these coefficients:

    int phi_k/(2 p_i) [sum_j K p_j - D_i + f_i] dA = 0,

which is K p = D - f inside the contact tested with the variations of p in the polynomial space (they are singular like
an inverse square root at the edge, because they move the edge). Forces and energy are therefore correct to second order
in the error of p.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from linear_bem.arrays import Array, Indices, Mask, hypotenuse
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.profiles import Height
from linear_bem.smooth.polynomials import basis
from linear_bem.smooth.zone import Zone, stacked

DIVERGED = 1e6
"""Relative step of the coefficients, or growth of the approaches, that counts as divergence."""
STALLED, LIMIT = 1e-3, 25
"""Largest last change of an unconverged state that may start the next degree; largest number of steps."""
SETTLED = 1e-3
"""Relative change of P up to which its frame, and the matrix of Newton's method with few balls, are kept."""


@dataclass(frozen=True)
class Rule:
    """Numbers of quadrature nodes: along rays, of rays, of chord directions, along chords."""

    radial: int
    angular: int
    directions: int
    along: int

    @classmethod
    def of(cls, zone: Zone, thickness: float, more: int = 0) -> Rule:
        """Return a rule for one zone or many; ``more`` raises the degree.

        Contact radius over layer thickness sets the nodes for the smooth kernel; an ellipse of aspect k^2 has chords
        whose weights converge like ((k - 1)/(k + 1))^directions.
        """
        degree = zone.degree + more
        long, short = np.moveaxis(np.linalg.svd(zone.axes, compute_uv=False), -1, 0)
        aspect = np.sqrt(long / short)
        rough = int(min(40.0, 3.0 * float(np.max(long)) / thickness))
        flat = float(np.max((aspect - 1.0) / (aspect + 1.0)))
        directions = int(np.clip(degree + 23.0 / -np.log(max(flat, 1e-9)), degree + 6, 300))
        return cls(degree // 2 + 6 + rough, 2 * degree + 6 + 2 * rough, directions, degree // 2 + 5)


@dataclass(frozen=True, eq=False)
class Nodes:
    """One zone or many with their quadrature: frame and surface coordinates [m], weights [m^2] and p at the nodes."""

    zone: Zone
    xi: Array
    eta: Array
    x: Array
    y: Array
    weights: Array
    pressure: Array

    @classmethod
    def of(cls, zone: Zone, rule: Rule) -> Nodes:
        """Return the nodes of one zone or many."""
        xi, eta, weights, pressure = zone.quadrature(rule.radial, rule.angular)
        return cls(zone, xi, eta, *zone.points(xi, eta), weights, pressure)

    @classmethod
    def joined(cls, nodes: Sequence[Nodes]) -> Nodes:
        """Return zones of one degree and one rule, given one by one, together."""
        return cls(stacked([n.zone for n in nodes]), *map(np.array, zip(*(n._arrays for n in nodes), strict=True)))

    @property
    def _arrays(self) -> tuple[Array, ...]:
        return self.xi, self.eta, self.x, self.y, self.weights, self.pressure

    def __len__(self) -> int:
        return len(self.zone)

    def __getitem__(self, part: int | slice | Indices | Mask) -> Nodes:
        return Nodes(self.zone[part], *(values[part] for values in self._arrays))

    def __iter__(self) -> Iterator[Nodes]:
        return (self[k] for k in range(len(self)))

    def moved(self, shift: Array) -> Nodes:
        """Return the nodes of images, shifted by (..., 2) [m]."""
        zone = replace(self.zone, centre=self.zone.centre + shift)
        return replace(self, zone=zone, x=self.x + shift[..., :1], y=self.y + shift[..., 1:])

    @property
    def loads(self) -> Array:
        """Point loads at the nodes (weight times p)."""
        return self.weights * self.pressure

    @property
    def forces(self) -> Any:
        """Integral of the pressure, of many zones an array."""
        return np.sum(self.loads, axis=-1)

    @cached_property
    def variations(self) -> Array:
        """The derivatives d p/d P phi_k, shape (..., nodes, terms)."""
        phi = np.moveaxis(basis(self.xi, self.eta, self.zone.degree), 0, -1)
        return np.asarray(0.5 * phi / self.pressure[..., None])

    @property
    def tests(self) -> Array:
        """The variations times their weights, shape (..., terms, nodes): they integrate functions at the nodes."""
        return np.swapaxes(self.variations, -1, -2) * self.weights[..., None, :]


@dataclass(frozen=True, eq=False)
class SmoothSolution:
    """Converged zones with their nodes, all approaches [m], and iterations and residual of the solver.

    Pressures p are multiplied by `LayeredKernel.singular`: int p (1/r + s) dA is the displacement [m].
    """

    nodes: Nodes
    approaches: Array
    iterations: int
    residual: float


def own_displacement(kernel: LayeredKernel, n: Nodes, rule: Rule, renew: bool = True) -> tuple[Array, Array]:
    """Return every zone's own displacement [m] at its nodes, and its derivative by the coefficients.

    Shapes (zones, nodes) and (zones, nodes, terms); without ``renew`` the latter has no terms.
    """
    w, derivative = n.zone.half_space(n.xi, n.eta, rule.directions, rule.along, renew)
    if kernel.homogeneous:
        return w, derivative
    r = hypotenuse(n.x[:, :, None] - n.x[:, None, :], n.y[:, :, None] - n.y[:, None, :])
    smooth = kernel.smooth(r) * n.weights[:, None, :]
    return w + (smooth @ n.pressure[..., None])[..., 0], derivative + smooth @ n.variations[..., : derivative.shape[-1]]


def _displacements(kernel: LayeredKernel, n: Nodes, rule: Rule, renew: bool) -> tuple[Array, Array]:
    """Return K p at every zone's nodes, and its derivatives by the coefficients, (zones, zones, nodes, terms).

    Without ``renew`` the derivatives have no terms.
    """
    total, own = own_displacement(kernel, n, rule, renew)
    count = len(n)
    derivative = np.empty((count, count, *own.shape[1:]))
    derivative[np.arange(count), np.arange(count)] = own
    for i, j in combinations(range(count), 2):
        block = kernel.scaled(hypotenuse(n.x[i][:, None] - n.x[j], n.y[i][:, None] - n.y[j]))
        for a, b, influence in ((i, j, block), (j, i, block.T)):
            weighted = influence * n.weights[b]
            total[a] += weighted @ n.pressure[b]
            derivative[a, b] = weighted @ n.variations[b][:, : own.shape[-1]]
    return total, derivative


def stalled(history: list[float]) -> bool:
    """Return whether a small change no longer shrinks.

    The derivative neglects that the test functions move with the edge. The convergence rate is therefore of the size of
    the remaining gap: a degree too low for the pressure slows Newton's method; the next degree leaves a smaller gap.
    """
    return len(history) > 10 and history[-1] < STALLED and history[-1] > 0.3 * max(history[-4:-1])


def solve_zones(
    kernel: LayeredKernel, shapes: list[Height], zones: Zone, approaches: Array, groups: Groups, tolerance: float
) -> SmoothSolution:
    """Return the contact state, at which the complementary energy is stationary.

    Balls in no group of ``groups`` keep their approach. ``tolerance`` bounds the last step of the coefficients relative
    to P; a step that is `stalled`, or is below `STALLED` after `LIMIT` steps, is returned as the residual. Raises
    `NotConverged`.
    """
    approaches = approaches.copy()
    first = float(np.max(np.abs(approaches)))
    step = np.inf
    history: list[float] = []
    blocks: Array | None = None
    for iteration in range(LIMIT):
        rule = Rule.of(zones, kernel.thickness)
        nodes = Nodes.of(zones, rule)
        history.append(step)
        if step < tolerance or stalled(history) or (iteration == LIMIT - 1 and step < STALLED):
            return SmoothSolution(nodes, approaches, iteration, step)
        with np.errstate(all="ignore"):  # a diverging iteration may overflow before the loop ends
            delta, change, blocks = _newton_step(kernel, shapes, nodes, approaches, groups, rule, blocks)
        if not np.all(np.isfinite(delta)):
            break
        step = float(np.max(np.max(np.abs(delta), axis=1) / np.max(np.abs(zones.coefficients), axis=1)))
        length = min(1.0, 0.6 / step)
        approaches = approaches + length * change
        zones = replace(zones, coefficients=zones.coefficients + length * delta)
        if step > SETTLED:
            zones, blocks = zones.reframed(zones.degree), None
        if not max(step, float(np.max(np.abs(approaches))) / first) < DIVERGED:
            break
    raise NotConverged(
        f"smooth contact: Newton's method did not converge in {LIMIT} steps (last relative step {step:.1e}, "
        f"tolerance {tolerance:.1e})"
    )


def solve_scaled(matrix: Array, right: Array, size: Array) -> Array:
    """Solve one or many systems, with rows and columns scaled by ``size``, and return the solutions.

    ``right`` has the shape (..., terms) or (..., terms, right sides). Raises `NotConverged`.
    """
    columns = right[..., None] if right.ndim == size.ndim else right
    try:
        solution = np.linalg.solve(matrix / size[..., :, None] / size[..., None, :], columns / size[..., None])
    except np.linalg.LinAlgError as singular:
        raise NotConverged(
            "smooth contact: the equations of Newton's method are singular, as where contacts merge or vanish during "
            "the iteration; press balls less deep or closer to equal depth"
        ) from singular
    return np.asarray((solution / size[..., None]).reshape(right.shape))


def _newton_step(
    kernel: LayeredKernel,
    shapes: list[Height],
    nodes: Nodes,
    approaches: Array,
    groups: Groups,
    rule: Rule,
    blocks: Array | None,
) -> tuple[Array, Array, Array]:
    """Return the changes of all coefficients, shape (zones, terms), and of all approaches, and the matrix in blocks.

    ``blocks`` are those of an earlier step in the same frames, which cost half of a step; None where there are none.
    """
    potential, derivative = _displacements(kernel, nodes, rule, blocks is None)
    tests = nodes.tests
    heights = np.array([f(x, y) for f, x, y in zip(shapes, nodes.x, nodes.y, strict=True)])
    right = -np.einsum("ntk,nk->nt", tests, potential - approaches[:, None] + heights)
    blocks = tests[:, None] @ derivative if blocks is None else blocks
    return *solve_grouped(blocks, right, tests.sum(axis=2), nodes.forces, groups), blocks


def solve_grouped(blocks: Array, right: Array, totals: Array, forces: Array, groups: Groups) -> tuple[Array, Array]:
    """Return the changes of all coefficients, shape (zones, terms), and of all approaches, shape (zones,).

    ``blocks`` (zones, zones, terms, terms) and ``right`` (zones, terms) hold the equations at fixed approaches.
    ``totals`` (zones, terms), the derivatives of the ``forces``, couple them to the unknown approaches of ``groups``.
    """
    count, terms = right.shape
    size = count * terms
    matrix, values = np.zeros((size + len(groups), size + len(groups))), np.zeros(size + len(groups))
    matrix[:size, :size] = blocks.transpose(0, 2, 1, 3).reshape(size, size)
    values[:size] = right.ravel()
    # every zone's rows and columns are scaled by its own size, so that balls of any size share one matrix
    scale = np.ones(size + len(groups))
    scale[:size] = np.sqrt(np.abs(np.diag(matrix)[:size]))
    for at, (members, force) in enumerate(groups, start=size):
        row = np.zeros_like(totals)
        row[members] = totals[members]
        matrix[at, :size], matrix[:size, at] = row.ravel(), -row.ravel()
        values[at] = force - sum(float(forces[i]) for i in members)
        scale[at] = float(np.max(np.abs(matrix[at, :size]) / scale[:size])) or 1.0
    answer = solve_scaled(matrix, values, scale)
    change = np.zeros(count)
    for at, (members, _) in enumerate(groups, start=size):
        change[members] = answer[at]
    return answer[:size].reshape(count, terms), change
