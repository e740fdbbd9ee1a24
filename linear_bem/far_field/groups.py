"""Groups of loads that lie far apart."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from linear_bem.arrays import Array, Indices

FINEST = 512
"""Largest number of squares along the extent in the search for groups."""
FEWEST = 8
"""Least mean number of loads in a group."""


@dataclass(frozen=True, eq=False)
class Groups:
    """Rectangles from ``low`` to ``high`` (groups, 2) [m], ``gap`` [m] or more apart; ``owners``: each load's group."""

    owners: Indices
    low: Array
    high: Array
    gap: float


def groupings(centres: Array, margins: Array) -> Iterator[Groups]:
    """Yield all loads as one group, then more and more groups; ``margins`` (n,) [m] surround ``centres`` (n, 2) [m]."""
    around = np.broadcast_to(margins, len(centres))[:, None]
    low, high = centres - around, centres + around
    first, extent = low.min(axis=0), float(np.max(high.max(axis=0) - low.min(axis=0)))
    yield Groups(np.zeros(len(centres), dtype=np.intp), first[None], high.max(axis=0)[None], np.inf)
    count, squares = 1, 4
    while squares <= FINEST and extent > 0.0:
        side = extent / squares
        at = np.minimum(((centres - first) / side).astype(int), squares - 1)
        taken = np.zeros((squares, squares), dtype=bool)
        taken[at[:, 0], at[:, 1]] = True
        found = label(taken, np.ones((3, 3)))[0][at[:, 0], at[:, 1]] - 1
        if found.max() + 1 > len(centres) / FEWEST:
            return
        groups = _apart(found, low, high, side)
        if len(groups.low) > count:
            count = len(groups.low)
            yield groups
        squares *= 2


def _apart(owners: Indices, low: Array, high: Array, least: float) -> Groups:
    """Return the groups' rectangles; those less than ``least`` [m] apart are joined."""
    while True:
        count = int(owners.max()) + 1
        boxes = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        np.minimum.at(boxes[0], owners, low)
        np.maximum.at(boxes[1], owners, high)
        between = np.maximum(boxes[0][:, None] - boxes[1], boxes[0] - boxes[1][:, None])
        gaps = np.hypot(*np.maximum(between, 0.0).transpose(2, 0, 1))
        np.fill_diagonal(gaps, np.inf)
        joined, names = connected_components(csr_matrix(gaps < least), directed=False)
        if joined == count:
            return Groups(owners, *boxes, gap=float(np.min(gaps)))
        owners = names[owners]
