"""What moves the balls: T and Q of every ball at any positions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linear_bem import ContactSequence
from linear_bem.arrays import Array
from linear_bem.problem import Problem
from runs.evolution.hard_balls import HardBalls


@dataclass(frozen=True, eq=False)
class State:
    """Tangential forces (balls, 2) [N], normal forces (balls,) [N], and the model's error of T (balls,) [N]."""

    tangential: Array
    normal: Array
    error: Array


Forces = Callable[[Array], State]
"""Positions (balls, 2) [m] in; state out. Overlaps by the error of a step are allowed."""


def abreast(distance: float) -> Array:
    """Return the positions of two balls at a distance [m] from each other."""
    return np.array([[-0.5 * distance, 0.0], [0.5 * distance, 0.0]])


class DirectForces:
    """Forces by the full linear model at any positions, for many balls of any sizes.

    The solution of each state starts from the previous one (`linear_bem.ContactSequence`), so a state that is reached
    by different paths agrees to ``accuracy``, not to the last digit.
    """

    def __init__(self, problem: Problem, accuracy: float) -> None:
        self.problem = problem
        self._balls = HardBalls.of(problem)
        self._sequence = ContactSequence(accuracy)

    def __call__(self, positions: Array) -> State:
        """Return the state at ``positions`` or, if balls overlap there, at the nearest positions without overlap.

        Raises what `linear_bem.ContactSequence` raises.
        """
        apart = self._balls.parted(positions, np.ones(len(positions)))
        found = self._sequence.solve(self.problem.at(apart))
        return State(found.tangential_force, found.normal_forces, found.tangential_force_error)
