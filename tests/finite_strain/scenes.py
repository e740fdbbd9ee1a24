"""Scenes that several tests press: the paper's dimensionless layer (E1 = 1, R = 1), and coarse models of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from finite_strain.domain import Resolution, box_to_mesh, reduce_scene
from finite_strain.planning import RunPlan
from linear_bem import Ball, Elastic, Elements, Layer, Load, Problem

if TYPE_CHECKING:
    from finite_strain.forces import ForceMeter
    from finite_strain.loading import LoadPath, StepRecord
    from finite_strain.model import Model
    from finite_strain.newton import NewtonSolver
    from finite_strain.traction import TractionRoute

PAPER_LOAD = 2.66666e-3
STIFF_SUBSTRATE = Elastic(1e3, 0.3)
SHAPES = {"finite_strain": "sphere", "small_strain": "paraboloid"}


def relatively(value: Any, tolerance: float) -> Any:
    """Return what equals ``value`` within a relative tolerance, however small it is (pytest's own lets 1e-12 pass)."""
    return pytest.approx(value, rel=tolerance, abs=0.0)


def balls_at(*positions: tuple[float, float], radius: float = 1.0, shape: str = "sphere") -> tuple[Ball, ...]:
    return tuple(Ball(position, radius, shape) for position in positions)


def on_layer(
    balls: tuple[Ball, ...],
    load: Load,
    thickness: float = 1.16,
    substrate: Elastic | None = None,
    poisson: float = 0.48,
) -> Problem:
    return Problem(Layer(1.0, poisson, thickness), balls, load, substrate)


def pair(
    load: Load | float,
    *,
    distance: float = 2.0,
    thickness: float = 1.16,
    substrate: Elastic | None = None,
    shape: str = "sphere",
    angle: float = 0.0,
    poisson: float = 0.48,
) -> Problem:
    """Return two equal balls; a number as load is the approach of both [m]."""
    x, y = 0.5 * distance * math.cos(angle), 0.5 * distance * math.sin(angle)
    load = load if isinstance(load, Load) else Load("approach", (load, load))
    return on_layer(balls_at((-x, -y), (x, y), shape=shape), load, thickness, substrate, poisson)


def in_form(form: str, problem: Problem) -> Problem:
    """Return the problem with the form of its elements named."""
    return replace(problem, elements=Elements(form))


def light_pair() -> Problem:
    """Return the thin pair pressed in so lightly that two load steps on small meshes do."""
    return pair(0.02)


def single(approach: float, thickness: float = 1.0, poisson: float = 0.48, shape: str = "sphere") -> Problem:
    load = Load("approach", (approach,))
    return on_layer(balls_at((0.0, 0.0), shape=shape), load, thickness, poisson=poisson)


def coarse_plan(
    problem: Problem, model: str, resolution: Resolution, contact_radius: float, fractions: tuple[float, ...] = (1.0,)
) -> RunPlan:
    """Return a plan with one mesh, sized for a contact radius [m]."""
    reduction = reduce_scene(problem)
    box = box_to_mesh(problem, reduction, resolution, contact_radius)
    return RunPlan(problem, model, reduction, fractions, (box, box))


@dataclass
class Rig:
    """A model on one mesh of this process alone, with what drives and measures it."""

    plan: RunPlan
    model: Model
    solver: NewtonSolver
    meter: ForceMeter
    traction: TractionRoute
    path: LoadPath

    def contact_radii(self) -> list[float]:
        """Return the radius [m] of every model ball's contact, as a run places its domain integrals by."""
        model = self.model
        areas = [contact.extremes(model.nodal, model.comm)["contact_area"] for contact in model.contacts]
        return [
            math.sqrt(ball.copies * area / math.pi) for ball, area in zip(model.reduction.balls, areas, strict=True)
        ]

    def press(self) -> list[StepRecord]:
        """Go along the plan's load path to its end."""
        return list(self.path.steps(list(self.plan.fractions)))


def coarse_rig(plan: RunPlan, folder: Path) -> Rig:
    """Mesh a plan's main box and return the model on it with its solver, force meter and load path."""
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain.forces import ForceMeter  # noqa: PLC0415
    from finite_strain.kinematics import Finite, Small  # noqa: PLC0415
    from finite_strain.loading import LoadPath  # noqa: PLC0415
    from finite_strain.model import Model  # noqa: PLC0415
    from finite_strain.newton import NewtonSolver  # noqa: PLC0415
    from finite_strain.traction import TractionRoute  # noqa: PLC0415
    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    write_layer_mesh(plan.boxes[1], folder / "mesh.msh")
    kinematics = Small() if plan.model == "small_strain" else Finite()
    model = Model(plan.problem, plan.reduction, kinematics, folder / "mesh.msh", MPI.COMM_SELF)
    solver = NewtonSolver(model)
    meter = ForceMeter(model, plan.boxes[1])
    return Rig(plan, model, solver, meter, TractionRoute(model, meter, solver), LoadPath(plan.problem, model, solver))


class Recorder:
    """An observer that remembers what it hears."""

    def __init__(self) -> None:
        self.info: dict[str, Any] = {}
        self.attempts: list[dict[str, Any]] = []
        self.residuals: list[float] = []
        self.steps: list[Any] = []
        self.surfaces: list[Any] = []

    def started(self, info: dict[str, Any]) -> None:
        self.info = info

    def attempt(self, info: dict[str, Any]) -> None:
        self.attempts.append(info)

    def newton(self, info: dict[str, Any]) -> None:
        self.residuals.append(info["residual"])

    def step_done(self, step: Any, fields: Any) -> None:
        self.steps.append(step)
        self.surfaces.append(fields)
