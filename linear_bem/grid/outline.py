"""The outline of a contact on square cells: the excess area of the cells, and the error of the contact area."""

import numpy as np

from linear_bem.arrays import Array, Indices, Mask

SIDE = (np.pi - 1.0 + np.log(2.0)) / 24.0
"""Mean excess of the cells in contact over the contact, in cells per side of the outline.

[Yastrebov, Anciaux, Molinari 2017, Tribol. Int. 114, 161, doi 10.1016/j.triboint.2017.04.023, eq. 8]
"""
STRAIGHT, CURVED = 0.6, 1.0 / 3.0
"""Largest error of an edge's position [cells] along a run of sides: half a cell about a mean that differs from `SIDE`
by up to 0.1; and for a parabola that leaves the row of cells at both ends of the run (its mean is 2/3 of its rise)."""
ALIKE = 8
"""Number of symmetries of the grid: up to this many runs of one length may be mirror images, with equal errors."""


def excess_edge(mine: Mask, contact: Mask, *, periodic: bool = False) -> float:
    """Return the excess area [cells] of the cells in ``mine`` over the true contact, averaged over the edge's position.

    A side of the outline separates a cell in ``mine`` from a cell outside ``contact``.
    """
    return SIDE * sum(int(np.count_nonzero(sides)) for sides in _outline(mine, contact, periodic=periodic))


def edge_error(mine: Mask, contact: Mask, *, periodic: bool = False) -> float:
    """Return the error [cells] of the contact area: the area of the cells in ``mine`` less their `excess_edge`.

    Along a run of n sides in one row, the edge's position has one common error: up to `STRAIGHT` if the run has no ends
    or n exceeds sqrt(8 a), the longest run of a circle of the same area, of radius a [cells]; else up to `CURVED`.
    Runs of different lengths are independent; among m of one length, up to `ALIKE` errors add up. The error is at least
    the excess itself.
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
    """Return the lengths of the runs of sides along the second axis, which wraps around if ``periodic``."""
    if periodic:
        along = np.argmin(sides, axis=1)[:, None] + np.arange(sides.shape[1])
        sides = np.take_along_axis(sides, along % sides.shape[1], axis=1)
    steps = np.diff(np.pad(sides, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    return np.asarray(np.nonzero(steps == -1)[1] - np.nonzero(steps == 1)[1])
