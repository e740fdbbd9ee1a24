"""The effect `[reciprocation]`: sliding cycles that move the balls."""

import math
import sys
from typing import Any, Literal

from linear_bem.magnitudes import RATIOS, range_faults
from runs.scene.effects.effect import Effect
from runs.scene.units import Direction, Length, Number, Table, Whole

FINEST, COARSEST = 1e-9, 1e-2
"""Least and largest `tolerance` [radii]: contacts are held to the first (`runs.evolution.hard_balls`)."""


class ReciprocationTable(Table):
    """[reciprocation]: the plate slides to and fro, held at a level (load: approach), and the balls drift.

    `evolve` computes it; see `runs.evolution`.
    """

    amplitude: Length
    """Of the sliding, from the middle to one end: a cycle slides by four amplitudes."""
    cycles: Number
    """How many; the run ends earlier where all balls come to rest."""
    friction: Number
    """Effective coefficient of friction; it changes only the time scale."""
    direction: Direction = (1.0, 0.0)
    """Of the sliding, (x, y); it changes only the arrow in the pictures."""
    perturbation: Length = 0.0
    """Largest random shift of each ball along x and y before the run; balls that overlap then are moved apart."""
    seed: Whole = 0
    """Of the random shifts; the same seed gives the same ones."""
    ensemble: Whole = 1
    """Number of runs, each with the next seed."""
    tolerance: Number = 1e-6
    """Error of one step of the path, in radii: 1e-9 (far from (0, 0) the roundoff of positions) to 0.01.

    A hundred times larger takes a quarter to a tenth of the steps: 1e-4 does for hundreds of balls whose groups count.
    """
    rest: Number = 1e-6
    """Force over load below which a ball counts as at rest."""
    forces: Literal["pairs", "direct"] = "pairs"
    """By a table of pairs, or the model solved at every step."""

    @property
    def path_per_cycle(self) -> float:
        """Sliding path of one cycle [m]."""
        return 4.0 * self.amplitude

    @property
    def end(self) -> float:
        """Sliding path over friction at the end of all cycles [m]."""
        return self.cycles * self.path_per_cycle / self.friction

    def cycles_after(self, sigma: float) -> float:
        """Return the number of cycles after which sliding path over friction is ``sigma`` [m]."""
        return sigma * self.friction / self.path_per_cycle


def _farthest(balls: Any) -> float:
    """Return the largest coordinate over the smallest radius, at most what a problem may have."""
    radii = balls.radius if isinstance(balls.radius, tuple) else (balls.radius or 0.0,)
    largest = max((abs(c) for place in balls.positions for c in place), default=0.0)
    return largest / min(radii) if largest < RATIOS[1] * min(radii, default=0.0) else RATIOS[1]


def _faults(table: ReciprocationTable, scene: Any) -> list[str]:
    load = scene.load.given[0]
    texts = [
        f"reciprocation.{key}: must be greater than 0 and finite, got {value:g}"
        for key in ("amplitude", "cycles", "friction", "rest")
        if not 0.0 < (value := getattr(table, key)) < math.inf
    ]
    texts += range_faults({f"reciprocation.{key}": getattr(table, key) for key in ("amplitude", "perturbation")}, "m")
    texts += range_faults({f"reciprocation.{key}": getattr(table, key) for key in ("cycles", "friction", "rest")})
    if not 0.0 <= table.perturbation < math.inf:
        texts.append(f"reciprocation.perturbation: must not be negative, got {table.perturbation:g} m")
    if table.ensemble < 1:
        texts.append(f"reciprocation.ensemble: must be at least 1, got {table.ensemble}")
    if table.ensemble > 1 and table.perturbation == 0.0:
        texts.append(f"reciprocation.ensemble: {table.ensemble} equal runs without a perturbation; give one")
    least, reason = FINEST, "to which contacts are held"
    if (roundoff := sys.float_info.epsilon * _farthest(scene.balls)) > least:
        least, reason = roundoff, "the roundoff of the positions"
    if not least <= table.tolerance <= COARSEST:
        texts.append(
            f"reciprocation.tolerance: must lie between {least:.2g} radii, {reason}, and {COARSEST:g}, got "
            f"{table.tolerance:g}"
        )
    if load != "approach":
        texts.append(
            f"[reciprocation]: the plate is held at a level, so [load] needs approach, not {load}; `thirdbody solve` "
            "without [reciprocation] prints the one D of all balls under total_force: give it as approach"
        )
    if scene.load.steps is not None:
        texts.append("load.steps: balls that drift are held at full load; drop steps, or drop [reciprocation]")
    angular = [shape for shape in ("ellipsoid", "cone") if shape in scene.balls.shapes]
    if angular:
        texts.append(
            f'balls.shape: balls that drift apart until they touch must be round, got "{angular[0]}"; '
            'take "sphere", "paraboloid" or "punch", or drop [reciprocation]'
        )
    radii = scene.balls.radius
    if "punch" in scene.balls.shapes and isinstance(radii, tuple) and len(set(radii)) > 1:
        # 2 sqrt(R1 R2) is the distance of two touching balls on a plane; upright sides touch at R1 + R2
        texts.append(
            f"balls.radius: punches that drift must be as wide as the bodies beside them, got {radii} m; take one "
            "radius, or drop [reciprocation]"
        )
    return texts


RECIPROCATION = Effect(
    "reciprocation",
    ReciprocationTable,
    "sliding cycles that move the balls",
    "the balls stay where they are",
    {
        "amplitude": "80 mm",
        "cycles": 50,
        "friction": 0.1,
        "direction": [1, 0],
        "perturbation": "0.1 mm",
        "seed": 1,
        "ensemble": 1,
        "tolerance": 1e-6,
        "rest": 1e-6,
        "forces": "pairs",
    },
    faults=_faults,
    of_drift=True,
)
