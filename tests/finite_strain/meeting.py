"""How far the contacts of touching balls are from each other along the load: where they meet, they merge into one.

    python -m tests.finite_strain.meeting     # fifteen minutes of one core

The pairs of the study `deep`, on the meshes that 20 % of T needs. At every load: how far the middle of the surface
between the balls lies below the point where they touch, and the gap between the balls at its height, both over R. Where
that gap closes, the contacts are one.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

import finite_strain
from finite_strain.output.top_surface import SurfaceFields
from linear_bem.result import Step
from runs.studies.deep.answer import cases

SCENES = ("thin pair", "pair on 2 R", "pair on 6 R")


class Cleft:
    """Prints the middle of the cleft at every step."""

    def started(self, *_: object) -> None:
        """Do nothing."""

    attempt = newton = started

    def step_done(self, step: Step, surface: Callable[[], SurfaceFields | None], /) -> None:
        """Print the approach, Q, T with its error, and the cleft."""
        found, ball = surface(), step.balls[0]
        assert found is not None
        away = np.hypot(found.reference[:, 0], found.reference[:, 1])
        top, middle = found.reference[:, 2].max(), found.points[np.argmin(away), 2]
        below = max(top + ball.radius - ball.approach - middle, 0.0)
        gap = 2.0 * (ball.radius - math.sqrt(max(ball.radius**2 - below**2, 0.0)))
        print(
            f"{ball.approach:4.2g} R   Q {ball.normal_force:.4g}   T {ball.tangential_force[0]:.4g} +- "
            f"{ball.tangential_force_error:.1g}   middle below the point {below:.3f}   gap there {gap:.4f}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    for case in cases(quick=False):
        if case.labels["scene"] in SCENES:
            print(case.labels["scene"], flush=True)
            finite_strain.solve(case.problem, accuracy=0.2, steps=case.steps, observer=Cleft())
