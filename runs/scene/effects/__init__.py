"""The registry of effects: an effect is simulated if the scene has its optional table, and otherwise costs nothing.

To add an effect, add a file here and an entry in `EFFECTS`. An effect that changes the contact problem has a class in
`linear_bem.effects` and a field of its name in `linear_bem.problem.Problem`; each model in `runs.models` lists the
effects that it supports.
"""

from runs.scene.effects.effect import Effect
from runs.scene.effects.finite_strain import FINITE_STRAIN
from runs.scene.effects.periodic import PERIODIC
from runs.scene.effects.reciprocation import RECIPROCATION
from runs.scene.effects.rolling_resistance import ROLLING_RESISTANCE
from runs.scene.effects.substrate import SUBSTRATE

EFFECTS = {effect.name: effect for effect in (SUBSTRATE, FINITE_STRAIN, RECIPROCATION, PERIODIC, ROLLING_RESISTANCE)}
"""Every effect by its name, in the order in which `plan` lists them."""

__all__ = ["EFFECTS", "Effect"]
