"""Contacts solved on grids of square cells: successive refinement, forces, fields and residuals."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates

from linear_bem.arrays import Array, Mask
from linear_bem.errors import NotConverged, UnsupportedProblem
from linear_bem.grid.outline import edge_error, edge_mean, excess_edge
from linear_bem.grid.patches import Patch, Patches
from linear_bem.grid.polonsky_keer import GridState, solve_bounded
from linear_bem.grid.shared_patches import shared_patches
from linear_bem.grid.surface import surface_displacement
from linear_bem.indenter import Indenter
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import deepest, force_error, force_groups, may_touch, unloaded
from linear_bem.problem import Problem
from linear_bem.profiles import farthest, gradient, height
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.initial_guess import Start
from linear_bem.smooth.polynomials import circle

COARSEST = 32
"""Cells across a patch on the first grid; a patch is about 1.3 contact diameters wide."""
SPARSE = 0.3
"""Contact radius over a patch's half width below which the patch is made smaller before grids are refined."""
DRAWN = 48
"""Cells along a side of a patch whose displacement is drawn outside of it."""
MOST_CELLS = 1_200_000
"""Largest number of cells in all patches."""


@dataclass(frozen=True, eq=False)
class GridContacts:
    """Contacts as pressures of square cells; all numbers are SI, one entry per ball."""

    problem: Problem
    kernel: LayeredKernel
    patches: Patches
    state: GridState
    approaches: Array

    @property
    def unknowns(self) -> int:
        """Number of cells."""
        return sum(p.nx * p.ny for p in self.patches.patches)

    @property
    def report(self) -> Report:
        """Receives progress lines while results are computed."""
        return self.patches.report

    @property
    def iterations(self) -> int:
        """Conjugate-gradient steps on the last grid."""
        return self.state.iterations

    def _cells(self) -> Iterator[tuple[int, Patch, Array, Mask]]:
        """Yield ball, patch, pressure [Pa] and the mask of the ball's contact."""
        for patch, p, owner in zip(self.patches.patches, self.state.pressures, self.state.owners, strict=True):
            for ball in patch.members:
                yield ball, patch, p / self.kernel.singular, (owner == ball) & (p > 0.0)

    def _of_balls(self, value: Callable[[int, Patch, Array, Mask], float]) -> Array:
        """Return a number per ball from ball, patch, pressure [Pa] and the mask of its contact."""
        out = np.zeros(self.problem.size)
        for ball, patch, p, mine in self._cells():
            out[ball] = value(ball, patch, p, mine)
        return out

    @cached_property
    def normal_forces(self) -> Array:
        """Normal force on every ball [N]."""
        return self._of_balls(lambda _, patch, p, mine: np.sum(p[mine]) * patch.cell**2)

    @cached_property
    def mutual_force(self) -> Array:
        """T on every ball [N] by the mutual formula, shape (balls, 2)."""
        place = {ball: k for k, patch in enumerate(self.patches.patches) for ball in patch.members}

        def component(slopes: list[Array]) -> Array:
            return self._of_balls(lambda i, patch, p, mine: np.sum((p * slopes[place[i]])[mine]) * patch.cell**2)

        return np.stack([component(slopes) for slopes in self.patches.slopes(self.state.pressures)], axis=1)

    @cached_property
    def slope_force(self) -> Array:
        """T on every ball [N] by the paper's slope integral, shape (balls, 2); noisy on a grid."""
        out = np.zeros((self.problem.size, 2))
        for ball, patch, p, mine in self._cells():
            x, y = patch.points
            fx, fy = gradient(self.problem.balls[ball], x[mine], y[mine])
            out[ball] = -float(p[mine] @ fx) * patch.cell**2, -float(p[mine] @ fy) * patch.cell**2
        return out

    @cached_property
    def peak_pressures(self) -> Array:
        """Largest cell pressure under every ball [Pa]."""
        return self._of_balls(lambda _, patch, p, mine: np.max(p[mine], initial=0.0))

    @cached_property
    def contact_areas(self) -> Array:
        """Contact area of every ball [m^2]: its cells less `edge_areas`."""
        return self._of_balls(lambda _, patch, p, mine: np.count_nonzero(mine) * patch.cell**2) - self.edge_areas

    @cached_property
    def edge_areas(self) -> Array:
        """Area [m^2] by which the cells in contact exceed every ball's true contact; see `excess_edge`."""
        return self._of_balls(lambda _, patch, p, mine: excess_edge(mine, p > 0.0) * patch.cell**2)

    @cached_property
    def area_errors(self) -> Array:
        """Error of every contact area [m^2] from the unknown position of its edge within cells; see `edge_error`."""
        return self._of_balls(lambda _, patch, p, mine: edge_error(mine, p > 0.0) * patch.cell**2)

    @cached_property
    def edge_shares(self) -> Array:
        """Relative error of every normal force or approach due to the error of its contact area.

        A pressure K/sqrt(2 pi s) at the distance s from the edge, as under a sharp punch, has the energy K^2/(2 E*)
        per area of contact [Johnson 1985, Contact Mechanics, section 5.5]; its mean over the last cell d is
        K sqrt(2/(pi d)). At a fixed approach D the force Q then changes by K^2/(E* D) per area. Where cells resolve an
        edge at which the pressure vanishes, this is of the order (d/a)^2 of the area's error.
        """
        release = self._of_balls(lambda _, patch, p, mine: 0.5 * np.pi * patch.cell * edge_mean(p**2, mine, p > 0.0))
        work = self.normal_forces * self.approaches
        safe = np.where(work > 0.0, work, np.inf)
        return np.asarray(np.pi * self.kernel.singular * release * self.area_errors / safe)

    @property
    def elastic_energy(self) -> float:
        """Elastic energy [J], half the work of the contact pressure."""
        state = self.state
        return sum(
            0.5 * float(np.sum(p * w)) * patch.cell**2 / self.kernel.singular
            for patch, p, w in zip(self.patches.patches, state.pressures, state.displacements, strict=True)
        )

    @property
    def resolution(self) -> float:
        """Largest side [m] of a cell."""
        return max(patch.cell for patch in self.patches.patches)

    def point_loads(self, depth: float) -> tuple[Array, Array, Array]:
        """Return positions x, y [m] and point loads [N] that replace the pressure for fields at a depth [m]."""
        loads = []
        for patch, p in zip(self.patches.patches, self.state.pressures, strict=True):
            loaded = p > 0.0
            x, y = patch.points
            # four Gauss points per cell for planes near the surface, else its centre
            off = 0.5 * patch.cell / 3.0**0.5 if depth < 1.5 * patch.cell else 0.0
            places = [(u, v) for u in (-off, off) for v in (-off, off)] if off > 0.0 else [(0.0, 0.0)]
            share = p[loaded] * patch.cell**2 / self.kernel.singular / len(places)
            loads += [(x[loaded] + u, y[loaded] + v, share) for u, v in places]
        x, y, load = (np.concatenate(parts) for parts in zip(*loads, strict=True))
        return x, y, load

    @cached_property
    def coarseness(self) -> float:
        """Largest side of a cell over the radius of its contact."""
        sides = [(patch.cell, np.sqrt(self.contact_areas[ball] / np.pi)) for ball, patch, _, _ in self._cells()]
        return max(side / radius for side, radius in sides if radius > 0.0)

    def outline(self, ball: int, count: int = 64) -> tuple[Array, Array]:
        """Return points x, y [m] on the edge of one ball's contact, to about half a cell."""
        for owner, patch, p, mine in self._cells():
            if owner != ball or not np.any(mine):
                continue
            centre_x, centre_y = (float(np.average(z[mine], weights=p[mine])) for z in patch.points)
            cos, sin = circle(count)
            t = np.arange(0.25, np.hypot(patch.nx, patch.ny), 0.25) * patch.cell
            i, j, inside = patch.cell_of(centre_x + t[:, None] * cos, centre_y + t[:, None] * sin)
            inside[inside] = mine[i[inside], j[inside]]
            first = np.argmin(inside, axis=0)
            r = t[np.maximum(first, 1)] - 0.125 * patch.cell
            return centre_x + r * cos, centre_y + r * sin
        return np.empty(0), np.empty(0)

    def pressure(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the pressure [Pa] of the cell that holds each surface point [m]."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        out = np.zeros(x.shape)
        for patch, p in zip(self.patches.patches, self.state.pressures, strict=True):
            i, j, here = patch.cell_of(x, y)
            out[here] = p[i[here], j[here]] / self.kernel.singular
        return out

    def displacement(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the surface displacement [m], positive into the layer, at any surface points [m]."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        return surface_displacement(self.kernel, zip(self.patches.patches, self.state.pressures, strict=True), x, y)

    def drawn_displacement(self, x: Array, y: Array) -> Array:
        """Return the displacement [m] at points (n,) [m], to about 1e-3 of the largest (beside a punch 6e-3).

        On a patch it is interpolated between cells, elsewhere that of the pressures averaged to `DRAWN` cells.
        """
        patches, state = self.patches.patches, self.state
        averaged = [patch.averaged(p, DRAWN) for patch, p in zip(patches, state.pressures, strict=True)]
        out = surface_displacement(self.kernel, averaged, x, y)
        for patch, w in zip(patches, state.displacements, strict=True):
            here = patch.cell_of(x, y)[2]
            places = [(x[here] - patch.x[0, 0]) / patch.cell, (y[here] - patch.y[0, 0]) / patch.cell]
            out[here] = map_coordinates(w, places, order=1, mode="nearest")
        return out

    @cached_property
    def certificate(self) -> dict[str, float]:
        """Residuals recomputed at the cell centres from the returned pressures; see `SmoothContacts.certificate`."""
        scale = deepest(self.approaches)
        peak = max(float(np.max(p)) for p in self.state.pressures)
        negative = -min(float(np.min(p)) for p in self.state.pressures) / peak
        inside = outside = product = 0.0
        displacements = self.patches.displacement(self.state.pressures)
        for patch, p, w in zip(self.patches.patches, self.state.pressures, displacements, strict=True):
            heights = _heights(self.problem, patch)
            gap = w - np.max(self.approaches[list(patch.members)][:, None, None] - heights, axis=0)
            contact = p > 0.0
            inside = max(inside, float(np.max(np.abs(gap[contact]), initial=0.0)))
            outside = max(outside, float(np.max(-gap[~contact], initial=0.0)))
            product = max(product, float(np.max(np.abs(gap * p))) / peak)
        return {
            "gap_in_contact": inside / scale,
            "penetration_outside": outside / scale,
            "complementarity": product / scale,
            "negative_pressure": max(negative, 0.0),
            "load": force_error(self.problem.load, self.normal_forces),
        }


def _heights(problem: Problem, patch: Patch) -> Array:
    """Return f [m] of the patch's balls at its cells, shape (members, nx, ny)."""
    return np.array([height(problem.balls[ball])(*patch.points) for ball in patch.members])


def grid_levels(start: Start, report: Report = silent) -> Iterator[GridContacts]:
    """Yield the solutions on successive grids, each of half the previous spacing, up to `MOST_CELLS` cells.

    ``report`` receives a line per grid and occasional lines in between. Raises `UnsupportedProblem` if even the first
    grid would exceed `MOST_CELLS`, and `NotConverged`.
    """
    problem, deep, touching = start.problem, deepest(start.approaches), zip(start.touching, start.zones, strict=True)
    reach = {i: 1.3 * farthest(problem.balls[i], zone.axes, deep) for i, zone in touching}
    smallest = min(reach.values())
    near = may_touch(start.approaches)
    for i in set(range(problem.size)) - set(reach):
        body, reach[i] = problem.balls[i].indenter, 0.5 * smallest
        if isinstance(body, Indenter) and body.edge and near[i] and i not in unloaded(problem.load):
            reach[i] = 1.05 * body.reach  # a punch may touch at its edge first
    count, before = COARSEST, None
    for _ in range(12):
        patches = shared_patches(problem, start.kernel, reach, count, report)
        cells = sum(p.nx * p.ny for p in patches.patches)
        if cells > MOST_CELLS:
            if before is None:
                raise UnsupportedProblem(
                    f"linear_bem: contacts near each other share a grid that resolves the smallest: {cells} cells, "
                    f"more than {MOST_CELLS}; use balls of more equal size, fewer balls, or a smaller load"
                )
            return
        report(f"grid of {cells} cells: {len(patches.patches)} patch(es), {count} cells across one contact's patch")
        contacts = _solve(patches, start, before)
        if _enlarged(contacts, reach) or (before is None and _shrunk(contacts, reach)):
            continue
        yield contacts
        count, before = 2 * count, contacts
    if before is None:
        raise NotConverged(
            "linear_bem: contacts kept growing over the edges of their patches; press the balls less deep"
        )


def _solve(patches: Patches, start: Start, before: GridContacts | None) -> GridContacts:
    problem, kernel, load, report = start.problem, start.kernel, start.problem.load, seldom(patches.report)
    approaches = start.approaches.copy() if before is None else before.approaches.copy()
    lifted = unloaded(load)
    loaded = [i for i in range(problem.size) if i not in lifted]
    approaches[lifted] = -1e3 * max(b.radius for b in problem.balls)
    if load.kind == "total_force":
        approaches[:] = np.max(approaches)
    groups = [([loaded[k] for k in members], q) for members, q in force_groups(load, loaded, kernel.singular)]
    pressures = []
    for done, patch in enumerate(patches.patches):
        report(f"first pressures on the grid: {done} of {len(patches.patches)} patches")
        if before is None:
            pressures.append(np.max([zone.pressure(*patch.points) for zone in start.zones], axis=0))
        else:
            pressures.append(before.pressure(*patch.points) * kernel.singular)
    heights = [_heights(problem, patch) for patch in patches.patches]
    state = solve_bounded(patches, heights, pressures, approaches, groups, report=report)
    return GridContacts(problem, kernel, patches, state, state.approaches)


def _shrunk(contacts: GridContacts, reach: dict[int, float]) -> bool:
    """Shrink patches that are much larger than their contact, as for flat profiles; return whether any is."""
    extent = {}
    for ball, patch, _, mine in contacts._cells():
        if np.any(mine):
            at = zip(patch.points, contacts.problem.balls[ball].position, strict=True)
            extent[ball] = float(max(np.max(np.abs(z[mine] - centre)) for z, centre in at)) + 0.5 * patch.cell
    if not extent:  # all contacts are smaller than a cell
        for ball in reach:
            reach[ball] *= 0.25
        return True
    small = [ball for ball, far in extent.items() if far < SPARSE * reach[ball]]
    for ball in small:
        reach[ball] = 1.3 * extent[ball]
    return bool(small)


def _enlarged(contacts: GridContacts, reach: dict[int, float]) -> bool:
    """Enlarge patches whose contact comes within two cells of their edge; return whether any does."""
    wide = [ball for ball, _, _, mine in contacts._cells() if np.sum(mine) > np.sum(mine[2:-2, 2:-2])]
    for ball in wide:
        reach[ball] *= 1.4
    return bool(wide)
