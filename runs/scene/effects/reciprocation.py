"""The effect `[reciprocation]`: sliding cycles that move the balls."""

import math
from typing import Any, Literal

from runs.scene.effects.effect import Effect
from runs.scene.units import Direction, Length, Number, Table, Whole


class ReciprocationTable(Table):
    """[reciprocation]: the plate slides to and fro, and the balls drift; see `runs.evolution`.

    ``amplitude`` [m], ``cycles``, effective ``friction`` coefficient (it changes only the time scale), ``direction``
    (x, y) of the main motion (it affects only the arrow in the pictures); random ``perturbation`` [m] of the positions
    from ``seed``, repeated with the next seeds for an ``ensemble``; ``tolerance``: error of one step, in radii;
    ``rest``: force over load below which a ball counts as at rest; ``forces`` from the table of "pairs", or "direct":
    the model solved at every step.
    """

    amplitude: Length
    cycles: Number
    friction: Number
    direction: Direction = (1.0, 0.0)
    perturbation: Length = 0.0
    seed: Whole = 0
    ensemble: Whole = 1
    tolerance: Number = 1e-6
    rest: Number = 1e-6
    forces: Literal["pairs", "direct"] = "pairs"

    @property
    def path_per_cycle(self) -> float:
        """Sliding path of one cycle [m]."""
        return 4.0 * self.amplitude

    def cycles_after(self, sigma: float) -> float:
        """Return the number of cycles after which sliding path over friction is ``sigma`` [m]."""
        return sigma * self.friction / self.path_per_cycle


def _faults(table: ReciprocationTable, scene: Any) -> list[str]:
    load = scene.load.given[0]
    texts = [
        f"reciprocation.{key}: must be greater than 0 and finite, got {value:g}"
        for key in ("amplitude", "cycles", "friction", "rest")
        if not 0.0 < (value := getattr(table, key)) < math.inf
    ]
    if not 0.0 <= table.perturbation < math.inf:
        texts.append(f"reciprocation.perturbation: must not be negative, got {table.perturbation:g} m")
    if table.ensemble < 1:
        texts.append(f"reciprocation.ensemble: must be at least 1, got {table.ensemble}")
    if table.ensemble > 1 and table.perturbation == 0.0:
        texts.append(f"reciprocation.ensemble: {table.ensemble} equal runs without a perturbation; give one")
    if not 0.0 < table.tolerance <= 1e-2:
        texts.append(f"reciprocation.tolerance: must lie between 0 and 0.01 (radii), got {table.tolerance:g}")
    if load != "approach":
        texts.append(f"[reciprocation]: the plate is held at a level, so [load] needs approach, not {load}")
    if scene.load.steps is not None:
        texts.append("load.steps: balls that drift are held at full load; drop steps, or drop [reciprocation]")
    if scene.balls.shape in ("ellipsoid", "cone"):
        texts.append(
            f'balls.shape: balls that drift apart until they touch must be round, got "{scene.balls.shape}"; '
            'take "sphere", "paraboloid" or "punch", or drop [reciprocation]'
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
