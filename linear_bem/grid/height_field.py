"""Contact of one rigid height field (a rough or user-defined surface) with the layer, isolated or periodic."""

import math
from collections.abc import Sequence
from dataclasses import replace
from numbers import Real

import numpy as np
from scipy.optimize import brentq

from linear_bem.arrays import Array, Mask
from linear_bem.depth import BETWEEN, CHECK_UNITS, LARGE_STRAIN, dent, large_strain_note
from linear_bem.errors import InvalidProblem, NotConverged
from linear_bem.grid.height_field_contact import HeightFieldContact, coarse_note
from linear_bem.grid.height_field_input import grid_faults, load_faults, real
from linear_bem.grid.outline import edge_error, excess_edge
from linear_bem.grid.patches import Patch, Patches
from linear_bem.grid.periodic import PeriodicPatch
from linear_bem.grid.polonsky_keer import GridState, solve_bounded
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.media import Elastic, Layer, SurfaceResponse, medium_faults, without_empty_layer

_COARSE, _COARSE_TOLERANCE = 32, 1e-4
"""Least number of cells across of the grids that give first guesses, and their tolerance."""
STEEP = 10.0
"""Root mean square slope of heights above which a note questions their unit."""
OF_HEIGHTS = {
    LARGE_STRAIN: "the surface is pressed down by up to",
    BETWEEN: "forces",
    CHECK_UNITS: "check the units of heights, cell and layer",
}
"""Words of notes on balls, and of the same notes on a height field."""
LEAST_GAP = 1e-9
"""Smallest mean gap over the mean height above the lowest one; a smaller gap is complete contact to roundoff."""


def _solve_grid(
    whole: Patch, heights: Array, groups: Groups, pressure: Array, depth: Array, tolerance: float
) -> tuple[Array, Array, GridState]:
    """Return pressures and displacements on the whole grid, from a box that grows until it holds the contact."""
    if isinstance(whole, PeriodicPatch):
        state = solve_bounded(Patches(whole.kernel, [whole]), [heights[None]], [pressure], depth, groups, tolerance)
        return state.pressures[0], state.displacements[0], state
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
    raise NotConverged("solve_height_field: the contact kept growing out of its box; press the surface less deep")


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
    mean_gap: float | None = None,
    periodic: bool = False,
    ends_at_edge: bool = False,
    tolerance: float = 1e-8,
) -> HeightFieldContact:
    """Return the contact of a rigid surface with ``heights`` [m] at the centres of square cells of side ``cell`` [m].

    The lowest height touches first. Exactly one load is given: ``normal_force`` [N] (of one period), ``approach`` [m]
    (measured from height 0), or, where ``periodic``, ``mean_gap`` [m] between the deformed surfaces. A surface that is
    not periodic must lift off before its grid ends, unless the body ``ends_at_edge``. Coarser grids, from about 32
    cells across, give first guesses. ``tolerance`` bounds the gap in contact and the penetration anywhere, over the
    approach from the lowest height, recomputed on the whole grid. ``layer`` may be a `SurfaceResponse`.
    Raises `InvalidProblem` and `NotConverged`.
    """
    heights = real(heights)
    loads = {"normal_force": normal_force, "approach": approach, "mean_gap": mean_gap}
    faults = [*medium_faults(layer, substrate), *grid_faults(heights, cell), *load_faults(loads, periodic)]
    if not (isinstance(tolerance, Real) and 0.0 < tolerance < 0.1):
        faults.append(f"tolerance: must be a number greater than 0 and less than 0.1, got {tolerance!r}")
    if faults:
        raise InvalidProblem(*faults)
    layer, substrate = without_empty_layer(layer, substrate)
    lowest = float(np.min(heights))
    above, kernel = heights - lowest, LayeredKernel(layer, substrate)
    whole = _patch(kernel, cell, above.shape, periodic)
    if normal_force is not None:
        found = _solve_grids(whole, above, normal_force, None, tolerance)
    else:
        depth, gap = _prescribed(above, lowest, loads, whole)
        own_response = isinstance(layer, SurfaceResponse)
        if depth is not None and substrate is None and not own_response and depth >= layer.thickness:
            raise InvalidProblem(
                "approach: must press the lowest height less deep than the thickness of a layer on a rigid base, "
                f"{layer.thickness:g} m, got {depth:g} m; check the units of heights and layer, or press less deep"
            )
        if depth is not None:
            found = _solve_grids(whole, above, None, depth, tolerance)
        else:
            assert isinstance(whole, PeriodicPatch)
            found = _at_mean_gap(whole, above, gap, tolerance)
    if not periodic and not ends_at_edge:
        _refuse_clipped(found.pressure)
    w, base = found.displacement, dent(substrate, layer.thickness, found.normal_force, found.contact_area)
    if periodic and substrate is not None:  # w excludes its mean; on a rigid base it bounds the layer's part
        rigid = LayeredKernel(layer)
        w, base = _patch(rigid, cell, above.shape, periodic).displacement(found.pressure * rigid.singular), 0.0
    notes = large_strain_note(layer, float(np.max(w[found.pressure > 0.0])), base)
    for words, of_heights in OF_HEIGHTS.items():
        notes = tuple(note.replace(words, of_heights) for note in notes)
    notes = (*_steep_note(heights, cell), *coarse_note(found), *notes)
    return replace(found, approach=found.approach + lowest, notes=notes)


