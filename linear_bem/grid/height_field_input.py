"""Input checks of `linear_bem.grid.height_field`: one message per fault, with key, rule and value."""

import math
from numbers import Real

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem


def real(heights: Array) -> Array:
    """Return heights as an array of real numbers; raises `InvalidProblem` if they are not."""
    try:
        given = np.asanyarray(heights)
    except ValueError:  # rows of unlike length
        given = np.array("")
    if given.dtype.kind not in "biuf":
        raise InvalidProblem("heights: must be real numbers in rows of equal length [m], got text, complex or others")
    if np.ma.is_masked(given):
        bad = int(np.ma.count_masked(given))
        raise InvalidProblem(f"heights: must all be known, {bad} of {given.size} are masked; fill them in")
    return np.asarray(given.astype(float))


def grid_faults(heights: Array, cell: float) -> list[str]:
    """Return a message per fault of the heights and the cell size."""
    faults = []
    if heights.ndim != 2 or min(heights.shape) < 4:
        faults.append(f"heights: must have two axes of at least 4 cells each, got shape {heights.shape}")
    elif not np.all(np.isfinite(heights)):
        bad = int(np.count_nonzero(~np.isfinite(heights)))
        faults.append(f"heights: must be finite, {bad} of {heights.size} are not; fill them in")
    if not (isinstance(cell, Real) and 0.0 < cell < math.inf):
        faults.append(f"cell: must be one number, the side of a square cell, greater than 0 and finite, got {cell} m")
    return faults


def load_faults(loads: dict[str, float | None], periodic: bool) -> list[str]:
    """Return a message per fault of the loads, of which exactly one must be given."""
    given = {name: value for name, value in loads.items() if value is not None}
    if len(given) != 1:
        written = ", ".join(f"{name} {value}" for name, value in given.items()) or "none"
        return [f"load: exactly one of normal_force and approach (or mean_gap where periodic) is needed, got {written}"]
    ((name, value),) = given.items()
    if not (isinstance(value, Real) and math.isfinite(value)):
        return [f"{name}: must be a finite number, got {value!r}"]
    if name != "approach" and not value > 0.0:
        return [f"{name}: must be greater than 0, got {value:g}"]
    if name == "mean_gap" and not periodic:
        return ["mean_gap: is defined where the surface is periodic, got periodic=False; give the approach"]
    return []
