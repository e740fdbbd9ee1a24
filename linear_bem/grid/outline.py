"""The outline of a contact on square cells: by how much its cells exceed it, and how well its area is known."""

import numpy as np

from linear_bem.arrays import Array, Indices, Mask

SIDE = (np.pi - 1.0 + np.log(2.0)) / 24.0
"""Mean excess of the cells in contact over the contact, in cells per side of the outline.

[Yastrebov, Anciaux, Molinari 2017, Tribol. Int. 114, 161, doi 10.1016/j.triboint.2017.04.023, eq. 8]
"""
STRAIGHT, CURVED = 0.6, 1.0 / 3.0
"""Largest error of an edge's place, in cells, along a run of sides: half a cell about a mean that differs from `SIDE`
by up to 0.1; and where a parabola leaves the row of cells at both ends of the run, whose mean is 2/3 of its rise."""
ALIKE = 8
"""Symmetries of the grid: so many runs of one length may be images of each other, with equal errors."""


def excess_edge(mine: Mask, contact: Mask, *, periodic: bool = False) -> float:
    """Return by how many cells those in ``mine`` exceed the true contact, on average over the edge's position.

    A side of the outline is shared by a cell in ``mine`` and one out of ``contact``.
    """
    return SIDE * sum(int(np.count_nonzero(sides)) for sides in _outline(mine, contact, periodic=periodic))


def edge_error(mine: Mask, contact: Mask, *, periodic: bool = False) -> float:
    """Return the error of the area of the cells in ``mine`` less their `excess_edge`, in cells.

    Along a run of n sides in one row the edge is out of place by one and the same part of a cell: by up to `STRAIGHT`
    if n exceeds sqrt(8 a), the longest run of a circle of the same area and a radius of a cells, or the run has no
    ends; else by up to `CURVED`. Runs of unlike length are independent; among m of one length, up to `ALIKE` add up.
    At least the excess itself.
    """
    lengths = np.concatenate([_runs(sides, periodic=periodic) for sides in _outline(mine, contact, periodic=periodic)])
    count = np.bincount(lengths)
    length = np.arange(len(count))
    straight = length > np.sqrt(8.0 * np.sqrt(np.count_nonzero(mine) / np.pi))
    if periodic:
        straight |= np.isin(length, mine.shape)
    place = np.where(straight, STRAIGHT, CURVED) * length
    return float(max(np.sqrt(np.sum(np.minimum(count, ALIKE) * count * place**2)), SIDE * np.sum(lengths)))


def edge_mean(values: Array, mine: Mask, contact: Mask) -> float:
    """Return the mean of ``values`` over the sides of the outline of the cells in ``mine``; 0 where there are none."""
    first, second, third, fourth = (sides.astype(float) for sides in _outline(mine, contact, periodic=False))
    sides = first + second + (third + fourth).T
    return float(np.average(values, weights=sides)) if np.any(sides) else 0.0


def _outline(mine: Mask, contact: Mask, *, periodic: bool) -> list[Mask]:
    """Return the sides of the outline that face each of the four directions; the second axis runs along them."""
    found = []
    for axis in (0, 1):
        for step in (1, -1):
            free = ~np.roll(contact, step, axis)
            if not periodic:  # a cell at the rim has no neighbour beyond it
                rim = [slice(None), slice(None)]
                rim[axis] = slice(0, 1) if step == 1 else slice(-1, None)
                free[tuple(rim)] = False
            sides = mine & free
            found.append(sides if axis == 0 else sides.T)
    return found


def _runs(sides: Mask, *, periodic: bool) -> Indices:
    """Return the numbers of sides in a row along the second axis, which goes on at its start if ``periodic``."""
    if periodic:
        along = np.argmin(sides, axis=1)[:, None] + np.arange(sides.shape[1])
        sides = np.take_along_axis(sides, along % sides.shape[1], axis=1)
    steps = np.diff(np.pad(sides, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    return np.asarray(np.nonzero(steps == -1)[1] - np.nonzero(steps == 1)[1])
