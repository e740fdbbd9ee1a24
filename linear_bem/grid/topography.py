"""Reads measured surfaces from files, by the library SurfaceTopography."""

import math
from os import PathLike

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem, UnsupportedProblem


def read_heights(path: str | PathLike[str]) -> tuple[Array, float, bool]:
    """Return heights [m] for `solve_height_field`, the side of a cell [m], and whether the surface is periodic.

    The file shows the surface of the rigid body from outside; it is inverted, so that its highest peak becomes the
    lowest height, 0. Raises `UnsupportedProblem` without the library SurfaceTopography, and `InvalidProblem` for
    line scans, cells that are not square, undefined heights and files without a unit.
    """
    try:
        from SurfaceTopography import read_topography  # noqa: PLC0415  (only to read measured surfaces)
    except ModuleNotFoundError as error:
        raise UnsupportedProblem(
            f"read_heights: {path}: needs the library SurfaceTopography, {error}; install it with this project in an "
            "environment of its own (pip install . SurfaceTopography): it needs a newer numpy than Debian's DOLFINx; "
            "or pass heights as an array to solve_height_field"
        ) from error
    measured = read_topography(str(path))
    faults = []
    if measured.dim != 2:
        faults.append(f"{path}: must be a map of two dimensions, got {measured.dim}")
    elif not math.isclose(*measured.pixel_size, rel_tol=1e-6):
        x, y = measured.pixel_size
        faults.append(f"{path}: cells must be square, got sides {x:g} and {y:g} {measured.unit}")
    if measured.has_undefined_data:
        faults.append(f"{path}: heights must be known everywhere, some are undefined; fill them in")
    if measured.unit is None:
        faults.append(f"{path}: must state its unit, got none")
    if faults:
        raise InvalidProblem(*faults)
    in_metres = measured.to_unit("m")
    heights = np.asarray(in_metres.heights(), dtype=float)
    return np.max(heights) - heights, float(in_metres.pixel_size[0]), bool(measured.is_periodic)
