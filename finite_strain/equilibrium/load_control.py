"""What a load prescribes: approaches, or forces that make approaches unknowns of the equilibrium.

Each kind of load gives the same few things to solvers: how its unknowns move the model's balls (``moves``, (balls,
unknowns)), what force the simulated part of the scene must carry at each unknown at a fraction of the load
(``targets``), and the approaches that the fraction prescribes, or that are expected of each ball alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finite_strain.geometry.estimates import alone
from finite_strain.geometry.symmetry import ModelBall, Reduction
from linear_bem.problem import Problem


@dataclass(frozen=True)
class PrescribedApproach:
    """Approaches (balls,) [m] at full load; they grow in proportion."""

    values: np.ndarray

    @property
    def moves(self) -> np.ndarray:
        """No unknowns."""
        return np.zeros((len(self.values), 0))

    def targets(self, fraction: float) -> np.ndarray:
        """Return no forces."""
        return np.zeros(0)

    def approaches(self, fraction: float) -> np.ndarray:
        """Return the approaches (balls,) [m]."""
        return fraction * self.values


@dataclass(frozen=True)
class PrescribedForce:
    """Forces (balls,) [N] at full load, on the simulated part of each ball and on the whole ball."""

    parts: np.ndarray
    whole: np.ndarray
    balls: tuple[ModelBall, ...]
    problem: Problem

    @property
    def moves(self) -> np.ndarray:
        """One unknown a ball."""
        return np.eye(len(self.parts))

    def targets(self, fraction: float) -> np.ndarray:
        """Return the forces (balls,) [N]."""
        return fraction * self.parts

    def approaches(self, fraction: float) -> np.ndarray:
        """Return the approaches (balls,) [m] that each ball would have alone."""
        layer, substrate = self.problem.layer, self.problem.substrate
        return np.array(
            [
                alone(layer, substrate, ball.shape, ball.radius, normal_force=fraction * force).approach
                for force, ball in zip(self.whole, self.balls, strict=True)
            ]
        )


@dataclass(frozen=True)
class TotalForce:
    """One force [N] on the simulated part of all balls at full load; they share one approach."""

    value: float
    each: PrescribedForce

    @property
    def moves(self) -> np.ndarray:
        """One unknown moves all balls."""
        return np.ones((len(self.each.parts), 1))

    def targets(self, fraction: float) -> np.ndarray:
        """Return the force (1,) [N]."""
        return np.array([fraction * self.value])

    def approaches(self, fraction: float) -> np.ndarray:
        """Return the mean of the approaches (balls,) [m] that each ball would have alone under an equal share."""
        approaches = self.each.approaches(fraction)
        return np.full(len(approaches), approaches.mean())


LoadControl = PrescribedApproach | PrescribedForce | TotalForce


def load_control(problem: Problem, reduction: Reduction) -> LoadControl:
    """Return the control of a problem's load on the balls of its reduced model."""
    load, balls = problem.load, reduction.balls
    if load.kind == "approach":
        return PrescribedApproach(np.array([load.values[ball.index] for ball in balls]))
    values = load.values if load.kind == "force" else (load.values[0] / problem.size,) * problem.size
    whole = np.array([values[ball.index] for ball in balls])
    each = PrescribedForce(whole / np.array([ball.copies for ball in balls]), whole, balls, problem)
    return each if load.kind == "force" else TotalForce(load.values[0] / 2 ** len(reduction.planes), each)
