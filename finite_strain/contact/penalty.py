"""How stiff the penalty of each contact is: as much as lets the surface penetrate by a small part of the approach."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from finite_strain.geometry.estimates import LEAST_SHARE, alone
from finite_strain.geometry.symmetry import ModelBall
from linear_bem.problem import Problem

PENETRATION = 1e-2
"""Mean penetration over the approach without multipliers, where Newton's method finds the contact's edge fast."""
STIFFENING = 5.0
"""By how much the penalty grows when multipliers are added."""


def penalties(problem: Problem, balls: Sequence[ModelBall], approaches: np.ndarray) -> np.ndarray:
    """Return the penalty (balls,) [Pa/m] at approaches (balls,) [m]: the expected mean pressure over the penetration.

    A ball that is pressed in by less than `LEAST_SHARE` of the deepest has the penalty that it has there.
    """
    deepest = float(np.max(approaches))
    answer = []
    for ball, approach in zip(balls, approaches, strict=True):
        depth = max(float(approach), LEAST_SHARE * deepest)
        state = alone(problem.layer, problem.substrate, ball.shape, ball.radius, approach=depth)
        pressure = state.normal_force / (math.pi * state.contact_radius**2)
        answer.append(pressure / (PENETRATION * depth))
    return np.array(answer)
