"""The region to be meshed: layer and substrate with a symmetric block of hexahedra under each ball (without gmsh).

``fineness`` (f) sets all element sizes: in a block they grow from one element to the next by a factor of at most
1 + `GROWTH` / f, outside by half of that growth; half a quadrant's rim has f elements, rounded to a whole number.
A box may multiply this growth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

TAGS = {"layer": 1, "substrate": 2, "top": 11, "bottom": 12, "x_low": 13, "x_high": 14, "y_low": 15, "y_high": 16}
"""Physical groups: two volumes and the six outer faces of the box."""
SIDES = {"x_low": (0, 0), "x_high": (0, 1), "y_low": (1, 0), "y_high": (1, 1)}
"""Axis and end (0: low, 1: high) of the upright faces."""
GROWTH, FILLER_GROWTH = 1.2, 0.6
"""Ratio of successive element sizes, less one, times f: in blocks, and outside."""
FIRST_LAYER, LAYERS = 0.8, 5.0
"""Thickness of the topmost elements times f, over the smallest contact radius; least layer thickness over it."""
EDGE = 0.2
"""Width of the elements at a contact's edge, times f, over the contact's radius."""
FILM_EDGE = 1.5
"""Upper bound of this width on a thin film, times f, over the film's thickness."""
CORE = 0.5
"""Half-width of a block's core over the smallest contact radius."""
FAR = 1.5
"""Number of coarsest elements between the balls and the box's outer sides."""
CAP, SHARED_CAP = 3.0, 6.0
"""Greatest half-width of a block over the contact radius: alone, and where it shares a face with its neighbour."""
STRIP = 1.0 / 3.0
"""Fraction of the distance between two blocks' axes that is left free if they share no face."""
OUTSIDE = 0.6
"""Greatest half-width of a block over the distance of its axis from an outer side of the box."""
SAME = 1e-9
"""Relative tolerance within which positions count as equal."""


def graded(low: float, high: float, size: Callable[[np.ndarray], np.ndarray], least: int = 1) -> np.ndarray:
    """Return coordinates (k + 1,) from low to high; ``size``, a function of the coordinate, bounds their spacing."""
    fine = np.linspace(low, high, 2001)
    rate = 1.0 / size(fine)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.abs(np.diff(fine)))])
    steps = max(least, math.ceil(count[-1] - 0.05))
    nodes = np.interp(np.linspace(0.0, count[-1], steps + 1), count, fine)
    nodes[[0, -1]] = low, high
    return nodes


@dataclass(frozen=True)
class Zone:
    """A ball's position [m], its contact radius at full load [m], and the half-width of its block [m].

    ``smallest`` is the contact radius at the first load step with output, over that at full load; ``detail`` [m] bounds
    the width of the elements at the contact's edge times f, for the pressure peak at the edge of a flat end.
    """

    position: tuple[float, float]
    contact_radius: float
    half_width: float
    smallest: float = 1.0
    detail: float = math.inf


