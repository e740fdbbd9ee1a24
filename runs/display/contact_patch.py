"""One ball's contact pressure as a smooth field inside a fitted contact edge, from values at the nodes of a surface.

Near the edge of a frictionless contact the pressure falls as the square root of the distance, so its square is smooth
up to there: a polynomial is fitted to the squared pressure well inside the contact, and its zero line is the edge.
Under a cone the pressure rises steeply towards the tip: there the polynomial is fitted around the middle alone, in
which nodal values are averaged over rings.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyval2d, polyvander2d
from scipy.interpolate import griddata

from linear_bem.arrays import Array, Mask

DEGREES = (2, 4, 6)
"""Degrees of polynomials that are tried; higher ones would follow the oscillations of nodal values outside."""
BETTER = 0.7
"""A higher degree is used if its deviation over the lower one's is below this."""
WELL_INSIDE = 0.3
"""Least pressure over the peak of the nodes used in the fit; averages farther out include cells without contact."""
AROUND_TIP = 0.12, 0.6
"""Pressure over the peak of the nodes used in the fit under a tip."""
GOOD = 0.12
"""Largest root mean square deviation of the fit, over the peak: 0.04 to 0.1 on coarse meshes that oscillate."""
BEYOND = 1.4
"""The edge is sought up to this distance from the middle, over that of the farthest fitted node."""
RINGS, RAYS = 40, 180


@dataclass(frozen=True, eq=False)
class Patch:
    """Points x, y (rings, rays) [m] from the middle to the edge, the last ring, and the pressure there [Pa]."""

    x: Array
    y: Array
    pressure: Array

    @property
    def area(self) -> float:
        """Area inside the edge [m^2]."""
        x, y = self.x[-1], self.y[-1]
        return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))

    @property
    def force(self) -> float:
        """Integral of the pressure [N]: mean pressure times area, summed over the rings."""
        share = (np.hypot(self.x - self.x[0, 0], self.y - self.y[0, 0]) ** 2).mean(axis=1)
        mean = self.pressure.mean(axis=1)
        return self.area * float(np.sum(0.5 * (mean[1:] + mean[:-1]) * np.diff(share)) / share[-1])


def contact_patch(points: Array, pressure: Array, pointed: bool = False) -> Patch | None:
    """Return the contact around ``points`` (n, 2) [m] of one ball, or of a ``pointed`` body; None if no fit is good."""
    peak = float(pressure.max(initial=0.0))
    low, high = AROUND_TIP if pointed else (WELL_INSIDE, 1.0)
    inside = (pressure > low * peak) & (pressure <= high * peak)
    if peak <= 0.0 or np.count_nonzero(inside) < 2 * np.count_nonzero(_terms(DEGREES[-1])):
        return None
    middle = np.average(points[inside], axis=0, weights=pressure[inside])
    offset = points[inside] - middle
    size = float(np.hypot(*offset.T).max())
    x, y = (offset / size).T
    known = pressure[inside] / peak
    factors, deviation = np.zeros((1, 1)), np.inf
    for degree in DEGREES[: 1 if pointed else None]:
        terms = _terms(degree)
        matrix = polyvander2d(x, y, (degree, degree))[:, terms.ravel()]
        found = np.linalg.lstsq(matrix, known**2, rcond=None)[0]
        error = float(np.sqrt(np.mean((np.sqrt(np.maximum(matrix @ found, 0.0)) - known) ** 2)))
        if error < BETTER * deviation:
            factors, deviation = np.zeros(terms.shape), error
            factors[terms] = found
    if deviation > GOOD:
        return None
    angle = np.linspace(0.0, 2.0 * np.pi, RAYS)
    along = np.linspace(0.0, BEYOND, 400)[:, None]
    squared = polyval2d(along * np.cos(angle), along * np.sin(angle), factors)
    first = np.argmax(squared <= 0.0, axis=0)
    if np.any(first == 0):
        return None
    before, after = (np.take_along_axis(squared, (first - k)[None], axis=0)[0] for k in (1, 0))
    edge = (first - 1 + before / (before - after)) * (along[1, 0] - along[0, 0])
    ring = np.sin(np.linspace(0.0, 0.5 * np.pi, RINGS))[:, None] * edge  # close rings where the pressure falls steeply
    x, y = ring * np.cos(angle), ring * np.sin(angle)
    values = peak * np.sqrt(np.maximum(polyval2d(x, y, factors), 0.0))
    if pointed:
        ring_means = griddata(points - middle, pressure, (size * x, size * y), fill_value=0.0).mean(axis=1)[:, None]
        near = ring_means > WELL_INSIDE * peak
        values = np.where(near, np.maximum(np.minimum(values, high * peak), ring_means), values)
    values[-1] = 0.0
    return Patch(middle[0] + size * x, middle[1] + size * y, values)


def patch_within(x: Array, y: Array, pressure: Callable[[Array, Array], Array]) -> Patch:
    """Return the contact inside a known edge (rays,) [m] under a known pressure [Pa]."""
    edge = np.stack([np.append(x, x[0]), np.append(y, y[0])])
    middle = edge[:, :-1].mean(axis=1)[:, None, None]
    rings = middle + np.sin(np.linspace(0.0, 0.5 * np.pi, RINGS))[:, None] * (edge[:, None] - middle)
    return Patch(rings[0], rings[1], pressure(rings[0], rings[1]))


def _terms(degree: int) -> Mask:
    """Return where x^i y^j, at [i, j], is a term of a polynomial of a degree."""
    return np.asarray(np.add.outer(np.arange(degree + 1), np.arange(degree + 1)) <= degree)
