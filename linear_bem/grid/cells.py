"""The cells of a grid as one vector, and the state of pressures on it."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.errors import NotConverged
from linear_bem.grid.patches import Patches
from linear_bem.load_control import Groups

Value = TypeVar("Value", np.float64, np.intp)


@dataclass(frozen=True, eq=False)
class GridState:
    """Pressures times ``singular`` and displacements [m] of all patches, owners of cells, approaches [m]."""

    pressures: list[Array]
    displacements: list[Array]
    owners: list[Indices]
    approaches: Array
    iterations: int


class Cells:
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
        self.group_of = np.full(balls, -1)
        for g, (members, _) in enumerate(groups):
            self.group_of[members] = g
        self._known: tuple[Array, Array, Indices] | None = None

    def split(self, v: NDArray[Value]) -> list[NDArray[Value]]:
        """Return the values of all cells as one array per patch."""
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
            approaches[members] += np.average(misfit[mine], weights=self.area[mine])

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
        masks = [mine for mine in self.groups_within(contact, owner) if np.any(mine)]
        z = self.precondition(residual, contact)
        if any(np.ptp(self.area[mine]) > 0.0 for mine in masks):
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
