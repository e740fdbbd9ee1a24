"""Colouring of a picture by a field: one number per node, its name, its unit with a prefix, and its colours."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from runs.display.style import LAYER

_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


@dataclass(frozen=True)
class Coloring:
    """Display of a written field: its name, colour map, and the number computed from its values at each node.

    ``centre``: middle value of a diverging colour map (None: a sequential map from the lowest value).
    """

    words: str
    colors: str
    number: Callable[[Array], Array] = lambda values: values
    centre: float | None = None

    def color_map(self) -> Any:
        """Return the matplotlib colour map."""
        import matplotlib  # noqa: PLC0415  (slow to load)
        from matplotlib.colors import LinearSegmentedColormap  # noqa: PLC0415

        if self.colors.startswith("layer"):
            stops = LAYER[::-1] if self.colors.endswith("_r") else LAYER
            return LinearSegmentedColormap.from_list(self.colors, stops)
        return matplotlib.colormaps[self.colors]

    def limits(self, values: Array) -> tuple[float, float]:
        """Return the lower and upper colour limit for these values; they are never equal."""
        numbers = values[np.isfinite(values)]  # a gap is infinite where no body has a height
        low, high = float(np.min(numbers)), float(np.max(numbers))
        if self.centre is not None:
            reach = max(high - self.centre, self.centre - low)
            low, high = self.centre - reach, self.centre + reach
        return (low, high) if high > low else (low, low + max(abs(low), 1.0) * 1e-6)


COLORINGS = {
    "von_mises": Coloring("von Mises stress", "layer"),
    "contact_pressure": Coloring("contact pressure", "layer"),
    "pressure": Coloring("pressure", "RdBu_r", centre=0.0),
    "cauchy_stress": Coloring("vertical stress", "RdBu", lambda tensors: tensors[:, 2, 2], centre=0.0),
    "volume_ratio": Coloring("volume ratio J", "RdBu", centre=1.0),
    "principal_stretches": Coloring("largest stretch", "layer", lambda stretches: stretches[:, 0]),
    "displacement": Coloring("displacement", "layer", lambda vectors: np.linalg.norm(vectors, axis=1)),
    "gap": Coloring("distance from the ball", "layer_r"),
}
"""Every field that can be drawn."""


def prefixed(unit: str, largest: float, dimensionless: bool) -> tuple[float, str]:
    """Return the factor for numbers of a unit, and the unit with the prefix that suits the largest of them.

    In a dimensionless scene lengths are in R and stresses in E, the layer's Young's modulus.
    """
    if dimensionless:
        return 1.0, {"m": "R", "Pa": "E", "1": ""}[unit]
    if unit == "1" or largest <= 0.0 or not math.isfinite(largest):
        return 1.0, "" if unit == "1" else unit
    power = 3 * math.floor(math.log10(largest * 1.0000001) / 3.0)
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return 10.0**-power, f"{_PREFIXES[power]}{unit}"


def round_length(length: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that does not exceed ``length``."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= length * 1.0000001)
