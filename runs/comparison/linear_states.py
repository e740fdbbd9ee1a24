"""The linear model at the states of another model's load path: same normal forces, same approaches."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from linear_bem.errors import ThirdBodyError
from linear_bem.problem import LoadKind, Problem
from linear_bem.result import BallResult, Result, Solved, Step
from runs.models import MODELS, USUAL, Run, at_small_strain
from runs.process.json_values import Document

SHARE, LEAST, MOST = 0.05, 1e-4, 1e-3
"""Accuracy of the linear T over that of the scene, and its bounds: its error must not affect a ratio. A higher accuracy
of the scene counts for the linear T, too."""
COST = ("seconds", "unknowns", "iterations", "notes")
"""What the record of a state says of its solution."""


def accuracy_beside(tangential_force: float | None) -> float:
    """Return the accuracy of the linear T beside another model's, of which this accuracy is required."""
    asked = tangential_force or USUAL
    return min(max(SHARE * asked, LEAST), MOST, asked)


class LinearStates:
    """Linear states of a load path, each solved once; ``earlier`` is a saved comparison whose states are reused.

    The record of a state holds its account `COST`; states saved without it are solved again.
    """

    def __init__(self, problem: Problem, tangential_force: float | None, earlier: Mapping[str, Any]) -> None:
        self.problem = at_small_strain(problem)
        self.accuracy = accuracy_beside(tangential_force)
        self.versions: Mapping[str, str] = {}
        self._solved: dict[tuple[str, tuple[float, ...]], Step] = {}
        finite = earlier.get("finite", {}).get("steps", [])
        for key, kind in ("linear", "force"), ("linear_at_approach", "approach"):
            known = earlier.get(key, {}).get("steps", [])
            for step, state in zip(finite, known, strict=False):
                if {*COST} <= state.get("record", {}).keys():
                    self._solved[kind, _values(kind, step)] = Step.from_dict(state)
                    self.versions = earlier[key]["solved"]["versions"]

    def along(self, kind: LoadKind, steps: Sequence[Mapping[str, Any]]) -> Document:
        """Return the linear result at the normal forces ("force") or approaches of ``steps``, all as JSON objects."""
        states = tuple(self._state(kind, _values(kind, step)) for step in steps)
        records = [state.record for state in states if "failure" not in state.record]
        solved = Solved(
            len(records) == len(states),
            sum(record["iterations"] for record in records),
            max((record["unknowns"] for record in records), default=0),
            sum(record["seconds"] for record in records),
            versions=self.versions,
            notes=tuple(dict.fromkeys(note for record in records for note in record["notes"])),
        )
        return Result("linear_bem", states[-1].balls, solved, states).to_dict()

    def _state(self, kind: LoadKind, values: tuple[float, ...]) -> Step:
        if (kind, values) not in self._solved:
            self._solved[kind, values] = self._solve(kind, values)
        return self._solved[kind, values]

    def _solve(self, kind: LoadKind, values: tuple[float, ...]) -> Step:
        failure, nan = "no ball is pressed in", math.nan
        if max(values) > 0.0:
            try:
                result = MODELS["linear_bem"].solve(self.problem.with_load(kind, values), Run(self.accuracy))
            except ThirdBodyError as error:  # one missing ratio must not end a long finite-strain run
                failure = f"linear model: {error}"
            else:
                self.versions = result.solved.versions
                return Step(result.balls, {"prescribed": kind, **{key: getattr(result.solved, key) for key in COST}})
        balls = (BallResult(b.position, b.radius, nan, nan, (nan, nan), nan, nan, nan) for b in self.problem.balls)
        return Step(tuple(balls), {"prescribed": kind, "failure": failure})


def _values(kind: str, step: Mapping[str, Any]) -> tuple[float, ...]:
    name = "normal_force" if kind == "force" else kind
    return tuple(float(ball[name]) for ball in step["balls"])
