"""The linear model at the states of another model's load path: same normal forces, same approaches."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from linear_bem.errors import ThirdBodyError
from linear_bem.problem import LoadKind, Problem
from linear_bem.result import BallResult, Result, Solved, Step
from runs.models import MODELS, USUAL, Run, without
from runs.process.json_values import Document

SHARE, LEAST, MOST = 0.05, 1e-4, 1e-3
"""Accuracy of the linear T over that of the scene, and its bounds: its error must not affect a ratio. A higher accuracy
of the scene counts for the linear T, too."""


def accuracy_beside(tangential_force: float | None) -> float:
    """Return the accuracy of the linear T beside another model's, of which this accuracy is required."""
    asked = tangential_force or USUAL
    return min(max(SHARE * asked, LEAST), MOST, asked)


class LinearStates:
    """Linear states of a load path, each solved once; ``earlier`` is a saved comparison whose states are reused.

    Reused states share one account of their solution.
    """

    def __init__(self, problem: Problem, tangential_force: float | None, earlier: Mapping[str, Any]) -> None:
        self.problem = without(problem, ["finite_strain"])
        self.accuracy = accuracy_beside(tangential_force)
        self._solved: dict[tuple[str, tuple[float, ...]], tuple[Step, Solved | None]] = {}
        finite = earlier.get("finite", {}).get("steps", [])
        for key, kind, name in (("linear", "force", "normal_force"), ("linear_at_approach", "approach", "approach")):
            known = earlier.get(key, {}).get("steps", [])
            account = Solved.from_dict({**earlier[key]["solved"], "converged": True}) if known else None
            for step, state in zip(finite, known, strict=False):
                if "failure" not in state.get("record", {}):
                    self._solved[kind, _values(step, name)] = (Step.from_dict(state), account)

    def at_force(self, steps: Sequence[Mapping[str, Any]]) -> Document:
        """Return the linear result at the normal forces of ``steps``, both as JSON objects."""
        return self._along("force", "normal_force", steps).to_dict()

    def at_approach(self, steps: Sequence[Mapping[str, Any]]) -> Document:
        """Return the linear result at the approaches of ``steps``, both as JSON objects."""
        return self._along("approach", "approach", steps).to_dict()

    def _along(self, kind: LoadKind, name: str, steps: Sequence[Mapping[str, Any]]) -> Result:
        found = [self._state(kind, _values(step, name)) for step in steps]
        states = tuple(state for state, _ in found)
        accounts = list({id(account): account for _, account in found if account is not None}.values())
        solved = Solved(
            all(a.converged for a in accounts) and not any("failure" in state.record for state in states),
            sum(a.iterations for a in accounts),
            max((a.unknowns for a in accounts), default=0),
            sum(a.seconds for a in accounts),
            versions=accounts[-1].versions if accounts else {},
            notes=tuple(dict.fromkeys(note for a in accounts for note in a.notes)),
        )
        return Result("linear_bem", states[-1].balls, solved, states)

    def _state(self, kind: LoadKind, values: tuple[float, ...]) -> tuple[Step, Solved | None]:
        if (kind, values) not in self._solved:
            self._solved[kind, values] = self._solve(kind, values)
        return self._solved[kind, values]

    def _solve(self, kind: LoadKind, values: tuple[float, ...]) -> tuple[Step, Solved | None]:
        record: dict[str, Any] = {"prescribed": kind}
        if max(values) <= 0.0:
            return self._nothing({**record, "failure": "no ball is pressed in"}), None
        try:
            result = MODELS["linear_bem"].solve(self.problem.with_load(kind, values), Run(self.accuracy))
        except ThirdBodyError as error:  # one missing ratio must not end a long finite-strain run
            return self._nothing({**record, "failure": f"linear model: {error}"}), None
        record |= {"seconds": result.solved.seconds, "unknowns": result.solved.unknowns}
        return Step(result.balls, record), result.solved

    def _nothing(self, record: dict[str, Any]) -> Step:
        nan = math.nan
        balls = tuple(
            BallResult(ball.position, ball.radius, nan, nan, (nan, nan), nan, nan, nan) for ball in self.problem.balls
        )
        return Step(balls, record)


def _values(step: Mapping[str, Any], name: str) -> tuple[float, ...]:
    return tuple(float(ball[name]) for ball in step["balls"])
