"""The cases of the study: the paper's pair on its thin and its thick layer, and variations of it."""

from linear_bem.problem import Elastic
from runs.studies.framework.case import Case
from runs.studies.framework.pair import POISSON, STIFF, THICK, THIN, pair

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
UNKNOWNS, HEADLINE_UNKNOWNS = 50e3, {THIN: 220e3, THICK: 120e3}
"""Largest numbers of unknowns: for order 3 of all curves, order 4 of the headline, fineness 1.5 where T is largest."""
SIDES = {THIN: "thin", THICK: "thick"}


def cases(quick: bool) -> list[Case]:
    """Return all cases, the most important ones for the answer first."""
    if quick:
        light, rough = (0.01, 0.02, 0.03), 0.2
        paraboloid = along("paraboloid", THIN, light, rough, shape="paraboloid")
        return [*(along("headline", h, light, rough) for h in SIDES), paraboloid]
    found = [along("headline", h, APPROACHES, 0.002, unknowns=HEADLINE_UNKNOWNS[h]) for h in SIDES]
    found += [along("paraboloid", h, VARIED, 0.02, shape="paraboloid") for h in SIDES]
    for h in SIDES:
        found += [along("distance", h, VARIED, 0.02, distance=distance) for distance in DISTANCES]
        found += [along("poisson", h, VARIED, 0.02, poisson=poisson) for poisson in POISSONS]
    found += [along("sign", h, VARIED, 0.02) for h in NEAR_SIGN_CHANGE]
    # apart from the headline, which must not fail with them
    found += [along("deeper", h, approaches, 0.02) for h, approaches in DEEPER.items()]
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
    return Case("-".join(words), problem, "finite_strain", accuracy, {}, labels, steps=steps, budget=budget)
