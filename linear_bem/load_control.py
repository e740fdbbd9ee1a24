"""The approaches that a load leaves unknown, and the forces that it prescribes instead."""

from collections.abc import Sequence

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.problem import Load

Groups = list[tuple[list[int], float]]
"""Balls that share one unknown approach, and their total force times `LayeredKernel.singular` [m^2]."""
BULGE = 2.0
"""Height over the deepest approach above which a lifted body cannot touch: the surface bulges by a small part of it."""


def force_groups(load: Load, touching: Sequence[int], singular: float) -> Groups:
    """Return the groups of a load; balls are numbered by their position in ``touching``."""
    if load.kind == "force":
        return [([k], load.values[i] * singular) for k, i in enumerate(touching)]
    if load.kind == "total_force":
        return [(list(range(len(touching))), load.values[0] * singular)]
    return []


def given_approaches(load: Load, others: Array) -> Array:
    """Return the prescribed approaches (balls,) [m]; ``others`` under forces."""
    return np.array(load.values, dtype=float) if load.kind == "approach" else others


def unloaded(load: Load) -> list[int]:
    """Return the balls with zero prescribed force, which rest on the surface deformed by the others."""
    return [i for i, q in enumerate(load.values) if q == 0.0] if load.kind == "force" else []


def deepest(approaches: Array) -> float:
    """Return the scale of gaps [m]: the deepest approach. Lifted balls may be far above the surface."""
    largest = float(np.max(approaches))
    return largest if largest > 0.0 else float(np.max(np.abs(approaches)))


def may_touch(approaches: Array) -> Mask:
    """Return which bodies may touch at approaches (balls,) [m]; others hang above all bulges of the surface."""
    return np.asarray(approaches > -BULGE * deepest(approaches))


def force_error(load: Load, forces: Array) -> float:
    """Return the largest error of the prescribed forces over the largest of them; 0 for prescribed approaches."""
    if load.kind == "approach":
        return 0.0
    prescribed = np.array(load.values)
    reached = forces if load.kind == "force" else np.sum(forces, keepdims=True)
    return float(np.max(np.abs(reached - prescribed)) / np.max(prescribed))
