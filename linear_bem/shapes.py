"""Heights of rigid indenters over the surface plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import InvalidProblem
from linear_bem.problem import Ball

Array = NDArray[np.float64]
Height = Callable[[Array, Array], Array]
"""f(x, y) [m] at surface points x, y [m] in the global frame."""

APEX = 1e-12
"""Height over the radius that a callable profile may have at the ball's axis: roundoff."""


def height(ball: Ball) -> Height:
    """Return the height [m] of a ball's surface above its lowest point, as a function of global x, y [m].

    "paraboloid" r^2/2R; "sphere" R - sqrt(R^2 - r^2), which ends at r = R (the edge of the contact must stay inside).
    """
    x0, y0 = ball.position
    radius, shape = ball.radius, ball.shape
    if callable(shape):
        profile = shape
        _check_apex(ball)

        def custom(x: Array, y: Array) -> Array:
            values = np.asarray(profile(x - x0, y - y0), dtype=float)
            if values.shape != np.shape(x):
                raise InvalidProblem(
                    f"balls.shape: a profile must return one height per point, shape {np.shape(x)}, got {values.shape}"
                )
            return values

        return custom
    if shape == "sphere":

        def sphere(x: Array, y: Array) -> Array:
            squared = (x - x0) ** 2 + (y - y0) ** 2
            # beyond the equator there is no surface to touch: continue steeply so that nothing does
            inside = np.minimum(squared, radius**2)
            return np.asarray(inside / (radius + np.sqrt(radius**2 - inside)) + (squared - inside) / radius)

        return sphere

    def paraboloid(x: Array, y: Array) -> Array:
        return np.asarray(((x - x0) ** 2 + (y - y0) ** 2) / (2.0 * radius))

    return paraboloid


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
    if ball.shape == "paraboloid":
        return dx / ball.radius, dy / ball.radius
    if ball.shape == "sphere":
        depth = np.sqrt(np.maximum(ball.radius**2 - dx**2 - dy**2, 1e-300))
        return dx / depth, dy / depth
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


def curvature(ball: Ball, scale: float) -> Array:
    """Return the 2x2 matrix of second derivatives [1/m] of f near the apex, seen over a length ``scale`` [m]."""
    if not callable(ball.shape):
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
