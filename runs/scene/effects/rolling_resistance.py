"""The effect `[rolling_resistance]`: a resistance that the force on a ball must exceed to move the ball."""

import math
from typing import Any

from linear_bem.magnitudes import range_faults
from runs.scene.effects.effect import Effect
from runs.scene.units import Number, Table


class RollingResistanceTable(Table):
    """[rolling_resistance]: the force up to which a ball stays at rest (theory: `runs.evolution.motion`)."""

    share: Number
    """Rolling resistance over the ball's load: only the force in excess of it moves the ball."""


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
    "a ball moves only if its force exceeds a share of its load",
    "any force moves a ball",
    {"share": 1e-3},
    faults=_faults,
    of_drift=True,
)
