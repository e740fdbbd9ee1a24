"""Groups close balls on shared patches, so that the kernel between patches is smooth on their scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linear_bem.grid.patches import Patch, Patches
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem
from linear_bem.report import Report, silent


@dataclass(frozen=True)
class _Cluster:
    """Balls on one patch: the bounding box of their axes [m], and how far the patch reaches beyond it [m]."""

    members: tuple[int, ...]
    low: tuple[float, float]
    high: tuple[float, float]
    margin: float

    @property
    def half_width(self) -> float:
        return max(self.high[0] - self.low[0], self.high[1] - self.low[1]) / 2.0 + self.margin

    def is_close(self, other: _Cluster) -> bool:
        """Return whether the gap between the two patches is below 1.2 half widths of the larger one."""
        gap = max(max(self.low[k] - other.high[k], other.low[k] - self.high[k]) for k in (0, 1))
        return gap - self.margin - other.margin < 1.2 * max(self.half_width, other.half_width)

    def merged(self, other: _Cluster) -> _Cluster:
        return _Cluster(
            self.members + other.members,
            (min(self.low[0], other.low[0]), min(self.low[1], other.low[1])),
            (max(self.high[0], other.high[0]), max(self.high[1], other.high[1])),
            max(self.margin, other.margin),
        )


def shared_patches(
    problem: Problem, kernel: LayeredKernel, reach: dict[int, float], count: int, report: Report = silent
) -> Patches:
    """Return patches of at least ``count`` cells across; balls that are close share one.

    ``reach`` holds the half width [m] of a patch about each ball alone; ``report`` is that of `Patches`.
    """
    clusters = [_Cluster((i,), b.position, b.position, reach[i]) for i, b in enumerate(problem.balls)]

    def first_close() -> tuple[int, int] | None:
        pairs = ((i, j) for i in range(len(clusters)) for j in range(i))
        return next(((i, j) for i, j in pairs if clusters[i].is_close(clusters[j])), None)

    while (pair := first_close()) is not None:
        i, j = pair
        clusters[j] = clusters[j].merged(clusters.pop(i))
    order = 10 if len(clusters) <= 30 else 6
    patches = []
    for c in clusters:
        cell = 2.0 * min(reach[i] for i in c.members) / count
        sides = (c.high[0] - c.low[0] + 2.0 * c.margin, c.high[1] - c.low[1] + 2.0 * c.margin)
        # even counts, so that the line between two equal balls falls between cells
        nx, ny = (2 * int(np.ceil(0.5 * side / cell - 1e-9)) for side in sides)
        centre = (0.5 * (c.low[0] + c.high[0]), 0.5 * (c.low[1] + c.high[1]))
        patches.append(Patch(kernel, centre, cell, nx, ny, tuple(sorted(c.members)), order))
    return Patches(kernel, patches, report)
