"""Load control: prescribed approaches, or prescribed forces with approaches as unknowns (without DOLFINx)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from finite_strain.geometry.estimates import alone, body_of
from linear_bem.closed_forms import Indentation
from linear_bem.depth import dent, given_by_others
from linear_bem.problem import Ball, Problem

if TYPE_CHECKING:
    from finite_strain.geometry.symmetry import ModelBall, Reduction

ANSWERS = 6
"""Number of load steps with output in a comparison along the load."""
LARGEST_APPROACH = 0.9
"""Largest approach over the layer's thickness: beyond it the elements below a ball have almost no volume."""
ENDING, ENDED = 0.05, 0.95
"""Difference from it within which a load path under forces that ends is ended by it, if at most that load fraction was
reached: the coarse elements of the first path end a little before others."""
BETWEEN = 2001
"""Number of points on the line between the axes of two bodies in the check for overlap."""
TOUCHING = 1e-6
"""Overlap over the largest approach below which bodies only touch."""


@dataclass(frozen=True, eq=False)
class LoadControl:
    """A load on a reduced model: unknowns move its balls by ``moves`` (balls, unknowns).

    At full load the simulated part of the scene carries the forces ``full`` (unknowns,) [N]. ``approaches`` returns
    the approaches (balls,) [m] prescribed at a fraction of the load, or those expected of single balls.
    """

    moves: np.ndarray
    full: np.ndarray
    approaches: Callable[[float], np.ndarray]


