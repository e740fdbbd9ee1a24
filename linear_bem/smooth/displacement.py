"""Surface displacement and T at any points, by sums over smooth contacts."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from linear_bem.arrays import Array, Indices, hypotenuse
from linear_bem.far_field.pairs_and_mesh import AROUND, cell_split
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.report import Report, silent
from linear_bem.smooth.multipole import DEGREES, Interaction, equivalent_loads, point_displacement
from linear_bem.smooth.newton import Nodes, Rule
from linear_bem.smooth.polynomials import PARABOLA, basis, disc_nodes, interpolation
from linear_bem.smooth.zone import Zone

FEW = 6
"""Largest number of contacts that are all integrated at every point."""
FINE = Rule(radial=14, angular=28, directions=0, along=0)
"""Quadrature rule of the pressures, different from the solver's."""
IN_CELL_TO, FINER = 1e-6, 1e-2
"""Precision of the kernel's split for fields in a periodic cell; the same for direct sums, over their precision."""
FAR, OF_FAR = 4.0, 6
"""Distance over a contact's reach from which it acts through its equivalent point loads, and the degree of these."""
TOGETHER = 500_000
"""Products of points and nodes that `zone_displacement` evaluates together: 4 MB per table."""
NEAR = 1.5
"""Distance of a point over that of the edge up to which 1/r needs more nodes than the rest of the kernel."""
AT_ONCE = 2000
"""Points that a sum over a contact's nodes evaluates together, to bound its memory: 5 MB at 60 nodes."""


