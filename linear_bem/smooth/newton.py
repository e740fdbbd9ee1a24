r"""Newton's method for smooth contacts: every ball's p^2 is a polynomial, and the edge follows from it.

The unknowns are the coefficients of P_i (p_i = sqrt(P_i), see `linear_bem.smooth.zone`) and, where forces are
given, the approaches. The equations are stationarity of the complementary energy
1/2 <p, K p> - <p, D - f> in these coefficients:

    int phi_k/(2 p_i) [sum_j K p_j - D_i + f_i] dA = 0,

which is K p = D - f inside the contact tested with the changes of p that the space allows (they have
the inverse square root at the edge: moving the edge is one of them). Forces and energy are therefore
correct to second order in the error of p.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.smooth.zone import Zone, basis

Array = NDArray[np.float64]
Shape = Callable[[Array, Array], Array]

DIVERGED = 1e6
"""Relative step of the coefficients, or growth of the approaches, after which there is no way back."""
STALLED = 1e-3
"""Largest last change that may be handed on to the next degree."""


@dataclass(frozen=True)
class Rule:
    """How many quadrature nodes: on rays, around, chord directions, along chords."""

    radial: int
    angular: int
    directions: int
    along: int

    @classmethod
    def of(cls, zones: Sequence[Zone], thickness: float, more: int = 0) -> Rule:
        """Return a rule for zones of one degree; ``more`` raises it.

        Contact radius over layer thickness sets the nodes for the smooth kernel; an ellipse of aspect k has chords
        whose weights converge like ((k - 1)/(k + 1))^directions.
        """
        degree = zones[0].degree + more
        axes = np.array([np.linalg.svd(z.axes, compute_uv=False) for z in zones])
        rough = int(min(40.0, 3.0 * float(np.max(axes)) / thickness))
        flat = float(np.max((axes[:, 0] - axes[:, 1]) / (axes[:, 0] + axes[:, 1])))
        directions = int(np.clip(23.0 / -np.log(max(flat, 1e-9)), degree + 6, 300))
        return cls(degree // 2 + 6 + rough, 2 * degree + 6 + 2 * rough, directions, degree // 2 + 5)


@dataclass(frozen=True)
class Nodes:
    """One zone with its quadrature: surface points x, y [m], weights [m^2], pressure, and d p/d P phi_k."""

    zone: Zone
    xi: Array
    eta: Array
    x: Array
    y: Array
    weights: Array
    pressure: Array
    variations: Array

    @classmethod
    def of(cls, zone: Zone, rule: Rule) -> Nodes:
        """Return the nodes of a zone."""
        xi, eta, weights, pressure = zone.quadrature(rule.radial, rule.angular)
        x, y = zone.points(xi, eta)
        variations = 0.5 * basis(xi, eta, zone.degree).T / pressure[:, None]
        return cls(zone, xi, eta, x, y, weights, pressure, variations)

    @property
    def force(self) -> float:
        """Integral of the pressure."""
        return float(self.weights @ self.pressure)


@dataclass(frozen=True)
class SmoothSolution:
    """Converged zones with their nodes, the approaches [m] and the account of Newton's method.

    Pressures are in units of 1/`LayeredKernel.singular`: int p (1/r + s) dA is the displacement [m].
    """

    nodes: tuple[Nodes, ...]
    approaches: Array
    iterations: int
    residual: float


def distances(a: Nodes, b: Nodes) -> Array:
    """Return the distances [m] between the nodes of two zones."""
    return np.hypot(a.x[:, None] - b.x, a.y[:, None] - b.y)


def _pairs(kernel: LayeredKernel, nodes: list[Nodes]) -> dict[tuple[int, int], Array]:
    """Return the kernel between the nodes of every two zones, once for both directions."""
    out = {}
    for i, a in enumerate(nodes):
        for j in range(i):
            r = distances(a, nodes[j])
            out[i, j] = 1.0 / r + kernel.smooth(r)
            out[j, i] = out[i, j].T
    return out


def displacements(kernel: LayeredKernel, nodes: list[Nodes], rule: Rule) -> tuple[list[Array], list[list[Array]]]:
    """Return K p at every zone's nodes, and its derivative by every zone's coefficients."""
    total: list[Array] = []
    derivative: list[list[Array]] = []
    pairs = _pairs(kernel, nodes)
    for i, here in enumerate(nodes):
        w = np.zeros(len(here.x))
        row: list[Array] = []
        for j, there in enumerate(nodes):
            if i == j:
                potential, change = here.zone.half_space(here.xi, here.eta, rule.directions, rule.along)
                if not kernel.homogeneous:
                    smooth = kernel.smooth(distances(here, here)) * here.weights
                    potential = potential + smooth @ here.pressure
                    change = change + smooth @ here.variations
            else:
                block = pairs[i, j] * there.weights
                potential, change = block @ there.pressure, block @ there.variations
            w += potential
            row.append(change)
        total.append(w)
        derivative.append(row)
    return total, derivative


def stalled(history: list[float]) -> bool:
    """Return whether a small change no longer shrinks: a degree too low for the pressure slows Newton's method.

    The change of the test functions with the edge is left out of the derivative, so that the rate of convergence is the
    gap that the degree leaves; the next degree leaves less.
    """
    return len(history) > 10 and history[-1] < STALLED and history[-1] > 0.3 * max(history[-4:-1])


def solve_zones(
    kernel: LayeredKernel,
    shapes: list[Shape],
    zones: list[Zone],
    approaches: Array,
    groups: list[tuple[list[int], float]],
    tolerance: float,
    limit: int = 25,
) -> SmoothSolution:
    """Return the state where the complementary energy is stationary.

    ``groups`` lists (balls that share one unknown approach, their total force times `singular`); balls in
    no group keep their approach. ``tolerance`` bounds the last step of the coefficients relative to P; a step that is
    `stalled`, or is small when ``limit`` steps are done, is returned as the residual. Raises `NotConverged`.
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
        with np.errstate(all="ignore"):  # a way that leads nowhere may overflow before it is left
            delta, change = _newton_step(kernel, shapes, nodes, approaches, groups, rule)
        if not np.all(np.isfinite(delta)):
            break
        length, step = 1.0, 0.0
        terms = len(zones[0].coefficients)
        for k, zone in enumerate(zones):
            relative = float(np.max(np.abs(delta[k * terms : (k + 1) * terms])) / np.max(np.abs(zone.coefficients)))
            step = max(step, relative)
        length = min(1.0, 0.6 / step)
        approaches = approaches + length * change
        zones = [
            replace(z, coefficients=z.coefficients + length * delta[k * terms : (k + 1) * terms]).reframed(z.degree)
            for k, z in enumerate(zones)
        ]
        if not max(step, float(np.max(np.abs(approaches))) / first) < DIVERGED:
            break
    raise NotConverged(
        f"smooth contact: Newton's method did not converge in {limit} steps (last relative step {step:.1e}, "
        f"tolerance {tolerance:.1e})"
    )


