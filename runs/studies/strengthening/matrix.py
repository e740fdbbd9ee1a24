"""The cases of the study: the paper's pair on its two layers (the headline), variations of it, hyperelastic laws."""

from dataclasses import replace

from linear_bem.law import Hyperfoam, Law
from linear_bem.problem import Elastic, FiniteStrain
from runs.studies.framework.case import Case
from runs.studies.framework.pair import POISSON, STIFF, THICK, THIN, pair
from runs.studies.strengthening.materials import FOAMS, LAWS

DISTANCES = (3.0, 4.0, 6.0)
POISSONS = (0.3, 0.4, 0.4999)
NEAR_SIGN_CHANGE = (1.7, 1.9)
"""Thicknesses about the linear model's sign change, h' = 1.6977 at the paper's load."""
APPROACHES = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.32, 0.4, 0.5)
"""Approaches over R with output for the headline's curves; the first is near the paper's load."""
VARIED = (0.03, 0.05, 0.07, 0.15, 0.32, 0.5)
"""The same for every other curve: three of them give its slope. The smallest contact determines the mesh size."""
DEEPER = {THIN: (0.32, 0.5, 0.6), THICK: (0.32, 0.5, 0.65, 0.8)}
"""The same for the deepest curves."""
LAW_APPROACHES = (0.1, 0.2, 0.32, 0.5)
"""Approaches over R at which laws are compared."""
FOAM_THICKNESS, FOAM_APPROACHES = 8.0, (0.3, 0.6, 0.9, 1.2)
"""Thickness and approaches over R of the paper's balls on foam (20 mm on 80 mm; study `experiments`)."""
ACCURACY, ROUGH, LIGHT = 0.02, 0.2, (0.01, 0.02, 0.03)
"""Accuracy of all curves but the headline's; accuracy and approaches over R of the quick version."""
UNKNOWNS, HEADLINE_UNKNOWNS = 50e3, {THIN: 220e3, THICK: 120e3}
"""Largest numbers of unknowns: for order 3 of all curves, order 4 of the headline, fineness 1.5 where T is largest."""
SIDES = {THIN: "thin", THICK: "thick"}


def cases(quick: bool) -> list[Case]:
    """Return all cases, the most important ones for the answer first."""
    if quick:
        paraboloid = along("paraboloid", THIN, LIGHT, ROUGH, shape="paraboloid")
        return [*(along("headline", h, LIGHT, ROUGH) for h in SIDES), paraboloid]
    found = [along("headline", h, APPROACHES, 0.002, unknowns=HEADLINE_UNKNOWNS[h]) for h in SIDES]
    found += [along("paraboloid", h, VARIED, ACCURACY, shape="paraboloid") for h in SIDES]
    for h in SIDES:
        found += [along("distance", h, VARIED, ACCURACY, distance=distance) for distance in DISTANCES]
        found += [along("poisson", h, VARIED, ACCURACY, poisson=poisson) for poisson in POISSONS]
    found += [along("sign", h, VARIED, ACCURACY) for h in NEAR_SIGN_CHANGE]
    # apart from the headline, which must not fail with them
    found += [along("deeper", h, approaches, ACCURACY) for h, approaches in DEEPER.items()]
    return found


def along(
    group: str,
    thickness: float,
    approaches: tuple[float, ...],
    accuracy: float,
    *,
    distance: float = 2.0,
    poisson: float = POISSON,
    shape: str = "sphere",
    unknowns: float = UNKNOWNS,
    substrate: Elastic | None = STIFF,
) -> Case:
    """Return the case of the pair on a layer, with output at ``approaches`` over R."""
    deepest = approaches[-1]
    problem = pair(deepest, thickness, distance=distance, poisson=poisson, shape=shape, substrate=substrate)
    words = [group, SIDES.get(thickness, f"h{thickness:g}"), f"L{distance:g}", f"nu{poisson:g}"]
    labels = {"group": group, "h": thickness, "L": distance, "nu": poisson, "shape": shape}
    steps, budget = tuple(approach / deepest for approach in approaches), {"unknowns": unknowns}
    return Case("-".join(words), problem, "finite_strain", accuracy, labels, steps=steps, budget=budget)


def law_cases(quick: bool) -> list[Case]:
    """Return all cases; two laws on the thin layer at light loads in the quick version."""
    if quick:
        return [_case("laws", THIN, LIGHT, ROUGH, law, nu) for law, nu in LAWS[:2]]
    found = [_case("laws", h, LAW_APPROACHES, ACCURACY, law, nu) for h in SIDES for law, nu in LAWS]
    return found + [_case("foam", FOAM_THICKNESS, FOAM_APPROACHES, ACCURACY, law, nu) for law, nu in FOAMS]


def _case(
    group: str, thickness: float, approaches: tuple[float, ...], accuracy: float, law: Law, poisson: float
) -> Case:
    case = along(group, thickness, approaches, accuracy, poisson=poisson)
    words = f"{law.name} {law.exponents[0]:g}" if isinstance(law, Hyperfoam) else law.name
    problem = replace(case.problem, finite_strain=FiniteStrain(law))
    name = case.name.replace(group, f"{group}-{words.replace(' ', '-')}", 1)
    return replace(case, name=name, problem=problem, labels={**case.labels, "law": words})
