"""The effect `[substrate]`: an elastic half-space below the layer."""

from linear_bem.problem import Elastic
from runs.scene.effects.effect import Effect
from runs.scene.units import Number, Pressure, Table


class SubstrateTable(Table):
    """[substrate]: isotropic elastic constants of the half-space below the layer."""

    young: Pressure
    """Young's modulus."""
    poisson: Number
    """Poisson's ratio, 0 to 0.5."""


SUBSTRATE = Effect(
    "substrate",
    SubstrateTable,
    "elastic half-space below the layer",
    "the base is rigid",
    {"young": "1 GPa", "poisson": 0.3},
    lambda table: Elastic(table.young, table.poisson),
)
