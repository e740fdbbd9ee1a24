"""From a problem to what will be run: kinematics, symmetry, two meshes, load steps, and what they cost."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from finite_strain.domain import (
    LEAST_SHARE,
    USUAL_ACCURACY,
    Reduction,
    Resolution,
    box_to_mesh,
    expected_indentation,
    reduce_scene,
    scene_positions,
)
from finite_strain.extent import Extent, choose_extent
from finite_strain.far_field import FarField
from finite_strain.refinement import Budget
from finite_strain.schedule import load_fractions
from finite_strain.solver_choice import choose, given_in
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
COARSEST = 1.5
"""Ratio of element sizes to those of the accuracy asked for up to which a budget may coarsen the first meshes."""
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
    accuracy: float = USUAL_ACCURACY
    budget: Budget = field(default_factory=Budget)
    resolution: Resolution | None = None
    smallest_contact: float = 0.0
    extent: Extent | None = None

    def box(self, size: float) -> Box:
        """Return the box with elements of ``size`` times the main mesh's."""
        if size == 1.0:
            return self.boxes[1]
        assert self.resolution is not None
        resolution = self.resolution.coarser(size)
        return box_to_mesh(self.problem, self.reduction, resolution, self.smallest_contact, self.extent)

    def far_field(self) -> FarField:
        """Return what the model's end does to every ball of the scene, in the model's frame."""
        box, reduction = self.boxes[1], self.reduction
        sides = [(-high if axis in reduction.planes else low, high) for axis, (low, high) in enumerate((box.x, box.y))]
        return FarField(self.problem, box.substrate, scene_positions(reduction), (sides[0], sides[1]))

    def unknowns(self) -> list[float]:
        """Estimate the unknowns of both meshes; fine ones have up to 1.4 times as many, the coarsest up to 2.6."""
        return [_UNKNOWNS_PER_TETRAHEDRON * box.estimated_tetrahedra() for box in self.boxes]

    def describe(self) -> dict[str, Any]:
        """Return the plan in words and numbers: SI units, seconds for two ranks."""
        unknowns = self.unknowns()
        box, most = self.boxes[1], self.budget.most_unknowns(unknowns[1])
        zone = min(box.zones, key=lambda z: z.finest)
        forms, given = describe_forms(self.problem), given_in(os.environ.get("PETSC_OPTIONS", ""))
        solvers = [choose(n, "mixed" in forms.values(), given) for n in unknowns]
        iteration = [_iteration_seconds(n, solver.direct) for n, solver in zip(unknowns, solvers, strict=True)]
        mirrors = ["mirror plane across the line of balls", "mirror plane along the line of balls"]
        return {
            "forms": forms,
            "linear_solver": solvers[1].describe(),
            "symmetries": [mirrors[axis] for axis in self.reduction.planes],
            "unknowns": round(unknowns[1]),
            "unknowns_companion": round(unknowns[0]),
            "meshes": [
                f"companion, about {unknowns[0]:.0f} unknowns: its difference from the next is the mesh error",
                f"main, about {unknowns[1]:.0f} unknowns",
                f"finer ones, up to {most:.0f} unknowns, while the error at full load exceeds what was asked",
            ],
            "memory_bytes": _bytes(unknowns[1], solvers[1].direct),
            "memory_bytes_at_most": _bytes(most, choose(most, "mixed" in forms.values(), given).direct),
            "seconds": 10.0 + len(self.fractions) * (_NEWTON_ITERATIONS_PER_STEP + 3) * sum(iteration),
            "domain": {"x": list(box.x), "y": list(box.y), "layer": box.thickness, "substrate": box.substrate},
            "element_sizes": {"finest": zone.finest, "coarsest": box.coarsest},
            "load_steps": len(self.fractions),
            "accuracy": {
                "asked": self.accuracy,
                "unknowns_at_most": most,
                "seconds_at_most": self.budget.seconds,
            },
        }


def _iteration_seconds(unknowns: float, direct: bool) -> float:
    """Return the time of a Newton iteration, measured on two ranks: factors (MUMPS) or multigrid."""
    return 0.38 * (unknowns / 28e3) ** 1.4 if direct else 3.1e-5 * unknowns


def _bytes(unknowns: float, direct: bool) -> float:
    """Return the memory of two ranks: matrix and factors, or matrix, multigrid and Krylov vectors, as measured."""
    return 4e8 + (0.77e9 * (unknowns / 51.5e3) ** 1.35 if direct else 7.5e3 * unknowns)


def planned_fractions(problem: Problem) -> list[float]:
    """Return the load fractions that a run passes: steps that suit the ball that goes deepest for its size."""
    expected = expected_indentation(problem)
    shares = [approach / ball.radius for ball, (approach, _, _) in zip(problem.balls, expected, strict=True)]
    return load_fractions(problem.load.kind, max(shares))


def plan_run(problem: Problem, tangential_force: float, model: str, budget: Budget | None = None) -> RunPlan:
    """Return the plan of a run; raises `UnsupportedProblem`, naming the key, for what the model lacks."""
    _check_supported(problem, model)
    reduction = reduce_scene(problem)
    expected = expected_indentation(problem)
    deepest = max(approach for approach, _, _ in expected)
    fractions = planned_fractions(problem)
    first = fractions[0] if problem.load.kind == "approach" else fractions[0] ** (2.0 / 3.0)
    smallest = min(
        indentation_of_layer(
            problem.layer, problem.substrate, ball.radius, approach=first * max(approach, LEAST_SHARE * deepest)
        ).contact_radius
        for ball, (approach, _, _) in zip(problem.balls, expected, strict=True)
        if approach > 0.0
    )
    extent = choose_extent(problem, scene_positions(reduction), reduction.planes, expected, tangential_force)
    budget = budget or Budget()

    def boxes(resolution: Resolution) -> tuple[Box, Box]:
        coarse, fine = (
            box_to_mesh(problem, reduction, r, smallest, extent) for r in (resolution.coarser(COARSENING), resolution)
        )
        return coarse, fine

    resolution = _within(budget, Resolution.for_accuracy(tangential_force), boxes)
    return RunPlan(
        problem, model, reduction, tuple(fractions), boxes(resolution),
        tangential_force, budget, resolution, smallest, extent,
    )  # fmt: skip


def _within(budget: Budget, resolution: Resolution, boxes: Callable[[Resolution], tuple[Box, Box]]) -> Resolution:
    """Return the resolution, made coarser where its main mesh would pass a stated budget of unknowns."""
    if budget.unknowns is None:
        return resolution
    size = 1.0
    while size <= COARSEST:
        wanted = _UNKNOWNS_PER_TETRAHEDRON * boxes(resolution.coarser(size))[1].estimated_tetrahedra()
        if wanted <= budget.unknowns:
            return resolution.coarser(size) if size > 1.0 else resolution
        size *= 1.05
    raise UnsupportedProblem(
        f"accuracy.unknowns: the coarsest mesh that tells T has about {wanted:.2g} unknowns, "
        f"got {budget.unknowns:g}; raise it, or accuracy.tangential_force"
    )


def _check_supported(problem: Problem, model: str) -> None:
    if model not in MODELS:
        raise UnsupportedProblem(f"model: the finite-element models are {' and '.join(MODELS)}, got {model}")
    faults = []
    if not 0.0 < problem.layer.thickness < math.inf:
        thickness = f"{problem.layer.thickness:g}"
        faults.append(
            f"layer.thickness: {model} meshes the layer and needs a finite one, got {thickness}; use linear_bem"
        )
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
