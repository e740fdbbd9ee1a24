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

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.profiles import Height
from linear_bem.smooth.polynomials import basis
from linear_bem.smooth.zone import Zone, stacked, unstacked
from linear_bem.smooth.zone_stack import ZoneStack

DIVERGED = 1e6
"""Relative step of the coefficients, or growth of the approaches, that counts as divergence."""
STALLED = 1e-3
"""Largest last change of an unconverged state that may start the next degree."""


@dataclass(frozen=True)
class Rule:
    """Numbers of quadrature nodes: along rays, of rays, of chord directions, along chords."""

    radial: int
    angular: int
    directions: int
    along: int

    @classmethod
    def of(cls, zones: Sequence[Zone] | ZoneStack, thickness: float, more: int = 0) -> Rule:
        """Return a rule for zones of one degree; ``more`` raises it.

        Contact radius over layer thickness sets the nodes for the smooth kernel; an ellipse of aspect k has chords
        whose weights converge like ((k - 1)/(k + 1))^directions.
        """
        stack = zones if isinstance(zones, ZoneStack) else stacked(zones)
        degree = stack.degree + more
        axes = np.linalg.svd(stack.axes, compute_uv=False)
        rough = int(min(40.0, 3.0 * float(np.max(axes)) / thickness))
        flat = float(np.max((axes[:, 0] - axes[:, 1]) / (axes[:, 0] + axes[:, 1])))
        directions = int(np.clip(23.0 / -np.log(max(flat, 1e-9)), degree + 6, 300))
        return cls(degree // 2 + 6 + rough, 2 * degree + 6 + 2 * rough, directions, degree // 2 + 5)


Arrays = tuple[Array, Array, Array, Array, Array, Array]


def _six(arrays: Iterable[Array]) -> Arrays:
    xi, eta, x, y, weights, pressure = arrays
    return xi, eta, x, y, weights, pressure


@dataclass(frozen=True)
class Quadrature:
    """Nodes in a zone (nodes,) or in many (zones, nodes): frame and surface coordinates [m], weights [m^2], p."""

    xi: Array
    eta: Array
    x: Array
    y: Array
    weights: Array
    pressure: Array

    @property
    def arrays(self) -> Arrays:
        """The six arrays in the order of the constructor."""
        return self.xi, self.eta, self.x, self.y, self.weights, self.pressure

    @property
    def loads(self) -> Array:
        """Point loads at the nodes (weight times p)."""
        return self.weights * self.pressure

    @property
    def forces(self) -> Array:
        """Integrals of the pressure, one per zone."""
        return np.asarray(np.sum(self.loads, axis=-1))


@dataclass(frozen=True)
class Nodes(Quadrature):
    """One zone with its quadrature, and d p/d P phi_k (nodes, terms)."""

    zone: Zone
    variations: Array

    @classmethod
    def of(cls, zone: Zone, rule: Rule) -> Nodes:
        """Return the nodes of a zone."""
        return NodeStack.of(stacked([zone]), rule).single()[0]

    def moved(self, shift: Array) -> Nodes:
        """Return the nodes of an image, shifted by (2,) [m]."""
        zone = replace(self.zone, centre=self.zone.centre + shift)
        return replace(self, zone=zone, x=self.x + shift[0], y=self.y + shift[1])

    @property
    def force(self) -> float:
        """Integral of the pressure."""
        return float(self.forces)


@dataclass(frozen=True)
class NodeStack(Quadrature):
    """Zones of one degree with their quadrature."""

    zones: ZoneStack

    @classmethod
    def of(cls, zones: ZoneStack, rule: Rule) -> NodeStack:
        """Return the nodes of many zones."""
        xi, eta, weights, pressure = zones.quadrature(rule.radial, rule.angular)
        return cls(xi, eta, *zones.points(xi, eta), weights, pressure, zones=zones)

    @classmethod
    def joined(cls, nodes: Sequence[Nodes]) -> NodeStack:
        """Return zones of one degree and one rule together."""
        return cls(
            *_six(map(np.array, zip(*(n.arrays for n in nodes), strict=True))), zones=stacked([n.zone for n in nodes])
        )

    def followed_by(self, other: NodeStack) -> NodeStack:
        """Return these zones and others of their degree and rule."""
        a, b = self.zones, other.zones
        zones = (np.concatenate([getattr(z, k) for z in (a, b)]) for k in ("centre", "axes", "coefficients"))
        centre, axes, coefficients = zones
        arrays = _six(map(np.concatenate, zip(self.arrays, other.arrays, strict=True)))
        return NodeStack(*arrays, zones=ZoneStack(centre, axes, a.degree, coefficients))

    def __getitem__(self, part: slice | Indices | Mask) -> NodeStack:
        return NodeStack(*_six(values[part] for values in self.arrays), zones=self.zones[part])

    def single(self) -> tuple[Nodes, ...]:
        """Return the zones one by one."""
        out = []
        for zone, *arrays in zip(unstacked(self.zones), *self.arrays, strict=True):
            variations = 0.5 * basis(arrays[0], arrays[1], zone.degree).T / arrays[-1][:, None]
            out.append(Nodes(*_six(arrays), zone=zone, variations=variations))
        return tuple(out)


@dataclass(frozen=True)
class SmoothSolution:
    """Converged zones with their nodes, the approaches [m], and iterations and residual of the solver.

    Pressures p are multiplied by `LayeredKernel.singular`: int p (1/r + s) dA is the displacement [m].
    """

    nodes: tuple[Nodes, ...]
    approaches: Array
    iterations: int
    residual: float


def own_displacement(kernel: LayeredKernel, n: Nodes, rule: Rule) -> tuple[Array, Array]:
    """Return a zone's own displacement [m] at its nodes, and its derivative by the coefficients (nodes, terms)."""
    w, derivative = n.zone.half_space(n.xi, n.eta, rule.directions, rule.along)
    if kernel.homogeneous:
        return w, derivative
    smooth = kernel.smooth(np.hypot(n.x[:, None] - n.x, n.y[:, None] - n.y)) * n.weights
    return w + smooth @ n.pressure, derivative + smooth @ n.variations


def _displacements(kernel: LayeredKernel, nodes: list[Nodes], rule: Rule) -> tuple[list[Array], list[list[Array]]]:
    """Return K p at every zone's nodes, and its derivative by every zone's coefficients."""
    own = [own_displacement(kernel, n, rule) for n in nodes]
    total = [w for w, _ in own]
    derivative = [[change] * len(nodes) for _, change in own]
    for i, here in enumerate(nodes):
        for j, there in enumerate(nodes[:i]):
            r = np.hypot(here.x[:, None] - there.x, here.y[:, None] - there.y)
            block = kernel.scaled(r)
            for a, b, influence in ((i, j, block), (j, i, block.T)):
                weighted = influence * nodes[b].weights
                total[a] = total[a] + weighted @ nodes[b].pressure
                derivative[a][b] = weighted @ nodes[b].variations
    return total, derivative


def stalled(history: list[float]) -> bool:
    """Return whether a small change no longer shrinks.

    The derivative neglects that the test functions move with the edge. The convergence rate is therefore of the size of
    the remaining gap: a degree too low for the pressure slows Newton's method; the next degree leaves a smaller gap.
    """
    return len(history) > 10 and history[-1] < STALLED and history[-1] > 0.3 * max(history[-4:-1])


def solve_zones(
    kernel: LayeredKernel,
    shapes: list[Height],
    zones: list[Zone],
    approaches: Array,
    groups: Groups,
    tolerance: float,
    limit: int = 25,
) -> SmoothSolution:
    """Return the contact state, at which the complementary energy is stationary.

    Balls in no group of ``groups`` keep their approach. ``tolerance`` bounds the last step of the coefficients relative
    to P; a step that is `stalled`, or is below `STALLED` after ``limit`` steps, is returned as the residual. Raises
    `NotConverged`.
    """
    approaches = approaches.copy()
    first = float(np.max(np.abs(approaches)))
    step = np.inf
    history: list[float] = []
    for iteration in range(limit):
        rule = Rule.of(zones, kernel.thickness)
        nodes = [Nodes.of(z, rule) for z in zones]
        history.append(step)
        if step < tolerance or stalled(history) or (iteration == limit - 1 and step < STALLED):
            return SmoothSolution(tuple(nodes), approaches, iteration, step)
        with np.errstate(all="ignore"):  # a diverging iteration may overflow before the loop ends
            delta, change = _newton_step(kernel, shapes, nodes, approaches, groups, rule)
        if not np.all(np.isfinite(delta)):
            break
        step = max(float(np.max(np.abs(d)) / np.max(np.abs(z.coefficients))) for d, z in zip(delta, zones, strict=True))
        length = min(1.0, 0.6 / step)
        approaches = approaches + length * change
        zones = [
            replace(z, coefficients=z.coefficients + length * d).reframed(z.degree)
            for d, z in zip(delta, zones, strict=True)
        ]
        if not max(step, float(np.max(np.abs(approaches))) / first) < DIVERGED:
            break
    raise NotConverged(
        f"smooth contact: Newton's method did not converge in {limit} steps (last relative step {step:.1e}, "
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
    nodes: list[Nodes],
    approaches: Array,
    groups: Groups,
    rule: Rule,
) -> tuple[Array, Array]:
    """Return the changes of all coefficients, shape (zones, terms), and of all approaches."""
    potential, derivative = _displacements(kernel, nodes, rule)
    tests = [n.variations.T * n.weights for n in nodes]
    blocks = np.array([[test @ change for change in row] for test, row in zip(tests, derivative, strict=True)])
    right = [
        -test @ (w - d + f(n.x, n.y))
        for n, test, w, d, f in zip(nodes, tests, potential, approaches, shapes, strict=True)
    ]
    totals = np.array([test.sum(axis=1) for test in tests])
    return solve_grouped(blocks, np.array(right), totals, [n.force for n in nodes], groups)


def solve_grouped(
    blocks: Array, right: Array, totals: Array, forces: Sequence[float] | Array, groups: Groups
) -> tuple[Array, Array]:
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
