"""Surface displacement anywhere, from smooth contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from linear_bem.layer.kernel import LayeredKernel
from linear_bem.smooth.multipole import DEGREES, disc_nodes, interpolation
from linear_bem.smooth.newton import Nodes, Rule

Array = NDArray[np.float64]

FEW = 6
"""Up to this number of contacts each is summed by itself."""
_NEAR = 4.0
_DEGREE = 6


def displacement_of_many(kernel: LayeredKernel, nodes: Sequence[Nodes], x: Array, y: Array) -> Array:
    """Return the displacement [m] at surface points from many contacts.

    Farther than four contact radii a contact acts by its equivalent point loads (relative error of its share below
    1e-6); nearer, that share is taken out again and `zone_displacement` put in.
    """
    u, v, _ = disc_nodes(_DEGREE)
    points = np.array([n.zone.points(u, v) for n in nodes])
    loads = np.array([(n.weights * n.pressure) @ interpolation(n.xi, n.eta, _DEGREE) for n in nodes])
    centres = np.array([n.zone.centre for n in nodes])
    reach = np.array([np.max(np.linalg.svd(n.zone.axes, compute_uv=False)) for n in nodes])
    total = np.zeros(x.shape)

    def share(part: NDArray[np.intp], which: NDArray[np.intp] | slice) -> Array:
        r = np.hypot(x[part, None] - points[which, 0].ravel(), y[part, None] - points[which, 1].ravel())
        r = np.maximum(r, 1e-9 * float(np.min(reach)))
        return np.asarray((1.0 / r + kernel.smooth(r)) @ loads[which].ravel())

    for part in np.array_split(np.arange(x.size), x.size * loads.size // 1_000_000 + 1):
        total[part] = share(part, slice(None))
    for j, n in enumerate(nodes):
        close = np.flatnonzero(np.hypot(x - centres[j, 0], y - centres[j, 1]) < _NEAR * reach[j])
        if close.size:
            exact = zone_displacement(kernel, n, x[close], y[close])
            total[close] += exact - share(close, np.array([j]))
    return total


def displacement_around(
    kernel: LayeredKernel, nodes: Sequence[Nodes], x: Sequence[Array], y: Sequence[Array], precision: float
) -> list[Array]:
    """Return the displacement [m] from all contacts at points around each: ``x[k]``, ``y[k]`` [m] near ``nodes[k]``.

    A far contact acts by equivalent point loads on interpolation nodes about the points, of the lowest degree d with
    (a/(L - a))^(d + 1) below ``precision``, a the larger of its size and the points' spread: what is neglected of its
    share is of that relative size. Where no degree does, the share is integrated to 1e-8. Nothing is taken from the
    solver but pressures: other nodes, other degrees, other pairs than in `linear_bem.smooth.multipole.Interaction`.
    """
    centres = np.array([n.zone.centre for n in nodes])
    size = np.array([1.1 * np.max(np.linalg.svd(n.zone.axes, compute_uv=False)) for n in nodes])
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
            values = _from_points(kernel, tx, ty, at[:, 0], at[:, 1], loads[d][chosen])
            total += interpolation((x[i] - centres[i, 0]) / spread[i], (y[i] - centres[i, 1]) / spread[i], d) @ values
        for j in np.flatnonzero(left):
            if apart[j] > 2.5 * size[j] + spread[i]:
                (_, _, w, p), (at_x, at_y) = fine[j], surface[j]
                total += _from_points(kernel, x[i], y[i], at_x, at_y, w * p)
            else:
                total += zone_displacement(kernel, nodes[j], x[i], y[i])
        out.append(total)
    return out


def _from_points(kernel: LayeredKernel, x: Array, y: Array, at_x: Array, at_y: Array, loads: Array) -> Array:
    r = np.hypot(x[:, None] - at_x.ravel(), y[:, None] - at_y.ravel())
    return np.asarray((1.0 / r + kernel.smooth(r)) @ loads.ravel())


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
        if chosen.size == 0:
            continue
        # the nearest singularity is log(ratio) away from the angle's axis and sqrt(2 log(ratio)) from the ray's
        away = np.log(max(low, 1.004))
        angular = max(rule.angular, int(22.0 / away))
        radial = max(rule.radial, int(4.0 + 9.0 / np.sqrt(2.0 * away)))
        for part in np.array_split(chosen, chosen.size // 64 + 1):
            if high == 1.0:
                value, _ = zone.half_space(xi[part], eta[part], rule.directions + 8, rule.along + 4)
                total[part] += value
                q_xi, q_eta, w, p = zone.quadrature(rule.radial, rule.angular)
            else:
                q_xi, q_eta, w, p = zone.quadrature(radial, angular)
            qx, qy = zone.points(q_xi, q_eta)
            r = np.hypot(x[part][:, None] - qx, y[part][:, None] - qy)
            block = kernel.smooth(r) if high == 1.0 else 1.0 / r + kernel.smooth(r)
            total[part] += block @ (w * p)
    return total
