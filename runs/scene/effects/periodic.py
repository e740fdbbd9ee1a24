"""The effect `[periodic]`: balls that drift in a cell which repeats along x and y."""

from __future__ import annotations

import math
from typing import Any

from runs.scene.effects.effect import Effect
from runs.scene.units import Table, TwoLengths


class PeriodicTable(Table):
    """[periodic]: balls that drift in a cell."""

    lengths: TwoLengths
    """Of the cell, along x and y."""


def _faults(table: PeriodicTable, scene: Any) -> list[str]:
    lengths = table.lengths
    if not all(0.0 < length < math.inf for length in lengths):
        given = ", ".join(f"{length:g}" for length in lengths)
        return [f"periodic.lengths: must be two lengths greater than 0 and finite, got {given} m"]
    texts = []
    if scene.reciprocation is None:
        texts.append("[periodic]: only balls that drift repeat; add [reciprocation], or drop [periodic]")
    elif scene.reciprocation.forces == "direct":
        texts.append('reciprocation.forces: the full model has no periodic cell; take forces = "pairs"')
    if scene.substrate is not None or math.isinf(scene.layer.thickness):
        texts.append(
            "[periodic]: the dents of infinitely many balls add up without limit on an elastic half-space; "
            "drop [substrate] and give [layer] a finite thickness"
        )
    radii = scene.balls.radius if isinstance(scene.balls.radius, tuple) else (scene.balls.radius or 0.0,)
    if min(lengths) < 4.0 * max(radii):
        texts.append(
            f"periodic.lengths: must be at least two diameters, {4.0 * max(radii):g} m, so that no ball touches two "
            f"images of another, got {min(lengths):g} m"
        )
    return texts


PERIODIC = Effect(
    "periodic",
    PeriodicTable,
    "a cell that repeats along x and y",
    "nothing is around the balls",
    {"lengths": ["200 mm", "200 mm"]},
    faults=_faults,
    of_drift=True,
)
