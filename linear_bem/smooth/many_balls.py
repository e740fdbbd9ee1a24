r"""Many smooth contacts: each ball is solved alone under fixed force, all together by forces and approaches.

Under a fixed force a ball feels its neighbours only through the tilt and curvature of the surface that they cause,
which is a weak coupling; the coupling through its approach is strong. So each sweep computes (1) the displacement from
all other balls, (2) one Newton step of every ball alone at its present force, which also gives its approach and its own
compliance s_i = dD_i/dQ_i, (3) new forces from the coarse system

    (diag(s) + K(L_ij)) dQ = D_wanted - D,

which point loads describe well. The error shrinks by the size of the shape coupling, 1e-2 to 1e-4 per
sweep for separate balls; contacts that nearly touch, whose error is only halved, are accelerated by Anderson's
mixing. A sweep costs n small dense systems and n^2 pairs of `linear_bem.smooth.multipole`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.coupled_point_loads import distances
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.profiles import Height
from linear_bem.smooth.multipole import Interaction
from linear_bem.smooth.newton import Nodes, Rule, SmoothSolution, own_displacement, solve_scaled, stalled
from linear_bem.smooth.zone import Zone

SLOW = 0.2
"""Ratio of successive changes above which sweeps are accelerated."""
SETTLED = 1e-3
"""Relative change of P below which a ball keeps its frame."""


def sweep_zones(
    kernel: LayeredKernel,
    shapes: list[Height],
    zones: list[Zone],
    approaches: Array,
    groups: Groups,
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
    coarse = kernel.scaled(distances(np.array([z.centre for z in zones])))
    forces = np.array([n.force for n in nodes])
    for members, force in groups:
        if len(members) == 1:
            forces[members[0]] = force
    shared = [(members, force) for members, force in groups if len(members) > 1]
    fixed = np.ones(len(zones), dtype=bool)
    fixed[[m for members, _ in groups for m in members]] = False
    mixing, slow = Anderson(), False
    history: list[float] = []
    for sweep in range(limit):
        interaction.update(nodes)
        steps = [
            _alone(kernel, shapes[i], n, interaction.displacement(i), forces[i], rule) for i, n in enumerate(nodes)
        ]
        changes = np.array([change for change, _, _ in steps])
        found, compliance = np.array([s[1:] for s in steps]).T
        before = [n.zone for n in nodes]
        sizes = np.max(np.abs(changes), axis=1) / np.array([np.max(np.abs(z.coefficients)) for z in before])
        zones = [
            _moved(z, min(1.0, 0.6 / max(size, 0.6)) * change, size > SETTLED)
            for z, change, size in zip(before, changes, sizes, strict=True)
        ]
        more, level = _balance(coarse, compliance, found, forces, np.where(fixed, approaches, found), fixed, shared)
        relative = [more / np.max(forces), (level - found) / np.max(np.abs(found)), sizes]
        last = float(np.max(np.abs(relative)))
        if not np.isfinite(last) or np.any(forces + more <= 0.0):
            raise NotConverged("smooth contacts: a ball lost its contact during the sweeps")
        history.append(last)
        if last < tolerance or stalled(history):
            return SmoothSolution(tuple(Nodes.of(z, rule) for z in zones), level, sweep + 1, last)
        slow = slow or (len(history) > 1 and last > SLOW * history[-2])
        if slow and np.max(sizes) <= SETTLED:
            zones, forces = _mixed(mixing, (before, forces), (zones, forces + more))
        else:
            mixing.forget()
            forces = forces + more
        nodes = [Nodes.of(z, rule) for z in zones]
    raise NotConverged(f"smooth contacts: {limit} sweeps left a change of {last:.1e}, tolerance {tolerance:.1e}")


def _moved(zone: Zone, change: Array, reframe: bool) -> Zone:
    moved = replace(zone, coefficients=zone.coefficients + change)
    return moved.reframed(zone.degree) if reframe else moved


def _alone(
    kernel: LayeredKernel, shape: Height, here: Nodes, outside: Array, force: float, rule: Rule
) -> tuple[Array, float, float]:
    """Return one Newton step of one ball under a force, its approach [m], and its compliance."""
    potential, derivative = own_displacement(kernel, here, rule)
    test = here.variations.T * here.weights
    matrix = test @ derivative
    total = test.sum(axis=1)
    size = np.sqrt(np.abs(np.diag(matrix)))
    right = np.stack([-test @ (potential + outside + shape(here.x, here.y)), total], axis=1)
    u, v = solve_scaled(matrix, right, size).T
    # the change u + D v reaches the force where total.(u + D v) = force - present force
    reach = float(total @ v)
    approach = (force - here.force - float(total @ u)) / reach
    return u + approach * v, approach, 1.0 / reach


def _balance(
    coarse: Array, compliance: Array, found: Array, forces: Array, level: Array, fixed: Mask, shared: Groups
) -> tuple[Array, Array]:
    """Return the changes of all forces and the resulting approaches.

    ``found`` are the approaches at the present forces, ``level`` those wanted. Balls with ``fixed`` approach and balls
    that share one change their force, all others keep it.
    """
    free = np.flatnonzero(fixed | np.isin(np.arange(len(found)), [m for members, _ in shared for m in members]))
    n = free.size
    matrix, right = np.zeros((n + len(shared), n + len(shared))), np.zeros(n + len(shared))
    matrix[:n, :n] = coarse[np.ix_(free, free)] + np.diag(compliance[free])
    right[:n] = np.where(fixed, level, 0.0)[free] - found[free]
    for at, (members, force) in enumerate(shared, start=n):
        mine = np.isin(free, members)
        matrix[at, :n], matrix[:n, at] = mine, -1.0 * mine
        right[at] = force - float(np.sum(forces[members]))
    answer = np.linalg.solve(matrix, right)
    more, level = np.zeros(len(found)), level.copy()
    more[free] = answer[:n]
    for at, (members, _) in enumerate(shared, start=n):
        level[members] = answer[at]
    return more, level


class Anderson:
    """Anderson's mixing [Anderson 1965, J. ACM 12, 547; Walker and Ni 2011, SIAM J. Numer. Anal. 49, 1715].

    It combines past iterates so that their residuals cancel best; for a linear iteration x -> G(x) it is equivalent
    to GMRES, so that a few slow components no longer determine the rate of convergence.
    """

    def __init__(self, depth: int = 10) -> None:
        self.depth = depth
        self.forget()

    def forget(self) -> None:
        """Drop the past iterates, as when the unknowns change their meaning."""
        self._points: list[Array] = []
        self._residuals: list[Array] = []

    def next(self, point: Array, image: Array) -> Array:
        """Return the next point from G(``point``) = ``image``."""
        self._points = [*self._points[-self.depth :], point]
        self._residuals = [*self._residuals[-self.depth :], image - point]
        if len(self._points) < 2:
            return image
        steps, changes = np.diff(self._points, axis=0), np.diff(self._residuals, axis=0)
        weights = np.linalg.lstsq(changes.T, self._residuals[-1], rcond=1e-10)[0]
        return np.asarray(image - weights @ (steps + changes))


def _mixed(mixing: Anderson, old: tuple[list[Zone], Array], new: tuple[list[Zone], Array]) -> tuple[list[Zone], Array]:
    """Return zones and forces accelerated; coefficients are scaled by each zone's largest."""
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
