"""One contact zone in the ball's own frame; `linear_bem.smooth.zone_stack` holds the formulas, for many at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array
from linear_bem.smooth.polynomials import basis, circle
from linear_bem.smooth.zone_stack import ZoneStack

INSIDE, BEYOND = 0.7, 1.001
"""Distance from the centre, in the frame, below which all points are inside; least distance over that of the edge from
which all are outside."""


@dataclass(frozen=True)
class Zone:
    """One contact zone: frame (``centre`` [m], ``axes`` 2x2 [m]) and coefficients of P [Pa^2 in the caller's unit]."""

    centre: Array
    axes: Array
    degree: int
    coefficients: Array

    @property
    def _stack(self) -> ZoneStack:
        return ZoneStack(self.centre[None], self.axes[None], self.degree, self.coefficients[None])

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

    def points(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """Return the surface coordinates x, y [m] of frame points."""
        a = self.axes
        return self.centre[0] + a[0, 0] * xi + a[0, 1] * eta, self.centre[1] + a[1, 0] * xi + a[1, 1] * eta

    def frame(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the frame coordinates of surface points [m]."""
        b = np.linalg.inv(self.axes)
        dx, dy = x - self.centre[0], y - self.centre[1]
        return b[0, 0] * dx + b[0, 1] * dy, b[1, 0] * dx + b[1, 1] * dy

    def squared_pressure(self, xi: Array, eta: Array) -> Array:
        """Return P = p^2 at frame points (negative outside the contact)."""
        return np.asarray(np.tensordot(self.coefficients, basis(xi, eta, self.degree), 1))

    def pressure(self, x: Array, y: Array) -> Array:
        """Return p at surface points [m], zero outside the contact."""
        xi, eta = self.frame(np.asarray(x, float), np.asarray(y, float))
        squared, distance = np.array(np.maximum(self.squared_pressure(xi, eta), 0.0)), np.hypot(xi, eta)
        doubtful = np.flatnonzero((squared > 0.0) & (distance > INSIDE))  # P of high degree is positive outside, too
        if doubtful.size:
            r = distance.flat[doubtful]
            edge = self.edge(np.zeros_like(r), np.zeros_like(r), xi.flat[doubtful] / r, eta.flat[doubtful] / r)
            squared.flat[doubtful[r > BEYOND * edge]] = 0.0
        return np.sqrt(squared)

    def edge(self, xi: Array, eta: Array, cos: Array, sin: Array) -> Array:
        """Return the distance (frame units) from interior points along unit directions to the edge."""
        return np.asarray(self._stack.edge(np.asarray(xi)[None], np.asarray(eta)[None], cos, sin)[0])

    def outline(self, count: int = 64) -> tuple[Array, Array]:
        """Return points x, y [m] of the contact's edge."""
        cos, sin = circle(count)
        zero = np.zeros(count)
        radius = self.edge(zero, zero, cos, sin)
        return self.points(radius * cos, radius * sin)

    def quadrature(self, radial: int, angular: int) -> tuple[Array, Array, Array, Array]:
        """Return xi, eta, weights [m^2] and p at nodes that integrate p and 1/p times smooth functions spectrally."""
        xi, eta, weights, p = self._stack.quadrature(radial, angular)
        return xi[0], eta[0], weights[0], p[0]

    def half_space(self, xi: Array, eta: Array, directions: int, along: int) -> tuple[Array, Array]:
        """Return int p/|x - x'| dA' at frame points inside (targets,), and its derivative by the coefficients of P."""
        potential, derivative = self._stack.half_space(xi[None], eta[None], directions, along)
        return potential[0], derivative[0]

    def reframed(self, degree: int) -> Zone:
        """Return the same pressure in the frame that maps its edge closest to the unit circle, at a new degree."""
        new = self._stack.reframed(degree)
        return Zone(new.centre[0], new.axes[0], degree, new.coefficients[0])


def stacked(zones: Sequence[Zone]) -> ZoneStack:
    """Return zones of one degree together."""
    centre, axes, coefficients = (np.array([getattr(z, k) for z in zones]) for k in ("centre", "axes", "coefficients"))
    return ZoneStack(centre, axes, zones[0].degree, coefficients)


def unstacked(zones: ZoneStack) -> list[Zone]:
    """Return the zones of a stack one by one."""
    together = zip(zones.centre, zones.axes, zones.coefficients, strict=True)
    return [Zone(centre, axes, zones.degree, coefficients) for centre, axes, coefficients in together]
