"""Polynomials of two variables on the unit disc: basis, values, and interpolation."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly

from linear_bem.arrays import Array, Indices

PARABOLA = np.array([0.0, 0.0, 0.0, -0.5, 0.0, -0.5])
"""Coefficients of 1 - xi^2 - eta^2 = -(T2(xi) + T2(eta))/2 at degree 2, the first ones at a higher degree."""


@lru_cache(maxsize=32)
def exponents(degree: int) -> tuple[Indices, Indices]:
    """Return the pairs (i, j), i + j <= degree, of the basis T_i(xi) T_j(eta), ordered by total degree."""
    pairs = [(k - j, j) for k in range(degree + 1) for j in range(k + 1)]
    i, j = np.array(pairs).T
    return i, j


def chebyshev(x: Array, degree: int) -> Array:
    """Return the Chebyshev polynomials T_0 to T_degree, shape (degree + 1, *x.shape)."""
    out = np.empty((degree + 1, *np.shape(x)))
    out[0], out[1:2] = 1.0, x
    twice = 2.0 * x
    for k in range(2, degree + 1):
        np.multiply(twice, out[k - 1], out=out[k, ...])
        out[k] -= out[k - 2]
    return out


def basis(xi: Array, eta: Array, degree: int) -> Array:
    """Return the basis polynomials, shape (terms, *xi.shape)."""
    t_xi, t_eta = chebyshev(xi, degree), chebyshev(eta, degree)
    pairs = exponents(degree)
    out = np.empty((len(pairs[0]), *np.shape(xi)))
    for k, (i, j) in enumerate(zip(*pairs, strict=True)):
        np.multiply(t_xi[i], t_eta[j], out=out[k, ...])
    return out


@lru_cache(maxsize=16)
def disc_nodes(degree: int) -> tuple[Array, Array, Array]:
    """Return interpolation nodes of the unit disc and the matrix from values there to basis coefficients.

    Nodes on concentric circles of 1, 5, 9, ... points determine polynomials of even degree uniquely [Bos 1991,
    J. Approx. Theory 64, 271].
    """
    xi, eta = [np.zeros(1)], [np.zeros(1)]
    for ring in range(1, degree // 2 + 1):
        angle = 2.0 * np.pi * np.arange(4 * ring + 1) / (4 * ring + 1)
        radius = np.sin(np.pi * ring / (degree + 1))
        xi.append(radius * np.cos(angle))
        eta.append(radius * np.sin(angle))
    x, y = np.concatenate(xi), np.concatenate(eta)
    return x, y, np.linalg.inv(basis(x, y, degree).T)


def interpolation(xi: Array, eta: Array, degree: int) -> Array:
    """Return the matrix from values at `disc_nodes` to values at frame points, shape (..., points, nodes)."""
    return np.asarray(np.moveaxis(basis(xi, eta, degree), 0, -1) @ disc_nodes(degree)[2])


@lru_cache(maxsize=64)
def circle(count: int) -> tuple[Array, Array]:
    """Return cosine and sine of ``count`` equally spaced angles."""
    angle = (np.arange(count) + 0.5) * 2.0 * np.pi / count
    return np.cos(angle), np.sin(angle)


@lru_cache(maxsize=32)
def monomials(degree: int) -> Array:
    """Return the power coefficients of every basis polynomial, shape (terms, degree + 1, degree + 1)."""
    table = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        table[k, : k + 1] = cheb2poly(np.eye(degree + 1)[k, : k + 1])
    i, j = exponents(degree)
    return np.asarray(table[i][:, :, None] * table[j][:, None, :])


def horner(powers: Array, x: Array, y: Array) -> Array:
    """Return a polynomial; ``powers[i, j]`` multiplies x^i y^j, i + j <= degree.

    ``powers`` may have further axes, which are broadcast with those of x and y.
    """
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


def along_rays(powers: Array, cos: Array, sin: Array) -> list[Array]:
    """Return a polynomial's coefficients (see `horner`) in powers of the distance from 0 along unit directions."""
    count = len(powers) - 1
    of_cos, of_sin = (list(accumulate([v] * count, np.multiply, initial=np.ones_like(v))) for v in (cos, sin))
    return [sum(powers[k - j, j] * of_cos[k - j] * of_sin[j] for j in range(k + 1)) for k in range(count + 1)]


def descent_to_zero(coefficients: Array | Sequence[Array], start: Array, floor: Array) -> Array:
    """Return where polynomials of one variable fall through 0 near ``start``, by Newton's method.

    ``coefficients`` are those of its powers; ``floor`` < 0 bounds the slopes from above.
    """
    t = start
    for _ in range(40):
        value, slope = np.zeros_like(t), np.zeros_like(t)
        for c in coefficients[::-1]:
            slope = slope * t + value
            value = value * t + c
        move = value / np.minimum(slope, floor)
        t = t - np.minimum(np.maximum(move, -0.3), 0.3)
        if np.max(np.abs(move)) < 3e-8:
            break  # the next step, quadratically smaller, is below roundoff
    return t