def _steep_note(heights: Array, cell: float) -> tuple[str, ...]:
    """Return a note on heights whose slopes no small strain permits, as if heights and cell were in unlike units."""
    # walls are steep, but few: not the mean
    slope = min(float(np.median(np.abs(np.diff(heights, axis=axis)))) for axis in (0, 1)) / cell
    if slope <= STEEP:
        return ()
    return (f"the median slope of the heights is {slope:.3g}; check the units of heights and cell",)


def _solve_grids(
    whole: Patch, above: Array, force: float | None, depth: float | None, tolerance: float
) -> HeightFieldContact:
    """Return the contact under a force [N] or at an approach from the lowest height [m], from coarse grids to fine."""
    kernel, periodic = whole.kernel, isinstance(whole, PeriodicPatch)
    if isinstance(whole, PeriodicPatch) and not np.any(above):
        return _flat(whole, above, force, depth)
    groups: Groups = [([0], force * kernel.singular)] if force is not None else []
    grids = [above]
    while min(grids[-1].shape) >= 2 * _COARSE and not any(n % 2 for n in grids[-1].shape):
        h = grids[-1]
        grids.append(0.25 * (h[::2, ::2] + h[1::2, ::2] + h[::2, 1::2] + h[1::2, 1::2]))
    low = float(np.min(grids[-1]))
    start = low + 0.3 * (float(np.median(grids[-1])) - low) if depth is None else depth
    approaches = np.array([start])
    pressure = np.maximum(start - grids[-1], 0.0)
    for k in range(len(grids) - 1, -1, -1):
        if not np.any(pressure):  # summits may be lost on a coarse grid
            pressure = np.where(grids[k] == np.min(grids[k]), 1.0, 0.0)
        patch = whole if k == 0 else _patch(kernel, whole.cell * 2**k, grids[k].shape, periodic)
        accepted = tolerance if k == 0 else _COARSE_TOLERANCE
        pressure, w, state = _solve_grid(patch, grids[k], groups, pressure, approaches, accepted)
        approaches = state.approaches
        if k > 0:
            pressure = np.repeat(np.repeat(pressure, 2, axis=0), 2, axis=1)
    return _found(whole, above, pressure, w, float(approaches[0]), state.iterations)


def _flat(whole: PeriodicPatch, above: Array, force: float | None, depth: float | None) -> HeightFieldContact:
    """Return the contact of a flat surface under a force [N] or, on a compressible layer, at an approach [m]."""
    if force is not None:
        mean = force * whole.kernel.singular / (above.size * whole.cell**2)
        depth = mean * whole.kernel.uniform if math.isfinite(whole.kernel.uniform) else 0.0
    else:
        assert depth is not None
        mean = depth / whole.kernel.uniform
    return _found(whole, above, np.full(above.shape, mean), np.full(above.shape, depth), depth, 0)


def _at_mean_gap(whole: PeriodicPatch, above: Array, gap: float, tolerance: float) -> HeightFieldContact:
    """Return the contact at a mean gap [m], by a search for the force.

    The gap falls from the mean height without force to 0 at the pressure `PeriodicPatch.complete`. With a prescribed
    gap, the equations are singular in complete contact, where only the mean pressure is free.
    """
    most = whole.complete(above) * above.size * whole.cell**2 / whole.kernel.singular

    def excess(log_force: float) -> float:
        return _solve_grids(whole, above, float(np.exp(log_force)), None, tolerance).mean_gap - gap

    least = 1e-3 * most
    while excess(np.log(least)) <= 0.0:
        least *= 1e-3
        if least < 1e-15 * most:
            raise NotConverged(f"solve_height_field: no force leaves a mean gap of {gap:g} m; take a smaller one")
    root = brentq(excess, np.log(least), np.log(most), xtol=1e-10)
    return _solve_grids(whole, above, float(np.exp(root)), None, tolerance)


