"""Tensor interpolation at Chebyshev points, the same as that of the live page in the browser.

Barycentric formula of the second form [Berrut and Trefethen 2004, SIAM Review 46, 501, doi 10.1137/S0036144502417715],
with the points of the first kind, cos((j + 1/2) pi / n).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from linear_bem.arrays import Array

SCALES: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "linear": (lambda x: x, lambda y: y),
    "log": (math.log, math.exp),
    "sqrt": (math.sqrt, lambda y: y * y),
}
"""Coordinates in which an axis is interpolated, and their inverses."""


@dataclass(frozen=True)
class Axis:
    """One variable of a table: its range, the coordinate in which it is interpolated, and the number of points."""

    name: str
    low: float
    high: float
    scale: str
    count: int

    def nodes(self) -> Array:
        """Return the variable at the Chebyshev points, shape (count,)."""
        into, back = SCALES[self.scale]
        middle, half = 0.5 * (into(self.high) + into(self.low)), 0.5 * (into(self.high) - into(self.low))
        points = np.cos((np.arange(self.count) + 0.5) * np.pi / self.count)
        return np.array([back(middle + half * x) for x in points])


def interpolate(axes: Sequence[Axis], values: Array, at: Sequence[float]) -> Array:
    """Return the table ``values`` (one axis of the array per axis, further ones kept) at the point ``at``."""
    for axis, place in zip(axes, at, strict=True):
        into = SCALES[axis.scale][0]
        values = BarycentricInterpolator([into(node) for node in axis.nodes()], values)(into(place))
    return values
