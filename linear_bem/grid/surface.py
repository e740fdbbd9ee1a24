"""Surface displacement anywhere, from pressures of square cells."""

from collections.abc import Iterable

import numpy as np

from linear_bem.arrays import Array, hypotenuse
from linear_bem.grid.patches import Patch
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.layer.rectangle_load import love_rectangle

AT_ONCE = 2_000_000
"""Products of points and cells that are taken together, to bound the memory."""


def surface_displacement(kernel: LayeredKernel, loads: Iterable[tuple[Patch, Array]], x: Array, y: Array) -> Array:
    """Return the displacement [m] at surface points [m] of any shape; pressures are times ``singular``."""
    flat_x, flat_y, out = x.ravel(), y.ravel(), np.zeros(x.size)
    for patch, p in loads:
        loaded = p > 0.0
        cx, cy = (c[loaded] for c in patch.points)
        half = 0.5 * patch.cell
        for part in np.array_split(np.arange(x.size), x.size * cx.size // AT_ONCE + 1):
            dx, dy = flat_x[part, None] - cx, flat_y[part, None] - cy
            block = love_rectangle(dx, dy, half, half)
            if not kernel.homogeneous:
                block = block + patch.cell**2 * kernel.smooth(hypotenuse(dx, dy))
            out[part] += block @ p[loaded]
    return out.reshape(x.shape)
