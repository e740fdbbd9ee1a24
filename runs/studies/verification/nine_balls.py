"""Nine balls without symmetry, solved together and by the law of pairs that `runs.evolution` uses."""

import hashlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.problem import Ball
from linear_bem.result import BallResult, Result, Solved
from runs import evolution
from runs.evolution.providers import table_of
from runs.models import MODELS, Run
from runs.session.progress import print_status
from runs.studies.framework.case import FINITE, Case, code_of
from runs.studies.framework.pair import pressed
from runs.studies.framework.saved_cases import DONE, Found
from runs.studies.verification.part import Part, claimed

NAME = "nine-balls"
PLACES = (
    (-2.17, -2.7), (0.06, -2.59), (2.6, -2.77), (-2.79, 0.22), (0.23, 0.06), (2.88, -0.26), (-2.18, 2.2), (0.42, 2.61),
    (2.6, 2.92),
)  # fmt: skip
"""Positions over R, within 0.45 R of a square lattice; the nearest are 2.07 R apart."""
APPROACH = 0.1
TOGETHER, BY_PAIRS = f"{NAME}-together", f"{NAME}-by-pairs"
ACCURACY, BUDGET = 0.03, {"unknowns": 250e3}
"""Order 3 has 203 thousand unknowns."""


@dataclass(frozen=True)
class TableCase(Case):
    """A case answered by the law of pairs; the model computes its table."""

    def key(self) -> str:
        """Return the key of `Case`, extended by the code of the law."""
        law = code_of(Path(evolution.__file__).parent)
        return hashlib.sha256(f"{super().key()} {law}".encode()).hexdigest()[:20]

    def solve(self, run: Run) -> Result:
        """Complete the table and return the forces of the case's balls (collective)."""
        assert run.folder is not None
        begun = time.monotonic()
        table = table_of(MODELS[self.model], self.problem, run.tangential_force, run.folder, run.comm, run.budget)
        table.complete(print_status)
        state = table.forces()(np.array([ball.position for ball in self.problem.balls]))
        balls = tuple(
            BallResult(ball.position, ball.radius, APPROACH, float(q), (float(t[0]), float(t[1])), float(e), 0.0, 0.0)
            for ball, q, t, e in zip(self.problem.balls, state.normal, state.tangential, state.error, strict=True)
        )
        return Result(self.model, balls, Solved(True, 0, 0, time.monotonic() - begun))


def cases(quick: bool) -> list[Case]:
    """Return both; none in the quick version."""
    problem = pressed([Ball(place, 1.0) for place in PLACES], APPROACH)
    ways = {} if quick else {TOGETHER: Case, BY_PAIRS: TableCase}
    return [kind(name, problem, FINITE, ACCURACY, {"part": NAME}, budget=BUDGET) for name, kind in ways.items()]


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per ball: forces by both methods, difference of T and sum of both errors [%]."""
    both = [found.steps(name)[-1]["balls"] for name in (TOGETHER, BY_PAIRS) if found.state(name) == DONE]
    if len(both) < 2:
        return []
    pulls = np.array([[ball["tangential_force"] for ball in balls] for balls in both])
    errors = np.array([[ball["tangential_force_error"] for ball in balls] for balls in both]).sum(axis=0)
    largest, off = np.hypot(*pulls[0].T).max(), np.hypot(*(pulls[0] - pulls[1]).T)
    return [
        {
            "x": ball["position"][0],
            "y": ball["position"][1],
            "Q": ball["normal_force"],
            "Q by pairs": other["normal_force"],
            "T": np.hypot(*together),
            "T by pairs": np.hypot(*by_pairs),
            "off": 100.0 * o / largest,
            "allowed": 100.0 * e / largest,
            "verdict": claimed(bool(o <= e), e / largest),
        }
        for ball, other, together, by_pairs, o, e in zip(*both, *pulls, off, errors, strict=True)
    ]


PART = Part(NAME, "Nine balls without symmetry, together and by the law of pairs", cases, rows)
