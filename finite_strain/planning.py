"""From a problem to what will be run: kinematics, symmetry, two meshes, load steps, and what they cost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from finite_strain.domain import LEAST_SHARE, Reduction, Resolution, box_to_mesh, expected_indentation, reduce_scene
from finite_strain.schedule import load_fractions
from finite_strain.volumetric import describe_forms, form_faults
from linear_bem.closed_forms import indentation_of_layer
from linear_bem.errors import UnsupportedProblem
from linear_bem.problem import Problem
from meshes.box import Box

MODELS = ("finite_strain", "small_strain")
COARSENING = 1.4
"""Ratio of element sizes of the companion mesh, whose difference from the main mesh measures the mesh error."""
LARGEST_APPROACH = 0.9
"""Part of the layer's thickness that a ball may be pressed in by, before elements below it vanish."""
SOFT_SUBSTRATE = 0.02
"""Layer over substrate modulus beyond which the substrate's far field is felt in T."""
_UNKNOWNS_PER_TETRAHEDRON = 3.8
_NEWTON_ITERATIONS_PER_STEP = 13


@dataclass(frozen=True)
class RunPlan:
    """What a run consists of; ``boxes`` are the companion's and the main mesh's, in the order they run."""

    problem: Problem
    model: str
    reduction: Reduction
    fractions: tuple[float, ...]
    boxes: tuple[Box, Box]

    def notes(self) -> list[str]:
        """Return what the reader must know about the model, beside its numbers."""
        problem, box = self.problem, self.boxes[1]
        if problem.substrate is None:
            return []
        softness = problem.layer.contact_modulus / problem.substrate.contact_modulus
        if softness < SOFT_SUBSTRATE:
            return []
        return [
            f"the substrate is only {1.0 / softness:.3g} times as stiff as the layer, and the model ends "
            f"{box.substrate:.3g} m below the layer and at its sides: what lies beyond is not in the error of T"
        ]

    def unknowns(self) -> list[float]:
        """Estimate the unknowns of both meshes (within about 40 %)."""
        return [_UNKNOWNS_PER_TETRAHEDRON * box.estimated_tetrahedra() for box in self.boxes]

    def describe(self) -> dict[str, Any]:
        """Return the plan in words and numbers: SI units, seconds for two ranks."""
        unknowns = self.unknowns()
        iteration = [0.45 * (n / 28e3) ** 1.4 for n in unknowns]  # measured on two ranks with MUMPS
        box = self.boxes[1]
        zone = min(box.zones, key=lambda z: z.finest)
        mirrors = ["mirror plane across the line of balls", "mirror plane along the line of balls"]
        return {
            "forms": describe_forms(self.problem),
            "symmetries": [mirrors[axis] for axis in self.reduction.planes],
            "unknowns": round(unknowns[1]),
            "unknowns_companion": round(unknowns[0]),
            "memory_bytes": 4e8 + 0.36e9 * (unknowns[1] / 49e3) ** 1.35,
            "seconds": 10.0 + len(self.fractions) * (_NEWTON_ITERATIONS_PER_STEP + 3) * sum(iteration),
            "domain": {"x": list(box.x), "y": list(box.y), "layer": box.thickness, "substrate": box.substrate},
            "element_sizes": {"finest": zone.finest, "coarsest": box.coarsest},
            "load_steps": len(self.fractions),
        }


def plan_run(problem: Problem, tangential_force: float, model: str) -> RunPlan:
    """Return the plan of a run; raises `UnsupportedProblem`, naming the key, for what the model lacks."""
    _check_supported(problem, model)
    reduction = reduce_scene(problem)
    expected = expected_indentation(problem)
    deepest, index = max((approach, i) for i, (approach, _, _) in enumerate(expected))
    radius = problem.balls[index].radius
    fractions = load_fractions(problem.load.kind, deepest, radius)
    first = fractions[0] if problem.load.kind == "approach" else fractions[0] ** (2.0 / 3.0)
    smallest = min(
        indentation_of_layer(
            problem.layer, problem.substrate, ball.radius, approach=first * max(approach, LEAST_SHARE * deepest)
        ).contact_radius
        for ball, (approach, _, _) in zip(problem.balls, expected, strict=True)
        if approach > 0.0
    )
    fine = Resolution.for_accuracy(tangential_force)
    boxes = tuple(box_to_mesh(problem, reduction, r, smallest) for r in (fine.coarser(COARSENING), fine))
    return RunPlan(problem, model, reduction, tuple(fractions), (boxes[0], boxes[1]))


def _check_supported(problem: Problem, model: str) -> None:
    if model not in MODELS:
        raise UnsupportedProblem(f"model: the finite-element models are {' and '.join(MODELS)}, got {model}")
    faults = []
    if not math.isfinite(problem.layer.thickness):
        faults.append(f"layer.thickness: {model} meshes the layer and needs a finite one, got inf; use linear_bem")
    faults += form_faults(problem, model)
    values = problem.load.values
    if problem.load.kind == "force" and min(values) <= 0.0:
        faults.append(
            f"load.force: {model} needs a force > 0 on every ball, got {min(values):g} N; leave that ball out"
        )
    if problem.load.kind == "approach" and max(values) >= LARGEST_APPROACH * problem.layer.thickness:
        faults.append(
            f"load.approach: {model} takes approaches below {LARGEST_APPROACH:g} of the layer's thickness "
            f"({problem.layer.thickness:g} m), got {max(values):g} m"
        )
    if faults:
        raise UnsupportedProblem("\n".join(faults))
