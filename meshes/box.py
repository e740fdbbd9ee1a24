"""What is to be meshed: a box of layer and substrate with refined zones under the balls; no gmsh here."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

TAGS = {"layer": 1, "substrate": 2, "top": 11, "bottom": 12, "x_low": 13, "x_high": 14, "y_low": 15, "y_high": 16}
"""Physical groups: two volumes and the six outer faces of the box."""


@dataclass(frozen=True)
class Zone:
    """Refinement under one ball: element size ``finest`` at (x, y, 0), growing with distance.

    It grows by ``growth`` per length up to ``radius``, by ``outer_growth`` beyond, and by ``far_growth``
    beyond ``far_radius``. ``mirror`` is the half-width of the square prism about the ball's axis in which
    the mesh is mirror-symmetric about x = x_ball and y = y_ball (0: none). Lengths in m.
    """

    position: tuple[float, float]
    finest: float
    growth: float
    radius: float
    outer_growth: float
    mirror: float
    far_radius: float = math.inf
    far_growth: float = 0.0

    def size(self, distance: np.ndarray) -> np.ndarray:
        """Return the element size [m] at a distance [m] from the zone's centre."""
        inner = np.minimum(distance, self.radius)
        far = np.maximum(distance - self.far_radius, 0.0)
        return self.finest + self.growth * inner + self.outer_growth * (distance - inner - far) + self.far_growth * far


@dataclass(frozen=True)
class Box:
    """The meshed region: x and y intervals, layer thickness, substrate depth (0: none); all in m."""

    x: tuple[float, float]
    y: tuple[float, float]
    thickness: float
    substrate: float
    zones: tuple[Zone, ...]
    coarsest: float

    def in_units_of(self, length: float) -> Box:
        """Return the same box with every length divided by ``length`` [m]."""

        def both(pair: tuple[float, float]) -> tuple[float, float]:
            return pair[0] / length, pair[1] / length

        zones = tuple(
            Zone(
                both(zone.position), zone.finest / length, zone.growth, zone.radius / length, zone.outer_growth,
                zone.mirror / length, zone.far_radius / length, zone.far_growth,
            )
            for zone in self.zones
        )  # fmt: skip
        return Box(
            both(self.x), both(self.y), self.thickness / length, self.substrate / length, zones, self.coarsest / length
        )

    def element_size(self, points: np.ndarray) -> np.ndarray:
        """Return the element size [m] asked for at points (n, 3) [m]."""
        size = np.full(len(points), self.coarsest)
        for zone in self.zones:
            centre = np.array([*zone.position, 0.0])
            size = np.minimum(size, zone.size(np.linalg.norm(points - centre, axis=1)))
        return size

    def estimated_tetrahedra(self, samples: int = 60) -> float:
        """Estimate the number of tetrahedra (within about 40 %) by integrating the size field."""
        axes = []
        for low, high, centres in (
            (*self.x, [z.position[0] for z in self.zones]),
            (*self.y, [z.position[1] for z in self.zones]),
            (-self.thickness - self.substrate, 0.0, [0.0]),
        ):
            span = high - low
            finest = min(z.finest for z in self.zones)
            offsets = np.concatenate([[0.0], np.geomspace(finest, span, samples)])
            nodes = np.concatenate([c + s * offsets for c in centres for s in (-1.0, 1.0)])
            nodes = np.unique(np.concatenate([[low, high], nodes[(nodes > low) & (nodes < high)]]))
            axes.append(nodes)
        mids = [0.5 * (a[1:] + a[:-1]) for a in axes]
        widths = [np.diff(a) for a in axes]
        total = 0.0
        for z, dz in zip(mids[2], widths[2], strict=True):
            gx, gy = np.meshgrid(mids[0], mids[1], indexing="ij")
            points = np.column_stack([gx.ravel(), gy.ravel(), np.full(gx.size, z)])
            size = self.element_size(points).reshape(gx.shape)
            total += float(np.sum(np.outer(widths[0], widths[1]) * dz / size**3))
        return total * 6.0 * math.sqrt(2.0)
