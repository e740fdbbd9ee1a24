r"""Displacement under a point load on a layered half-space, in real space.

With the response G(t) of `linear_bem.layer.response`, the inverse Hankel transform splits into the
half-space's singular kernel and a smooth remainder,

    K(r) = (1 - nu1^2) / (pi E1) * [ 1/r + s(r/h)/h ],     s(rho) = int_0^inf (G(t) - 1) J0(rho t) dt.

G - 1 falls like t^2 exp(-2 t), so s is analytic for |Im rho| < 2: one small table serves every contact
problem with these materials. At large rho it falls like (G(0) - 1)/rho, so that K tends to the substrate's kernel.

Quadrature: substitute u = rho t. Then s(rho) = (1/rho) sum_j omega_j (G(u_j/rho) - 1) with *fixed*
nodes u_j on dyadic panels (G is smooth in log t) and weights that contain J0(u_j) and a smooth cut-off,
whose error falls faster than any power of its width. Below rho = 1 the rule is applied in t itself.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline, PPoly, make_interp_spline
from scipy.special import erfc, j0, jv

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem
from linear_bem.layer.response import LayerResponse, MeasuredResponse, response_of, scaled_media
from linear_bem.media import Elastic, Layer, medium_faults, without_empty_layer
from linear_bem.problem import Problem

if TYPE_CHECKING:
    from linear_bem.layer.cell import Cell

_SPACING = 0.02
"""Step of the table of s in asinh(rho)."""
_NEAR = 1.0
"""Largest rho at which the nodes of an integral over Jn(rho t) need not follow its waves."""
_EVEN = {0.8: 12, 1.6: 18, 3.2: 30}
"""Ends of ranges from rho = 0 on, with the number of terms of a polynomial in rho^2 that is s there to roundoff.

Thick layers need only the first: with the last alone, sequences of 30 balls on them take a third longer.
"""
NONE = 1e-9
"""`LayeredKernel.uniform` over the layer's thickness that counts as 0: the measured limit is accurate to 1e-11."""


@lru_cache(maxsize=64)
def gauss(count: int) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights on [-1, 1]."""
    return np.polynomial.legendre.leggauss(count)


def panels(edges: Array, order: int) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss-Legendre rules on consecutive panels."""
    x, w = gauss(order)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()


@lru_cache(maxsize=3)
def far_rule(order: int) -> tuple[Array, Array]:
    """Return u_j and weights that contain Jn(u_j) and the cut-off: int f(u) Jn(u) du for f smooth in log u.

    Exact for constants (int Jn = 1), so that the layer's 1/r and the substrate's cancel to roundoff at large r.
    """
    edges = np.concatenate([2.0 ** np.arange(-44.0, 2.0), np.arange(4.0, 141.0, 4.0)])
    u, w = panels(edges, 12)
    w = w * jv(order, u) * 0.5 * erfc((u - 80.0) / 9.0)
    return u, w / np.sum(w)


@lru_cache(maxsize=1)
def near_rule() -> tuple[Array, Array]:
    """Return t_j and weights for int f(t) J0(rho t) dt with rho <= 1 and f negligible beyond t = 48."""
    edges = np.concatenate([2.0 ** np.arange(-44.0, 2.0), np.arange(4.0, 49.0, 2.0)])
    return panels(edges, 12)


