"""Groups close balls on shared patches, so that the kernel between patches is smooth on their scale."""

import numpy as np

from linear_bem.arrays import Array
from linear_bem.grid.patches import Patch, Patches
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem
from linear_bem.report import Report


def shared_patches(
    problem: Problem, kernel: LayeredKernel, reach: dict[int, float], count: int, report: Report
) -> Patches:
    """Return patches of at least ``count`` cells across; balls that are close share one.

    ``reach`` holds the half width [m] of a patch about each ball alone; ``report`` is that of `Patches`.
    """
    members = [[i] for i in range(problem.size)]
    low, high, margin = problem.positions, problem.positions, np.array([reach[i] for i in range(problem.size)])
    while (pair := _first_close(low, high, margin)) is not None:
        i, j = pair
        members[j] += members.pop(i)
        low[j], high[j] = np.minimum(low[i], low[j]), np.maximum(high[i], high[j])
        margin[j] = max(margin[i], margin[j])
        low, high, margin = (np.delete(values, i, axis=0) for values in (low, high, margin))
    patches = []
    for balls, first, last, beyond in zip(members, low, high, margin, strict=True):
        cell = 2.0 * min(reach[i] for i in balls) / count
        # even counts, so that the line between two equal balls falls between cells
        nx, ny = (2 * int(np.ceil(0.5 * side / cell - 1e-9)) for side in last - first + 2.0 * beyond)
        x, y = (0.5 * (first + last)).tolist()
        patches.append(Patch(kernel, (x, y), cell, nx, ny, tuple(sorted(balls)), 10 if len(members) <= 30 else 6))
    return Patches(kernel, patches, report)


def _first_close(low: Array, high: Array, margin: Array) -> tuple[int, int] | None:
    """Return the first two patches with a gap below 1.2 half widths of the larger one.

    Patches reach ``margin`` (n,) [m] beyond the bounding boxes of their balls' axes, ``low`` to ``high`` (n, 2) [m].
    """
    half_width = 0.5 * np.max(high - low, axis=1) + margin
    gap = np.max(np.maximum(low[:, None] - high, low - high[:, None]), axis=2) - margin[:, None] - margin
    close = np.argwhere(np.tril(gap < 1.2 * np.maximum(half_width[:, None], half_width), -1))
    return (int(close[0, 0]), int(close[0, 1])) if len(close) else None
