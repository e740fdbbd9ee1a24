"""The effect `[finite_strain]`: a hyperelastic layer with contact in the deformed configuration."""

from dataclasses import asdict
from typing import Any

from linear_bem.law import Law, law_of
from linear_bem.problem import FiniteStrain
from runs.scene.effects.effect import Effect
from runs.scene.units import Number, Numbers, Table


class FiniteStrainTable(Table):
    """[finite_strain]: ``law`` and its dimensionless numbers, of one law alone; energies: `linear_bem.law`."""

    law: str = "neo_hookean"
    """One of `neo_hookean` (takes no numbers), `mooney_rivlin`, `yeoh`, `gent`, `ogden`, `hyperfoam`."""
    share: Number | None = None
    """Of `mooney_rivlin`: C2 / (C1 + C2), 0 to 1."""
    ratios: Numbers | None = None
    """Of `yeoh`: C2 / C1 and C3 / C1."""
    limit: Number | None = None
    """Of `gent`: the value of I1 - 3 that no strain reaches."""
    exponents: Numbers | None = None
    """Of `ogden` and `hyperfoam`: one of each term."""
    weights: Numbers | None = None
    """Of `ogden` and `hyperfoam`: each term's part of the shear modulus; they add up to 1."""

    @property
    def numbers(self) -> dict[str, Any]:
        """The law's own numbers."""
        return {key: value for key, value in dict(self).items() if key != "law" and value is not None}


def _part(table: FiniteStrainTable) -> FiniteStrain:
    law, _ = law_of(table.law, table.numbers)  # None in a table with faults, which is not solved
    return FiniteStrain(law) if law is not None and table.numbers else FiniteStrain()


def effect_identity(effect: FiniteStrain) -> dict[str, Any]:
    """Return what distinguishes one effect from another: two laws may have numbers of the same names."""
    found = asdict(effect)
    return {"law": {"name": effect.law.name, **found["law"]}} if isinstance(effect.law, Law) else found


FINITE_STRAIN = Effect(
    "finite_strain",
    FiniteStrainTable,
    "hyperelastic layer, contact in the deformed configuration",
    "strains are small",
    {"law": "neo_hookean"},
    _part,
    lambda table, _scene: [f"finite_strain.{text}" for text in law_of(table.law, table.numbers)[1]],
)
