"""Displacement under a uniformly loaded rectangle or square (the paper's figure 8)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from linear_bem.kernel import LayeredKernel
from linear_bem.problem import Elastic, Layer

Array = NDArray[np.float64]


def love_rectangle(x: ArrayLike, y: ArrayLike, half_x: float, half_y: float) -> Array:
    """Return int dA'/|x - x'| [m] over the rectangle |x'| <= half_x, |y'| <= half_y, inside or outside.

    Closed form of [Love 1929, Phil. Trans. R. Soc. A 228, 377, doi 10.1098/rsta.1929.0009; Johnson 1985, eq. 3.25].
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)

    def corner(a: Array, b: Array) -> Array:
        # d2/da db of this is 1/sqrt(a^2 + b^2); asinh keeps its digits for large arguments
        tiny = 1e-300
        return np.asarray(a * np.arcsinh(b / (np.abs(a) + tiny)) + b * np.arcsinh(a / (np.abs(b) + tiny)))

    return (
        corner(x + half_x, y + half_y)
        - corner(x + half_x, y - half_y)
        - corner(x - half_x, y + half_y)
        + corner(x - half_x, y - half_y)
    )


def uniform_square_displacement(
    layer: Layer, substrate: Elastic | None, half_side: float, pressure: float, x: ArrayLike, y: ArrayLike = 0.0
) -> Array:
    """Return the surface displacement [m] under ``pressure`` [Pa] on |x|, |y| <= half_side [m].

    Positive into the layer. Singular part in closed form, smooth part by Gauss quadrature on panels of a layer
    thickness (error below 1e-10 of the displacement under the square).
    """
    kernel = LayeredKernel(layer, substrate)
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    total = love_rectangle(x, y, half_side, half_side)
    if not kernel.homogeneous:
        panels = int(np.clip(np.ceil(2.0 * half_side / layer.thickness), 1, 60))
        z, w = np.polynomial.legendre.leggauss(12)
        width = 2.0 * half_side / panels
        nodes = (-half_side + width * (np.arange(panels)[:, None] + 0.5 * (1.0 + z))).ravel()
        weights = np.tile(0.5 * width * w, panels)
        smooth = np.array(
            [
                weights @ kernel.smooth(np.hypot(a - nodes[:, None], b - nodes)) @ weights
                for a, b in zip(x.ravel(), y.ravel(), strict=True)
            ]
        )
        total = total + smooth.reshape(x.shape)
    return np.asarray(kernel.singular * pressure * total)


def deepest_bulge(layer: Layer, substrate: Elastic | None, half_side: float = 1.0) -> tuple[float, float]:
    """Return x*/a and w* E1/(a q): where the surface on the axis y = 0 bulges out most beside a loaded square.

    Both as in the paper's figure 8; w* < 0 is out of the layer; (inf, 0): it bulges nowhere on 1 < x/a < 1e3.
    """
    scale = layer.young / half_side

    def displacement(log_x: float) -> float:
        at = half_side * (1.0 + np.exp(log_x))
        return float(uniform_square_displacement(layer, substrate, half_side, 1.0, at)) * scale

    samples = np.linspace(np.log(1e-3), np.log(1e3), 160)
    values = np.array([displacement(s) for s in samples])
    best = int(np.argmin(values))
    if values[best] >= 0.0 or best in (0, len(samples) - 1):
        return np.inf, 0.0
    found = minimize_scalar(
        displacement, bounds=(samples[best - 1], samples[best + 1]), method="bounded", options={"xatol": 1e-10}
    )
    return 1.0 + float(np.exp(found.x)), float(found.fun)
