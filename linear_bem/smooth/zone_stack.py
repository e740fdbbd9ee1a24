"""Many contact zones of one degree at once: their edges, quadrature and singular integrals.

A frame maps the plane of xi to the surface by x = centre + A xi, so that the contact is close to the
unit disc. The pressure is the square root of a polynomial P(xi), which is exact for Hertz's elliptical contact. For
every smooth indenter p is sqrt(1 - rho^2) times a smooth function, so p^2 is smooth and vanishes linearly at the edge:
P converges like a Taylor series, and the edge is the zero line of P.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.layer.kernel import gauss
from linear_bem.smooth.polynomials import basis, circle, fit_nodes, horner, monomials

CACHED = 200_000
"""Numbers per array up to which zones are treated together, so that arrays stay in the processor's cache."""


@dataclass(frozen=True)
class ZoneStack:
    """Zones of one degree: ``centre`` (zones, 2) [m], ``axes`` (zones, 2, 2) [m], ``coefficients`` (zones, terms) of P.

    Arrays of points have the zones as their first axis.
    """

    centre: Array
    axes: Array
    degree: int
    coefficients: Array

    def __len__(self) -> int:
        return len(self.centre)

    def __getitem__(self, part: slice | Indices | Mask) -> ZoneStack:
        return ZoneStack(self.centre[part], self.axes[part], self.degree, self.coefficients[part])

    @property
    def jacobian(self) -> Array:
        """Areas [m^2] of the frames' unit squares."""
        return np.asarray(np.abs(np.linalg.det(self.axes)))

    @property
    def reach(self) -> Array:
        """Largest semi-axes [m] of the frames."""
        return np.asarray(np.linalg.svd(self.axes, compute_uv=False)[:, 0])

    def parts(self, numbers: int) -> Iterator[slice]:
        """Yield slices of as many zones as fit the cache with so many numbers per zone and array."""
        size = max(1, CACHED // numbers)
        return (slice(start, start + size) for start in range(0, len(self), size))

    def powers(self, axes: int) -> Array:
        """Return the coefficients of P in powers of xi and eta, shape (i, j, zones), and ``axes`` more of length 1."""
        both = np.einsum("nt,tij->ijn", self.coefficients, monomials(self.degree))
        return both.reshape(*both.shape, *(1,) * axes)

    def points(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """Return the surface coordinates x, y [m], shape (zones, points), of frame points."""
        a, c = self.axes[..., None], self.centre[..., None]
        return c[:, 0] + a[:, 0, 0] * xi + a[:, 0, 1] * eta, c[:, 1] + a[:, 1, 0] * xi + a[:, 1, 1] * eta

    def frame(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the frame coordinates of surface points."""
        b = np.linalg.inv(self.axes)[..., None]
        dx, dy = x - self.centre[:, :1], y - self.centre[:, 1:]
        return b[:, 0, 0] * dx + b[:, 0, 1] * dy, b[:, 1, 0] * dx + b[:, 1, 1] * dy

    def squared_pressure(self, xi: Array, eta: Array) -> Array:
        """Return P = p^2 at frame points (negative outside the contact)."""
        return np.asarray(np.einsum("nt,tnk->nk", self.coefficients, basis(xi, eta, self.degree)))

    def edge(self, xi: Array, eta: Array, cos: Array, sin: Array) -> Array:
        """Return the distance (frame units) from interior points along unit directions to the edge.

        For P of degree 2 this is a root of the quadratic along the chord; else Newton's method starts from there.
        """
        p = self.powers(np.ndim(xi) - 1)
        a = p[2, 0] * cos * cos + p[1, 1] * cos * sin + p[0, 2] * sin * sin
        b = (p[1, 0] + 2.0 * p[2, 0] * xi + p[1, 1] * eta) * cos + (p[0, 1] + p[1, 1] * xi + 2.0 * p[0, 2] * eta) * sin
        c = p[0, 0] + p[1, 0] * xi + p[0, 1] * eta + p[2, 0] * xi * xi + p[1, 1] * xi * eta + p[0, 2] * eta * eta
        root = b * b - 4.0 * a * c
        hopeful = (a < 0.0) & (root > 0.0)
        quadratic = np.where(hopeful, b + np.sqrt(np.where(hopeful, root, 1.0)), 0.0) / np.where(hopeful, -2.0 * a, 1.0)
        if self.degree <= 2 and np.all(hopeful):
            return np.maximum(quadratic, 1e-12)
        along = xi * cos + eta * sin
        on_circle = -along + np.sqrt(np.maximum(along * along + 1.02**2 - xi**2 - eta**2, 0.0))
        t = np.maximum(np.where(np.abs(quadratic - on_circle) < 0.1, quadratic, on_circle), 0.01)
        floor = -1e-6 * np.abs(self.coefficients[:, 0]).reshape(-1, *(1,) * (np.ndim(xi) - 1))
        for _ in range(40):
            value, dx, dy = horner(p, xi + t * cos, eta + t * sin)
            move = value / np.minimum(dx * cos + dy * sin, floor)
            t = t - np.minimum(np.maximum(move, -0.3), 0.3)
            if np.max(np.abs(move)) < 3e-8:
                break  # the next step, quadratically smaller, is below roundoff
        return np.maximum(t, 1e-12)

    def outline(self, count: int = 64) -> tuple[Array, Array]:
        """Return points x, y [m] of the contacts' edges, shape (zones, count)."""
        cos, sin = circle(count)
        zero = np.zeros((len(self), count))
        radius = self.edge(zero, zero, cos, sin)
        return self.points(radius * cos, radius * sin)

    def quadrature(self, radial: int, angular: int) -> tuple[Array, Array, Array, Array]:
        """Return xi, eta, weights [m^2] and p at nodes that integrate p and 1/p times smooth functions spectrally.

        Along each ray r = R cos(phi): p is sin(phi) times a smooth function, and dr is proportional to sin(phi).
        """
        cos, sin = circle(angular)
        zero = np.zeros((len(self), angular))
        edge = self.edge(zero, zero, cos, sin)[:, None, :]
        phi, w = gauss(radial)
        phi, w = 0.25 * np.pi * (1.0 + phi)[:, None], 0.25 * np.pi * w[:, None]
        r = edge * np.cos(phi)
        xi, eta = (r * cos).reshape(len(self), -1), (r * sin).reshape(len(self), -1)
        weights = (w * np.sin(phi) * edge * r * (2.0 * np.pi / angular)).reshape(xi.shape) * self.jacobian[:, None]
        p = np.sqrt(np.maximum(self.squared_pressure(xi, eta), 1e-300))
        return xi, eta, weights, p

    def half_space(
        self, xi: Array, eta: Array, directions: int, along: int, derivative: bool = True
    ) -> tuple[Array, Array]:
        """Return int p/|x - x'| dA' at frame points inside, and its derivative by the coefficients of P.

        Polar coordinates about each target remove the singularity. Along each chord the rule is Gauss-Chebyshev, exact
        for sqrt(parabola) times polynomials; over the chords' directions it is the trapezoidal rule. Shapes (zones,
        targets) and (zones, targets, terms); without ``derivative`` the latter has no terms.
        """
        angle = (np.arange(directions) + 0.5) * np.pi / directions
        cos, sin = np.cos(angle), np.sin(angle)
        beta = (np.arange(along) + 0.5) * np.pi / along
        a = self.axes[..., None]
        stretch = np.hypot(a[:, 0, 0] * cos + a[:, 0, 1] * sin, a[:, 1, 0] * cos + a[:, 1, 1] * sin)
        measure = np.pi / along * np.pi / directions * self.jacobian[:, None] / stretch
        both = np.concatenate([cos, -cos]), np.concatenate([sin, -sin])
        terms = self.coefficients.shape[1] if derivative else 0
        potential, changes = np.empty(xi.shape), np.empty((*xi.shape, terms))
        for part in self.parts(xi.shape[1] * directions * along * max(1, terms // 8)):
            zones = self[part]
            zero = np.zeros(2 * directions)
            x, y = xi[part, :, None] + zero, eta[part, :, None] + zero
            ahead, back = np.split(zones.edge(x, y, *both), 2, axis=2)
            half, middle = 0.5 * (ahead + back)[..., None], 0.5 * (ahead - back)[..., None]
            t = middle + half * np.cos(beta)
            weight = half * np.sin(beta) * measure[part, None, :, None]
            u, v = x[:, :, :directions, None] + t * cos[:, None], y[:, :, :directions, None] + t * sin[:, None]
            p = np.sqrt(np.maximum(_value(zones.powers(3), u, v), 1e-300))
            potential[part] = np.sum(weight * p, axis=(2, 3))
            if derivative:
                share = (0.5 * weight / p).reshape(1, *u.shape[:2], -1)
                phi = basis(u, v, self.degree).reshape(terms, *share.shape[1:])
                changes[part] = np.einsum("tnkc,nkc->nkt", phi, share[0])
        return potential, changes

    def reframed(self, degree: int) -> ZoneStack:
        """Return the same pressures in the frames that map their edges closest to the unit circle, at a new degree."""
        outline = np.stack(self.outline(32), axis=1)
        centre = outline.mean(axis=2)
        d = outline - centre[:, :, None]
        scale, turn = np.linalg.eigh(2.0 * d @ d.transpose(0, 2, 1) / d.shape[2])
        mean = np.sqrt(scale.mean(axis=1))[:, None, None] * np.eye(2)
        round_enough = scale[:, 1] - scale[:, 0] < 1e-3 * scale[:, 1]
        axes = np.where(round_enough[:, None, None], mean, turn * np.sqrt(np.maximum(scale, 0.0))[:, None, :])
        xi, eta, fit = fit_nodes(degree)
        new = replace(self, centre=centre, axes=axes, degree=degree)
        old = self.frame(*new.points(xi, eta))
        return replace(new, coefficients=self.squared_pressure(*old) @ fit.T)


def _value(powers: Array, x: Array, y: Array) -> Array:
    """Return a polynomial by Horner's rule; see `linear_bem.smooth.polynomials.horner`."""
    degree = len(powers) - 1
    value = np.zeros(np.shape(x))
    row = np.empty(np.shape(x))
    for i in range(degree, -1, -1):
        row[:] = powers[i, degree - i]
        for j in range(degree - i - 1, -1, -1):
            row *= y
            row += powers[i, j]
        value *= x
        value += row
    return value
