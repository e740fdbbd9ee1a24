"""Surface displacement anywhere, from smooth contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linear_bem.arrays import Array, Indices
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.smooth.multipole import DEGREES, disc_nodes, interpolation, point_displacement
from linear_bem.smooth.newton import Nodes, Rule

FEW = 6
"""Up to this number of contacts each is integrated at all points."""
_NEAR = 4.0
_DEGREE = 6


def displacement_of_many(kernel: LayeredKernel, nodes: Sequence[Nodes], x: Array, y: Array) -> Array:
    """Return the displacement [m] at surface points from many contacts.

    At more than four contact radii a contact acts by its equivalent point loads (relative error of its share below
    1e-6); nearer, that share is replaced by `zone_displacement`.
    """
    u, v, _ = disc_nodes(_DEGREE)
    points = np.array([n.zone.points(u, v) for n in nodes])
    loads = np.array([n.loads @ interpolation(n.xi, n.eta, _DEGREE) for n in nodes])
    reach = np.array([n.zone.reach for n in nodes])
    total = np.zeros(x.shape)

    def share(part: Indices, which: Indices | slice) -> Array:
        r = np.hypot(x[part, None] - points[which, 0].ravel(), y[part, None] - points[which, 1].ravel())
        r = np.maximum(r, 1e-9 * float(np.min(reach)))
        return np.asarray(kernel.scaled(r) @ loads[which].ravel())

    for part in np.array_split(np.arange(x.size), x.size * loads.size // 1_000_000 + 1):
        total[part] = share(part, slice(None))
    for j, n in enumerate(nodes):
        close = np.flatnonzero(np.hypot(x - n.zone.centre[0], y - n.zone.centre[1]) < _NEAR * reach[j])
        if close.size:
            exact = zone_displacement(kernel, n, x[close], y[close])
            total[close] += exact - share(close, np.array([j]))
    return total


def displacement_around(
    kernel: LayeredKernel, nodes: Sequence[Nodes], x: Sequence[Array], y: Sequence[Array], precision: float
) -> list[Array]:
    """Return the displacement [m] from all contacts at points around each: ``x[k]``, ``y[k]`` [m] near ``nodes[k]``.

    A far contact acts by equivalent point loads on interpolation nodes about the points, of the lowest degree d with
    (a/(L - a))^(d + 1) below ``precision``, a the larger of its size and the points' spread: the neglected terms are
    of that size relative to its share. Where no degree suffices, the share is integrated to 1e-8. Only the pressures
    come from the solver: nodes, degrees and pairs differ from those of `linear_bem.smooth.multipole.Interaction`.
    """
    centres = np.array([n.zone.centre for n in nodes])
    size = np.array([1.1 * n.zone.reach for n in nodes])
    spread = np.array([np.max(np.hypot(u - c[0], v - c[1])) for u, v, c in zip(x, y, centres, strict=True)])
    fine = [n.zone.quadrature(14, 28) for n in nodes]
    loads = {d: np.array([(w * p) @ interpolation(u, v, d) for u, v, w, p in fine]) for d in DEGREES}
    sources = {d: np.array([n.zone.points(*disc_nodes(d)[:2]) for n in nodes]) for d in DEGREES}
    surface = [n.zone.points(u, v) for n, (u, v, _, _) in zip(nodes, fine, strict=True)]
    out = []
    for i in range(len(nodes)):
        apart = np.hypot(*(centres - centres[i]).T)
        large = np.maximum(size, spread[i])
        eta = np.where(apart > 1.02 * large, large / np.maximum(apart - large, 0.01 * large), np.inf)
        eta[i] = np.inf
        left = np.ones(len(nodes), dtype=bool)
        total = np.zeros(len(x[i]))
        for d in DEGREES:
            chosen = np.flatnonzero(left & (eta ** (d + 1) < precision))
            if chosen.size == 0:
                continue
            left[chosen] = False
            u, v, _ = disc_nodes(d)
            tx, ty = centres[i, 0] + spread[i] * u, centres[i, 1] + spread[i] * v
            at = sources[d][chosen]
            values = point_displacement(kernel, tx, ty, at[:, 0], at[:, 1], loads[d][chosen])
            total += interpolation((x[i] - centres[i, 0]) / spread[i], (y[i] - centres[i, 1]) / spread[i], d) @ values
        for j in np.flatnonzero(left):
            if apart[j] > 2.5 * size[j] + spread[i]:
                (_, _, w, p), (at_x, at_y) = fine[j], surface[j]
                total += point_displacement(kernel, x[i], y[i], at_x, at_y, w * p)
            else:
                total += zone_displacement(kernel, nodes[j], x[i], y[i])
        out.append(total)
    return out


def zone_displacement(kernel: LayeredKernel, n: Nodes, x: Array, y: Array) -> Array:
    """Return the displacement [m] at any surface points from one zone, relative error below about 1e-8.

    Inside: chords through the point. Outside: nodes refined with the distance to the edge.
    """
    zone = n.zone
    xi, eta = zone.frame(x, y)
    rho = np.hypot(xi, eta)
    safe = np.maximum(rho, 1e-12)
    edge = zone.edge(np.zeros_like(rho), np.zeros_like(rho), xi / safe, eta / safe)
    ratio = np.where(rho > 1e-12, rho / edge, 0.0)
    total = np.zeros(x.shape)
    rule = Rule.of([zone], kernel.thickness, more=4)
    bands = ((0.0, 1.0), (1.0, 1.02), (1.02, 1.1), (1.1, 1.2), (1.2, 1.5), (1.5, 4.0), (4.0, np.inf))
    for low, high in bands:
        chosen = np.flatnonzero((ratio >= low) & (ratio < high))
        inside = high == 1.0
        radial, angular = rule.radial, rule.angular
        if not inside:
            # the nearest singularity is log(ratio) away from the angle's axis and sqrt(2 log(ratio)) from the ray's
            away = np.log(max(low, 1.004))
            angular = max(angular, int(22.0 / away))
            radial = max(radial, int(4.0 + 9.0 / np.sqrt(2.0 * away)))
        for part in np.array_split(chosen, chosen.size // 64 + 1) if chosen.size else ():
            if inside:
                total[part] += zone.half_space(xi[part], eta[part], rule.directions + 8, rule.along + 4)[0]
            q_xi, q_eta, w, p = zone.quadrature(radial, angular)
            qx, qy = zone.points(q_xi, q_eta)
            r = np.hypot(x[part][:, None] - qx, y[part][:, None] - qy)
            total[part] += (kernel.smooth(r) if inside else kernel.scaled(r)) @ (w * p)
    return total
