"""Which cases the study solves: the paper's pair, thin and thick, and what is varied about it."""

from __future__ import annotations

from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem
from runs.studies.case import Case

THIN, THICK = 1.16, 6.0
"""Thickness over R of the paper's separation case and of its attraction case."""
POISSON, SUBSTRATE = 0.48, Elastic(1e3, 0.3)
DISTANCES = (3.0, 4.0, 6.0)
POISSONS = (0.3, 0.4, 0.4999)
NEAR_SIGN_CHANGE = (1.7, 1.9)
"""Thicknesses about the linear model's sign change, h' = 1.6977 at the paper's load."""
DEEPEST = 0.5
DEEPER = {THIN: 0.6, THICK: 0.8}
"""Approaches over R of the deepest curves: under the thin layer's pair single elements fold from 0.62 R on."""
UNKNOWNS, HEADLINE_UNKNOWNS = 30e3, 60e3
"""Budgets of a curve: two meshes, and three."""
LONG_STEPS = {"finite_strain.schedule.LARGEST_STEP": 0.1}
"""The answer does not depend on the load steps: a third fewer than usual draw the same curve."""
ONE_MESH = {"finite_strain.refinement.MOST_MESHES": 1}
SIDES = {THIN: "thin", THICK: "thick"}


def pair(
    thickness: float, approach: float, *, distance: float = 2.0, poisson: float = POISSON, shape: str = "sphere"
) -> Problem:
    """Return two balls ``distance`` R apart, pressed in by ``approach`` R; R = 1, E1 = 1."""
    balls = tuple(Ball((side * distance / 2.0, 0.0), 1.0, shape) for side in (-1.0, 1.0))
    return Problem(Layer(1.0, poisson, thickness), balls, Load("approach", (approach,) * 2), SUBSTRATE, FiniteStrain())


def cases(quick: bool) -> list[Case]:
    """Return all cases, the ones that the answer leans on first."""
    return _quick() if quick else _full()


def _quick() -> list[Case]:
    deepest, accuracy = 0.03, 0.2
    return [
        *(_along("headline", h, deepest, accuracy) for h in SIDES),
        _along("paraboloid", THIN, deepest, accuracy, shape="paraboloid"),
        _along("small load", THIN, deepest, accuracy, model="small_strain"),
    ]


def _full() -> list[Case]:
    found = [_along("headline", h, DEEPEST, 0.01, unknowns=HEADLINE_UNKNOWNS) for h in SIDES]
    for model in ("finite_strain", "small_strain"):
        found += [_along("small load", h, 0.06, 0.02, model=model, one_mesh=True) for h in SIDES]
    found += [_along("paraboloid", h, DEEPEST, 0.02, shape="paraboloid") for h in SIDES]
    # each curve twice on one mesh: what a load so small that the mesh error hides it does to T shows in their ratio
    for model in ("finite_strain", "small_strain"):
        for h in SIDES:
            for distance in DISTANCES:
                found.append(_along("distance", h, DEEPEST, 0.02, distance=distance, model=model, one_mesh=True))
            for poisson in POISSONS:
                found.append(_along("poisson", h, DEEPEST, 0.02, poisson=poisson, model=model, one_mesh=True))
    found += [_along("sign", h, DEEPEST, 0.02) for h in NEAR_SIGN_CHANGE]
    # apart from the headline, which must not fail with them
    found += [_along("deeper", h, deepest, 0.02) for h, deepest in DEEPER.items()]
    return found


def _along(
    group: str,
    thickness: float,
    deepest: float,
    accuracy: float,
    *,
    distance: float = 2.0,
    poisson: float = POISSON,
    shape: str = "sphere",
    model: str = "finite_strain",
    unknowns: float = UNKNOWNS,
    one_mesh: bool = False,
) -> Case:
    problem = pair(thickness, deepest, distance=distance, poisson=poisson, shape=shape)
    if model == "small_strain":
        problem = Problem(problem.layer, problem.balls, problem.load, problem.substrate)
    words = [group.replace(" ", "-"), SIDES.get(thickness, f"h{thickness:g}"), f"L{distance:g}", f"nu{poisson:g}"]
    if group == "small load" or model != "finite_strain":
        words.append(model.replace("_", "-"))
    labels = {"group": group, "h": thickness, "L": distance, "nu": poisson, "shape": shape}
    # a ratio of two runs needs both on the same meshes: no refinement beyond the one that the accuracy sizes
    constants = (ONE_MESH if one_mesh else {}) | (LONG_STEPS if deepest > 0.1 else {})
    return Case("-".join(words), problem, model, accuracy, constants, labels, budget={"unknowns": unknowns})