@dataclass(frozen=True)
class PrescribedLoad:
    """A problem's load: approaches, or forces on each ball or on all; all values grow in proportion."""

    problem: Problem
    forces_given: bool
    follows: str
    """Name of the result that the load does not prescribe."""
    power: float
    """Power of the approach with which the values grow (Hertz's for forces)."""

    @property
    def values(self) -> tuple[float, ...]:
        """The value (balls,) [m or N] of each ball at full load, its share of a common one."""
        load, size = self.problem.load, self.problem.size
        return load.values if load.kind != "total_force" else (load.values[0] / size,) * size

    def moves(self, balls: int) -> np.ndarray:
        """Return how the unknowns move the balls (balls, unknowns); approaches that are given are no unknowns."""
        if not self.forces_given:
            return np.zeros((balls, 0))
        return np.ones((balls, 1)) if self.problem.load.kind == "total_force" else np.eye(balls)

    def expected(self) -> list[Indentation]:
        """Return the expected state of each ball at full load, each ball alone."""
        return [self.single(ball, value) for ball, value in zip(self.problem.balls, self.values, strict=True)]

    def single(self, ball: Ball, value: float) -> Indentation:
        """Return the expected state of a single ball under a load of ``value`` [m or N].

        Under a force the layer gives at most `LARGEST_APPROACH`.
        """
        if not self.forces_given:
            return alone(self.problem, ball, approach=value)
        state = alone(self.problem, ball, normal_force=value)
        most = LARGEST_APPROACH * self.problem.layer.thickness + self._dent(state)
        return state if state.approach <= most else alone(self.problem, ball, approach=most)

    def fractions(self, deepest: float, goals: Sequence[float], largest: float) -> tuple[float, ...]:
        """Return rising load fractions that include all goals, for a deepest approach over its ball's radius.

        Between two goals the steps of the approach are equal and at most ``largest`` over the radius.
        """
        fractions, before = list[float](), 0.0
        for goal in goals:
            after = goal ** (1.0 / self.power)
            parts = max(math.ceil(deepest * (after - before) / largest - 1e-9), 1)
            fractions += [*((before + (after - before) * n / parts) ** self.power for n in range(1, parts)), goal]
            before = after
        return tuple(fractions)

    def answered_fractions(self) -> tuple[float, ...]:
        """Return the load fractions with output of a comparison along the load: equal steps of the approach."""
        return tuple((n / ANSWERS) ** self.power for n in range(1, ANSWERS + 1))

    def _dent(self, state: Indentation) -> float:
        """Return about how deep [m] the substrate is dented."""
        area = math.pi * state.contact_radius**2
        return dent(self.problem.substrate, self.problem.layer.thickness, state.normal_force, area)

    def faults(self, model: str) -> list[str]:
        """Reject balls without a force, approaches that are too large for the layer, and bodies that overlap."""
        if self.forces_given:
            least, rule = min(self.values), f"{model} needs a force > 0 on every ball"
            return [f"load.force: {rule}, got {least:g} N; leave that ball out"] if least <= 0.0 else []
        h, deepest, taken = self.problem.layer.thickness, max(self.values), ""
        given, most = deepest, LARGEST_APPROACH * h
        if given >= most > 0.0 and self.problem.substrate is not None:
            pressed = zip(self.values, self.expected(), strict=True)
            given, deepest = max((value - self._dent(state), value) for value, state in pressed)
            taken = f", of which the layer takes about {given:.3g} m"
        limit = f"takes approaches below {LARGEST_APPROACH:g} of the layer's thickness, {most:g} m"
        faults = [f"load.approach: {model} {limit}, got {deepest:g} m{taken}"] if given >= most else []
        return faults + (self._overlaps(model) if self.problem.finite_strain is not None else [])

    def _overlaps(self, model: str) -> list[str]:
        """Reject bodies that overlap where they pass through the undeformed surface.

        At small strain bodies are profiles over that surface, which may meet.
        """
        balls, share = self.problem.balls, np.linspace(0.0, 1.0, BETWEEN)
        for i, j in itertools.combinations(range(len(balls)), 2):
            x, y = np.subtract(balls[j].position, balls[i].position)
            with np.errstate(invalid="ignore"):  # nan where a body has no height, which `radius_seen` refuses
                first = body_of(balls[i]).gap(share * x, share * y, self.values[i])
                second = body_of(balls[j]).gap((share - 1.0) * x, (share - 1.0) * y, self.values[j])
            deepest = -float(np.maximum(first, second).min())
            if deepest > TOUCHING * max(self.values):
                return [
                    f"load.approach: {model} needs bodies that do not overlap; {i} and {j} do, by "
                    f"{2.0 * deepest:.2g} m at the undeformed surface: as one rigid body they have no mutual force"
                ]
        return []

    def ended_by(self, fraction: float, approaches: Sequence[float], balls: Sequence[ModelBall]) -> str:
        """Return why a path ends after a load fraction with approaches (balls,) [m]; empty if unknown.

        A force is too large if much of it is left and the layer gives nearly `LARGEST_APPROACH`.
        """
        if not self.forces_given or fraction > ENDED:
            return ""
        kind, h = self.problem.load.kind, self.problem.layer.thickness
        forces = fraction * np.array(self.values)
        given = max(
            approach
            - self._dent(self.single(ball, forces[ball.index]))
            - given_by_others(self.problem, ball.index, forces)
            for ball, approach in zip(balls, approaches, strict=True)
        )
        if given < (LARGEST_APPROACH - ENDING) * h:
            return ""
        base = "" if self.problem.substrate is None else ", without the dent of the substrate,"
        full = max(self.problem.load.values)
        return (
            f"load.{kind}: finite elements take forces whose approach{base} stays below about {LARGEST_APPROACH:g} of "
            f"the layer's thickness ({h:g} m), got {full:g} N, of which {100.0 * fraction:.2g} % already give "
            f"{given:.3g} m; check the units of {kind} and of the layer's young, or reduce the {kind.replace('_', ' ')}"
        )

    def on(self, reduction: Reduction) -> LoadControl:
        """Return the control of a reduced model, with the forces on its part of the balls that an unknown moves.

        Under forces it expects the approaches of single balls, or their mean if one unknown moves all.
        """
        balls, moves = reduction.balls, self.moves(len(reduction.balls))
        whole = np.array([self.values[ball.index] for ball in balls])

        def approaches(fraction: float) -> np.ndarray:
            if not self.forces_given:
                return fraction * whole
            pairs = zip(balls, whole, strict=True)
            single = np.array([self.single(ball, fraction * force).approach for ball, force in pairs])
            return np.asarray(moves @ (single @ moves / moves.sum(axis=0)))

        return LoadControl(moves, (whole / np.array([ball.copies for ball in balls])) @ moves, approaches)


def prescribed(problem: Problem) -> PrescribedLoad:
    """Return the load of a problem."""
    if problem.load.kind == "approach":
        return PrescribedLoad(problem, forces_given=False, follows="normal_force", power=1.0)
    return PrescribedLoad(problem, forces_given=True, follows="approach", power=1.5)
