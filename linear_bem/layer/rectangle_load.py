"""Displacement under a uniformly loaded rectangle or square (the paper's figure 8)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem
from linear_bem.layer.kernel import LayeredKernel, panels
from linear_bem.magnitudes import is_number
from linear_bem.problem import Elastic, Layer


def love_rectangle(x: ArrayLike, y: ArrayLike, half_x: float, half_y: float) -> Array:
    """Return int dA'/|x - x'| [m] over the rectangle |x'| <= half_x, |y'| <= half_y, inside or outside.

    Closed form of [Love 1929, Phil. Trans. R. Soc. A 228, 377, doi 10.1098/rsta.1929.0009; Johnson 1985, eq. 3.25].
    """
    return _of_corners(_corner, x, y, half_x, half_y)


def love_slopes(x: ArrayLike, y: ArrayLike, half: float) -> tuple[Array, Array]:
    """Return the x and y derivatives of `love_rectangle` of a square, off the lines of its edges."""

    def across(a: Array, b: Array) -> Array:
        return np.arcsinh(b / np.abs(a))

    return _of_corners(across, x, y, half, half), _of_corners(lambda a, b: across(b, a), x, y, half, half)


def _of_corners(f: Callable[[Array, Array], Array], x: ArrayLike, y: ArrayLike, half_x: float, half_y: float) -> Array:
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    right, left = (f(x + side, y + half_y) - f(x + side, y - half_y) for side in (half_x, -half_x))
    return np.asarray(right - left)


def _corner(a: Array, b: Array) -> Array:
    # the integral of 1/sqrt(a^2 + b^2) over a and b; asinh is accurate for large arguments
    tiny = 1e-300
    return np.asarray(a * np.arcsinh(b / (np.abs(a) + tiny)) + b * np.arcsinh(a / (np.abs(b) + tiny)))


def graded_rule(low: float, high: float, finest: float, order: int = 6) -> tuple[Array, Array]:
    """Return Gauss nodes and weights on an interval, panels doubling from ``finest`` away from zero."""
    beside = finest * 2.0 ** np.arange(64.0)
    edges = np.concatenate([-beside[::-1], [0.0], beside])
    return panels(np.array([low, *edges[(low < edges) & (edges < high)], high]), order)


def uniform_square_displacement(
    layer: Layer, substrate: Elastic | None, half_side: float, pressure: float, x: ArrayLike, y: ArrayLike = 0.0
) -> Array:
    """Return the surface displacement [m] under ``pressure`` [Pa] on ``|x|, |y| <= half_side`` [m].

    Positive into the layer. Singular part in closed form, smooth part by Gauss quadrature on panels
    that double away from the point, from half a layer thickness on (error below 1e-9 of the largest displacement).
    Raises `InvalidProblem`.
    """
    kernel = LayeredKernel(layer, substrate)
    if not (is_number(half_side) and 0.0 < half_side < np.inf):
        raise InvalidProblem(f"half_side: must be a number greater than 0 and finite, got {half_side!r} m")
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    total = love_rectangle(x, y, half_side, half_side)
    if not kernel.homogeneous:
        finest = 0.5 * kernel.thickness

        def smooth_part(px: float, py: float) -> float:
            u, wu = graded_rule(-half_side - px, half_side - px, finest, 12)
            low, halves = (0.0, 2.0) if py == 0.0 else (-half_side - py, 1.0)  # both halves are alike on the axis
            v, wv = graded_rule(low, half_side - py, finest, 12)
            return halves * float(wu @ kernel.smooth(np.hypot(u[:, None], v)) @ wv)

        smooth = np.array([smooth_part(float(px), float(py)) for px, py in zip(x.ravel(), y.ravel(), strict=True)])
        total = total + smooth.reshape(x.shape)
    return np.asarray(kernel.singular * pressure * total)


def deepest_bulge(layer: Layer, substrate: Elastic | None, half_side: float = 1.0) -> tuple[float, float]:
    """Return x*/a and w* E1/(a q) of the largest bulge of the surface on the axis y = 0 beside a loaded square.

    As in the paper's figure 8 (a half side, q pressure); w* < 0 points outwards; (inf, 0): no bulge on 1 < x/a < 1e3.
    """

    def displacement(log_x: float) -> float:
        at = half_side * (1.0 + np.exp(log_x))
        return float(uniform_square_displacement(layer, substrate, half_side, 1.0, at)) * layer.young / half_side

    samples = np.linspace(np.log(1e-3), np.log(1e3), 160)
    values = np.array([displacement(s) for s in samples])
    best = int(np.argmin(values))
    if values[best] >= 0.0 or best in (0, len(samples) - 1):
        return np.inf, 0.0
    found = minimize_scalar(
        displacement, bounds=(samples[best - 1], samples[best + 1]), method="bounded", options={"xatol": 1e-10}
    )
    return 1.0 + float(np.exp(found.x)), float(found.fun)
