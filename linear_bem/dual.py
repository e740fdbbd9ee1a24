"""Exact slopes of an indenter's height by dual numbers, and checks that a user's height permits them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from linear_bem.arrays import Array
from linear_bem.indenter import Ellipsoid, HeightFunction, Indenter, Sphere

APEX = 1e-12
"""Largest height at the axis, over the radius, that counts as roundoff in a user's body."""
POINTED = 1e-3
"""Slope at a distance of 1e-9 radii from the axis that only a pointed tip or a tilt exceeds."""
SAGGING = 1e-6
"""Second difference along a ray, over the largest one, that counts as roundoff in a convex height."""
GAP = 1e-2
"""Largest error of a user's gap next to the apex, over the height there and over the distance below it."""
FUNCTIONS = "np.sqrt, exp, log, sin, cos, tan, sinh, cosh, tanh, maximum, minimum"
"""numpy functions in `SLOPES`, for messages; np.where is excluded, as no error estimate would notice its jumps."""


def slope(indenter: Indenter, x: Array, y: Array) -> tuple[Array, Array]:
    """Return the exact df/dx and df/dy of an indenter's height f at points x, y [m] from its axis."""
    one, none = np.ones_like(x), np.zeros_like(x)
    change = indenter.height(Dual(x, one, none), Dual(y, none, one))
    return change.dx, change.dy


def has_kinks(indenter: Indenter) -> bool:
    """Return whether a height has a kink below its equator: uses a function of `KINKED`, as no ellipsoid does there."""
    if type(indenter) in (Sphere, Ellipsoid):
        return False
    at = Dual(np.array([0.01 * _size(indenter)]), np.ones(1), np.zeros(1))
    return bool(indenter.height(at, at).kinked)


def _size(body: Indenter) -> float:
    return min(body.apex_radius, body.reach)


def height_faults(shapes: Iterable[object]) -> list[str]:
    """Return a message per height that is not an expression for all models, or not 0, or not level, at the axis."""
    bodies = {id(shape): shape for shape in shapes if isinstance(shape, Indenter)}
    return list(dict.fromkeys(text for body in bodies.values() for text in _faults_of(body)))


def _faults_of(body: Indenter) -> list[str]:
    name, as_it_is = f"{type(body).__name__}.height", "any function f(x, y): Ball(..., shape=f)"
    if isinstance(body, HeightFunction):
        name, as_it_is = getattr(body.function, "__name__", "f"), "it"
    aside = np.array([0.01 * _size(body)])
    at = Dual(aside, np.ones(1), np.zeros(1))
    other = "another function"
    try:
        expression = isinstance(body.height(at, at), Dual)
    except Exception as error:  # whatever a user's function raises
        body.height(aside, aside)  # raises again if the function itself is faulty
        found = re.search(r"<ufunc '(\w+)'>", str(error))
        other, expression = f"np.{found[1]}" if found else other, False
    if not expression:
        return [
            f"balls.shape: {name} must be an expression of + - * / **, abs and {FUNCTIONS}, which finite elements can "
            f"differentiate, got {other}; np.where may jump: write a kink by np.maximum or np.minimum; the "
            f"linear model takes {as_it_is}"
        ]
    apex = float(np.ravel(body.height(np.zeros(1), np.zeros(1)))[0])
    if not abs(apex) <= APEX * body.apex_radius:
        rule = "must be 0 at the axis, from which approaches are measured"
        return [f"balls.shape: {name} {rule}, got {apex:g} m; subtract it"]
    if isinstance(body, HeightFunction):
        near = 1e-7 * aside * np.exp(2j * np.pi * (np.arange(8) + 0.5) / 8.0)
        steep = float(np.hypot(*slope(body, near.real, near.imag)).max())
        if not steep <= POINTED:
            rule = "must be level at the axis: no pointed tip, whose pressure has no limit, and no tilt"
            remedy = "round a tip: np.sqrt(x**2 + y**2 + t**2) - t, or move the axis to the lowest point"
            return [f"balls.shape: {name} {rule}, got a slope of {steep:g} next to the axis; {remedy}"]
        rays = 0.5 * body.apex_radius * np.outer(np.exp(2j * np.pi * np.arange(8) / 8.0), np.linspace(0.0, 1.0, 26))
        heights = body.height(rays.ravel().real, rays.ravel().imag).reshape(rays.shape)
        bends = np.diff(heights, 2)
        if not heights.max() > 0.0 or np.min(bends) < -SAGGING * np.abs(bends).max():
            rule = "must rise from the axis, ever steeper (convex), up to half the radius"
            worst = np.unravel_index(np.argmin(bends), bends.shape)
            return [f"balls.shape: {name} {rule}, got another slope {abs(rays[worst[0], worst[1] + 1]):.3g} m away"]
    around = _size(body) * np.outer((0.01, 0.1), np.exp(2j * np.pi * np.arange(16) / 16.0)).ravel()
    lowest = float(np.min(body.height(around.real, around.imag)))
    if lowest < -APEX * body.apex_radius:
        rule = "must have its lowest point at the axis, from which approaches are measured"
        return [f"balls.shape: {name} {rule}, got {lowest:g} m near it; change its sign, or move the axis"]
    return _faults_of_gap(body) if type(body).gap.__module__ != Indenter.__module__ else []


