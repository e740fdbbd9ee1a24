"""The effect `[reciprocation]`: sliding cycles that move the balls."""

import math
import sys
from typing import Any, Literal

from linear_bem.magnitudes import RATIOS, range_faults
from runs.scene.effects.effect import Effect
from runs.scene.units import Direction, Length, Number, Table, Whole

FINEST, COARSEST = 1e-9, 1e-2
"""Least and largest `tolerance` [radii]; contacts are satisfied to the least one (`runs.evolution.hard_balls`)."""


class ReciprocationTable(Table):
    """[reciprocation]: the plate slides back and forth at a fixed height ([load] approach), and the balls drift.

    Computed by `thirdbody evolve`; theory in `runs.evolution`. One flat plate presses all balls: they have
    equal approaches, or equal tops (each approach is the ball's diameter less one length). Unequal balls need
    `forces = "direct"`, or the model point_load, and cannot drift at finite strain.
    """

    amplitude: Length
    """Sliding distance from the middle to one end: the sliding path of a cycle is four amplitudes."""
    cycles: Number
    """Number of cycles; the run ends earlier if all balls come to rest. A larger number continues a saved run."""
    friction: Number
    """Effective coefficient of friction; it affects only the time scale."""
    direction: Direction = (1.0, 0.0)
    """Direction of sliding, [x, y]; it affects only the arrow in the pictures."""
    perturbation: Length = 0.0
    """Largest random shift of each ball along x and y before the run; balls that then overlap are moved apart."""
    seed: Whole = 0
    """Seed of the random shifts; equal seeds give equal shifts."""
    ensemble: Whole = 1
    """Number of runs; each uses the next seed."""
    tolerance: Number = 1e-6
    """Error per step of the path, in radii: 1e-9 (or the roundoff of positions, if larger) to 0.01.

    A value 100 times larger needs a quarter to a tenth of the steps; 1e-4 suffices to find the groups of many balls.
    """
    rest: Number = 1e-6
    """A ball counts as at rest while its force over load is below this value."""
    forces: Literal["pairs", "direct"] = "pairs"
    """`pairs`: from a table of pairs, for equal balls; `direct`: the model is solved at every step (small strain)."""

    @property
    def path_per_cycle(self) -> float:
        """Sliding path of one cycle [m]."""
        return 4.0 * self.amplitude

    @property
    def end(self) -> float:
        """Sliding path over friction at the end of all cycles [m]."""
        return self.cycles * self.path_per_cycle / self.friction

    def cycles_after(self, sigma: float) -> float:
        """Return the number of cycles after which the sliding path over friction reaches ``sigma`` [m]."""
        return sigma * self.friction / self.path_per_cycle


def _farthest(balls: Any) -> float:
    """Return the largest coordinate over the smallest radius, at most the largest ratio that a problem may have."""
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
    texts += [
        f"reciprocation.{key}: must be at least {least}, got {value}"
        for key, least in (("seed", 0), ("ensemble", 1))
        if (value := getattr(table, key)) < least
    ]
    if table.ensemble > 1 and table.perturbation == 0.0:
        texts.append(f"reciprocation.ensemble: {table.ensemble} equal runs; give a perturbation")
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
            f"[reciprocation]: the plate's height is fixed, so [load] needs approach, not {load}; `thirdbody solve` "
            "without [reciprocation] prints the one D of all balls under total_force: give it as approach"
        )
    if scene.load.steps is not None:
        texts.append("load.steps: balls that drift are held at full load; drop steps, or drop [reciprocation]")
    angular = [shape for shape in ("ellipsoid", "cone") if shape in scene.balls.shapes]
    if angular:
        texts.append(
            f'balls.shape: must be a shape that can drift, got "{angular[0]}"; '
            'take "sphere", "paraboloid" or "punch", or drop [reciprocation]'
        )
    radii = scene.balls.radius
    if "punch" in scene.balls.shapes and isinstance(radii, tuple) and len(set(radii)) > 1:
        # 2 sqrt(R1 R2) is the distance of two touching balls on a plane; upright sides touch at R1 + R2
        texts.append(
            f"balls.radius: a drifting punch and all other bodies must have equal radii, got {radii} m; take one "
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
