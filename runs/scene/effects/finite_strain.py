"""The effect `[finite_strain]`: a hyperelastic layer with contact in the deformed configuration."""

from dataclasses import asdict
from typing import Any

from linear_bem.law import Law, NeoHookean, law_of
from linear_bem.problem import FiniteStrain
from runs.scene.effects.effect import Effect
from runs.scene.units import Number, Numbers, Table


class FiniteStrainTable(Table):
    """[finite_strain]: a hyperelastic ``law`` and its dimensionless parameters; strain energies: `linear_bem.law`.

    The layer needs a finite thickness; approaches must be less than 0.9 of it, and so must what the layer gives under
    forces. A force must be greater than 0 on every ball.
    """

    law: str = "neo_hookean"
    """One of `neo_hookean` (no parameters), `mooney_rivlin`, `yeoh`, `gent`, `ogden`, `hyperfoam`."""
    share: Number | None = None
    """`mooney_rivlin`: C2 / (C1 + C2), 0 to 1."""
    ratios: Numbers | None = None
    """`yeoh`: C2 / C1 and C3 / C1."""
    limit: Number | None = None
    """`gent`: the limiting value of I1 - 3, which no strain reaches."""
    exponents: Numbers | None = None
    """`ogden` and `hyperfoam`: the exponent of each term."""
    weights: Numbers | None = None
    """`ogden` and `hyperfoam`: each term's share of the shear modulus; the sum is 1."""

    @property
    def numbers(self) -> dict[str, Any]:
        """The parameters of the law."""
        return {key: value for key, value in dict(self).items() if key != "law" and value is not None}


def _part(table: FiniteStrainTable) -> FiniteStrain:
    law, _ = law_of(table.law, table.numbers)  # None in a table with faults, which is not solved
    return FiniteStrain() if law in (None, NeoHookean()) else FiniteStrain(law)


def effect_identity(effect: FiniteStrain) -> dict[str, Any]:
    """Return what identifies an effect, the law's name included: two laws may have parameters of the same names."""
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
