"""Input checks of `linear_bem.grid.height_field`: one message per fault, with key, rule and value."""

import math
from numbers import Real

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem
from linear_bem.media import Elastic, Layer, material_faults


def real(heights: Array) -> Array:
    """Return heights as an array of real numbers; raises `InvalidProblem` if they are not."""
    try:
        given = np.asarray(heights)
    except ValueError:  # rows of unlike length
        given = np.array("")
    if given.dtype.kind not in "biuf":
        raise InvalidProblem("heights: must be real numbers in rows of equal length [m], got text, complex or others")
    return given.astype(float)


def medium_faults(layer: Layer, substrate: Elastic | None) -> list[str]:
    """Return a message per fault of layer and substrate."""
    if not isinstance(layer, Layer):
        return [f"layer: must be a Layer or a SurfaceResponse, got {layer!r}"]
    if not isinstance(substrate, Elastic | None):
        return [f"substrate: must be Elastic or None, got {substrate!r}"]
    faults = [
        f"{name}.{key}: must be a number, got {value!r}"
        for name, solid in (("layer", layer), ("substrate", substrate))
        for key in ("young", "poisson", "thickness")
        if not isinstance(value := getattr(solid, key, 0.0), Real)
    ]
    return faults or material_faults(layer, substrate)


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
