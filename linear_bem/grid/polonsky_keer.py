r"""Non-negative pressures on a grid by preconditioned, constrained conjugate gradients.

The method of [Polonsky and Keer 1999, Wear 231, 206, doi 10.1016/S0043-1648(99)00113-1] with two
changes: the search direction is preconditioned by the periodic inverse of the influence matrix (the number of
iterations then hardly grows with the grid), and groups of balls may have a prescribed force, each group with one
unknown approach. A projection of the search direction keeps the forces; for cells of different size within a group
(one holder for unequal balls), it uses the preconditioner's metric. The iteration stops when the gap in contact and the
penetration outside, relative to the largest approach, are both below the tolerance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.errors import NotConverged
from linear_bem.grid.patches import Patches
from linear_bem.load_control import Groups
from linear_bem.report import Report, silent

Value = TypeVar("Value", np.float64, np.intp)
PATIENCE = 60
"""Steps without progress after which steps are shortened."""
HOPELESS = 1000
"""Steps without progress after which the solver stops; the hardest solved case made no progress for 920 steps."""


@dataclass(frozen=True)
class GridState:
    """Pressures times ``singular`` and displacements [m] of all patches, owners of cells, approaches [m]."""

    pressures: list[Array]
    displacements: list[Array]
    owners: list[Indices]
    approaches: Array
    iterations: int


class _Cells:
    """The cells of all patches as one vector, with the envelope of the balls over each cell and the groups of forces.

    Forces are <1_g, p> in the inner product weighted by ``area``, in which influence and preconditioner are symmetric.
    """

    def __init__(self, patches: Patches, heights: list[Array], groups: Groups, balls: int) -> None:
        self.patches, self.heights, self.groups = patches, heights, groups
        self.shapes = [(p.nx, p.ny) for p in patches.patches]
        sizes = [a * b for a, b in self.shapes]
        self.ends = np.cumsum(sizes)[:-1]
        self.area = np.repeat([p.cell**2 for p in patches.patches], sizes)
        self.diagonal = np.repeat([p.influence[0, 0] for p in patches.patches], sizes)
        self.equal = len({p.cell for p in patches.patches}) == 1
        self.group_of = np.full(balls, -1)
        for g, (members, _) in enumerate(groups):
            self.group_of[members] = g
        self._known: tuple[Array, Array, Indices] | None = None

    def split(self, v: NDArray[Value]) -> list[NDArray[Value]]:
        return [part.reshape(shape) for part, shape in zip(np.split(v, self.ends), self.shapes, strict=True)]

    def apply(self, v: Array) -> Array:
        """Return the displacement [m] under pressures ``v``."""
        return np.concatenate([w.ravel() for w in self.patches.displacement(self.split(v))])

    def curvature(self, direction: Array) -> tuple[Array, float]:
        """Return the displacement [m] under a direction of pressures, and the inner product of both."""
        image = self.apply(direction)
        return image, float(direction @ (image * self.area))

    def precondition(self, v: Array, where: Mask) -> Array:
        """Return approximate pressures that cause displacements ``v``, zero except at the cells ``where``."""
        parts = zip(self.patches.patches, self.split(v), strict=True)
        return np.where(where, np.concatenate([p.precondition(r).ravel() for p, r in parts]), 0.0)

    def envelope(self, approaches: Array) -> tuple[Array, Indices]:
        """Return the lowest indenter's depth D - f [m] at each cell, and the index of its ball.

        The last envelope is kept: if all approaches change by the same amount, only the depth is shifted.
        """
        if self._known is not None:
            at, depth, owner = self._known
            shift = approaches - at
            if np.ptp(shift) == 0.0:
                return depth + shift[0] if shift[0] != 0.0 else depth, owner
        lowest, owners = [], []
        for f, patch in zip(self.heights, self.patches.patches, strict=True):
            best, which = np.full(f[0].shape, -np.inf), np.full(f[0].shape, patch.members[0])
            for height, ball in zip(f, patch.members, strict=True):
                deeper = approaches[ball] - height > best
                best[deeper] = approaches[ball] - height[deeper]
                which[deeper] = ball
            lowest.append(best.ravel())
            owners.append(which.ravel())
        self._known = approaches.copy(), np.concatenate(lowest), np.concatenate(owners)
        return self._known[1:]

    def groups_within(self, cells: Mask, owner: Indices) -> list[Mask]:
        """Return, per group, the mask of those ``cells`` that belong to its balls."""
        kind = self.group_of[owner]
        return [cells & (kind == g) for g in range(len(self.groups))]

    def rest_on_contact(self, approaches: Array, misfit: Array, contact: Mask, owner: Indices) -> None:
        """Shift the groups' approaches so that the gap vanishes on average over the area of their contacts."""
        for (members, _), mine in zip(self.groups, self.groups_within(contact, owner), strict=True):
            if not np.any(mine):
                raise NotConverged(
                    "grid contact: a ball under a prescribed force lost its contact during the iteration; "
                    "press the balls less deep or closer to equal depth; an own profile must be convex"
                )
            approaches[members] += np.average(misfit[mine], weights=None if self.equal else self.area[mine])

    def with_prescribed_forces(self, p: Array, owner: Indices) -> Array:
        """Return pressures scaled to the groups' forces (the same array if they already have these forces)."""
        factor = np.ones(len(self.groups) + 1)
        kind = self.group_of[owner]
        for g, (_, force) in enumerate(self.groups):
            total = float(np.sum((p * self.area)[kind == g]))
            factor[g] = force / total if total > 0.0 else 1.0
        if np.all(np.abs(factor - 1.0) < 1e-12):
            return p
        return p * factor[kind]

    def descent(self, residual: Array, contact: Mask, owner: Indices) -> tuple[Array, float]:
        """Return a direction of descent that keeps the groups' forces, and its product with the residual.

        If a group's cells have one size, the mean of M r is subtracted, an orthogonal projection (M is the
        preconditioner). If they differ, a constant is a poor change of pressure: a small contact needs more pressure
        for the same approach. Then z and the changes d of the approaches solve K p - D = r with M for K's inverse,
        z = M (r - sum_g d_g 1_g) and <1_g, z> = 0; then <r, z> >= 0 by Schwarz's inequality, for any approaches.
        """
        masks = self.groups_within(contact, owner)
        z = self.precondition(residual, contact)
        if not self.equal and any(np.ptp(self.area[mine]) > 0.0 for mine in masks):
            responses = [self.precondition(mine.astype(float), contact) for mine in masks]
            forces = np.array([[np.sum((m * self.area)[mine]) for m in responses] for mine in masks])
            excess = np.array([np.sum((z * self.area)[mine]) for mine in masks])
            for d, m in zip(np.linalg.solve(forces, excess), responses, strict=True):
                z -= d * m
        else:
            self._subtract_means(z, masks)
        slope = float(residual @ (z * self.area))
        if slope > 0.0:
            return z, slope
        z = residual.copy()
        self._subtract_means(z, masks)
        return z, float(residual @ (z * self.area))

    def _subtract_means(self, z: Array, masks: list[Mask]) -> None:
        for mine in masks:
            z[mine] -= np.sum((z * self.area)[mine]) / np.sum(self.area[mine])


