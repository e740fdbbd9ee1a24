"""How far the contacts of touching balls are from each other along the load: where they meet, they merge into one.

    python -m tests.finite_strain.meeting     # ten minutes of one core

Two of the scenes of the study `deep`. At every load: the width of the free surface between the two contacts, from the
nodes with contact pressure on the line through both axes, and how far its middle lies below the point where the balls
touch, both over R. At that point the gap between the balls is zero, so that a surface that reaches it fills the cleft.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import finite_strain
from finite_strain.observer import Silence
from finite_strain.output.top_surface import SurfaceFields
from linear_bem.result import Step
from runs.studies.deep.matrix import scenes

SCENES = ("pair on 2 R", "pair on 6 R")


class Width(Silence):
    """Prints the cleft of every step."""

    def step_done(self, step: Step, surface: Callable[[], SurfaceFields | None], /) -> None:
        """Print the approach, Q, T with its error, width and depth of the cleft."""
        found, ball = surface(), step.balls[0]
        assert found is not None
        line = np.abs(found.reference[:, 1]) < 1e-9
        x, z, pressed = np.abs(found.points[line, 0]), found.points[line, 2], found.pressure[line] > 0.0
        top, middle = found.reference[:, 2].max(), np.abs(found.reference[line, 0]) < 1e-9
        touching = top + ball.radius - ball.approach
        print(
            f"{ball.approach:4.2g} R   Q {ball.normal_force:.4g}   T {ball.tangential_force[0]:.4g} +- "
            f"{ball.tangential_force_error:.1g}   free width {2.0 * x[pressed].min():.3f}   middle below the point "
            f"where the balls touch {touching - z[middle].max():.3f}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    for name in SCENES:
        scene = scenes()[name]
        print(name, flush=True)
        deepest = max(scene.problem.load.values)
        finite_strain.solve(
            scene.problem, tangential_force=0.03, steps=[depth / deepest for depth in scene.approaches],
            observer=Width(),
        )  # fmt: skip
