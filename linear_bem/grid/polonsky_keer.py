r"""Non-negative pressures on a grid by preconditioned, constrained conjugate gradients.

The method of [Polonsky and Keer 1999, Wear 231, 206, doi 10.1016/S0043-1648(99)00113-1] with two
changes: the search direction is preconditioned by the periodic inverse of the influence matrix
(iterations then hardly grow with the grid), and any groups of balls may have their forces prescribed,
each with its own unknown approach. Forces are kept by projecting the direction; where a group's balls have
cells of different size (one holder for unequal balls), in the preconditioner's own metric. It stops when, relative
to the largest approach, the gap in contact and the penetration outside are both below the tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.errors import NotConverged
from linear_bem.grid.patches import Patches

PATIENCE = 60
"""Steps without progress after which steps are shortened."""
HOPELESS = 1000
"""Steps without progress after which the solver gives up; the hardest case that was solved took 920 to get going."""


@dataclass(frozen=True)
class GridState:
    """Pressures over ``singular`` and displacements [m] of all patches, owners of cells, approaches [m]."""

    pressures: list[Array]
    displacements: list[Array]
    owners: list[Indices]
    approaches: Array
    iterations: int
    gap: float
    penetration: float


class _Joined:
    """Lists of patch arrays as one vector, with the envelope of the balls over each cell."""

    def __init__(self, patches: Patches, heights: list[Array]) -> None:
        self.patches = patches
        self.shapes = [(p.nx, p.ny) for p in patches.patches]
        self.ends = np.cumsum([a * b for a, b in self.shapes])
        self.heights = heights
        self.members = [np.array(p.members) for p in patches.patches]
        self._known: tuple[Array, Array, Indices] | None = None
        self.area = np.concatenate(
            [np.full(a * b, p.cell**2) for (a, b), p in zip(self.shapes, patches.patches, strict=True)]
        )
        self.equal = len({p.cell for p in patches.patches}) == 1

    def split(self, v: Array) -> list[Array]:
        return [part.reshape(s) for part, s in zip(np.split(v, self.ends[:-1]), self.shapes, strict=True)]

    def split_owner(self, v: Indices) -> list[Indices]:
        return [part.reshape(s) for part, s in zip(np.split(v, self.ends[:-1]), self.shapes, strict=True)]

    def apply(self, v: Array) -> Array:
        return np.concatenate([w.ravel() for w in self.patches.displacement(self.split(v))])

    def precondition(self, v: Array) -> Array:
        return np.concatenate(
            [p.precondition(r).ravel() for p, r in zip(self.patches.patches, self.split(v), strict=True)]
        )

    def envelope(self, approaches: Array) -> tuple[Array, Indices]:
        """Return the lowest indenter's depth D - f [m] at each cell, and which ball that is.

        Kept while the approaches are; where all move together only the depth changes.
        """
        if self._known is not None:
            at, depth, owner = self._known
            shift = approaches - at
            if np.ptp(shift) == 0.0:
                return depth + shift[0] if shift[0] != 0.0 else depth, owner
        lowest, owners = [], []
        for f, members in zip(self.heights, self.members, strict=True):
            best, which = approaches[members[0]] - f[0], np.full(f[0].shape, members[0])
            for height, ball in zip(f[1:], members[1:], strict=True):
                each = approaches[ball] - height
                deeper = each > best
                best[deeper] = each[deeper]
                which[deeper] = ball
            lowest.append(best.ravel())
            owners.append(which.ravel())
        self._known = approaches.copy(), np.concatenate(lowest), np.concatenate(owners)
        return self._known[1:]


def solve_bounded(
    patches: Patches,
    heights: list[Array],
    pressures: list[Array],
    approaches: Array,
    groups: list[tuple[list[int], float]],
    tolerance: float = 1e-8,
    limit: int | None = None,
) -> GridState:
    """Return the state with p >= 0, gap >= 0, p gap = 0.

    ``heights`` holds per patch the members' f at its cells, shape (members, nx, ny) [m]; ``groups`` as in
    `solve_zones`. Soft layers take 10 to 30 steps on any grid; a stiff film on a soft base, whose
    pressure crowds at the contact's edge, hundreds: ``limit`` is 3000 on small grids, 600 on others. Raises
    `NotConverged`.
    """
    joined = _Joined(patches, heights)
    approaches = approaches.astype(float).copy()
    p = np.concatenate([q.ravel() for q in pressures])
    label = np.full(len(approaches), -1)
    for g, (members, _) in enumerate(groups):
        label[members] = g
    wanted = np.array([force for _, force in groups])
    depth, owner = joined.envelope(approaches)
    p = _scaled(p, label[owner], wanted, joined.area)
    w = joined.apply(p)
    direction, old, restart = np.zeros_like(p), 1.0, True
    diagonal = np.concatenate(
        [np.full(a * b, q.influence[0, 0]) for (a, b), q in zip(joined.shapes, patches.patches, strict=True)]
    )
    worst = penetration = best = np.inf
    damping, since, progress = 1.0, 0, 0
    if limit is None:
        limit = 3000 if p.size <= 40_000 else 600
    for iteration in range(limit):
        contact = p > 0.0
        for _ in range(2):
            _rest_on_contact(approaches, w - depth, contact, label[owner], groups, joined)
            depth, owner = joined.envelope(approaches)
        gap = w - depth
        scale = float(np.max(np.abs(approaches)))
        worst = float(np.max(np.abs(gap[contact]), initial=0.0)) / scale
        penetration = float(np.max(-gap[~contact], initial=0.0)) / scale
        if worst < tolerance and penetration < tolerance and iteration > 0:
            return GridState(
                joined.split(p), joined.split(w), joined.split_owner(owner), approaches,
                iteration, worst, penetration,
            )  # fmt: skip
        if not np.any(contact):
            # all was lost in one step: take up again what penetrates
            p = np.maximum(-0.5 * gap / diagonal, 0.0)
            w, restart = joined.apply(p), True
            continue
        residual = np.where(contact, gap, 0.0)
        z, new = _descent(joined, residual, contact, label[owner], len(groups))
        direction = np.where(contact, z + (0.0 if restart else new / old) * direction, 0.0)
        old = new
        image = joined.apply(direction)
        curvature = float(direction @ (image * joined.area))
        if curvature <= 0.0:
            direction, restart = z, True
            image = joined.apply(direction)
            curvature = float(direction @ (image * joined.area))
        if not curvature > 0.0:
            raise NotConverged(
                f"grid contact: after {iteration} steps no direction of descent is left, at a gap of {worst:.1e} and a "
                f"penetration of {penetration:.1e} of the approach, tolerance {tolerance:.1e}: roundoff exceeds the "
                "tolerance; take a smaller load, a thicker film or a lower E1/E2"
            )
        if worst < 0.9 * best:
            best, since, progress = worst, 0, iteration
        if iteration - progress > HOPELESS:
            break
        since += 1
        if since > PATIENCE and restart:
            # cells that are gained and lost in turn: move less far at once
            damping, since = max(0.5 * damping, 0.05), 0
        step = (damping if restart else 1.0) * float(residual @ (direction * joined.area)) / curvature
        p = p - step * direction
        lost = contact & (p <= 0.0)
        p[p < 0.0] = 0.0
        gained = ~contact & (gap < -0.5 * tolerance * scale)
        p[gained] = -0.5 * damping * gap[gained] / diagonal[gained]
        restart = bool(np.any(lost) or np.any(gained))
        before = p
        p = _scaled(p, label[owner], wanted, joined.area)
        w = joined.apply(p) if restart or p is not before else w - step * image
    raise NotConverged(
        f"grid contact: {iteration + 1} conjugate-gradient steps left a gap of {worst:.1e} and a penetration of "
        f"{penetration:.1e} of the approach, tolerance {tolerance:.1e}; a film very much stiffer than its base, and "
        "thin against the contact, crowds the pressure at the edge: take a smaller load, a thicker film or a lower "
        "E1/E2"
    )


def _rest_on_contact(
    approaches: Array,
    misfit: Array,
    contact: Mask,
    kind: Indices,
    groups: list[tuple[list[int], float]],
    joined: _Joined,
) -> None:
    """Shift the groups' approaches so that the gap vanishes on average over the area of their contacts."""
    for g, (members, _) in enumerate(groups):
        mine = contact & (kind == g)
        if not np.any(mine):
            raise NotConverged("grid contact: a ball under a prescribed force lost its contact on the way")
        approaches[members] += np.average(misfit[mine], weights=None if joined.equal else joined.area[mine])


