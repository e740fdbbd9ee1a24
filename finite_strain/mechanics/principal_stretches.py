"""Sums over principal stretches whose first and second derivatives are exact wherever stretches coincide.

Eigenvalues are not smooth where they coincide, but sums of one function over all of them are. With eigenvalues 1 + g
of C = F^T F, D the deviator of C - I, J2 = D:D/2 and J3 = det D, one of them is apart from the others and smooth:

    g_a = tr(C - I)/3 + sign(J3) 2 sqrt(J2/3) cos(acos(r)/3),   r = sqrt(27/4) |J3| / J2^(3/2).

Of the other two only the mean of the logarithms and their squared half difference appear, which are smooth too. Where
all three nearly coincide, the sum is its Taylor series in D. Stress and tangent are exact to 1e-14 where two or three
stretches differ by 1e-3, 1e-6, 1e-9 or not at all (a test); eigenvalues by the cosine formula with perturbations of
1e-8 lose up to 3e-6 of the stress there and, where two stretches coincide, two thirds of the tangent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import ufl

from finite_strain.mechanics.invariants import logarithm, second_order, series, volume_change

NEAR, HIGHEST = 0.02, 10
"""Size of D over tr C / 3 below which the Taylor series in D is used, and its highest power."""


def invariants(H: Any) -> list[Any]:
    """Return tr(C - I)/3, J2, J3 and J - 1 of F = I + H, without differences of nearly equal numbers."""
    G = H + H.T + H.T * H
    D = ufl.dev(G)
    return [ufl.tr(G) / 3, ufl.inner(D, D) / 2, ufl.det(D), volume_change(H)]


def summed(energy: Callable[[PrincipalStretches], Any], H: Any, still: Any) -> Any:
    """Return an energy of the principal stretches of F = I + H; ``still`` has the values of H and no derivative.

    With the energy itself the tangent takes 170 s to compile, with its Taylor polynomial 8 s.
    """
    return second_order(lambda values: energy(PrincipalStretches(values)), invariants(H), invariants(still))


class PrincipalStretches:
    """Sums over the logarithms l of the three principal stretches, from the values of `invariants`."""

    def __init__(self, values: Sequence[Any]) -> None:
        third, second, cubed, j = values
        sign = ufl.conditional(ufl.lt(cubed, 0), -1.0, 1.0)
        r = math.sqrt(6.75) * sign * cubed / (second * ufl.sqrt(second))
        x = 0.8661 + 0.1339 * r
        for _ in range(3):  # Newton's method for cos(acos(r)/3), the root of 4 x^3 - 3 x = r
            x = x - (4 * x**3 - 3 * x - r) / (12 * x**2 - 3)
        away = sign * 2 / math.sqrt(3.0) * ufl.sqrt(second) * x
        self.logarithm = logarithm(j)
        """ln J, the sum of all l; nan where an element is inverted."""
        self._apart = logarithm(third + away) / 2
        self._mean = (self.logarithm - self._apart) / 2
        self._squared = _artanh_squared((second - 0.75 * away**2) / (1 + third - away / 2) ** 2) / 4
        u, v = second / (1 + third) ** 2, cubed / (1 + third) ** 3
        self._is_near, self._middle = ufl.lt(u, NEAR**2), logarithm(third) / 2
        self._powers = [3.0, 0.0, 2 * u]  # traces of the powers of D
        while len(self._powers) <= HIGHEST:
            self._powers.append(u * self._powers[-2] + v * self._powers[-3])

    def excess(self, a: Any) -> Any:
        """Return the sum of exp(a l) - 1 - a l, which is l1^a + l2^a + l3^a - 3 - a ln J of the stretches."""
        mean = a * self._mean
        pair = 2 * exponential_excess(mean) + 2 * ufl.exp(mean) * _cosh_less_one(a**2 * self._squared)
        growth, binomial, near = ufl.exp(a * self._middle), a / 2, 3 * exponential_excess(a * self._middle)
        for n in range(2, HIGHEST + 1):
            binomial = binomial * (a / 2 - (n - 1)) / n
            near += (growth * binomial + a / 2 * (-1) ** n / n) * self._powers[n]
        return ufl.conditional(self._is_near, near, exponential_excess(a * self._apart) + pair)


def exponential_ratio(x: Any) -> Any:
    """Return (exp(x) - 1 - x) / x^2, without cancellation where x is small."""
    near = series(x, [1.0 / math.factorial(n) for n in range(2, 14)])
    return ufl.conditional(ufl.lt(abs(x), 0.3), near, (ufl.exp(x) - 1 - x) / x**2)


def exponential_excess(x: Any) -> Any:
    """Return exp(x) - 1 - x."""
    return x**2 * exponential_ratio(x)


def _cosh_less_one(squared: Any) -> Any:
    """Return cosh(x) - 1, a smooth function of x^2."""
    near = squared * series(squared, [1.0 / math.factorial(2 * n) for n in range(1, 10)])
    return ufl.conditional(ufl.lt(squared, 1.0), near, ufl.cosh(ufl.sqrt(squared)) - 1)


def _artanh_squared(squared: Any) -> Any:
    """Return artanh(x)^2, a smooth function of x^2."""
    near = squared * series(squared, [1.0 / (2 * n + 1) for n in range(9)]) ** 2
    root = ufl.sqrt(squared)
    return ufl.conditional(ufl.lt(squared, 0.02), near, (ufl.ln((1 + root) / (1 - root)) / 2) ** 2)