def _patch(kernel: LayeredKernel, cell: float, shape: tuple[int, ...], periodic: bool) -> Patch:
    kind = PeriodicPatch if periodic else Patch
    return kind(kernel, (0.0, 0.0), cell, shape[0], shape[1], (0,))


def _found(whole: Patch, above: Array, pressure: Array, w: Array, depth: float, iterations: int) -> HeightFieldContact:
    gap, contact, area = w + above - depth, pressure > 0.0, whole.cell**2
    scale = abs(depth) or 1.0  # a flat periodic surface on a half-space has no approach
    periodic = isinstance(whole, PeriodicPatch)
    excess = excess_edge(contact, contact, periodic=periodic) * area
    return HeightFieldContact(
        pressure=pressure / whole.kernel.singular,
        displacement=w,
        cell=whole.cell,
        approach=depth,
        normal_force=float(np.sum(pressure)) * area / whole.kernel.singular,
        mean_gap=max(float(np.mean(gap)), 0.0),
        contact_area=float(np.count_nonzero(contact)) * area - excess,
        contact_area_error=edge_error(contact, contact, periodic=periodic) * area,
        iterations=iterations,
        gap_in_contact=float(np.max(np.abs(gap[contact]))) / scale,
        penetration_outside=float(np.max(-gap[~contact], initial=0.0)) / scale,
    )


def contact_area_curve(
    layer: Layer,
    substrate: Elastic | None,
    heights: Array,
    cell: float,
    normal_forces: Sequence[float],
    **options: bool,
) -> Array:
    """Return contact area [m^2] and its error [m^2] under each of some forces [N], shape (forces, 2).

    ``options`` as for `solve_height_field`: ``periodic``, ``ends_at_edge``. The notes of `solve_height_field`, for
    example that a grid is too coarse, are not returned.
    """
    found = (
        solve_height_field(layer, substrate, heights, cell, normal_force=force, **options)
        for force in np.atleast_1d(normal_forces).tolist()
    )
    return np.array([(contact.contact_area, contact.contact_area_error) for contact in found]).reshape(-1, 2)


def _prescribed(
    above: Array, lowest: float, loads: dict[str, float | None], whole: Patch
) -> tuple[float | None, float]:
    """Return the approach from the lowest height [m], or None and the mean gap [m]."""
    mean = float(np.mean(above))
    if loads["mean_gap"] is not None:
        if not loads["mean_gap"] < mean:
            raise InvalidProblem(
                f"mean_gap: must be less than {mean:g} m, at which the lowest height touches, got "
                f"{loads['mean_gap']:g} m"
            )
        if loads["mean_gap"] < LEAST_GAP * mean:
            raise InvalidProblem(
                f"mean_gap: must be at least {LEAST_GAP * mean:.3g} m, below which contact is complete to roundoff, "
                f"got {loads['mean_gap']:g} m; give the force"
            )
        return None, loads["mean_gap"]
    assert loads["approach"] is not None
    depth = loads["approach"] - lowest
    if not depth > 0.0:
        raise InvalidProblem(
            f"approach: must be greater than the lowest height, {lowest:g} m, to make contact, got "
            f"{loads['approach']:g} m"
        )
    if not isinstance(whole, PeriodicPatch) or 0.0 < whole.kernel.uniform < math.inf:
        return depth, math.nan
    if not depth < mean:
        medium = "half-space, whose displacement is measured from its mean"
        if whole.kernel.uniform == 0.0:
            medium = "incompressible layer, whose surface keeps its mean height"
        raise InvalidProblem(
            f"approach: must be less than the mean height, {mean + lowest:g} m, on a periodic {medium}, got "
            f"{loads['approach']:g} m; give the force"
        )
    return None, mean - depth


def _refuse_clipped(pressure: Array) -> None:
    rim = pressure > 0.0
    rim[1:-1, 1:-1] = False
    if np.any(rim):
        raise InvalidProblem(
            f"heights: the contact reaches the edge of the grid at {np.count_nonzero(rim)} cells, where the surface is "
            "unknown; give heights farther out or a smaller load, ends_at_edge=True for a body that ends there, or "
            "periodic=True; if the highest peaks should touch, negate heights: they are positive away from the layer"
        )