def _descent(joined: _Joined, residual: Array, contact: Mask, kind: Indices, groups: int) -> tuple[Array, float]:
    """Return a direction of descent that keeps the groups' forces, and its product with the residual.

    Forces are <1_g, p> in the product weighted by area, in which influence K and preconditioner M are symmetric.
    Where a group's cells are of one size the mean of M r is subtracted, an orthogonal projection. Where they are not, a
    constant is a poor change of pressure: a small contact takes more pressure for the same approach. There z and the
    changes d of the approaches solve K p - D = r with M for K's inverse, z = M (r - sum_g d_g 1_g) and <1_g, z> = 0;
    then <r, z> >= 0 by Schwarz's inequality, wherever the approaches are.
    """
    masks = [contact & (kind == g) for g in range(groups)]
    z = np.where(contact, joined.precondition(residual), 0.0)
    if not joined.equal and any(np.ptp(joined.area[mine]) > 0.0 for mine in masks):
        responses = [np.where(contact, joined.precondition(mine.astype(float)), 0.0) for mine in masks]
        forces = np.array([[np.sum((m * joined.area)[mine]) for m in responses] for mine in masks])
        excess = np.array([np.sum((z * joined.area)[mine]) for mine in masks])
        for d, m in zip(np.linalg.solve(forces, excess), responses, strict=True):
            z -= d * m
    else:
        _subtract_means(z, masks, joined.area)
    slope = float(residual @ (z * joined.area))
    if slope > 0.0:
        return z, slope
    z = residual.copy()
    _subtract_means(z, masks, joined.area)
    return z, float(residual @ (z * joined.area))


def _subtract_means(z: Array, masks: list[Mask], area: Array) -> None:
    for mine in masks:
        z[mine] -= np.sum((z * area)[mine]) / np.sum(area[mine])


def _scaled(p: Array, kind: Indices, wanted: Array, area: Array) -> Array:
    """Return pressures whose group forces are exactly the prescribed ones (the same array where they already are)."""
    factor = np.ones(len(wanted) + 1)
    for g, force in enumerate(wanted):
        total = float(np.sum((p * area)[kind == g]))
        factor[g] = force / total if total > 0.0 else 1.0
    if np.all(np.abs(factor - 1.0) < 1e-12):
        return p
    return p * factor[kind]
