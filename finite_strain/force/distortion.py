"""The distortion of a state: smallest volume ratio, surface stretch and area seen from above, and their positions.

A surface that is a graph over the plane does not touch itself: seen from above, every part of it has a positive area,
so the map of points in the plane is one to one near each point and, with fixed edges, as a whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from finite_strain.discretisation.nodal_values import CellNodes

CREASE = 0.65
"""Stretch of a free surface under plane strain below which it folds into a crease [Hong Zhao Suo 2009,
doi 10.1063/1.3211917: at a compressive strain of 0.35; neo-Hookean and incompressible]."""
SQUEEZED, OF_FILM = 0.1, 0.5
"""Volume ratio below which a state is not resolved, absolute and over the remaining share of the layer's thickness
under a ball: foam (nu = 0) in a film has about that share, and above 0.3 in contacts 1.2 R deep on thick layers."""


def is_resolved(volume_ratio: float, film: float | None) -> bool:
    """Return whether no element is nearly inverted; ``film`` is that of `film_left`, None if unknown."""
    return volume_ratio >= (SQUEEZED if film is None else min(SQUEEZED, OF_FILM * film))


def film_left(
    space: Any, nodal: np.ndarray, axes: Sequence[Sequence[float]], approaches: np.ndarray, thickness: float
) -> float:
    """Return the smallest share of the layer's thickness [m] left under balls (collective).

    For the displacements and axes see `distortion`. The substrate takes the part of an approach (balls,) [m] by which
    the bottom of the layer moves down at the node nearest to the ball's axis.
    """
    points, given = space.tabulate_dof_coordinates(), []
    for axis, approach in zip(axes, approaches, strict=True):
        away = np.linalg.norm(points - [*axis, -thickness], axis=1)
        here = (float(away.min()), float(nodal[away.argmin(), 2])) if away.size else (np.inf, 0.0)
        given.append(approach + min(space.mesh.comm.allgather(here))[1])
    return float(1.0 - max(given) / thickness)


@dataclass(frozen=True)
class Distortion:
    """Smallest values at the nodes: det F, stretch along the top, and area of the top from above; and their places.

    The area is seen from above, over the undeformed area: det of the in-plane part of F; if it is positive everywhere,
    the surface does not overhang. ``surface_crossing`` [m]: how far the top passes through planes of symmetry; if it is
    positive, the flanks between mirrored bodies meet. ``distorted_at``: undeformed distance from the nearest ball's
    axis, and depth below the surface [m], of the smallest "volume_ratio", "surface_stretch" and "seen_area".
    """

    smallest_volume_ratio: float
    smallest_surface_stretch: float
    smallest_seen_area: float
    surface_crossing: float
    distorted_at: dict[str, list[float]]

    def describe(self) -> str:
        """Return the values in words, with their meaning for the solid."""
        places = {name: _place(*at) for name, at in self.distorted_at.items()}
        volume = f"smallest volume ratio J = {self.smallest_volume_ratio:.2g}, {places['volume_ratio']}"
        stretch = self.smallest_surface_stretch
        surface = f"smallest stretch of the surface {stretch:.2g}, {places['surface_stretch']}"
        if stretch < CREASE:
            surface += f", below {CREASE:g}, where a free surface folds into a crease"
        if self.smallest_seen_area <= 0.0:
            surface += f"; it overhangs, {places['seen_area']}"
        if self.surface_crossing > 0.0:
            surface += f"; it passes through a plane of symmetry by {self.surface_crossing:.2g} m"
        return f"{volume}; {surface}"


def distortion(
    space: Any, nodal: np.ndarray, top_nodes: np.ndarray, axes: Sequence[Sequence[float]],
    mirrors: np.ndarray | bool = True,
) -> Distortion:  # fmt: skip
    """Return the distortion under displacements (local nodes, 3) [m] (collective).

    ``top_nodes`` (local nodes,): those on the top; ``axes`` (balls, 2) [m] of balls; ``mirrors`` (x and y, low and
    high): whether that side is a plane of symmetry.
    """
    cells = CellNodes(space)
    F = np.eye(3) + cells.gradient(nodal)
    points = space.tabulate_dof_coordinates()[cells.dofs]
    along = F[..., :, :2]
    squared = np.linalg.eigvalsh(along.swapaxes(-1, -2) @ along)[..., 0]
    comm, corners = space.mesh.comm, space.mesh.geometry.x
    ends = np.concatenate([corners.min(axis=0, initial=np.inf), -corners.max(axis=0, initial=-np.inf)])
    comm.Allreduce(MPI.IN_PLACE, ends, op=MPI.MIN)
    low, high = ends[:3], -ends[3:]
    top, deep = high[2], high[2] - low[2]
    on_top = top_nodes[cells.dofs]
    stretch, seen = np.sqrt(np.maximum(squared, 0.0)), np.linalg.det(F[..., :2, :2])
    values = np.linalg.det(F), np.where(on_top, stretch, np.inf), np.where(on_top, seen, np.inf)
    least: list[tuple[float, list[float]]] = []
    for value in values:
        number = int(value.argmin()) if value.size else 0
        x, y, z = points.reshape(-1, 3)[number] if value.size else (0.0, 0.0, 0.0)
        away = min(float(np.hypot(x - a[0], y - a[1])) for a in axes)
        place = [length if length > 1e-9 * deep else 0.0 for length in (away, float(top - z))]
        least.append(min(comm.allgather((float(value.min(initial=np.inf)), place))))
    moved = (points + nodal[cells.dofs])[on_top][:, :2]
    beyond = np.stack([low[:2] - moved, moved - high[:2]], axis=-1)
    outside = beyond.max(initial=0.0, where=np.broadcast_to(mirrors, beyond.shape))
    crossing = comm.allreduce(float(outside), op=MPI.MAX)
    (volume, shortest, least_seen), places = zip(*least, strict=True)
    at = dict(zip(("volume_ratio", "surface_stretch", "seen_area"), places, strict=True))
    return Distortion(volume, shortest, least_seen, crossing if crossing > 1e-9 * deep else 0.0, at)


def _place(away: float, depth: float) -> str:
    below = f" and {depth:.2g} m below the surface" if depth > 0.0 else ""
    return f"{away:.2g} m from a ball's axis{below}"