def displacement_of_many(kernel: LayeredKernel, nodes: Nodes, x: Array, y: Array) -> Array:
    """Return the displacement [m] at surface points from many contacts.

    At more than four contact radii, a contact acts through its equivalent point loads (relative error of its share
    below 1e-6); nearer, that share is replaced by `zone_displacement`.
    """
    u, v, _ = disc_nodes(OF_FAR)
    points = np.stack(nodes.zone.points(u, v), axis=1)
    loads = equivalent_loads(nodes, OF_FAR)
    reach = nodes.zone.reach
    total = np.zeros(x.shape)

    def share(part: Indices, which: Indices | slice) -> Array:
        r = hypotenuse(x[part, None] - points[which, 0].ravel(), y[part, None] - points[which, 1].ravel())
        r = np.maximum(r, 1e-9 * float(np.min(reach)))
        return np.asarray(kernel.scaled(r) @ loads[which].ravel())

    for part in np.array_split(np.arange(x.size), x.size * loads.size // 1_000_000 + 1):
        total[part] = share(part, slice(None))
    for j, n in enumerate(nodes):
        close = np.flatnonzero(np.hypot(x - n.zone.centre[0], y - n.zone.centre[1]) < FAR * reach[j])
        if close.size:
            exact = zone_displacement(kernel, n, x[close], y[close])
            total[close] += exact - share(close, np.array([j]))
    return total


def displacement_about(
    kernel: LayeredKernel, nodes: Nodes, centres: Array, reach: Array, precision: float
) -> Callable[[Array, Array], Array]:
    """Return a function of places in each disc: the displacement [m] from all contacts on discs without pressure.

    ``centres`` (discs, 2), ``reach`` (discs,) [m]; it takes xi, eta (discs, points), xi^2 + eta^2 = 1 at a disc's edge.
    """
    zones = nodes.zone
    count, terms = len(centres), zones.coefficients.shape[1]
    parabola = np.zeros((count, terms))
    parabola[:, : PARABOLA.size] = PARABOLA
    discs = Zone(centres, reach[:, None, None] * np.eye(2), zones.degree, parabola)
    rule = Rule.of(zones, kernel.thickness)
    empty = Nodes.of(discs, rule)
    empty = replace(empty, pressure=np.zeros_like(empty.pressure))
    values = Interaction(kernel, Nodes.joined([*nodes, *empty]), precision).displacement()[len(zones) :]
    fit = np.linalg.pinv(basis(empty.xi[0], empty.eta[0], zones.degree).T)
    coefficients = values @ fit.T
    return lambda xi, eta: np.asarray(np.einsum("nt,tnk->nk", coefficients, basis(xi, eta, zones.degree)))


class LatticeRest:
    """The smooth field that the lattice of a periodic cell adds to the sum over the contacts and images listed.

    ``nodes`` are the contacts, then their images within ``reach`` [m] of the bounding rectangle of ``places`` (k, 2)
    [m], by default of the contacts. Without a mesh, the kernel is negligible beyond the images and the field is 0.
    """

    def __init__(self, kernel: LayeredKernel, nodes: Nodes, precision: float, places: Array | None = None) -> None:
        assert kernel.cell is not None
        margin = AROUND * 1.1 * float(np.max(nodes.zone.reach))
        self.mesh, split, reach = cell_split(kernel, len(nodes), margin, precision)
        self.reach = reach + 2.0 * margin
        owners, shifts = kernel.cell.images(nodes.zone.centre, self.reach, places)
        self.nodes = Nodes.joined([*nodes, *nodes[owners].moved(shifts)])
        if self.mesh is not None:
            self._grid = self.mesh.field(self.mesh.at(nodes.x, nodes.y), nodes.loads)
            assert split is not None
            self.split = split

    def displacement(self, x: Array, y: Array, listed: Nodes) -> Array:
        """Return the displacement [m] at points due to all contacts and images that are not among ``listed``."""
        if self.mesh is None:
            return np.zeros(len(x))
        total = np.asarray(self.mesh.at(x, y).value @ self._grid)
        for start in range(0, len(x), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            for n in listed:
                total[part] -= self.split.far(hypotenuse(x[part, None] - n.x, y[part, None] - n.y)) @ n.loads
        return total

    def slope(self, x: Array, y: Array, listed: Nodes) -> Array:
        """Return the gradient (points, 2) of `displacement`."""
        if self.mesh is None:
            return np.zeros((len(x), 2))
        points = self.mesh.at(x, y, slopes=True)
        assert points.dx is not None
        assert points.dy is not None
        total = np.stack([points.dx @ self._grid, points.dy @ self._grid], axis=1)
        for n in listed:
            dx, dy = x[:, None] - n.x, y[:, None] - n.y
            r = np.maximum(hypotenuse(dx, dy), 1e-300)
            g = self.split.far_slope(r) / r
            total -= np.stack([(g * dx) @ n.loads, (g * dy) @ n.loads], axis=1)
        return total


def displacement_in_cell(kernel: LayeredKernel, nodes: Nodes, x: Array, y: Array) -> Array:
    """Return the displacement [m] at surface points from contacts in a periodic cell."""
    assert kernel.cell is not None
    low = np.min(nodes.zone.centre, axis=0)
    points = low + np.mod(np.stack([x, y], axis=1) - low, kernel.cell.lengths)
    rest = LatticeRest(kernel, nodes, IN_CELL_TO, points)
    px, py = points.T
    return displacement_of_many(kernel, rest.nodes, px, py) + rest.displacement(px, py, rest.nodes)


class DirectSums:
    """Displacement and T by direct sums over all contacts, a check of the solver's degrees, pairs and mesh.

    A far contact acts through equivalent point loads, interpolated about the target points by the lowest degree d with
    (a/(L - a))^(d + 1) below ``precision``, a the larger of both sizes; this is also the relative size of the neglected
    terms. Nearer contacts are integrated. Only the pressures come from the solver. In a periodic cell the sums include
    contacts and images within the cut-off of a second mesh, independent of the solver's, which adds the rest.
    """

    def __init__(self, kernel: LayeredKernel, nodes: Nodes, precision: float, report: Report = silent) -> None:
        self.rest = None if kernel.cell is None else LatticeRest(kernel, nodes, FINER * precision)
        nodes = nodes if self.rest is None else self.rest.nodes
        self.kernel, self.nodes, self.precision, self.report = kernel, nodes, precision, report
        self.centres, self.size = nodes.zone.centre, 1.1 * nodes.zone.reach
        self.fine = Nodes.of(nodes.zone, FINE)
        self.fine_loads = self.fine.loads
        self._loads: dict[int, tuple[Array, Array]] = {}
        self._felt: dict[tuple[int, float], tuple[list[tuple[int, Array]], Indices]] = {}

    def _sources(self, degree: int) -> tuple[Array, Array]:
        """Return positions (contacts, 2, nodes) [m] and equivalent loads of a degree."""
        if degree not in self._loads:
            self.report(f"equivalent loads of degree {degree}")
            places = np.stack(self.fine.zone.points(*disc_nodes(degree)[:2]), axis=1)
            self._loads[degree] = places, equivalent_loads(self.fine, degree)
        return self._loads[degree]

    def _degrees(self, i: int, spread: float) -> tuple[list[tuple[int, Indices]], Indices]:
        """Return the far contacts for points within ``spread`` [m] of contact i, by degree, and the near contacts."""
        apart = np.hypot(*(self.centres - self.centres[i]).T)
        large = np.maximum(self.size, spread)
        eta = np.where(apart > 1.02 * large, large / np.maximum(apart - large, 0.01 * large), np.inf)
        eta[i] = np.inf
        left, out = apart < (np.inf if self.rest is None else self.rest.reach), []
        for d in DEGREES:
            chosen = np.flatnonzero(left & (eta ** (d + 1) < self.precision))
            left[chosen] = False
            if chosen.size:
                out.append((d, chosen))
        left[i] = False
        return out, np.flatnonzero(left)

    def _far(self, i: int, spread: float) -> tuple[list[tuple[int, Array]], Indices]:
        """Return the far contacts' displacement [m] at the nodes of each degree about contact i, and the near ones."""
        if (i, spread) not in self._felt:
            by_degree, near = self._degrees(i, spread)
            felt = []
            for d, chosen in by_degree:
                u, v, _ = disc_nodes(d)
                at, loads = self._sources(d)
                x, y = self.centres[i][:, None] + spread * np.stack([u, v])
                felt.append((d, point_displacement(self.kernel, x, y, at[chosen, 0], at[chosen, 1], loads[chosen])))
            self._felt[i, spread] = felt, near
        return self._felt[i, spread]

    def displacement(self, i: int, x: Array, y: Array, own: bool = True, spread: float | None = None) -> Array:
        """Return the displacement [m] at points about contact i, with its own share or without.

        ``spread`` [m], by default their largest distance from its centre, is known to points that are asked in parts.
        """
        centre = self.centres[i]
        if spread is None:
            spread = float(np.max(np.hypot(x - centre[0], y - centre[1])))
        felt, near = self._far(i, spread)
        total = np.zeros(len(x))
        for d, values in felt:
            total += interpolation((x - centre[0]) / spread, (y - centre[1]) / spread, d) @ values
        for j in near:
            if np.hypot(*(self.centres[j] - centre)) > 2.5 * self.size[j] + spread:
                f = self.fine
                total += point_displacement(self.kernel, x, y, f.x[j], f.y[j], self.fine_loads[j])
            else:
                total += zone_displacement(self.kernel, self.nodes[j], x, y)
        if self.rest is not None:
            total += self.rest.displacement(x, y, self._listed(i))
        return total + zone_displacement(self.kernel, self.nodes[i], x, y) if own else total

    def _listed(self, i: int) -> Nodes:
        """Return contact i and the contacts and images in the sum about it."""
        assert self.rest is not None
        apart = np.hypot(*(self.centres - self.centres[i]).T)
        return self.nodes[apart < self.rest.reach]

    def force(self, i: int, here: Nodes) -> Array:
        """Return T [N] on the pressure ``here`` in place of that of contact i, from all other contacts."""
        by_degree, near = self._degrees(i, 1.1 * here.zone.reach)
        total = np.zeros(2)
        for d, chosen in by_degree:
            at, loads = self._sources(d)
            q = here.loads @ interpolation(here.xi, here.eta, d)
            x, y = here.zone.points(*disc_nodes(d)[:2])
            total += self._pull(x, y, q, at[chosen, 0].ravel(), at[chosen, 1].ravel(), loads[chosen].ravel())
        f = self.fine
        for j in near:
            total += self._pull(here.x, here.y, here.loads, f.x[j], f.y[j], self.fine_loads[j])
        if self.rest is not None:
            total += here.loads @ self.rest.slope(here.x, here.y, self._listed(i))
        return total / self.kernel.singular

    def _pull(self, x: Array, y: Array, q: Array, at_x: Array, at_y: Array, loads: Array) -> Array:
        dx, dy = x[:, None] - at_x, y[:, None] - at_y
        r = hypotenuse(dx, dy)
        g = self.kernel.scaled_slope(r) / r
        return np.array([q @ (g * dx) @ loads, q @ (g * dy) @ loads])


def zone_displacement(kernel: LayeredKernel, n: Nodes, x: Array, y: Array) -> Array:
    """Return the displacement [m] at any surface points from one zone, relative error below about 1e-8.

    Inside: by chords through the point. Outside: by more nodes for points near the edge; closest to it, for 1/r only.
    """
    zone = n.zone
    xi, eta = zone.frame(x, y)
    rho = np.hypot(xi, eta)
    safe = np.maximum(rho, 1e-12)
    edge = zone.edge(xi / safe, eta / safe)
    ratio = np.where(rho > 1e-12, rho / edge, 0.0)
    total = np.zeros(x.shape)
    rule = Rule.of(zone, kernel.thickness, more=4)

    def add(chosen: Indices, radial: int, angular: int, function: Callable[[Array], Array]) -> None:
        q_xi, q_eta, w, p = zone.quadrature(radial, angular)
        qx, qy = zone.points(q_xi, q_eta)
        for part in np.array_split(chosen, chosen.size // max(1, min(64, TOGETHER // qx.size)) + 1):
            r = hypotenuse(x[part][:, None] - qx, y[part][:, None] - qy)
            total[part] += function(r) @ (w * p)

    inside, near = np.flatnonzero(ratio < 1.0), np.flatnonzero(ratio < NEAR)
    for part in np.array_split(inside, inside.size // 64 + 1) if inside.size else ():
        at = xi[None, part], eta[None, part]
        total[part] += zone[None].half_space(*at, rule.directions + 8, rule.along + 4, derivative=False)[0][0]
    if near.size and not kernel.homogeneous:
        add(near, rule.radial, rule.angular, kernel.smooth)
    for low, high in pairwise((1.0, 1.02, 1.1, 1.2, NEAR, 4.0, np.inf)):
        chosen = np.flatnonzero((ratio >= low) & (ratio < high))
        if chosen.size:
            # the nearest singularity is log(ratio) away from the angle's axis and sqrt(2 log(ratio)) from the ray's
            away = np.log(max(np.min(ratio[chosen]), 1.004))
            angular = max(rule.angular, int(22.0 / away))
            radial = max(rule.radial, int(4.0 + 9.0 / np.sqrt(2.0 * away)))
            add(chosen, radial, angular, np.reciprocal if high <= NEAR else kernel.scaled)
    return total
