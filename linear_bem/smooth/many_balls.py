r"""Many smooth contacts: every ball by itself under fixed force, all together through forces and approaches.

Under a fixed force a ball feels its neighbours only through the tilt and curvature that they give the surface, which
is weak; how far it must be pressed is strong. So each sweep takes (1) the displacement from all other
balls, (2) one Newton step of every ball alone at its present force, which also gives its approach and its own
compliance s_i = dD_i/dQ_i, (3) new forces from the coarse system

    (diag(s) + K(L_ij)) dQ = D_wanted - D,

which point loads describe well. The error shrinks by the size of the shape coupling, 1e-2 to 1e-4 per
sweep for separate balls; contacts that nearly touch, which gain only a factor of two, are accelerated by Anderson's
mixing. A sweep costs n small dense systems and n^2 pairs of `linear_bem.smooth.multipole`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.smooth.acceleration import Anderson
from linear_bem.smooth.multipole import Interaction
from linear_bem.smooth.newton import Nodes, Rule, Shape, SmoothSolution, solve_scaled, stalled
from linear_bem.smooth.zone import Zone

Array = NDArray[np.float64]

SLOW = 0.2
"""Share of the change that a sweep leaves from which on sweeps are accelerated."""
SETTLED = 1e-3
"""Relative change of P below which a ball keeps its frame."""


def sweep_zones(
    kernel: LayeredKernel,
    shapes: list[Shape],
    zones: list[Zone],
    approaches: Array,
    groups: list[tuple[list[int], float]],
    tolerance: float,
    limit: int = 60,
) -> SmoothSolution:
    """Return the same state as `linear_bem.smooth.newton.solve_zones`, for many balls.

    ``tolerance`` bounds the last change of forces, approaches and coefficients; a change that is `stalled` is returned
    as the residual. Raises `NotConverged`, also where a ball loses its contact.
    """
    rule = Rule.of(zones, kernel.thickness)
    nodes = [Nodes.of(z, rule) for z in zones]
    interaction = Interaction(kernel, nodes, tolerance)
    coarse = _coarse(kernel, zones)
    wanted = np.full(len(zones), np.nan)
    forces = np.array([n.force for n in nodes])
    shared: list[tuple[list[int], float]] = []
    for members, force in groups:
        if len(members) == 1:
            forces[members[0]] = force
        else:
            shared.append((members, force))
    fixed = np.ones(len(zones), dtype=bool)
    fixed[[m for members, _ in groups for m in members]] = False
    wanted[fixed] = approaches[fixed]
    approaches = approaches.copy()
    last, mixing = np.inf, Anderson()
    history: list[float] = []
    slow = False
    for sweep in range(limit):
        interaction.update(nodes)
        compliance, step = np.zeros(len(zones)), 0.0
        found, before, settled = np.zeros(len(zones)), zones, True
        zones = list(zones)
        for i, here in enumerate(nodes):
            change, found[i], compliance[i] = _alone(
                kernel, shapes[i], here, interaction.displacement(i), forces[i], rule
            )
            size = float(np.max(np.abs(change)) / np.max(np.abs(here.zone.coefficients)))
            step = max(step, size)
            change *= min(1.0, 0.6 / size) if size > 0.0 else 1.0
            zones[i] = replace(here.zone, coefficients=here.zone.coefficients + change)
            if size > SETTLED:
                zones[i] = zones[i].reframed(here.zone.degree)
                settled = False
        more, level = _balance(coarse, compliance, found, forces, wanted, shared)
        scale = float(np.max(np.abs(found)))
        last = max(step, float(np.max(np.abs(more)) / np.max(forces)), float(np.max(np.abs(level - found))) / scale)
        if not np.isfinite(last) or np.any(forces + more <= 0.0):
            raise NotConverged("smooth contacts: a ball lost its contact during the sweeps")
        history.append(last)
        if last < tolerance or stalled(history):
            return SmoothSolution(tuple(Nodes.of(z, rule) for z in zones), level, sweep + 1, last)
        slow = slow or (len(history) > 1 and last > SLOW * history[-2])
        if settled and slow:
            zones, forces = _mixed(mixing, (before, forces), (zones, forces + more))
        else:
            mixing.forget()
            forces = forces + more
        nodes = [Nodes.of(z, rule) for z in zones]
    raise NotConverged(f"smooth contacts: {limit} sweeps left a change of {last:.1e}, tolerance {tolerance:.1e}")


def _mixed(mixing: Anderson, old: tuple[list[Zone], Array], new: tuple[list[Zone], Array]) -> tuple[list[Zone], Array]:
    """Return zones and forces accelerated; coefficients count relative to each zone's largest."""
    size = np.array([np.max(np.abs(z.coefficients)) for z in old[0]])
    load = float(np.max(old[1]))
    count = len(size)

    def vector(state: tuple[list[Zone], Array]) -> Array:
        return np.concatenate([(np.array([z.coefficients for z in state[0]]) / size[:, None]).ravel(), state[1] / load])

    mixed = mixing.next(vector(old), vector(new))
    coefficients = mixed[:-count].reshape(count, -1) * size[:, None]
    forces = mixed[-count:] * load
    if np.any(forces <= 0.0):
        mixing.forget()
        return new
    return [replace(z, coefficients=c) for z, c in zip(old[0], coefficients, strict=True)], forces


