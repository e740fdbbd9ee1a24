"""Exact slopes of an indenter's height by dual numbers, and whether its height is an expression that these take."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from linear_bem.indenter import Indenter

APEX = 1e-12
"""Largest height over the radius at the axis that counts as roundoff of an own body."""


def slope(indenter: Indenter, x: Array, y: Array) -> tuple[Array, Array]:
    """Return the exact df/dx and df/dy of an indenter's height f at points x, y [m] from its axis."""
    one, none = np.ones_like(x), np.zeros_like(x)
    change = indenter.height(Dual(x, one, none), Dual(y, none, one))
    return change.dx, change.dy


def height_faults(shapes: Iterable[object]) -> list[str]:
    """Return what keeps the heights of indenters from being expressions that all models take, one text each."""
    bodies = {id(shape): shape for shape in shapes if isinstance(shape, Indenter)}
    return list(dict.fromkeys(text for body in bodies.values() for text in _faults_of(body)))


def _faults_of(body: Indenter) -> list[str]:
    name, aside = f"balls.shape: {type(body).__name__}.height", np.array([0.01 * body.apex_radius])
    at = Dual(aside, np.ones(1), np.zeros(1))
    try:
        expression = isinstance(body.height(at, at), Dual)
    except TypeError as fault:
        if Dual.__name__ not in str(fault):  # a fault of the user's own
            raise
        expression = False
    if not expression:
        return [
            f"{name} must be an expression of + - * / ** and abs alone (a root is s**0.5), which finite elements can "
            "differentiate, got another function, such as one of numpy; the linear model takes these, too, as a plain "
            "function f(x, y): Ball(..., shape=f)"
        ]
    apex = float(np.ravel(body.height(np.zeros(1), np.zeros(1)))[0])
    if abs(apex) <= APEX * body.apex_radius:
        return []
    return [f"{name} must be 0 at the axis, from which approaches are measured, got {apex:g} m; subtract it"]


@dataclass(frozen=True)
class Dual:
    """Values with their derivatives by x and y (forward-mode automatic differentiation)."""

    value: Array
    dx: Array
    dy: Array
    __array_ufunc__ = None

    def _chain(self, value: Array, by: Any) -> Dual:
        return Dual(value, by * self.dx, by * self.dy)

    def __add__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.dx + other.dx, self.dy + other.dy)
        return self._chain(self.value + other, 1.0)

    def __mul__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            a, b = self._chain(self.value * other.value, other.value), other._chain(other.value, self.value)
            return Dual(a.value, a.dx + b.dx, a.dy + b.dy)
        return self._chain(self.value * other, other)

    def __pow__(self, power: float) -> Dual:
        return self._chain(self.value**power, power * self.value ** (power - 1.0))

    def __abs__(self) -> Dual:
        return self._chain(abs(self.value), np.sign(self.value))

    def __neg__(self) -> Dual:
        return self * -1.0

    def __sub__(self, other: Any) -> Dual:
        return self + (-other)

    def __rsub__(self, other: Any) -> Dual:
        return -self + other

    def __truediv__(self, other: Any) -> Dual:
        return self * (other**-1.0 if isinstance(other, Dual) else 1.0 / other)

    __radd__, __rmul__ = __add__, __mul__
