"""Where the balls start: the scene's positions, shaken by a random perturbation that leaves no overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from linear_bem.problem import Problem
from runs.evolution.hard_balls import HardBalls

Array = NDArray[np.float64]


def start(problem: Problem, balls: HardBalls, perturbation: float, seed: int) -> Array:
    """Return positions (balls, 2) [m]: uniformly shaken by up to ``perturbation`` [m] in x and y, then parted."""
    x = np.array([ball.position for ball in problem.balls], dtype=float)
    nothing = np.zeros(0, dtype=np.intp)
    if perturbation > 0.0:
        x = x + perturbation * np.random.default_rng(seed).uniform(-1.0, 1.0, x.shape)
    return balls.restored(x, np.ones(len(x)), nothing)