@dataclass(frozen=True)
class Box:
    """The meshed region: x and y intervals, layer thickness, substrate depth (0: none), all in m; fineness f >= 1.

    ``growth`` multiplies `GROWTH` and `FILLER_GROWTH`.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    thickness: float
    substrate: float
    zones: tuple[Zone, ...]
    fineness: float
    growth: float = 1.0

    def in_units_of(self, length: float) -> Box:
        """Return the same box with every length divided by ``length`` [m]."""
        x, y, *places = ((a / length, b / length) for a, b in (self.x, self.y, *(z.position for z in self.zones)))
        zones = tuple(
            Zone(place, zone.contact_radius / length, zone.half_width / length, zone.smallest, zone.detail / length)
            for place, zone in zip(places, self.zones, strict=True)
        )
        thickness, substrate = self.thickness / length, self.substrate / length
        return replace(self, x=x, y=y, thickness=thickness, substrate=substrate, zones=zones)

    @property
    def elements(self) -> int:
        """Number of elements along a quadrant of a block."""
        return math.floor(self.fineness + 0.5)

    @property
    def rate(self) -> float:
        """Growth of element size per length outside the blocks."""
        return math.log1p(self.growth * FILLER_GROWTH / self.fineness)

    @property
    def slope(self) -> float:
        """Growth of element size per length inside the blocks, and with the depth."""
        return math.log1p(self.growth * GROWTH / self.fineness)

    @property
    def sides(self) -> list[tuple[int, float]]:
        """The four upright sides: the axis normal to each, and its coordinate [m] along it."""
        return [(axis, end) for axis, ends in enumerate((self.x, self.y)) for end in ends]

    @property
    def coarsest(self) -> float:
        """Size [m] of the largest elements."""
        return max(min(abs(zone.position[axis] - end) for zone in self.zones) for axis, end in self.sides) / FAR

    def quadrants(self, zone: Zone) -> list[tuple[int, int]]:
        """Return the signs (x, y) of the quadrants of a zone's block that lie in the box."""
        signs = []
        for axis, (low, high) in enumerate((self.x, self.y)):
            centre, room = zone.position[axis], 0.5 * zone.half_width
            signs.append([s for s, there in ((-1, centre - room > low), (1, centre + room < high)) if there])
        return [(sx, sy) for sx in signs[0] for sy in signs[1]]

    def rings(self, zone: Zone) -> tuple[np.ndarray, np.ndarray]:
        """Return radii [m] of the lines of a block, from core to outline, and their shape (0: circle, 1: square)."""
        a, m, slope = zone.contact_radius, zone.half_width, self.slope
        edge_size = min(EDGE * a, FILM_EDGE * self.thickness, zone.detail) / self.fineness
        if a > 0.9 * m:  # no line at the contact's edge fits
            core = CORE * m
            radii = graded(core, m, lambda r: slope * r)
            return radii, CORE + (1.0 - CORE) * (radii - core) / (m - core)

        def size(r: np.ndarray) -> np.ndarray:
            return np.minimum(slope * r, edge_size + slope * np.abs(r - a))

        inner = graded(CORE * zone.smallest * a, a, size)
        outer = graded(a, m, size)
        square = [0.5 * (a - inner) / (a - inner[0]), ((outer - a) / (m - a)) ** 2]
        return np.concatenate([inner, outer[1:]]), np.concatenate([square[0], square[1][1:]])

    def levels(self) -> tuple[np.ndarray, np.ndarray]:
        """Return z [m] of the faces between elements, from the top down: in the layer, in the substrate (or empty)."""
        slope = self.slope
        radius = min(zone.smallest * zone.contact_radius for zone in self.zones)
        finest = min(FIRST_LAYER * radius, self.thickness / LAYERS, *(zone.detail for zone in self.zones))
        first = finest * slope / (self.growth * GROWTH)

        def size(z: np.ndarray) -> np.ndarray:
            return first - slope * z

        layer = graded(0.0, -self.thickness, size, self.elements + 1)
        if self.substrate == 0.0:
            return layer, np.empty(0)
        return layer, graded(-self.thickness, -self.thickness - self.substrate, size)

    @property
    def layers(self) -> int:
        """Number of elements through layer and substrate."""
        return sum(max(len(heights) - 1, 0) for heights in self.levels())

    def size(self, points: np.ndarray) -> np.ndarray:
        """Return the width [m] of elements outside the blocks at points (..., 2) [m]."""
        answer = np.full(points.shape[:-1], self.coarsest)
        for zone in self.zones:
            beyond = self.beyond(zone, points)
            answer = np.minimum(answer, zone.half_width / self.elements + self.rate * np.maximum(beyond, 0.0))
        return answer

    @staticmethod
    def beyond(zone: Zone, points: np.ndarray) -> np.ndarray:
        """Return the distance [m] of points (..., 2) from a zone's block, the larger of x and y; negative inside."""
        return np.abs(points - np.array(zone.position)).max(axis=-1) - zone.half_width

    def estimated_hexahedra(self) -> float:
        """Estimate the number of hexahedra (within 30 %, mostly 15 %): blocks are counted, the rest from its sizes."""
        n = self.elements
        plane = sum(len(self.quadrants(zone)) * (n * n + 2 * n * (len(self.rings(zone)[0]) - 1)) for zone in self.zones)
        axes = [np.linspace(*side, 301) for side in (self.x, self.y)]
        middles = np.stack(np.meshgrid(*[0.5 * (a[1:] + a[:-1]) for a in axes], indexing="ij"), axis=-1)
        outside = np.all([self.beyond(zone, middles) > 0.0 for zone in self.zones], axis=0)
        cell = (axes[0][1] - axes[0][0]) * (axes[1][1] - axes[1][0])
        filler = np.sum(outside * cell / self.size(middles) ** 2) * (1.35 + 0.8 / n)  # fitted to counts in 60 meshes
        return float(plane + filler) * self.layers


def half_widths(
    positions: list[tuple[float, float]], contact_radii: list[float],
    x: tuple[float, float], y: tuple[float, float], planes: tuple[int, ...] = (),
) -> list[float]:  # fmt: skip
    """Return the half-widths [m] of the balls' blocks; x[0] or y[0] is a mirror plane for each axis in ``planes``.

    Aligned neighbours share a face if both can; otherwise a strip of a third of their distance stays free.
    """
    sides, scale = (x, y), SAME * max(x[1] - x[0], y[1] - y[0])
    here = np.array(positions, dtype=float)
    most = np.full(len(here), np.inf)
    for axis, side in enumerate(sides):
        for end in side[1:] if axis in planes else side:
            most = np.minimum(most, OUTSIDE * np.abs(here[:, axis] - end))
    radii = np.array(contact_radii, dtype=float)
    centres, mirrors = here, [(axis, 2.0 * sides[axis][0]) for axis in planes]
    for axis, twice in mirrors:
        image = centres.copy()
        image[:, axis] = twice - image[:, axis]
        added = np.abs(image[:, axis] - centres[:, axis]) > scale
        centres, most = np.concatenate([centres, image[added]]), np.concatenate([most, most[added]])
        radii = np.concatenate([radii, radii[added]])
    offsets = np.abs(centres[:, None] - centres)
    gaps = offsets.max(axis=2)
    np.fill_diagonal(gaps, np.inf)
    shared = (offsets.min(axis=2) <= scale) & np.isfinite(gaps)
    diagonal = offsets.max(axis=2) - offsets.min(axis=2) <= scale
    for axis, twice in mirrors:  # no block reaches a plane that cuts another: the lines along the plane would end there
        if np.any(np.abs(2.0 * here[:, axis] - twice) <= scale):
            on_plane = np.abs(centres[:, None, axis] + centres[:, axis] - twice) <= scale
            shared &= ~(on_plane & (offsets[:, :, 1 - axis] <= scale))
    share = (1.0 - STRIP) * radii[:, None] / (radii[:, None] + radii)
    while True:
        meeting = shared | (diagonal & (shared @ shared))  # at a corner, where a third block shares a face with each
        cap = np.where(shared.any(axis=1), SHARED_CAP, CAP) * radii
        widths = np.minimum(np.minimum(most, cap), np.min(gaps * np.where(meeting, 0.5, share), axis=1, initial=np.inf))
        full = widths[:, None] >= 0.5 * gaps - scale
        kept = shared & full & full.T
        if np.array_equal(kept, shared):
            return [float(width) for width in widths[: len(here)]]
        shared = kept
