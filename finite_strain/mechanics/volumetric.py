"""Volumetric energy in the two forms of the elements: in the displacement alone, or mixed.

In the displacement form the energy is lambda/2 j^2 with j = J - 1 (at small strain the trace of the strain),
and lambda tends to infinity as Poisson's ratio tends to 1/2. In the mixed form a pressure p is an unknown of
its own and p j - p^2 / (2 lambda) is made stationary: p = lambda j where lambda is finite, and j = 0
where 1/lambda = 0. Displacements of order p with continuous pressures of order p - 1 (Taylor and Hood) are stable for
every lambda [Boffi Brezzi Fortin 2013, section 8.8, doi 10.1007/978-3-642-36519-5].

The pressures enforce j = p / lambda only on average over a few nodes. Under a large pressure, displacements that change
the volume in between make the tangent indefinite, although the solid is stable [Auricchio Beirao da Veiga Lovadina
Reali 2010, doi 10.1016/j.cma.2008.06.004]. Under contact pressures above 2 mu, b/2 (j - p / lambda)^2 is therefore
added, which vanishes in the solution (`finite_strain.geometry.estimates.is_stable`; below, it would cost accuracy and,
in multigrid, iterations: 35 in place of 22 at 19 thousand unknowns).
"""

from dataclasses import dataclass
from typing import Any

from linear_bem.law import Law
from linear_bem.problem import Problem

LEAST_MIXED_POISSON = 0.49
"""Poisson's ratio from which on the mixed form is used: it costs 50 % more, and displacements of order 3 do not lock
(at 0.48 and D = 0.1 R the error of T is 0.1 % in both forms with 20 thousand unknowns)."""
LARGEST_DISPLACEMENT_POISSON = 0.4999
"""Largest Poisson's ratio for which the displacement form can be requested."""
VOLUME_STIFFNESS = 4.0
"""b over the shear modulus if lambda is infinite.

At nu = 0.5 without the term the thin pair ends at D = 0.76 R; with 4 it reaches 0.9 R, in less time than with 2 or 10.
The discretisation's share of the error of T (order 3, D = 0.1 R) is 0.24 % with 5, and 0.19 % without the term.
"""
MIXED_CAN = 0.4
"""Smallest Poisson's ratio for which the mixed form can be requested."""


@dataclass(frozen=True)
class Compressible:
    """lambda/2 j^2."""

    lame: Any

    def __call__(self, j: Any) -> Any:
        """Return the energy [J/m^3] of the change of volume j = J - 1."""
        return self.lame / 2 * j**2


@dataclass(frozen=True)
class Mixed:
    """p j - p^2 / (2 lambda) + b/2 (j - p / lambda)^2, stationary in the pressure p [Pa], positive in tension.

    ``compliance`` is 1/lambda [1/Pa], zero where the material is incompressible; ``stiffness`` is b [Pa].
    """

    pressure: Any
    compliance: Any
    stiffness: Any

    def __call__(self, j: Any) -> Any:
        """Return the energy [J/m^3] of the change of volume j = J - 1; a saddle point, not a minimum."""
        excess = j - self.compliance * self.pressure
        return self.pressure * j - self.compliance / 2 * self.pressure**2 + self.stiffness / 2 * excess**2


def volume_stiffness(shear: float, lame: float) -> float:
    """Return b [Pa] for Lame's constants: below lambda, so that the energy stays concave in p."""
    return 1.0 / (1.0 / (VOLUME_STIFFNESS * shear) + 1.0 / lame)


Volumetric = Compressible | Mixed


def describe_forms(problem: Problem) -> dict[str, str]:
    """Return the form of each region, "layer" and "substrate", by its name: "displacement" or "mixed".

    A form named in the scene applies to the layer. The form of the substrate, and of the layer if none is named,
    follows from Poisson's ratio.
    """
    regions = {"layer": problem.layer, "substrate": problem.substrate}
    solids = {name: solid for name, solid in regions.items() if solid is not None}
    forms = {name: "mixed" if s.poisson >= LEAST_MIXED_POISSON else "displacement" for name, s in solids.items()}
    if problem.elements is not None:
        forms["layer"] = problem.elements.form
    elif _without_pressure(problem):
        forms["layer"] = "displacement"
    return forms


def _without_pressure(problem: Problem) -> str:
    """Return the name of the layer's law if its volumetric energy has no mixed form, else ""."""
    if problem.finite_strain is None:
        return ""
    law = problem.finite_strain.chosen
    if isinstance(law, Law):
        return "" if law.takes_pressure else law.name
    return "a user-defined energy psi(F)"


def form_faults(problem: Problem, model: str) -> list[str]:
    """Return a message per fault of the element form that a scene requests."""
    asked = problem.elements.form if problem.elements is not None else None
    nu, own = problem.layer.poisson, _without_pressure(problem)
    if own and (asked == "mixed" or nu > LARGEST_DISPLACEMENT_POISSON):
        return [
            f"elements.form: {own} takes the displacement form for layer.poisson up to "
            f"{LARGEST_DISPLACEMENT_POISSON:g}, got {nu:g}{' and mixed' * (asked == 'mixed')}; "
            f"{'leave the key out' if asked else 'take a smaller poisson'}, or a law with a mixed form"
        ]
    if asked == "displacement" and nu > LARGEST_DISPLACEMENT_POISSON:
        range_, other = f"up to {LARGEST_DISPLACEMENT_POISSON:g}", "mixed"
    elif asked == "mixed" and nu < MIXED_CAN:
        range_, other = f"from {MIXED_CAN:g} to 0.5", "displacement"
    else:
        return []
    return [
        f"elements.form: {model} takes the {asked} form for layer.poisson {range_}, got {nu:g}; "
        f'use "{other}", or leave the key out'
    ]


def form_notes(problem: Problem) -> list[str]:
    """Return notes on the law and the forms used, one sentence each."""
    law = None if problem.finite_strain is None else problem.finite_strain.chosen
    notes = [f"{law.name}: {t}" for t in law.doubts(problem.layer.poisson)] if isinstance(law, Law) else []
    for name, form in describe_forms(problem).items():
        if problem.elements is not None and name == "layer":
            notes.append(f"{name}: {form} form of the elements, as [elements] asks")
        elif form == "mixed":
            why = f"as its Poisson's ratio {getattr(problem, name).poisson:g} is {LEAST_MIXED_POISSON:g} or more"
            notes.append(f"{name}: mixed (displacement and pressure) form of the elements, {why}")
    return notes
