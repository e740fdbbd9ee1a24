"""The effect `[rolling_resistance]`: a force that a ball's drift has to overcome."""

import math
from typing import Any

from linear_bem.magnitudes import range_faults
from runs.scene.effects.effect import Effect
from runs.scene.units import Number, Table


class RollingResistanceTable(Table):
    """[rolling_resistance]: a force that does not move a ball; needs [reciprocation]. See `runs.evolution.motion`."""

    share: Number
    """Force over the ball's load below which it stays at rest; above it, only the excess moves the ball."""


def _faults(table: RollingResistanceTable, scene: Any) -> list[str]:
    texts = range_faults({"rolling_resistance.share": table.share})
    if not 0.0 <= table.share < math.inf:
        texts.append(f"rolling_resistance.share: must not be negative, and finite, got {table.share:g}")
    if scene.reciprocation is None:
        texts.append("[rolling_resistance]: only balls that drift roll; add [reciprocation], or drop it")
    return texts


ROLLING_RESISTANCE = Effect(
    "rolling_resistance",
    RollingResistanceTable,
    "the drift of a ball has to overcome a share of its load",
    "any force moves a ball",
    {"share": 1e-3},
    faults=_faults,
    of_drift=True,
)
