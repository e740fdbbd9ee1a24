"""Effects that change the contact problem: finite strain of the layer, and a cell that repeats."""

from __future__ import annotations

import math
from dataclasses import dataclass

from linear_bem.law import Energy, Law, law_of
from linear_bem.magnitudes import are_numbers


@dataclass(frozen=True)
class FiniteStrain:
    """Effect: a hyperelastic layer with contact in the deformed configuration.

    ``law`` is a `Law` with its parameters such as ``Gent(limit=30.0)``, the name of a law without parameters, or a
    user-defined strain energy psi(F) in UFL; see `linear_bem.law`. It applies to the layer; a substrate is neo-Hookean.
    """

    law: str | Law | Energy = "neo_hookean"

    @property
    def chosen(self) -> Law | Energy:
        """The law as an object; requires an accepted problem."""
        law = law_of(self.law, {})[0] if isinstance(self.law, str) else self.law
        assert law is not None
        return law

    def faults(self, poisson: float) -> list[str]:
        """Return a message per fault of the law on a layer with this Poisson's ratio."""
        law, texts = law_of(self.law, {}) if isinstance(self.law, str) else (self.law, [])
        if isinstance(law, Law):
            texts = law.faults(poisson)
        elif not texts and (isinstance(law, type) or not callable(law)):
            remedy = ""
            if isinstance(law, type) and issubclass(law, Law):
                remedy = f"; give an object, such as {law.__name__}(...)"
            texts = [f"law: must be a name, a law or an energy psi(F), got {law!r}{remedy}"]
        return [f"finite_strain.{text}" for text in texts]


@dataclass(frozen=True)
class Periodic:
    """Effect: the layer and its balls are one rectangular cell that repeats along x and y; linear model only.

    ``lengths`` [m] are the sides of the cell. Every ball has images at multiples of the sides, under the same load;
    forces are those of one cell. Approaches and displacements are measured from the mean level of the layer's
    underside, on a half-space and on a `SurfaceResponse` whose base yields (far_ratio > 0) from the mean level of the
    surface; see `linear_bem.layer.cell`.
    """

    lengths: tuple[float, float]

    def faults(self) -> list[str]:
        """Return a message per fault of the lengths."""
        lengths, must = self.lengths, "periodic.lengths: must be two lengths"
        if not (are_numbers(lengths) and len(lengths) == 2):
            return [f"{must} in metres, along x and y, such as (10.0, 10.0), got {lengths!r:.80}"]
        if not all(0.0 < v < math.inf for v in lengths):
            return [f"{must} greater than 0 and finite, got {lengths[0]:g} m and {lengths[1]:g} m"]
        return []