def hankel(f: Callable[[Array], Array], rho: Array, order: int = 0) -> Array:
    """Return int_0^inf f(t) Jn(rho t) dt, n = ``order``, for f smooth in log t that is negligible beyond t = 48."""
    rho = np.atleast_1d(np.asarray(rho, dtype=float))
    out = np.empty(rho.shape)
    near = rho <= _NEAR
    t, w = near_rule()
    arguments = np.outer(rho[near], t)
    out[near] = (j0(arguments) if order == 0 else jv(order, arguments)) @ (w * f(t))
    u, omega = far_rule(order)
    for block in np.array_split(np.flatnonzero(~near), max(1, int(np.sum(~near)) // 256)):
        out[block] = (f(u / rho[block, None]) @ omega) / rho[block]
    return out


def smooth_kernel(response: LayerResponse | MeasuredResponse, rho: Array) -> Array:
    """Return s(rho) by quadrature (no table); absolute error about 1e-13 (1 + G(0)/rho)."""
    return hankel(lambda t: response(t) - 1.0, rho)


def even_spline(y: Array, values: Array, mirrored: int, *, odd: bool = False) -> BSpline:
    """Return the quintic spline through values at y = 0, ..., continued evenly (or oddly) by ``mirrored`` points."""
    both = np.concatenate([(-1.0 if odd else 1.0) * values[mirrored:0:-1], values])
    return make_interp_spline(np.concatenate([-y[mirrored:0:-1], y]), both, k=5)


class _Table:
    """s(rho) sqrt(1 + rho^2) as a quintic spline in y = asinh(rho), even in y; its limit G(0) - 1 beyond the table."""

    def __init__(self, response: LayerResponse | MeasuredResponse) -> None:
        self.far = response.at_zero - 1.0
        y_end = float(np.arcsinh(1e4 / response.smallest_scale))
        y = _SPACING * np.arange(int(np.ceil(y_end / _SPACING)) + 1)
        values = smooth_kernel(response, np.sinh(y)) * np.cosh(y)
        self.end = float(y[-1])
        self.spline = PPoly.from_spline(even_spline(y, values, 12))
        self.remainder = values[-1] - self.far
        # near the axis s is a power series in rho^2, singular at rho^2 = -4: polynomials are five times faster
        self.even = [(end, *_even_powers(response, end, terms)) for end, terms in _EVEN.items()]

    def value_and_slope(self, rho: Array, slope: bool) -> tuple[Array, Array]:
        """Return s and ds/drho (zeros without ``slope``)."""
        largest = np.max(rho, initial=0.0)
        for end, powers, derivative in self.even:
            if largest <= end:
                z = rho * rho * (2.0 / end**2) - 1.0
                return _power_series(powers, z), rho * _power_series(derivative, z) if slope else np.zeros_like(rho)
        y = np.arcsinh(rho)
        beyond = y > self.end
        y = np.minimum(y, self.end)
        root = np.sqrt(1.0 + rho * rho)
        value = self.spline(y)
        fall = self.remainder * (np.sinh(self.end) / root) ** 2
        s = np.where(beyond, self.far + fall, value) / root
        if not slope:
            return s, np.zeros_like(s)
        inside = (self.spline(y, 1) - value * rho / root) / root**2
        return s, np.where(beyond, -(self.far + 3.0 * fall) * rho / root**3, inside)


def _even_powers(response: LayerResponse | MeasuredResponse, end: float, terms: int) -> tuple[Array, Array]:
    """Return the coefficients of s(rho) and of its slope over rho in powers of z = 2 (rho/end)^2 - 1."""
    z = np.cos((np.arange(terms) + 0.5) * np.pi / terms)
    values = smooth_kernel(response, end * np.sqrt(0.5 * (1.0 + z)))
    powers = np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(z, values, terms - 1))
    return powers, np.polynomial.polynomial.polyder(powers) * (4.0 / end**2)


def _power_series(coefficients: Array, z: Array) -> Array:
    """Return a polynomial by Horner's rule, in place."""
    out = np.full_like(z, coefficients[-1])
    for c in coefficients[-2::-1]:
        out *= z
        out += c
    return out


@lru_cache(maxsize=64)
def _table(layer: Layer, substrate: Elastic | None) -> _Table:
    return _Table(response_of(layer, substrate))


class LayeredKernel:
    """Surface displacement K(r) [m/N] under a unit normal point load, and its slope.

    ``singular`` = (1 - nu1^2)/(pi E1) [m^2/N] multiplies 1/r + s(r/h)/h. The table of s depends on
    (nu1, nu2, E1/E2) only and is cached; spline error below 1e-11 in s, 1e-9 in its slope, relative to 1 + G(0). The
    ``thickness`` h [m] is that of the layer; for a `SurfaceResponse`, the scale that `MeasuredResponse` finds; infinite
    for equal materials. ``cell`` is the periodic cell, if any; all functions of r here refer to a single load.
    """

    cell: Cell | None = None

    def __init__(self, layer: Layer, substrate: Elastic | None = None) -> None:
        faults = medium_faults(layer, substrate)
        if faults:
            raise InvalidProblem(*faults)
        layer, substrate = without_empty_layer(layer, substrate)
        self.thickness = layer.thickness
        self.singular = (1.0 - layer.poisson**2) / (np.pi * layer.young)
        self.homogeneous = not np.isfinite(layer.thickness) or substrate == Elastic(layer.young, layer.poisson)
        self._table = None
        self._response = response_of(layer, substrate)
        if isinstance(self._response, MeasuredResponse):
            self.thickness, self.homogeneous = self._response.thickness, self._response.homogeneous
        if self.homogeneous:
            self.thickness = np.inf  # a contact is never wide against a layer of its base's material
        else:
            self._table = _table(*scaled_media(layer, substrate))

    @classmethod
    def of(cls, problem: Problem) -> LayeredKernel:
        """Return the kernel of the problem's layer and base."""
        kernel = cls(problem.layer, problem.substrate)
        if problem.periodic is not None:
            from linear_bem.layer.cell import Cell  # noqa: PLC0415  (only where loads repeat)

            kernel.cell = Cell.of(problem.periodic.lengths, problem.layer, kernel)
        return kernel

    @property
    def far_ratio(self) -> float:
        """G(0), the displacement far from a load over that of a half-space of the layer's material."""
        return 1.0 if self.homogeneous else self._response.at_zero

    def response_at(self, k: Array) -> Array:
        """Return G(k h) at wave numbers k > 0 [1/m]."""
        return np.ones_like(k) if self.homogeneous else self._response(k * self.thickness)

    @property
    def uniform(self) -> float:
        """Displacement per uniform pressure times ``singular`` [m], 2 pi h G'(0); infinite where G(0) > 0."""
        if self.homogeneous or self.far_ratio > 0.0:
            return np.inf
        k = np.array([1e-4, 2e-4]) / self.thickness
        near, far = 2.0 * np.pi * self.response_at(k) / k
        limit = float(4.0 * near - far) / 3.0  # the next term goes like k^2
        return limit if limit > NONE * self.thickness else 0.0

    def smooth_and_slope(self, r: Array | float, slope: bool = True) -> tuple[Array, Array]:
        """Return `smooth` and `smooth_slope` (zeros without ``slope``) at once."""
        r = np.asarray(r, dtype=float)
        if self._table is None:
            return np.zeros(r.shape), np.zeros(r.shape)
        s, ds = self._table.value_and_slope(r / self.thickness, slope)
        return s / self.thickness, ds / self.thickness**2

    def smooth(self, r: Array | float) -> Array:
        """Return s(r/h)/h [1/m], the kernel over ``singular`` without its 1/r."""
        return self.smooth_and_slope(r, slope=False)[0]

    def smooth_slope(self, r: Array | float) -> Array:
        """Return d/dr of `smooth` [1/m^2]."""
        return self.smooth_and_slope(r)[1]

    def scaled(self, r: Array | float) -> Array:
        """Return K(r) over ``singular``, 1/r + s(r/h)/h [1/m]; 0 at infinity."""
        return np.asarray(1.0 / np.asarray(r, dtype=float) + self.smooth(r))

    def scaled_slope(self, r: Array | float) -> Array:
        """Return dK/dr over ``singular`` [1/m^2]."""
        return np.asarray(self.smooth_slope(r) - 1.0 / np.asarray(r, dtype=float) ** 2)

    def displacement(self, r: Array | float) -> Array:
        """Return K(r) [m/N] at distance r > 0 [m] from a unit load, positive into the layer."""
        return self.singular * self.scaled(r)

    def slope(self, r: Array | float) -> Array:
        """Return dK/dr [1/N]."""
        return self.singular * self.scaled_slope(r)
