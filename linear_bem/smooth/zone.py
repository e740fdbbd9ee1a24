"""Polynomials and quadrature on one smooth contact zone, in the ball's own frame.

A frame maps the plane of xi to the surface by x = centre + A xi, so that the contact is close to the
unit disc. The pressure is the square root of a polynomial P(xi), which is exact for Hertz's elliptical contact. For
every smooth indenter p is sqrt(1 - rho^2) times a smooth function, so p^2 is smooth and vanishes linearly at the edge:
P converges like a Taylor series, and the edge is the zero line of P.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from linear_bem.arrays import Array, Indices
from linear_bem.layer.kernel import gauss


@lru_cache(maxsize=32)
def exponents(degree: int) -> tuple[Indices, Indices]:
    """Return the pairs (i, j), i + j <= degree, of the basis T_i(xi) T_j(eta), ordered by total degree."""
    pairs = [(k - j, j) for k in range(degree + 1) for j in range(k + 1)]
    i, j = np.array(pairs).T
    return i, j


def basis(xi: Array, eta: Array, degree: int) -> Array:
    """Return the basis polynomials, shape (terms, *xi.shape)."""
    i, j = exponents(degree)
    t_xi, t_eta = np.moveaxis(chebvander([xi, eta], degree), -1, 1)
    return np.asarray(t_xi[i] * t_eta[j])


@lru_cache(maxsize=32)
def _fit_nodes(degree: int) -> tuple[Array, Array, Array]:
    """Return points of the unit disc and the matrix that fits a polynomial through values there."""
    rings = degree // 2 + 2
    radius = np.repeat(np.cos((np.arange(rings) + 0.5) * np.pi / (2 * rings)), 2 * degree + 4)
    angle = np.tile((np.arange(2 * degree + 4) + 0.5) * 2.0 * np.pi / (2 * degree + 4), rings)
    xi, eta = radius * np.cos(angle), radius * np.sin(angle)
    return xi, eta, np.linalg.pinv(basis(xi, eta, degree).T)


@lru_cache(maxsize=64)
def circle(count: int) -> tuple[Array, Array]:
    """Return cosine and sine of ``count`` equally spaced angles."""
    angle = (np.arange(count) + 0.5) * 2.0 * np.pi / count
    return np.cos(angle), np.sin(angle)


@lru_cache(maxsize=32)
def _monomials(degree: int) -> Array:
    """Return the power coefficients of every basis polynomial, shape (terms, degree + 1, degree + 1)."""
    table = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        table[k, : k + 1] = np.polynomial.chebyshev.cheb2poly(np.eye(degree + 1)[k, : k + 1])
    i, j = exponents(degree)
    return np.asarray(table[i][:, :, None] * table[j][:, None, :])


def horner(powers: Array, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return a polynomial and its two derivatives; ``powers[i, j]`` multiplies x^i y^j, i + j <= degree."""
    degree = len(powers) - 1
    value = dx = dy = np.zeros(np.shape(x))
    for i in range(degree, -1, -1):
        row = np.full(np.shape(x), powers[i, degree - i])
        slope = np.zeros(np.shape(x))
        for j in range(degree - i - 1, -1, -1):
            slope = slope * y + row
            row = row * y + powers[i, j]
        dx = dx * x + value
        value = value * x + row
        dy = dy * x + slope
    return value, dx, dy


