r"""A rectangular periodic cell of the surface: images of points, and the displacement by the mean pressure (k = 0).

Under a uniform pressure p a layer of thickness h, which cannot extend sideways, is compressed by

    w0 = h (1 + nu) (1 - 2 nu) / (E (1 - nu)) p

(the oedometric compliance, 2 pi h G'(0) times `LayeredKernel.singular` on a rigid base), and an elastic half-space
below it moves down without limit. Displacements and approaches are therefore measured from the mean level of the
layer's underside, on a half-space without a layer from that of its surface, w0 = 0 [Stanley and Kato 1997, J. Tribol.
119, 481, doi 10.1115/1.2833523], and so on the response of a surface over a base that yields. If forces are prescribed,
forces, differences of approaches and T do not depend on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from linear_bem.arrays import Array, Indices
from linear_bem.media import Layer, SurfaceResponse
from linear_bem.touching import to_nearest

if TYPE_CHECKING:
    from linear_bem.layer.kernel import LayeredKernel


@dataclass(frozen=True, eq=False)
class Cell:
    """A cell of ``lengths`` (2,) [m]; ``uniform`` [m]: displacement per uniform pressure times ``singular``."""

    lengths: Array
    uniform: float

    @classmethod
    def of(cls, lengths: tuple[float, float], layer: Layer, kernel: LayeredKernel) -> Cell:
        """Return the cell on a layer; ``kernel`` is that of a single load."""
        uniform = 0.0
        if isinstance(layer, SurfaceResponse):
            uniform = kernel.uniform if np.isfinite(kernel.uniform) else 0.0
        elif np.isfinite(layer.thickness):
            nu = layer.poisson
            compliance = layer.thickness * (1.0 + nu) * (1.0 - 2.0 * nu) / (layer.young * (1.0 - nu))
            uniform = compliance / kernel.singular
        return cls(np.array(lengths, dtype=float), uniform)

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return float(np.prod(self.lengths))

    def nearest(self, offset: Array) -> Array:
        """Return offsets (..., 2) [m] between points, each reduced to that of the nearest image."""
        return to_nearest(offset, self.lengths)

    def images(self, points: Array, reach: float, places: Array | None = None) -> tuple[Indices, Array]:
        """Return point indices and shifts [m] of all images, without the points, within ``reach`` [m] of a rectangle.

        It is the bounding rectangle of ``places`` (k, 2) [m], by default of the ``points`` (n, 2) [m].
        """
        places = points if places is None else places
        low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
        fewest = np.floor((low - points.max(axis=0)) / self.lengths).astype(int)
        most = np.ceil((high - points.min(axis=0)) / self.lengths).astype(int)
        owners, shifts = [], []
        for m, n in product(*(range(a, b + 1) for a, b in zip(fewest, most, strict=True))):
            shift = self.lengths * (m, n)
            moved = points + shift
            inside = np.flatnonzero(np.all((moved >= low) & (moved <= high), axis=1))
            if (m or n) and inside.size:
                owners.append(inside)
                shifts.append(np.broadcast_to(shift, (inside.size, 2)))
        return np.concatenate([np.empty(0, dtype=np.intp), *owners]), np.concatenate([np.empty((0, 2)), *shifts])

    def pairs(self, points: Array, reach: float) -> tuple[Indices, Indices, Array]:
        """Return all pairs within ``reach`` [m], each once, and the shifts [m] of the second to its image.

        A point and its own image also form a pair, one for the two images in opposite directions.
        """
        back = -self.lengths * np.floor(points / self.lengths)
        inside = points + back
        tree = cKDTree(inside)
        close = tree.query_pairs(reach, output_type="ndarray").astype(np.intp)
        owner, shift = self.images(inside, reach)
        half = (shift[:, 0] > 0.0) | ((shift[:, 0] == 0.0) & (shift[:, 1] > 0.0))  # the other half mirrors it
        owner, shift = owner[half], shift[half]
        found = tree.query_ball_point(inside[owner] + shift, reach) if owner.size else []
        counts = np.array([len(some) for some in found], dtype=np.intp)
        first = np.concatenate([close[:, 0], *found]).astype(np.intp)
        second = np.concatenate([close[:, 1], np.repeat(owner, counts)])
        moved = np.concatenate([np.zeros((len(close), 2)), np.repeat(shift, counts, axis=0)])
        return first, second, moved + back[second] - back[first]
