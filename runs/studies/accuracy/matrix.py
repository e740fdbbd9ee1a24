"""The ladder of models and the knobs of each, on one problem: the paper's thin pair at D = 0.1 R, exact spheres."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem
from runs.studies.case import Case

ONE_MESH = {"finite_strain.refinement.MOST_MESHES": 1}
"""No refinement after the first two meshes: the size of the elements is then a knob of its own."""
USUAL = 0.05
"""Accuracy that sizes the mesh on which the other knobs are turned."""
KNOBS: dict[str, tuple[str, tuple[float, ...]]] = {
    "contact quadrature degree": ("finite_strain.contact.QUADRATURE_DEGREE", (4, 6, 14)),
    "augmentation tolerance": ("finite_strain.loading.INDENTATION_CHANGE", (0.5, 0.01, 0.001)),
    "penalty": ("finite_strain.penalty.PENALTY", (2.0, 32.0)),
    "Newton tolerance": ("finite_strain.loading.RESIDUAL", (1e-4, 1e-6, 1e-11)),
    "growth of load steps": ("finite_strain.schedule.GROWTH", (1.2, 2.5, 1e3)),
    "ratio of the two meshes": ("finite_strain.planning.COARSENING", (1.2, 2.0)),
}
"""Constants of the solver that are turned one at a time from their default, which is left out here."""
REFERENCES = {"linear_bem": "linear-bem-reference", "small_strain": "small-strain-reference",
              "finite_strain": "finite-strain-reference", "point_load": "linear-bem-reference"}  # fmt: skip
"""The better solution that each model's error is measured against."""


def problem(approach: float, model: str) -> Problem:
    """Return the problem as a model sees it."""
    balls = (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 1.0, "sphere"))
    effect = FiniteStrain() if model == "finite_strain" else None
    return Problem(Layer(1.0, 0.48, 1.16), balls, Load("approach", (approach,) * 2), Elastic(1e3, 0.3), effect)


def cases(quick: bool) -> list[Case]:
    """Return the references first, then the ladder, then the knobs."""
    approach = 0.015 if quick else 0.1

    def make(
        name: str, model: str, accuracy: float, knob: str, value: Any,
        constants: Mapping[str, float] | None = None, **more: Any,
    ) -> Case:  # fmt: skip
        labels = {"knob": knob, "value": value}
        return Case(name, problem(approach, model), model, accuracy, constants or {}, labels, **more)

    found = [
        make("linear-bem-reference", "linear_bem", 1e-8, "reference", ""),
        make("point-load", "point_load", 0.5, "model", ""),
    ]
    asked = (1e-2, 1e-4) if quick else (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
    found += [make(f"linear-bem-{a:g}", "linear_bem", a, "accuracy asked", a) for a in asked]
    meshes = (0.2,) if quick else (0.2, 0.05, 0.02, 0.01)
    for model in ("finite_strain", "small_strain"):
        short = model.replace("_", "-")
        budget = {"unknowns": 30e3 if quick else 200e3}
        best = 0.03 if quick else 0.003
        found.append(make(f"{short}-reference", model, best, "reference", "", ONE_MESH, budget=budget))
        found += [make(f"{short}-mesh-{a:g}", model, a, "mesh for an accuracy of", a, ONE_MESH) for a in meshes]
    if quick:
        return found
    found += [make(f"finite-strain-asked-{a:g}", "finite_strain", a, "accuracy asked", a) for a in (0.05, 0.02, 0.01)]
    found.append(
        make(f"finite-strain-one-rank-{USUAL:g}", "finite_strain", USUAL, "one rank", "", ONE_MESH, alone=True)
    )
    for knob, (place, values) in KNOBS.items():
        stem = knob.replace(" ", "-").lower()
        found += [make(f"{stem}-{v:g}", "finite_strain", USUAL, knob, v, {**ONE_MESH, place: v}) for v in values]
    return found
