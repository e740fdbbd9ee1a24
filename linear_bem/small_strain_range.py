"""How far a small-strain answer means something, and what is said beyond."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from linear_bem.problem import Problem

LINEAR_UP_TO = 0.5
"""Approach over the layer's thickness above which an answer comes with a note, where the layer alone yields.

At 0.43 finite strain already makes T of touching balls 1.8 times as large (study `strengthening`, h = 1.16 R).
"""
STIFF, THICK = 10.0, 0.5
"""Substrate over layer modulus, and layer thickness over contact radius, from which on the layer alone yields."""


def beyond(problem: Problem, approaches: NDArray[np.float64], areas: NDArray[np.float64]) -> tuple[str, ...]:
    """Return a note where approaches (balls,) [m], with areas (balls,) [m^2], are as large as the layer is thick."""
    layer, base = problem.layer, problem.substrate
    share, radius = float(np.max(approaches)) / layer.thickness, math.sqrt(np.max(areas) / math.pi)
    yields = base is not None and (base.young < STIFF * layer.young or layer.thickness < THICK * radius)
    if share <= LINEAR_UP_TO or yields:
        return ()
    return (
        f"the largest approach is {share:.2g} of the layer's thickness: strains are of that size, and a small-strain "
        f"model means something up to about {LINEAR_UP_TO:g}; the effect finite_strain goes on to 0.9",
    )