def solve_scaled(matrix: Array, right: Array, size: Array) -> Array:
    """Return the solution of equations with rows and columns of these sizes; `NotConverged` where singular."""
    try:
        solution = np.linalg.solve(matrix / size[:, None] / size, (right.T / size).T)
    except np.linalg.LinAlgError as singular:
        raise NotConverged(
            "smooth contact: the equations of Newton's method are singular, as where contacts merge or vanish on "
            "the way; press balls less deep or closer to equal depth"
        ) from singular
    return np.asarray((solution.T / size).T)


def _newton_step(
    kernel: LayeredKernel,
    shapes: list[Shape],
    nodes: list[Nodes],
    approaches: Array,
    groups: list[tuple[list[int], float]],
    rule: Rule,
) -> tuple[Array, Array]:
    """Return the changes of all coefficients and of all approaches."""
    terms = nodes[0].variations.shape[1]
    count, free = len(nodes), len(groups)
    potential, derivative = displacements(kernel, nodes, rule)
    matrix = np.zeros((count * terms + free, count * terms + free))
    right = np.zeros(count * terms + free)
    for i, here in enumerate(nodes):
        rows = slice(i * terms, (i + 1) * terms)
        test = here.variations.T * here.weights
        f = shapes[i](here.x, here.y)
        right[rows] = -test @ (potential[i] - approaches[i] + f)
        for j in range(count):
            matrix[rows, j * terms : (j + 1) * terms] = test @ derivative[i][j]
    for g, (members, force) in enumerate(groups):
        at = count * terms + g
        right[at] = force
        for i in members:
            rows = slice(i * terms, (i + 1) * terms)
            total = nodes[i].variations.T @ nodes[i].weights
            matrix[rows, at] = -total
            matrix[at, rows] = total
            right[at] -= nodes[i].force
    # rows and columns in each zone's own size, so that balls of any size share one matrix
    size = np.sqrt(np.abs(np.diag(matrix)))
    size[count * terms :] = 1.0
    for g, (members, _) in enumerate(groups):
        at = count * terms + g
        reach = np.max(np.abs(matrix[at, : count * terms] / size[: count * terms]))
        size[at] = reach if reach > 0.0 else 1.0
        del members
    delta = solve_scaled(matrix, right, size)
    change = np.zeros(count)
    for g, (members, _) in enumerate(groups):
        change[members] = delta[count * terms + g]
    return delta[: count * terms], change
