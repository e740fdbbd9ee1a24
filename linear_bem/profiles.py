"""Height, slope and curvature of the indenter of one ball at points of the surface plane."""

import math
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from linear_bem.arrays import Array
from linear_bem.dual import APEX, slope
from linear_bem.errors import InvalidProblem
from linear_bem.indenter import WALL, Indenter, Paraboloid, Sphere
from linear_bem.problem import Ball

Value = TypeVar("Value", float, Array)
Height = Callable[[Array, Array], Array]
"""f(x, y) [m] at surface points x, y [m] in the global frame."""
BEYOND = 10.0
"""Height over distance from the axis that a body has beyond its edge only."""


def height(ball: Ball) -> Height:
    """Return the height [m] of a ball's surface above its lowest point, as a function of global x, y [m].

    It is `WALL` radii where the body has none: an own profile may give np.nan or np.inf beyond its edge.
    """
    x0, y0 = ball.position
    body = ball.indenter
    given = body.height if isinstance(body, Indenter) else body

    def found(x: Array, y: Array) -> Array:
        with np.errstate(all="ignore"):
            values = np.asarray(given(x - x0, y - y0), dtype=float)
        if values.shape != np.shape(x):
            raise InvalidProblem(
                f"balls.shape: a profile must return one height per point, shape {np.shape(x)}, got {values.shape}; "
                "use numpy"
            )
        return np.where(np.isfinite(values), values, WALL * ball.radius)

    if isinstance(body, Indenter):
        return found
    apex = float(found(np.full(1, float(x0)), np.full(1, float(y0)))[0])
    if not abs(apex) <= APEX * ball.radius:
        raise InvalidProblem(
            f"balls.shape: a profile must be 0 at the ball's axis, that of the ball at {ball.position} is "
            f"{apex:g} m there" + ("; subtract it, and lower the approach by as much" if math.isfinite(apex) else "")
        )
    return found


def gradient(ball: Ball, x: Array, y: Array) -> tuple[Array, Array]:
    """Return df/dx and df/dy at surface points [m]; for callables by fourth-order differences."""
    dx, dy = x - ball.position[0], y - ball.position[1]
    body = ball.indenter
    if isinstance(body, Indenter):
        return slope(body, dx, dy)
    if x.size == 0:
        return dx, dy
    f = height(ball)
    step = 1e-3 * max(float(np.ptp(x)), float(np.ptp(y)), 1e-9 * ball.radius)
    return difference(lambda s: f(x + s, y), step), difference(lambda s: f(x, y + s), step)


def difference(f: Callable[[float], Value], step: float) -> Value:
    """Return the derivative of f at 0 by the fourth-order central difference."""
    return (8.0 * (f(step) - f(-step)) - (f(2.0 * step) - f(-2.0 * step))) / (12.0 * step)


def is_ball(ball: Ball) -> bool:
    """Return whether the body is a sphere or a paraboloid, so that the radius describes its apex."""
    return isinstance(ball.indenter, Sphere | Paraboloid)


def curvature(ball: Ball, scale: float) -> Array:
    """Return the 2x2 matrix of second differences [1/m] of f at the apex with step ``scale`` [m], less near an edge.

    Beyond an edge an own profile may have no height, or rise by any amount.
    """
    if is_ball(ball):
        return np.eye(2) / ball.radius
    scales, steps = scale * 0.7 ** np.arange(30.0)[:, None, None], np.array([-1.0, 0.0, 1.0])
    x, y = np.broadcast_arrays(ball.position[0] + scales * steps[:, None], ball.position[1] + scales * steps)
    f = height(ball)(x, y)
    xx = f[:, 2, 1] + f[:, 0, 1] - 2.0 * f[:, 1, 1]
    yy = f[:, 1, 2] + f[:, 1, 0] - 2.0 * f[:, 1, 1]
    xy = 0.25 * (f[:, 2, 2] + f[:, 0, 0] - f[:, 2, 0] - f[:, 0, 2])
    matrices = np.array([[xx, xy], [xy, yy]]).T / scales**2
    rises = np.any(f - f[:, 1:2, 1:2] > BEYOND * scales, axis=(1, 2))
    fits = ~rises & (np.linalg.eigvalsh(matrices)[:, 0] > 0.0)
    chosen = int(np.argmax(fits)) if rises[0] else 0
    matrix, scale = matrices[chosen], float(scales[chosen, 0, 0])
    if np.linalg.eigvalsh(matrix)[0] <= 0.0:
        raise InvalidProblem(
            f"balls.shape: a profile must be strictly convex at its apex; the ball at {ball.position} has second "
            f"derivatives {matrix.tolist()} 1/m over {scale:g} m"
        )
    return matrix


def mean_height(ball: Ball, radius: float) -> float:
    """Return the mean height [m] of f on a circle of this radius [m] about the axis."""
    angle = 2.0 * np.pi * (np.arange(16) + 0.5) / 16.0
    x0, y0 = ball.position
    return float(np.mean(height(ball)(x0 + radius * np.cos(angle), y0 + radius * np.sin(angle))))


def farthest(ball: Ball, axes: Array, depth: float) -> float:
    """Return the largest distance [m] from the axis at which the body is lower than a ``depth`` [m].

    At most the half length of an ellipse with ``axes`` (2, 2) [m]: a body that is flat at its axis may seem far longer
    than it is. It is looked for in all directions and, so that no needle is missed, along the ellipse.
    """
    turn, (longest, _), _ = np.linalg.svd(axes)
    if is_ball(ball):
        return float(longest)
    angle = np.arctan2(turn[1, 0], turn[0, 0]) + 2.0 * np.pi * np.arange(64) / 64.0
    r = longest * np.geomspace(1.0, 1e-9, 400)[:, None]
    low = height(ball)(ball.position[0] + r * np.cos(angle), ball.position[1] + r * np.sin(angle)) < depth
    return float(r[np.argmax(np.any(low, axis=1)), 0])
