"""Contact zones, one or many of one degree at once: their edges, quadrature and singular integrals.

A frame maps the plane of xi to the surface by x = centre + A xi, so that the contact is close to the
unit disc. The pressure is the square root of a polynomial P(xi), which is exact for Hertz's elliptical contact. For
every smooth indenter p is sqrt(1 - rho^2) times a smooth function, so p^2 is smooth and vanishes linearly at the edge:
P converges like a Taylor series, and the edge is the zero line of P.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.layer.kernel import gauss
from linear_bem.smooth.polynomials import (
    along_rays,
    basis,
    chebyshev,
    circle,
    descent_to_zero,
    disc_nodes,
    exponents,
    horner,
    monomials,
)

CACHED = 200_000
"""Largest number of values per array of zones treated together, so that arrays fit into the processor's cache."""
INSIDE, BEYOND = 0.7, 1.001
"""Distance from the centre, in the frame, below which all points are inside; least distance over that of the edge from
which all are outside."""


@dataclass(frozen=True, eq=False)
class Zone:
    """A contact zone, or many of one degree.

    ``centre`` (..., 2) [m] and ``axes`` (..., 2, 2) [m] of the frame, ``coefficients`` (..., terms) of P [Pa^2 in the
    caller's unit]. Arrays of points have the zones, if many, as their first axis.
    """

    centre: Array
    axes: Array
    degree: int
    coefficients: Array

    @property
    def shape(self) -> tuple[int, ...]:
        """(zones,), or () for one zone."""
        return self.centre.shape[:-1]

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, part: int | slice | Indices | Mask | None) -> Zone:
        return Zone(self.centre[part], self.axes[part], self.degree, self.coefficients[part])

    def __iter__(self) -> Iterator[Zone]:
        return (self[k] for k in range(len(self)))

    @property
    def jacobian(self) -> Array:
        """Area [m^2] of the frame's unit square."""
        return np.asarray(np.abs(np.linalg.det(self.axes)))

    @property
    def radius(self) -> Any:
        """Mean radius [m] of the contact, the geometric mean of the frame's semi-axes."""
        return np.sqrt(self.jacobian)

    @property
    def reach(self) -> Any:
        """Largest semi-axis [m] of the frame."""
        return np.linalg.norm(self.axes, 2, axis=(-2, -1))

    def parts(self, numbers: int) -> Iterator[slice]:
        """Yield slices of as many zones as fit the cache, with ``numbers`` values per zone and array."""
        size = max(1, CACHED // numbers)
        return (slice(start, start + size) for start in range(0, len(self), size))

    def powers(self, axes: int) -> Array:
        """Return the coefficients of P in powers of xi and eta, shape (i, j, zones), and ``axes`` more of length 1."""
        both = np.einsum("...t,tij->ij...", self.coefficients, monomials(self.degree))
        return both.reshape(*both.shape, *(1,) * axes)

    def points(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """Return the surface coordinates x, y [m] of frame points."""
        a, c = self.axes[..., None], self.centre[..., None]
        x = c[..., 0, :] + a[..., 0, 0, :] * xi + a[..., 0, 1, :] * eta
        return x, c[..., 1, :] + a[..., 1, 0, :] * xi + a[..., 1, 1, :] * eta

    def frame(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the frame coordinates of surface points [m]."""
        b = np.linalg.inv(self.axes)[..., None]
        dx, dy = x - self.centre[..., :1], y - self.centre[..., 1:]
        return b[..., 0, 0, :] * dx + b[..., 0, 1, :] * dy, b[..., 1, 0, :] * dx + b[..., 1, 1, :] * dy

    def squared_pressure(self, xi: Array, eta: Array) -> Array:
        """Return P = p^2 at frame points (negative outside the contact)."""
        out = np.empty(xi.shape)
        terms = self.coefficients.shape[-1]
        for part in np.array_split(np.arange(xi.shape[-1]), xi.size * terms // CACHED + 1):
            values = basis(xi[..., part], eta[..., part], self.degree)
            out[..., part] = np.einsum("...t,t...k->...k", self.coefficients, values)
        return out

    def pressure(self, x: Array, y: Array) -> Array:
        """Return p of one zone at surface points [m], zero outside the contact."""
        xi, eta = self.frame(x, y)
        squared, distance = np.maximum(self.squared_pressure(xi, eta), 0.0), np.hypot(xi, eta)
        doubtful = np.flatnonzero((squared > 0.0) & (distance > INSIDE))  # P of high degree is positive outside, too
        if doubtful.size:
            r = distance.flat[doubtful]
            edge = self.edge(xi.flat[doubtful] / r, eta.flat[doubtful] / r)
            squared.flat[doubtful[r > BEYOND * edge]] = 0.0
        return np.sqrt(squared)

    def edge(self, cos: Array, sin: Array) -> Array:
        """Return the distance (frame units) from the frame's centre along unit directions to the edge."""
        return self._edge(along_rays(self.powers(1), cos, sin))

    def _edge(self, along: list[Array]) -> Array:
        """Return `edge` of rays along which P has these coefficients in powers of the distance.

        Newton's method starts from a root of the first three terms, for P of degree 2 the edge, where it is near 1.
        """
        c, b, a = along[:3]
        root = b * b - 4.0 * a * c
        hopeful = (a < 0.0) & (root > 0.0)
        quadratic = np.where(hopeful, b + np.sqrt(np.where(hopeful, root, 1.0)), 0.0) / np.where(hopeful, -2.0 * a, 1.0)
        start = np.where(np.abs(quadratic - 1.02) < 0.1, quadratic, 1.02)
        return np.maximum(descent_to_zero(along, start, -1e-6 * np.abs(self.coefficients[..., :1])), 1e-12)

    def outline(self, count: int = 64) -> tuple[Array, Array]:
        """Return points x, y [m] of the contact's edge."""
        cos, sin = circle(count)
        radius = self.edge(cos, sin)
        return self.points(radius * cos, radius * sin)

    def peaks(self, xi: Array, eta: Array) -> Array:
        """Return the largest P near points (zones,) of large P, by Newton's method on its gradient."""
        p, at = self.powers(0), np.stack([xi, eta])
        first = [polyder(p, axis=axis) for axis in (0, 1)]
        second = [[polyder(d, axis=axis) for axis in (0, 1)] for d in first]

        def value(powers: Array) -> Array:
            return np.asarray(polyval(at[1], polyval(at[0], powers, tensor=False), tensor=False))

        best, low, high = value(p), at - 0.3, at + 0.3
        for _ in range(12):
            slope = np.stack([value(d) for d in first])
            scale, turn = np.linalg.eigh(np.array([[value(d) for d in row] for row in second]).T)
            # ascend even where P is convex or, as on a ring of maxima, flat in one direction
            size = np.maximum(np.abs(scale), 1e-3 * np.max(np.abs(scale), axis=1, keepdims=True) + 1e-300)
            move = np.einsum("nij,nj,nkj,kn->in", turn, 1.0 / size, turn, slope)
            before, at = at, np.clip(at + move, low, high)
            best = np.maximum(best, value(p))
            if np.max(np.abs(at - before)) < 1e-8:
                break  # P is flat there: it changes by the square of this
        return np.asarray(best)

    def quadrature(self, radial: int, angular: int) -> tuple[Array, Array, Array, Array]:
        """Return xi, eta, weights [m^2] and p at nodes that integrate p and 1/p times smooth functions spectrally.

        Along each ray r = R cos(phi): p is sin(phi) times a smooth function, and dr is proportional to sin(phi).
        """
        cos, sin = circle(angular)
        along = along_rays(self.powers(1), cos, sin)
        edge = self._edge(along)[..., None, :]
        phi, w = gauss(radial)
        phi, w = 0.25 * np.pi * (1.0 + phi)[:, None], 0.25 * np.pi * w[:, None]
        r = edge * np.cos(phi)
        xi, eta = (r * cos).reshape(*self.shape, -1), (r * sin).reshape(*self.shape, -1)
        weights = (w * np.sin(phi) * edge * r * (2.0 * np.pi / angular)).reshape(xi.shape) * self.jacobian[..., None]
        squared = np.zeros(r.shape)
        for coefficient in along[::-1]:
            squared *= r
            squared += coefficient[..., None, :]
        return xi, eta, weights, np.sqrt(np.maximum(squared, 1e-300)).reshape(xi.shape)

    def half_space(
        self, xi: Array, eta: Array, directions: int, along: int, derivative: bool = True
    ) -> tuple[Array, Array]:
        """Return int p/|x - x'| dA' of many zones at frame points inside, and its derivative by the coefficients of P.

        Polar coordinates about each target remove the singularity. Along each chord the rule is Gauss-Chebyshev, exact
        for sqrt(parabola) times polynomials; over the chords' directions it is the trapezoidal rule. Shapes (zones,
        targets) and (zones, targets, terms); without ``derivative`` the latter has no terms.
        """
        angle = (np.arange(directions) + 0.5) * np.pi / directions
        beta = (np.arange(along) + 0.5) * np.pi / along
        a = self.axes[..., None]
        flat = np.sqrt(np.hypot(a[:, 0, 0], a[:, 1, 0]) / np.hypot(a[:, 0, 1], a[:, 1, 1]))
        cos, sin = np.cos(angle), flat * np.sin(angle)
        wide = np.hypot(cos, sin)
        cos, sin = cos / wide, sin / wide
        stretch = np.hypot(a[:, 0, 0] * cos + a[:, 0, 1] * sin, a[:, 1, 0] * cos + a[:, 1, 1] * sin)
        measure = np.pi / along * np.pi / directions * self.jacobian[:, None] * flat / (wide**2 * stretch)
        terms, points = self.coefficients.shape[1] if derivative else 0, xi.shape[1]
        potential, changes = np.empty(xi.shape), np.empty((*xi.shape, terms))
        numbers = points * directions * along * max(1, terms // 8)
        few = points // (numbers // CACHED + 1) + 1
        for part, some in product(self.parts(numbers), (slice(k, k + few) for k in range(0, points, few))):
            at = part, some
            x, y, c, s = xi[at][..., None], eta[at][..., None], cos[part, None], sin[part, None]
            chord = _Chords.through(self[part], x, y, c, s)
            ahead, back = chord.ends()
            half, middle = 0.5 * (ahead + back)[..., None], 0.5 * (ahead - back)[..., None]
            t = middle + half * np.cos(beta)
            weight = half * np.sin(beta) * measure[part, None, :, None]
            p = np.sqrt(np.maximum(chord.squared_pressure(t), 1e-300))
            potential[at] = np.sum(weight * p, axis=(2, 3))
            if derivative:
                u, v = x[..., None] + t * c[..., None], y[..., None] + t * s[..., None]
                both = [chebyshev(w, self.degree).reshape(self.degree + 1, *x.shape[:2], -1) for w in (u, v)]
                both[1] *= (0.5 * weight / p).reshape(*x.shape[:2], -1)
                products = both[0].transpose(1, 2, 0, 3) @ both[1].transpose(1, 2, 3, 0)
                changes[at] = products[:, :, *exponents(self.degree)]
        return potential, changes

    def reframed(self, degree: int) -> Zone:
        """Return the same pressure in the frame that maps its edge closest to the unit circle, at a new degree."""
        outline = np.stack(self.outline(32), axis=-2)
        centre = outline.mean(axis=-1)
        d = outline - centre[..., None]
        scale, turn = np.linalg.eigh(2.0 * d @ np.swapaxes(d, -1, -2) / d.shape[-1])
        mean = np.sqrt(scale.mean(axis=-1))[..., None, None] * np.eye(2)
        round_enough = scale[..., 1:] - scale[..., :1] < 1e-3 * scale[..., 1:]
        axes = np.where(round_enough[..., None], mean, turn * np.sqrt(np.maximum(scale, 0.0))[..., None, :])
        xi, eta, fit = disc_nodes(degree)
        new = replace(self, centre=centre, axes=axes, degree=degree)
        old = self.frame(*new.points(xi, eta))
        return replace(new, coefficients=self.squared_pressure(*old) @ fit.T)


def stacked(zones: Sequence[Zone]) -> Zone:
    """Return zones of one degree together."""
    centre, axes, coefficients = (np.array([getattr(z, k) for z in zones]) for k in ("centre", "axes", "coefficients"))
    return Zone(centre, axes, zones[0].degree, coefficients)


@dataclass(frozen=True, eq=False)
class _Chords:
    """P along chords through points: polynomials of (t - ``middle``) / ``half``, t the distance from the point.

    The interval from -1 to 1 is the part of the chord in a disc a little larger than the unit disc.
    """

    middle: Array
    half: Array
    coefficients: Array
    start: tuple[Array, Array]

    @classmethod
    def through(cls, zones: Zone, x: Array, y: Array, cos: Array, sin: Array) -> _Chords:
        """Return the chords through points (zones, points, 1) in some directions."""
        middle = -(x * cos + y * sin)
        half = np.sqrt(np.maximum(middle**2 + 1.02**2 - x * x - y * y, 1e-4))
        nodes, chebyshev, powers = _chord_rule(zones.degree)
        t = middle + half * nodes[:, None, None, None]
        values = horner(zones.powers(2), x + t * cos, y + t * sin)
        c0, c1, c2 = np.tensordot(chebyshev, values, 1)
        # the best parabola, c0 + c1 u + c2 (2 u^2 - 1), has its roots close to the chord's ends
        root = c1 * c1 - 8.0 * c2 * (c0 - c2)
        hopeful = (c2 < 0.0) & (root > 0.0)
        root, c2 = np.sqrt(np.where(hopeful, root, 0.0)), np.where(hopeful, 4.0 * c2, -1.0)
        ends = [np.where(hopeful, (-c1 + sign * root) / c2, -sign) for sign in (-1.0, 1.0)]
        trusted = [np.where(np.abs(u - end) * half < 0.2, u, end) for u, end in zip(ends, (1.0, -1.0), strict=True)]
        return cls(middle, half, np.tensordot(powers, values, 1), (trusted[0], trusted[1]))

    def ends(self) -> tuple[Array, Array]:
        """Return the distances from the points to the edge, ahead and back."""
        floor = -1e-6 * np.max(np.abs(self.coefficients), axis=0)
        back = self.coefficients.copy()
        back[1::2] *= -1.0  # P along the opposite direction
        ahead = self.middle + self.half * descent_to_zero(self.coefficients, self.start[0], floor)
        behind = -self.middle + self.half * descent_to_zero(back, -self.start[1], floor)
        return np.maximum(ahead, 1e-12), np.maximum(behind, 1e-12)

    def squared_pressure(self, t: Array) -> Array:
        """Return P at distances t, shape (zones, points, chords, distances)."""
        u = (t - self.middle[..., None]) / self.half[..., None]
        value = np.zeros_like(u)
        for c in self.coefficients[::-1, ..., None]:
            value *= u
            value += c
        return value


@lru_cache(maxsize=16)
def _chord_rule(degree: int) -> tuple[Array, Array, Array]:
    """Return nodes on [-1, 1], and matrices from values to the Chebyshev coefficients up to 2 and to powers."""
    nodes = np.cos((np.arange(degree + 1) + 0.5) * np.pi / (degree + 1))
    inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, degree))
    powers = np.linalg.inv(np.polynomial.polynomial.polyvander(nodes, degree))
    return nodes, inverse[:3], powers
