"""Geometry of many loads: groups that lie far apart, and near pairs of loads of different sizes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from linear_bem.arrays import Array, Indices

FINEST = 512
"""Largest number of squares along the extent in the search for groups."""
FEWEST = 8
"""Least mean number of loads in a group."""
CLASSES = 6
"""Number of size classes; the loads of a class are half as large as those of the previous class."""


@dataclass(frozen=True)
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


class UnlikePairs:
    """Pairs of loads of different ``sizes`` (n,) [m] that are nearer than reach(first size, second size) [m]."""

    def __init__(self, centres: Array, sizes: Array) -> None:
        self.centres, self.sizes = centres, np.broadcast_to(np.asarray(sizes, dtype=float), len(centres))
        largest = float(np.max(self.sizes))
        step = -np.log2(np.maximum(self.sizes, 1e-300) / largest) if largest > 0.0 else np.zeros(len(centres))
        place = np.minimum(step.astype(int), CLASSES - 1)
        members = [np.flatnonzero(place == k) for k in np.unique(place)]
        self._classes = [(m, cKDTree(centres[m]), float(np.max(self.sizes[m]))) for m in members]

    def _of_classes(self) -> Iterator[tuple[Indices, cKDTree, float, Indices, cKDTree, float]]:
        for k, one in enumerate(self._classes):
            for other in self._classes[k:]:
                yield (*one, *other)

    def count(self, reach: Callable[[float, float], float]) -> float:
        """Return an upper bound of the number of pairs: each class counts with its largest size."""
        total = 0.0
        for m, tree, a, n, other, b in self._of_classes():
            found = float(tree.count_neighbors(other, reach(a, b)))
            total += 0.5 * (found - len(m)) if m is n else found
        return total

    def within(self, reach: Callable[[Any, Any], Any]) -> tuple[Indices, Indices]:
        """Return the indices of the pairs, each first below its second."""
        firsts, seconds = [], []
        for m, tree, a, n, other, b in self._of_classes():
            most = reach(a, b)
            if m is n:
                i, j = tree.query_pairs(most, output_type="ndarray").T
            else:
                found = tree.sparse_distance_matrix(other, most, output_type="ndarray")
                i, j = found["i"], found["j"]
            firsts.append(m[i])
            seconds.append(n[j])
        first, second = np.concatenate(firsts), np.concatenate(seconds)
        if len(self._classes) > 1 or np.any(self.sizes != self.sizes[0]):
            apart = np.hypot(*(self.centres[first] - self.centres[second]).T)
            kept = apart < reach(self.sizes[first], self.sizes[second])
            first, second = first[kept], second[kept]
        return np.minimum(first, second), np.maximum(first, second)