class _Progress:
    """Shortens the steps, and finally stops, while the gap does not fall."""

    def __init__(self) -> None:
        self.damping = 1.0
        self._best, self._since, self._improved = np.inf, 0, 0

    def ends(self, iteration: int, gap: float, restart: bool) -> bool:
        """Return whether to stop the iteration; shorten steps if cells are gained and lost alternately."""
        if gap < 0.9 * self._best:
            self._best, self._since, self._improved = gap, 0, iteration
        self._since += 1
        if self._since > PATIENCE and restart:
            self.damping, self._since = max(0.5 * self.damping, 0.05), 0
        return iteration - self._improved > HOPELESS


def solve_bounded(
    patches: Patches,
    heights: list[Array],
    pressures: Sequence[Array],
    approaches: Array,
    groups: Groups,
    tolerance: float = 1e-8,
    report: Report = silent,
) -> GridState:
    """Return the state with p >= 0, gap >= 0, p gap = 0.

    ``heights`` holds per patch the members' f at its cells, shape (members, nx, ny) [m]; balls in no group of
    ``groups`` keep their approach. Soft layers need 10 to 30 steps on any grid; a stiff film on a soft base, with its
    pressure concentrated at the contact's edge, needs hundreds: at most 3000 on small grids, 600 on others.
    ``report`` receives a line per step. Raises `NotConverged`.
    """
    cells = _Cells(patches, heights, groups, len(approaches))
    approaches = approaches.astype(float).copy()
    depth, owner = cells.envelope(approaches)
    p = cells.with_prescribed_forces(np.concatenate([q.ravel() for q in pressures]), owner)
    w = cells.apply(p)
    direction, old, restart = np.zeros_like(p), 1.0, True
    gap_inside = penetration = np.inf
    progress = _Progress()
    for iteration in range(3000 if p.size <= 40_000 else 600):
        contact = p > 0.0
        for _ in range(2):
            cells.rest_on_contact(approaches, w - depth, contact, owner)
            depth, owner = cells.envelope(approaches)
        gap = w - depth
        scale = float(np.max(np.abs(approaches)))
        gap_inside = float(np.max(np.abs(gap[contact]), initial=0.0)) / scale
        penetration = float(np.max(-gap[~contact], initial=0.0)) / scale
        left = f"gap {gap_inside:.1e}, penetration {penetration:.1e}, tolerance {tolerance:.1e}"
        report(f"grid of {p.size} cells, step {iteration + 1}: {left}")
        if gap_inside < tolerance and penetration < tolerance and iteration > 0:
            return GridState(cells.split(p), cells.split(w), cells.split(owner), approaches, iteration)
        if not np.any(contact):
            # all contact was lost in one step: restart from the cells that penetrate
            p, restart = np.maximum(-0.5 * gap / cells.diagonal, 0.0), True
            w = cells.apply(p)
            continue
        residual = np.where(contact, gap, 0.0)
        z, new = cells.descent(residual, contact, owner)
        direction = np.where(contact, z + (0.0 if restart else new / old) * direction, 0.0)
        old = new
        image, curvature = cells.curvature(direction)
        if curvature <= 0.0:
            direction, restart = z, True
            image, curvature = cells.curvature(direction)
        settled = gap_inside < tolerance  # the contact needs no step, cells outside it may have to be gained
        if not (curvature > 0.0 or settled):
            raise NotConverged(
                f"grid contact: after {iteration} steps no direction of descent is left, at a gap of {gap_inside:.1e} "
                f"and a penetration of {penetration:.1e} of the approach, tolerance {tolerance:.1e}: roundoff exceeds "
                "the tolerance; take a smaller load, a thicker film or a lower E1/E2"
            )
        if progress.ends(iteration, gap_inside, restart):
            break
        descent = float(residual @ (direction * cells.area)) / curvature if curvature > 0.0 else 0.0
        step = (progress.damping if restart else 1.0) * descent
        p = p - step * direction
        lost = contact & (p <= 0.0)
        p[p < 0.0] = 0.0
        gained = ~contact & (gap < -0.5 * tolerance * scale)
        p[gained] = -0.5 * progress.damping * gap[gained] / cells.diagonal[gained]
        restart = bool(np.any(lost) or np.any(gained))
        before = p
        p = cells.with_prescribed_forces(p, owner)
        w = cells.apply(p) if restart or p is not before else w - step * image
    raise NotConverged(
        f"grid contact: {iteration + 1} conjugate-gradient steps left a gap of {gap_inside:.1e} and a penetration of "
        f"{penetration:.1e} of the approach, tolerance {tolerance:.1e}; a film much stiffer than its base, and thin "
        "against the contact, concentrates the pressure at the edge: take a smaller load, a thicker film or a lower "
        "E1/E2"
    )