def _alone(
    kernel: LayeredKernel, shape: Shape, here: Nodes, outside: Array, force: float, rule: Rule
) -> tuple[Array, float, float]:
    """Return one Newton step of one ball under a force, its approach [m], and its compliance."""
    potential, derivative = here.zone.half_space(here.xi, here.eta, rule.directions, rule.along)
    if not kernel.homogeneous:
        r = np.hypot(here.x[:, None] - here.x, here.y[:, None] - here.y)
        smooth = kernel.smooth(r) * here.weights
        potential = potential + smooth @ here.pressure
        derivative = derivative + smooth @ here.variations
    test = here.variations.T * here.weights
    matrix = test @ derivative
    total = test.sum(axis=1)
    size = np.sqrt(np.abs(np.diag(matrix)))
    right = np.stack([-test @ (potential + outside + shape(here.x, here.y)), total], axis=1)
    u, v = solve_scaled(matrix, right, size).T
    # c = u + D v keeps the force where total.c = force - present force
    reach = float(total @ v)
    approach = (force - here.force - float(total @ u)) / reach
    return u + approach * v, approach, 1.0 / reach


def _coarse(kernel: LayeredKernel, zones: list[Zone]) -> Array:
    x, y = np.array([z.centre for z in zones]).T
    r = np.hypot(x[:, None] - x, y[:, None] - y)
    np.fill_diagonal(r, np.inf)
    out = np.zeros_like(r)
    apart = np.isfinite(r)
    out[apart] = 1.0 / r[apart] + kernel.smooth(r[apart])
    return out


def _balance(
    coarse: Array,
    compliance: Array,
    found: Array,
    forces: Array,
    wanted: Array,
    shared: list[tuple[list[int], float]],
) -> tuple[Array, Array]:
    """Return the changes of all forces and the approaches that they lead to."""
    given = np.flatnonzero(np.isfinite(wanted))
    together = [m for members, _ in shared for m in members]
    free = np.concatenate([given, np.array(together, dtype=np.intp)]).astype(np.intp)
    more = np.zeros(len(found))
    if free.size == 0:
        return more, found
    n, g = free.size, len(shared)
    matrix = np.zeros((n + g, n + g))
    matrix[:n, :n] = coarse[np.ix_(free, free)] + np.diag(compliance[free])
    right = np.zeros(n + g)
    right[: given.size] = wanted[given] - found[given]
    right[given.size : n] = -found[free[given.size :]]
    at = given.size
    for k, (members, force) in enumerate(shared):
        rows = slice(at, at + len(members))
        matrix[rows, n + k] = -1.0
        matrix[n + k, rows] = 1.0
        right[n + k] = force - float(np.sum(forces[members]))
        at += len(members)
    answer = np.linalg.solve(matrix, right)
    more[free] = answer[:n]
    level = found.copy()
    level[given] = wanted[given]
    for k, (members, _) in enumerate(shared):
        level[members] = answer[n + k]
    return more, level
