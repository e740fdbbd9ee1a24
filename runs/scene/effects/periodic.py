"""The effect `[periodic]`: a cell with its balls that repeats along x and y."""

import math
from typing import Any

from linear_bem.magnitudes import range_faults
from linear_bem.problem import Periodic
from runs.scene.effects.effect import Effect
from runs.scene.units import Table, TwoLengths


class PeriodicTable(Table):
    """[periodic]: a cell with its balls that repeats along x and y; forces are per cell.

    ``solve`` supports it with linear_bem, ``evolve`` with a table of pairs of any model. In ``solve``, an approach is
    relative to the mean level of the layer's underside or, on a half-space, of its surface. Positions may lie outside
    the cell: every ball stands for all its images.
    """

    lengths: TwoLengths
    """Lengths of the cell along x and y."""


def _faults(table: PeriodicTable, scene: Any) -> list[str]:
    if scene.reciprocation is None:
        return []
    lengths = table.lengths  # the problem has no cell here
    if texts := Periodic(lengths).faults():
        return texts
    radii = scene.balls.radius if isinstance(scene.balls.radius, tuple) else (scene.balls.radius or 0.0,)
    largest = max(radii, default=0.0)
    texts = range_faults({"periodic.lengths": max(lengths)}, "m", largest, "the largest ball's radius")
    if scene.reciprocation.forces == "direct":
        texts.append(
            'reciprocation.forces: [periodic] supports only pair forces; take forces = "pairs" (for '
            "unequal balls with --model point_load), or drop [periodic]"
        )
    if scene.substrate is not None or math.isinf(scene.layer.thickness):
        remedy = "drop [substrate]" if scene.substrate is not None else "give [layer] a finite thickness"
        texts.append(
            "[periodic]: on an elastic half-space, the dents of infinitely many drifting balls add up without limit; "
            f"{remedy}"
        )
    if min(lengths) < 4.0 * largest:
        texts.append(
            f"periodic.lengths: must be at least two diameters, {4.0 * largest:g} m, so that no ball touches two "
            f"images of another, got {min(lengths):g} m"
        )
    return texts


PERIODIC = Effect(
    "periodic",
    PeriodicTable,
    "a cell that repeats along x and y",
    "the balls are alone on an infinite layer",
    {"lengths": ["200 mm", "200 mm"]},
    lambda table: Periodic(table.lengths),
    _faults,
    of_drift=True,
)
