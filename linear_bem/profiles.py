"""Heights of rigid indenters over the surface plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import InvalidProblem
from linear_bem.indenter import Indenter, Paraboloid, Sphere, slope
from linear_bem.problem import Ball

Array = NDArray[np.float64]
Height = Callable[[Array, Array], Array]
"""f(x, y) [m] at surface points x, y [m] in the global frame."""

APEX = 1e-12
"""Height over the radius that a callable profile may have at the ball's axis: roundoff."""


def height(ball: Ball) -> Height:
    """Return the height [m] of a ball's surface above its lowest point, as a function of global x, y [m]."""
    x0, y0 = ball.position
    body = ball.indenter
    if isinstance(body, Indenter):
        return lambda x, y: np.asarray(body.height(x - x0, y - y0))
    _check_apex(ball)

    def custom(x: Array, y: Array) -> Array:
        values = np.asarray(body(x - x0, y - y0), dtype=float)
        if values.shape != np.shape(x):
            raise InvalidProblem(
                f"balls.shape: a profile must return one height per point, shape {np.shape(x)}, got {values.shape}"
            )
        return values

    return custom


def _check_apex(ball: Ball) -> None:
    """Raise `InvalidProblem` where a callable is not 0 at the ball's axis: approaches are counted from there."""
    assert callable(ball.shape)
    apex = np.asarray(ball.shape(np.zeros(1), np.zeros(1)), dtype=float)
    if apex.shape != (1,):
        raise InvalidProblem(
            f"balls.shape: a profile must return one height per point, shape (1,), got {apex.shape}; use numpy"
        )
    if not abs(float(apex[0])) <= APEX * ball.radius:
        raise InvalidProblem(
            f"balls.shape: a profile must be 0 at the ball's axis, that of the ball at {ball.position} is "
            f"{float(apex[0]):g} m there; subtract it, and lower the approach by as much"
        )


def gradient(ball: Ball, x: Array, y: Array) -> tuple[Array, Array]:
    """Return df/dx and df/dy at surface points; a callable is differenced to fourth order."""
    dx, dy = x - ball.position[0], y - ball.position[1]
    body = ball.indenter
    if isinstance(body, Indenter):
        return slope(body, dx, dy)
    if x.size == 0:
        # a ball that does not touch has no slope to difference
        return dx, dy
    f = height(ball)
    step = 1e-3 * max(float(np.ptp(x)), float(np.ptp(y)), 1e-9 * ball.radius)

    def along(ex: float, ey: float) -> Array:
        near = f(x + step * ex, y + step * ey) - f(x - step * ex, y - step * ey)
        far = f(x + 2 * step * ex, y + 2 * step * ey) - f(x - 2 * step * ex, y - 2 * step * ey)
        return np.asarray((8.0 * near - far) / (12.0 * step))

    return along(1.0, 0.0), along(0.0, 1.0)


def is_ball(ball: Ball) -> bool:
    """Return whether a radius of curvature alone says how the ball begins: a sphere or a paraboloid."""
    return isinstance(ball.indenter, Sphere | Paraboloid)


def curvature(ball: Ball, scale: float) -> Array:
    """Return the 2x2 matrix of second derivatives [1/m] of f near the apex, seen over a length ``scale`` [m]."""
    if is_ball(ball):
        return np.eye(2) / ball.radius
    f = height(ball)
    x0, y0 = ball.position
    e = scale

    def at(a: float, b: float) -> float:
        return float(f(np.array([x0 + a * e]), np.array([y0 + b * e]))[0])

    xx = at(1, 0) + at(-1, 0) - 2.0 * at(0, 0)
    yy = at(0, 1) + at(0, -1) - 2.0 * at(0, 0)
    xy = 0.25 * (at(1, 1) + at(-1, -1) - at(1, -1) - at(-1, 1))
    matrix = np.array([[xx, xy], [xy, yy]]) / e**2
    if np.linalg.eigvalsh(matrix)[0] <= 0.0:
        raise InvalidProblem(
            f"balls.shape: a profile must be strictly convex at its apex; the ball at {ball.position} has second "
            f"derivatives {matrix.tolist()} 1/m over {e:g} m"
        )
    return matrix


def mean_height(ball: Ball, radius: float) -> float:
    """Return the mean height [m] of f on a circle of this radius [m] about the axis."""
    angle = 2.0 * np.pi * (np.arange(16) + 0.5) / 16.0
    x0, y0 = ball.position
    return float(np.mean(height(ball)(x0 + radius * np.cos(angle), y0 + radius * np.sin(angle))))
