"""What a ball alone is expected to do: to size meshes, penalties and first guesses. No result depends on it."""

from __future__ import annotations

import math
from functools import lru_cache

from scipy.optimize import brentq

from finite_strain.indenter import NAMED
from linear_bem.closed_forms import Indentation, indentation_of_layer
from linear_bem.indenter import Indenter
from linear_bem.problem import Elastic, Layer

_FARTHEST = 1e3
"""Approaches and apex radii beyond which no profile is followed."""
_ROUNDS = 4
"""Fixed-point iterations between approach and radius where the force is given."""


@lru_cache(maxsize=4096)
def radius_seen(shape: str | Indenter, radius: float, approach: float) -> float:
    """Return the radius [m] of the paraboloid that the undeformed surface cuts in the same area at an approach [m]."""
    indenter, unit = (NAMED[shape], radius) if isinstance(shape, str) else (shape, 1.0)
    depth = approach / unit
    end = min(indenter.reach, _FARTHEST * (depth + indenter.apex_radius))
    cuts = []
    for x, y in ((1.0, 0.0), (0.0, 1.0)):

        def above(r: float, x: float = x, y: float = y) -> float:
            return float(indenter.height(r * x, r * y)) - depth

        cuts.append(brentq(above, 0.0, end) if above(end) > 0.0 else end)
    return unit * cuts[0] * cuts[1] / (2.0 * depth)


def alone(
    layer: Layer, substrate: Elastic | None, shape: str | Indenter, radius: float,
    *, approach: float | None = None, normal_force: float | None = None,
) -> Indentation:  # fmt: skip
    """Return what one ball does at an approach [m] > 0 or under a force [N] > 0, as a paraboloid of the radius seen."""
    if approach is not None:
        return indentation_of_layer(layer, substrate, radius_seen(shape, radius, approach), approach=approach)
    seen = radius
    for _ in range(_ROUNDS):
        state = indentation_of_layer(layer, substrate, seen, normal_force=normal_force)
        seen = math.sqrt(seen * radius_seen(shape, radius, state.approach))
    return indentation_of_layer(layer, substrate, seen, normal_force=normal_force)
