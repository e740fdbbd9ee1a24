"""The effect `[finite_strain]`: a hyperelastic layer with contact in the deformed configuration."""

from __future__ import annotations

from linear_bem.problem import FiniteStrain
from runs.scene.effects.effect import Effect
from runs.scene.units import Table


class FiniteStrainTable(Table):
    """[finite_strain]: hyperelastic layer, contact in the deformed configuration."""

    law: str = "neo_hookean"


FINITE_STRAIN = Effect(
    "finite_strain",
    FiniteStrainTable,
    "hyperelastic layer, contact in the deformed configuration",
    "strains are small",
    {"law": "neo_hookean"},
    lambda table: FiniteStrain(table.law),
)
