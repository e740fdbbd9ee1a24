"""Contact of one rigid height field with the layer on one grid, the benchmark problem of contact codes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.errors import InvalidProblem, NotConverged
from linear_bem.grid.patches import Patch, Patches
from linear_bem.grid.polonsky_keer import GridState, solve_bounded
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.problem import Elastic, Layer

_COARSE = 32
_COARSE_TOLERANCE = 1e-4


@dataclass(frozen=True)
class HeightFieldContact:
    """Pressure [Pa] and displacement [m] at the cells, approach [m], force [N], and the recomputed residuals."""

    pressure: Array
    displacement: Array
    approach: float
    normal_force: float
    iterations: int
    gap_in_contact: float
    penetration_outside: float


def _solve_grid(
    whole: Patch, heights: Array, groups: Groups, pressure: Array, depth: Array, tolerance: float
) -> tuple[Array, Array, GridState]:
    """Return pressures and displacements on the whole grid, from a box that grows until it holds the contact."""
    needed = pressure > 0.0
    for _ in range(12):
        box = _box(needed)
        inside = heights[box]
        patches = Patches(whole.kernel, [whole.part(inside.shape[0], inside.shape[1])])
        start = [np.ascontiguousarray(pressure[box])]
        state = solve_bounded(patches, [inside[None]], start, depth, groups, tolerance)
        pressure = np.zeros(heights.shape)
        pressure[box] = state.pressures[0]
        w = whole.displacement(pressure)
        depth = state.approaches
        penetrating = heights + w - depth[0] < -tolerance * abs(float(depth[0]))
        penetrating[box] = False
        if not np.any(penetrating):
            return pressure, w, state
        needed = (pressure > 0.0) | penetrating
    raise NotConverged("solve_height_field: the contact kept growing out of the box that was solved")


def _box(needed: Mask) -> tuple[slice, slice]:
    """Return the marked cells' bounding box, a tenth wider."""

    def side(axis: int) -> slice:
        loaded = np.flatnonzero(np.any(needed, axis=1 - axis))
        margin = 2 + (loaded[-1] - loaded[0]) // 20
        return slice(max(loaded[0] - margin, 0), min(loaded[-1] + 1 + margin, needed.shape[axis]))

    return side(0), side(1)


def solve_height_field(
    layer: Layer,
    substrate: Elastic | None,
    heights: Array,
    cell: float,
    *,
    normal_force: float | None = None,
    approach: float | None = None,
    tolerance: float = 1e-8,
) -> HeightFieldContact:
    """Return the non-periodic contact of a rigid surface with ``heights`` [m] at the centres of square cells [m].

    The lowest height touches first. Exactly one of ``normal_force`` [N] and ``approach`` [m] (measured from height 0)
    is given. Each grid starts from the solution on one of twice the spacing, down to about 32 cells across.
    ``tolerance`` bounds gap in contact and penetration anywhere, over the approach, recomputed on the whole grid.
    Raises `InvalidProblem` and `NotConverged`.
    """
    heights = np.asarray(heights, dtype=float)
    given = [v for v in (normal_force, approach) if v is not None]
    if len(given) != 1 or heights.ndim != 2 or min(heights.shape) < 4:
        raise InvalidProblem(
            "solve_height_field: needs one of normal_force and approach, and at least 4 x 4 heights; got "
            f"{normal_force}, {approach} and heights of shape {heights.shape}"
        )
    kernel = LayeredKernel(layer, substrate)
    groups = [([0], normal_force * kernel.singular)] if normal_force is not None else []
    grids = [heights]
    while min(grids[-1].shape) >= 2 * _COARSE and not any(n % 2 for n in grids[-1].shape):
        h = grids[-1]
        grids.append(0.25 * (h[::2, ::2] + h[1::2, ::2] + h[::2, 1::2] + h[1::2, 1::2]))
    low = float(np.min(grids[-1]))
    rise = float(np.median(grids[-1])) - low
    depth = np.array([approach if approach is not None else low + 0.3 * rise])
    pressure = np.maximum(depth[0] - grids[-1], 0.0)
    if not np.any(pressure):
        pressure = np.where(grids[-1] == low, 1.0, 0.0)
    for k in range(len(grids) - 1, -1, -1):
        nx, ny = grids[k].shape
        whole = Patch(kernel, (0.0, 0.0), cell * 2**k, nx, ny, (0,))
        accepted = tolerance if k == 0 else _COARSE_TOLERANCE
        pressure, w, state = _solve_grid(whole, grids[k], groups, pressure, depth, accepted)
        depth = state.approaches
        if k > 0:
            pressure = np.repeat(np.repeat(pressure, 2, axis=0), 2, axis=1)
    gap = w + heights - depth[0]
    scale = abs(float(depth[0]))
    contact = pressure > 0.0
    return HeightFieldContact(
        pressure=pressure / kernel.singular,
        displacement=w,
        approach=float(depth[0]),
        normal_force=float(np.sum(pressure)) * cell**2 / kernel.singular,
        iterations=state.iterations,
        gap_in_contact=float(np.max(np.abs(gap[contact]))) / scale,
        penetration_outside=float(np.max(-gap[~contact], initial=0.0)) / scale,
    )
