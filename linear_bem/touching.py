"""Distances of bodies in the plane, in a cell those of the nearest images; least distances, and bodies that overlap."""

import math
from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from linear_bem.arrays import Array, Indices
from linear_bem.indenter import Indenter, Paraboloid, Sphere

Body = tuple[object, float]
"""An indenter or a profile, and its radius [m]."""


ROUNDOFF = 1e-9
"""Largest overlap over touching distance that a `Problem` may have; least distance of axes over the largest radius."""


def wrapped(positions: Array, cell: Array | None) -> Array:
    """Return positions [m] wrapped into the cell: from 0 to less than its lengths; unchanged without a cell."""
    if cell is None:
        return positions
    # in floating point L floor(x / L) may exceed x, and the difference for a small negative x is L
    return np.clip(positions - cell * np.floor(positions / cell), 0.0, np.nextafter(cell, 0.0))


def to_nearest(vectors: Array, cell: Array | None) -> Array:
    """Return vectors (..., 2) [m] between points, each to the nearest image of its end; unchanged without a cell."""
    return vectors if cell is None else np.asarray(vectors - cell * np.round(vectors / cell))


def nearest_distances(positions: Array, cell: Array | None) -> Array:
    """Return the distance [m] from every position (n, 2) [m] to the nearest other one or its image; inf if alone."""
    places = wrapped(positions, cell)
    return np.asarray(cKDTree(places, boxsize=cell).query(places, 2)[0][:, 1])


def largest_half_width(body: object, radius: float) -> float:
    """Return a bound [m] of half the touching distance to an equal body."""
    if not isinstance(body, Indenter):
        return radius
    reach = body.reach if math.isfinite(body.reach) else 0.0
    return max(radius, reach, body.half_width(1.0, 0.0), body.half_width(0.0, 1.0))


def touching_distance(first: Body, second: Body, between: tuple[float, float]) -> float:
    """Return the distance [m] of the axes of two touching bodies that rest on one plane; 0 if one is unbounded.

    ``between`` is the vector from one axis to the other. Exact for balls, for punches and for equal ellipsoids. Cones
    are unbounded: they may merge above the layer.
    """
    if not any(isinstance(body, Indenter) and not isinstance(body, Sphere | Paraboloid) for body, _ in (first, second)):
        return 2.0 * math.sqrt(first[1] * second[1])
    length = math.hypot(*between) or 1.0
    x, y = between[0] / length, between[1] / length
    widths = [body.half_width(x, y) if isinstance(body, Indenter) else radius for body, radius in (first, second)]
    return sum(widths) if min(widths) > 0.0 else 0.0


def overlap_faults(whole: Mapping[int, Body], positions: Array, cell: Array | None) -> list[str]:
    """Return messages on whole bodies, by ball index, that overlap others or their own images in the next cell."""
    if not whole:
        return []
    faults = [] if cell is None else _own_overlaps(whole, cell)
    if faults:
        return faults
    numbers = np.array(list(whole))
    reach = 2.0 * np.array([largest_half_width(*body) for body in whole.values()])
    pairs = numbers[near_pairs(wrapped(positions[numbers], cell), reach, cell)]
    found: list[tuple[float, float, int, int, bool]] = []
    for i, j in sorted(pairs.tolist()):
        between = positions[j] - positions[i]
        away = np.zeros(2) if cell is None else cell * np.round(between / cell)
        between -= away
        gap, touch = math.hypot(*between), touching_distance(whole[i], whole[j], (between[0], between[1]))
        if gap < touch * (1.0 - ROUNDOFF):
            found.append((touch - gap, gap, i, j, bool(np.any(away != 0.0))))
    if found:
        by, gap, i, j, across = max(found, key=lambda pair: pair[0])
        where = " across the cell's edge" if across else ""
        others = f", the most of {len(found)} pairs that do" if len(found) > 1 else ""
        radii, what = [whole[k][1] for k in (i, j)], "their shapes"
        if math.isclose(gap + by, 2.0 * math.sqrt(radii[0] * radii[1])):
            what = f"radii {radii[0]:g} m and {radii[1]:g} m"
        faults.append(
            f"balls.positions: balls {i} and {j} overlap by {by:.3g} m{where}{others}: their axes are "
            f"{gap if gap > ROUNDOFF * by else 0.0:.9g} m apart, {what} need at least {gap + by:.9g} m; "
            "caps of a rough surface may stand closer: Ball(..., asperity=True)"
        )
    return faults


def axis_faults(radii: Array, positions: Array, cell: Array | None) -> list[str]:
    """Return a message on the first two bodies that stand on one axis: the force between them has no direction."""
    pairs = cKDTree(wrapped(positions, cell), boxsize=cell).query_pairs(ROUNDOFF * np.max(radii))
    if not pairs:
        return []
    (i, j), others = min(pairs), f", the first of {len(pairs)} such pairs" if len(pairs) > 1 else ""
    return [f"balls.positions: balls {i} and {j} must not stand on one axis{others}; move one of them, or leave it out"]


def near_pairs(places: Array, reach: Array, cell: Array | None = None) -> Indices:
    """Return the pairs of ``places`` (n, 2) [m], first below second, within the larger ``reach`` (n,) [m] of both."""
    tree = cKDTree(places, boxsize=cell)
    if np.all(reach == reach[0]):  # many times faster
        return np.asarray(tree.query_pairs(reach[0], output_type="ndarray"))
    near = tree.query_ball_point(places, reach)
    first, second = np.repeat(np.arange(len(places)), list(map(len, near))), np.concatenate(near).astype(np.intp)
    # of equal reach, each is near the other
    once = (reach[second] < reach[first]) | ((reach[second] == reach[first]) & (first < second))
    return np.sort(np.stack([first[once], second[once]], axis=1), axis=1)


def _own_overlaps(whole: Mapping[int, Body], cell: Array) -> list[str]:
    """Return a message per axis along which bodies overlap their own images: the body that needs the longest cell."""
    faults = []
    for axis, length in enumerate(cell):
        needs = {i: touching_distance(body, body, (1.0 - axis, float(axis))) for i, body in whole.items()}
        longest = max(needs, key=lambda i: needs[i])
        if length < needs[longest] * (1.0 - ROUNDOFF):
            faults.append(
                f"periodic.lengths[{axis}]: ball {longest} overlaps its own image: they need at least "
                f"{needs[longest]:.9g} m, got {length:.9g} m"
            )
    return faults