def _faults_of_gap(body: Indenter) -> list[str]:
    """Return a message if a user's gap is not that of the height, which the small-strain models use."""
    near = 0.01 * _size(body)
    ring = near * np.exp(2j * np.pi * np.arange(16) / 16.0)
    heights = np.broadcast_to(body.height(ring.real, ring.imag), ring.shape)
    off = np.broadcast_to(body.gap(ring.real, ring.imag, heights), ring.shape)
    step = GAP * near  # small, as a gap need be a distance to first order alone
    below = float(np.ravel(body.gap(np.zeros(1), np.zeros(1), np.full(1, -step)))[0])
    rule, remedy = f"balls.shape: {type(body).__name__}.gap must be", "return height(x, y) - z, or leave gap out"
    if not np.abs(off).max() <= GAP * (heights.max() + GAP**2 * near):  # heights may be 0
        worst = np.nanargmax(np.abs(off)) if np.isfinite(off).any() else 0
        place = f"at (x, y) = ({ring[worst].real:.3g}, {ring[worst].imag:.3g}) m"
        return [f"{rule} 0 on the surface z = height(x, y), got {off[worst]:.3g} m {place}; {remedy}"]
    if not abs(below - step) <= GAP * step:
        return [f"{rule} the distance from the apex, positive below, got {below:.3g} m at {step:.3g} m below; {remedy}"]
    return []


@dataclass(frozen=True, eq=False)
class Dual(NDArrayOperatorsMixin):
    """Values with their x and y derivatives (forward-mode automatic differentiation); ``kinked``: these may jump."""

    value: Array
    dx: Array
    dy: Array
    kinked: bool = False

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Return a function of `SLOPES` with its derivatives; numpy raises TypeError for others."""
        if ufunc not in SLOPES or method != "__call__" or kwargs:
            return NotImplemented
        values = [v.value if isinstance(v, Dual) else v for v in inputs]
        slopes = SLOPES[ufunc](*values)
        if any(isinstance(v, Dual) for v in inputs[len(slopes) :]):
            return NotImplemented
        terms = [(slope, v) for slope, v in zip(slopes, inputs, strict=False) if isinstance(v, Dual)]
        dx, dy = sum(slope * v.dx for slope, v in terms), sum(slope * v.dy for slope, v in terms)
        kinked = ufunc in KINKED or any(isinstance(v, Dual) and v.kinked for v in inputs)
        return Dual(ufunc(*values), dx, dy, kinked)


SLOPES: dict[np.ufunc, Callable[..., tuple[Any, ...]]] = {
    np.add: lambda a, b: (1.0, 1.0),
    np.subtract: lambda a, b: (1.0, -1.0),
    np.multiply: lambda a, b: (b, a),
    np.true_divide: lambda a, b: (1.0 / b, -a / b**2),
    np.power: lambda a, power: (power * a ** (power - 1.0),),
    np.negative: lambda a: (-1.0,),
    np.absolute: lambda a: (np.sign(a),),
    np.maximum: lambda a, b: (np.where(a > b, 1.0, 0.0), np.where(a > b, 0.0, 1.0)),
    np.minimum: lambda a, b: (np.where(a < b, 1.0, 0.0), np.where(a < b, 0.0, 1.0)),
    np.sqrt: lambda a: (0.5 / np.sqrt(a),),
    np.exp: lambda a: (np.exp(a),),
    np.log: lambda a: (1.0 / a,),
    np.sin: lambda a: (np.cos(a),),
    np.cos: lambda a: (-np.sin(a),),
    np.tan: lambda a: (1.0 + np.tan(a) ** 2,),
    np.sinh: lambda a: (np.cosh(a),),
    np.cosh: lambda a: (np.sinh(a),),
    np.tanh: lambda a: (1.0 - np.tanh(a) ** 2,),
}
"""Functions that a height may use, with their derivative by each operand; the exponent of a power must be a number."""
KINKED = {np.absolute, np.maximum, np.minimum}
"""Functions of `SLOPES` whose slope jumps."""
