"""The ladder of models and the knobs of each, on one problem: the paper's thin pair at D = 0.1 R, exact spheres."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem
from runs.studies.case import Case
from runs.studies.stability.matrix import LinearPath

ONE_MESH = {"finite_strain.refinement.MOST_MESHES": 1}
"""No refinement after the first two meshes: the size of the elements is then a knob of its own."""
TWICE_AS_COARSE = {"finite_strain.planning.COARSEST": 2.5}
COARSE_UNKNOWNS = 700.0
"""A budget that makes the elements of the coarsest mesh that an accuracy sizes twice as large again."""
GRIDS = {"linear_bem.solver.STEEP": 0.0, "linear_bem.solver.ROUTES_SUFFICE": 0.0}
"""Every contact on a grid, none by polynomials."""
USUAL = 0.1
"""Accuracy that sizes the mesh on which the other knobs are turned."""
USUAL_CASE = "finite-strain-0.1"
"""The case with every knob at its default."""
REFERENCE_ACCURACY = 0.006
"""Sizes the meshes of the finite-strain reference: about 30 and 60 thousand unknowns."""
ALL_RANKS = "all ranks"


@cache
def knobs() -> dict[str, dict[str, Mapping[str, float]]]:
    """Return the solver's constants that are turned one at a time from their default, which the knob's name holds."""
    from finite_strain.schedule import GROWTH  # noqa: PLC0415  (no DOLFINx, but not for every command)

    # the first load step, which sizes the meshes, stays where growth is a root or a power of the usual one
    five_in_one = {"finite_strain.schedule.GROWTH": GROWTH**5, "finite_strain.schedule.LARGEST_STEP": 10.0}
    return {
        "degree of the contact's quadrature (10)": {
            f"{d}": {"finite_strain.contact.QUADRATURE_DEGREE": d} for d in (4, 6, 14)
        },
        "change of Q by which augmentations end (0.05)": {
            f"{c:g}": {"finite_strain.loading.INDENTATION_CHANGE": c} for c in (0.5, 0.005)
        },
        "penalty (8)": {f"{p:g}": {"finite_strain.penalty.PENALTY": p} for p in (2.0, 32.0)},
        "residual at which Newton's method stops (1e-9)": {
            f"{r:g}": {"finite_strain.loading.RESIDUAL": r} for r in (1e-4, 1e-6, 1e-11)
        },
        "load steps (6)": {"11": {"finite_strain.schedule.GROWTH": GROWTH**0.5}, "2": five_in_one},
        "size of the companion's elements (1.4)": {
            f"{r:g}": {"finite_strain.simulation.COARSENING": r} for r in (1.2, 2.0)
        },
    }


REFERENCES = {"linear_bem": "linear-bem-reference", "small_strain": "linear-bem-reference",
              "finite_strain": "finite-strain-reference", "point_load": "linear-bem-reference"}  # fmt: skip
"""The better solution that each model's error is measured against; small strain has one by other means."""


def problem(approach: float, model: str) -> Problem:
    """Return the problem as a model sees it."""
    balls = (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 1.0, "sphere"))
    effect = FiniteStrain() if model == "finite_strain" else None
    return Problem(Layer(1.0, 0.48, 1.16), balls, Load("approach", (approach,) * 2), Elastic(1e3, 0.3), effect)


def cases(quick: bool) -> list[Case]:
    """Return the linear models, the finite elements by mesh and accuracy, the knobs, the reference, and all ranks.

    Every case is one rank's but the last, so that seconds compare.
    """
    approach = 0.015 if quick else 0.1

    def make(
        name: str, model: str, accuracy: float, knob: str, value: Any,
        constants: Mapping[str, float] | None = None, *, alone: bool = True, **more: Any,
    ) -> Case:  # fmt: skip
        labels = {"knob": knob, "value": value}
        alone = alone and model in ("finite_strain", "small_strain")
        kind = LinearPath if name == REFERENCES["linear_bem"] else Case
        return kind(name, problem(approach, model), model, accuracy, constants or {}, labels, alone=alone, **more)

    found = [
        make("linear-bem-reference", "linear_bem", 1e-8, "reference", ""),
        make("point-load", "point_load", 0.5, "model", ""),
    ]
    asked = (1e-2, 1e-4) if quick else (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
    found += [make(f"linear-bem-{a:g}", "linear_bem", a, "accuracy asked", a) for a in asked]
    if not quick:
        grids = (1e-1, 1e-2, 1e-3, 1e-4)
        found += [make(f"linear-bem-grids-{a:g}", "linear_bem", a, "accuracy asked on grids", a, GRIDS) for a in grids]
    meshes = (0.2,) if quick else (0.1, 0.05, 0.02)
    for model in ("finite_strain", "small_strain"):
        short = model.replace("_", "-")
        found += [make(f"{short}-{a:g}", model, a, "accuracy asked", a) for a in meshes]
        if not quick:
            found.append(
                make(f"{short}-coarse", model, USUAL, "mesh", "twice as coarse as any", ONE_MESH | TWICE_AS_COARSE,
                     budget={"unknowns": COARSE_UNKNOWNS})
            )  # fmt: skip
    if not quick:
        for number, (knob, values) in enumerate(knobs().items(), start=1):
            found += [
                make(f"knob-{number}-{v}", "finite_strain", USUAL, knob, v, {**ONE_MESH, **constants})
                for v, constants in values.items()
            ]
    best, budget = (0.03, {"unknowns": 30e3}) if quick else (REFERENCE_ACCURACY, {})
    found.append(make(REFERENCES["finite_strain"], "finite_strain", best, "reference", "", ONE_MESH, budget=budget))
    if not quick:
        found.append(make("finite-strain-all-ranks", "finite_strain", USUAL, ALL_RANKS, "", ONE_MESH, alone=False))
    return found
