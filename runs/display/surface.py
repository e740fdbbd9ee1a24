"""The deformed top surface of a finite-element run: kept on disk and cut by a section."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linear_bem.arrays import Array
from linear_bem.errors import OutputUnusable
from runs.process.files import DAMAGED, replacing

NAME = "surface.npz"
ROUNDS = 8
"""Averaging rounds of `smoothed`; five to six average over one element of order 3."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Deformed points (n, 3) [m] of the whole scene's surface, triangles (m, 3), contact pressure (n,) [Pa]."""

    points: Array
    triangles: NDArray[np.int64]
    pressure: Array


def keep(folder: Path, fields: Any) -> None:
    """Write the surface of ``fields`` into ``folder``, whole or not at all."""
    arrays = {name: getattr(fields, name) for name in ("points", "triangles", "pressure")}
    with replacing(folder / NAME) as draft, open(draft, "wb") as file:
        np.savez_compressed(file, **arrays)


def load(folder: Path) -> Surface | None:
    """Return the surface kept in ``folder``, or None; raises `OutputUnusable` if it is damaged."""
    try:
        with open(folder / NAME, "rb") as file, np.load(file) as data:  # numpy leaves a damaged file open
            return Surface(data["points"], data["triangles"], data["pressure"])
    except FileNotFoundError:
        return None
    except DAMAGED as error:
        raise OutputUnusable(
            f"{folder / NAME}: cannot be read ({error}); remove it: it is used only for a picture"
        ) from None


def smoothed(surface: Surface) -> Iterator[Array]:
    """Yield the nodal pressure [Pa]: first unchanged, then averaged over larger and larger surroundings.

    In nearly incompressible elements under stiff contact some nodes lose contact and others carry more; averaging
    conserves the force.
    """
    points = surface.points
    places = np.round(points / (1e-9 * np.ptp(points)))  # mirror images meet in nodes of their own
    _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
    corners, x, values = number.reshape(-1)[surface.triangles], points[first, :2], surface.pressure[first]
    sides = x[corners[:, 1:]] - x[corners[:, :1]]
    areas = np.abs(np.linalg.det(sides))[:, None]
    weights = np.bincount(corners.ravel(), np.repeat(areas, 3), len(first))
    for _ in range(ROUNDS + 1):
        yield values[number.reshape(-1)]
        part = areas * (values[corners] + values[corners].sum(axis=1, keepdims=True)) / 4.0
        values = np.bincount(corners.ravel(), part.ravel(), len(first)) / weights


def farthest(positions: Sequence[Sequence[float]] | Array) -> int:
    """Return the number of the ball farthest from the first one."""
    return max(range(len(positions)), key=lambda i: math.dist(positions[i], positions[0]))


def section_line(positions: Sequence[Sequence[float]] | Array) -> tuple[Array, Array, Array]:
    """Return the first ball's position [m] and unit vectors from it along the section, to the farthest, and across."""
    origin = np.asarray(positions[0], dtype=float)
    across = np.asarray(positions[farthest(positions)], dtype=float) - origin
    length = float(np.linalg.norm(across))
    along = across / length if length > 0.0 else np.array([1.0, 0.0])
    return origin, along, np.array([-along[1], along[0]])


def section(top: Surface, positions: Sequence[Sequence[float]]) -> tuple[Array, Array]:
    """Return coordinates along the section line and heights [m] there, where it crosses edges of the surface."""
    origin, direction, normal = section_line(positions)
    offset = (top.points[:, :2] - origin) @ normal
    # a line exactly along edges crosses none of them: shift it off the nodes by a tiny distance
    span = float(np.ptp(top.points[:, :2], axis=0).max())
    offset = np.where(np.abs(offset) < 1e-9 * span, 1e-9 * span, offset)
    edges = np.unique(np.sort(top.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    a, b = edges.T
    crossed = offset[a] * offset[b] < 0.0
    a, b = a[crossed], b[crossed]
    share = (offset[a] / (offset[a] - offset[b]))[:, None]
    crossing = top.points[a] * (1.0 - share) + top.points[b] * share
    along = crossing[:, :2] @ direction
    order = np.argsort(along)
    return along[order], crossing[order, 2]