@dataclass(frozen=True)
class Zone:
    """One contact zone: frame (``centre`` [m], ``axes`` 2x2 [m]) and coefficients of P [Pa^2 in the caller's unit]."""

    centre: Array
    axes: Array
    degree: int
    coefficients: Array

    @property
    def jacobian(self) -> float:
        """Area [m^2] of the frame's unit square."""
        return float(abs(np.linalg.det(self.axes)))

    @property
    def radius(self) -> float:
        """Mean radius [m] of the contact, the geometric mean of the frame's semi-axes."""
        return float(np.sqrt(self.jacobian))

    @property
    def reach(self) -> float:
        """Largest semi-axis [m] of the frame."""
        return float(np.linalg.norm(self.axes, 2))

    @property
    def powers(self) -> Array:
        """Coefficients of P in powers of xi and eta, shape (degree + 1, degree + 1)."""
        return np.asarray(np.tensordot(self.coefficients, _monomials(self.degree), 1))

    def points(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """Return the surface coordinates x, y [m] of frame points."""
        a = self.axes
        return self.centre[0] + a[0, 0] * xi + a[0, 1] * eta, self.centre[1] + a[1, 0] * xi + a[1, 1] * eta

    def frame(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the frame coordinates of surface points."""
        b = np.linalg.inv(self.axes)
        dx, dy = x - self.centre[0], y - self.centre[1]
        return b[0, 0] * dx + b[0, 1] * dy, b[1, 0] * dx + b[1, 1] * dy

    def squared_pressure(self, xi: Array, eta: Array) -> Array:
        """Return P = p^2 at frame points (negative outside the contact)."""
        return np.asarray(np.tensordot(self.coefficients, basis(xi, eta, self.degree), 1))

    def pressure(self, x: Array, y: Array) -> Array:
        """Return p at surface points, zero outside the contact."""
        xi, eta = self.frame(np.asarray(x, float), np.asarray(y, float))
        inside = self.squared_pressure(xi, eta) * (xi**2 + eta**2 < 1.7)
        return np.sqrt(np.maximum(inside, 0.0))

    def edge(self, xi: Array, eta: Array, cos: Array, sin: Array) -> Array:
        """Return the distance (frame units) from interior points along unit directions to the edge.

        For P of degree 2 this is a root of the quadratic along the chord; else Newton's method starts from there.
        """
        p = self.powers
        a = p[2, 0] * cos * cos + p[1, 1] * cos * sin + p[0, 2] * sin * sin
        b = (p[1, 0] + 2.0 * p[2, 0] * xi + p[1, 1] * eta) * cos + (p[0, 1] + p[1, 1] * xi + 2.0 * p[0, 2] * eta) * sin
        c = p[0, 0] + p[1, 0] * xi + p[0, 1] * eta + p[2, 0] * xi * xi + p[1, 1] * xi * eta + p[0, 2] * eta * eta
        root = b * b - 4.0 * a * c
        hopeful = (a < 0.0) & (root > 0.0)
        quadratic = np.where(hopeful, b + np.sqrt(np.where(hopeful, root, 1.0)), 0.0) / np.where(hopeful, -2.0 * a, 1.0)
        if self.degree <= 2 and np.all(hopeful):
            return np.maximum(quadratic, 1e-12)
        along = xi * cos + eta * sin
        circle = -along + np.sqrt(np.maximum(along * along + 1.02**2 - xi**2 - eta**2, 0.0))
        t = np.maximum(np.where(np.abs(quadratic - circle) < 0.1, quadratic, circle), 0.01)
        floor = -1e-6 * abs(self.coefficients[0])
        for _ in range(40):
            value, dx, dy = horner(p, xi + t * cos, eta + t * sin)
            move = value / np.minimum(dx * cos + dy * sin, floor)
            t = t - np.minimum(np.maximum(move, -0.3), 0.3)
            if np.max(np.abs(move)) < 3e-8:
                break  # the next step, quadratically smaller, is below roundoff
        return np.maximum(t, 1e-12)

    def outline(self, count: int = 64) -> tuple[Array, Array]:
        """Return points x, y [m] of the contact's edge."""
        cos, sin = circle(count)
        zero = np.zeros(count)
        radius = self.edge(zero, zero, cos, sin)
        return self.points(radius * cos, radius * sin)

    def quadrature(self, radial: int, angular: int) -> tuple[Array, Array, Array, Array]:
        """Return xi, eta, weights [m^2] and p at nodes that integrate p and 1/p times smooth functions spectrally.

        Along each ray r = R cos(phi): p is sin(phi) times a smooth function, and dr is proportional to sin(phi).
        """
        cos, sin = circle(angular)
        zero = np.zeros(angular)
        edge = self.edge(zero, zero, cos, sin)
        phi, w = gauss(radial)
        phi, w = 0.25 * np.pi * (1.0 + phi)[:, None], 0.25 * np.pi * w[:, None]
        r = edge * np.cos(phi)
        xi, eta = (r * cos).ravel(), (r * sin).ravel()
        weights = (w * np.sin(phi) * edge * r * (2.0 * np.pi / angular)).ravel() * self.jacobian
        p = np.sqrt(np.maximum(self.squared_pressure(xi, eta), 1e-300))
        return xi, eta, weights, p

    def half_space(self, xi: Array, eta: Array, directions: int, along: int) -> tuple[Array, Array]:
        """Return int p/|x - x'| dA' at frame points inside, and its derivative by the coefficients of P.

        Polar coordinates about each target remove the singularity. Along each chord the rule is Gauss-Chebyshev, exact
        for sqrt(parabola) times polynomials; over the chords' directions it is the trapezoidal rule. Shapes (targets,)
        and (targets, terms).
        """
        angle = (np.arange(directions) + 0.5) * np.pi / directions
        cos, sin = np.cos(angle), np.sin(angle)
        a = self.axes
        stretch = np.hypot(a[0, 0] * cos + a[0, 1] * sin, a[1, 0] * cos + a[1, 1] * sin)
        x, y = np.broadcast_arrays(xi[:, None], np.zeros(directions))[0], eta[:, None] + np.zeros(directions)
        both = np.array([cos, -cos])[:, None, :], np.array([sin, -sin])[:, None, :]
        ahead, back = self.edge(x, y, *both)
        beta = (np.arange(along) + 0.5) * np.pi / along
        half, middle = 0.5 * (ahead + back)[..., None], 0.5 * (ahead - back)[..., None]
        t = middle + half * np.cos(beta)
        weight = half * np.sin(beta) * (np.pi / along * np.pi / directions * self.jacobian / stretch)[:, None]
        phi = basis(x[..., None] + t * cos[:, None], y[..., None] + t * sin[:, None], self.degree)
        p = np.sqrt(np.maximum(np.tensordot(self.coefficients, phi, 1), 1e-300))
        potential = np.sum(weight * p, axis=(1, 2))
        derivative = phi.reshape(len(phi), len(xi), -1) * (0.5 * weight / p).reshape(1, len(xi), -1)
        return potential, derivative.sum(axis=2).T

    def reframed(self, degree: int) -> Zone:
        """Return the same pressure in the frame that maps its edge closest to the unit circle, at a new degree."""
        x, y = self.outline(32)
        centre = np.array([x.mean(), y.mean()])
        d = np.array([x - centre[0], y - centre[1]])
        scale, turn = np.linalg.eigh(2.0 * d @ d.T / d.shape[1])
        round_enough = scale[1] - scale[0] < 1e-3 * scale[1]
        axes = np.sqrt(scale.mean()) * np.eye(2) if round_enough else turn * np.sqrt(scale)
        xi, eta, fit = _fit_nodes(degree)
        new = replace(self, centre=centre, axes=axes, degree=degree)
        old = self.frame(*new.points(xi, eta))
        return replace(new, coefficients=fit @ self.squared_pressure(*old))
