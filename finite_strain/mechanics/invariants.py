"""Invariants of the displacement gradient, and functions of them without differences of nearly equal numbers."""

from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement
from typing import Any

import ufl


def volume_change(H: Any) -> Any:
    """Return J - 1 = det(I + H) - 1."""
    return ufl.tr(H) + second_invariant(H) + ufl.det(H)


def second_invariant(X: Any) -> Any:
    """Return (tr^2 X - tr X^2) / 2."""
    return (ufl.tr(X) ** 2 - ufl.tr(X * X)) / 2


def second_order(function: Callable[[list[Any]], Any], moving: Sequence[Any], still: Sequence[Any]) -> Any:
    """Return a function of invariants as its Taylor polynomial of second order about their present values.

    ``moving`` are the invariants, ``still`` their values without derivative. Value and first two derivatives are the
    function's own, and the compiled tangent is several times smaller: the form compiler applies the chain rule to each
    of the nine components of H at each operation of the function.
    """
    present = [ufl.variable(value) for value in still]
    change = [now - value for now, value in zip(moving, present, strict=True)]
    total = value = function(present)
    slopes = [ufl.diff(value, each) for each in present]
    total += sum(slope * step for slope, step in zip(slopes, change, strict=True))
    for k, m in combinations_with_replacement(range(len(present)), 2):
        total += (0.5 if k == m else 1.0) * ufl.diff(slopes[k], present[m]) * change[k] * change[m]
    return total


def minus_logarithm(x: Any) -> Any:
    """Return x - ln(1 + x); by its Taylor series (error below 1e-17) where x is small."""
    near = x * x * series(x, [(-1) ** n / n for n in range(2, 11)])
    return ufl.conditional(ufl.lt(abs(x), 0.02), near, x - ufl.ln(1 + x))


def logarithm(x: Any) -> Any:
    """Return ln(1 + x), without cancellation where x is small."""
    return x - minus_logarithm(x)


def series(x: Any, coefficients: Sequence[float]) -> Any:
    """Return c_0 + c_1 x + c_2 x^2 + ..."""
    total: Any = 0.0
    for coefficient in reversed(coefficients):
        total = coefficient + x * total
    return total
