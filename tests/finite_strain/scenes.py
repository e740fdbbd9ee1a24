"""Scenes shared by tests: the paper's dimensionless layer (E1 = 1, R = 1), and coarse models of them."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from finite_strain.geometry.extent import Extent
from finite_strain.numerics import Numerics
from finite_strain.planning.records import Discretisation
from finite_strain.planning.run_plan import RunPlan, plan_run
from linear_bem import Ball, Elastic, Elements, FiniteStrain, Indenter, Layer, Load, Problem
from linear_bem.problem import Profile

if TYPE_CHECKING:
    import numpy as np

    from finite_strain.discretisation.discrete_model import Model
    from finite_strain.equilibrium.load_path import LoadPath
    from finite_strain.equilibrium.newton import NewtonSolver, StepRecord
    from finite_strain.one_discretisation import ModelRun

PAPER_LOAD = 2.66666e-3
STIFF_SUBSTRATE = Elastic(1e3, 0.3)
SHAPES = {"finite_strain": "sphere", "small_strain": "paraboloid"}
QUADRATIC, CUBIC = Discretisation(order=2, fineness=1.0), Discretisation(order=3, fineness=1.0)
"""The coarsest discretisations of a run: for claims about the code, and about the answer."""
NEAR = Extent(1.7, 0.8)
"""Sides and bottom [m] of a small model: exact claims hold in any box."""


def relatively(value: Any, tolerance: float) -> Any:
    """Return an approximation by relative tolerance alone (pytest's default adds an absolute one of 1e-12)."""
    return pytest.approx(value, rel=tolerance, abs=0.0)


def balls_at(
    *positions: tuple[float, float], radius: float = 1.0, shape: str | Indenter | Profile = "sphere"
) -> tuple[Ball, ...]:
    if isinstance(shape, Indenter):  # which has its own radius
        return tuple(Ball(position, shape=shape) for position in positions)
    return tuple(Ball(position, radius, shape) for position in positions)


def on_layer(
    balls: tuple[Ball, ...],
    load: Load,
    thickness: float = 1.16,
    substrate: Elastic | None = None,
    poisson: float = 0.48,
) -> Problem:
    """Return the balls on a hyperelastic layer; `at_small_strain` removes the effect."""
    return Problem(Layer(1.0, poisson, thickness), balls, load, substrate, FiniteStrain())


def at_small_strain(problem: Problem) -> Problem:
    """Return the problem for small-strain models."""
    return replace(problem, finite_strain=None)


def pair(
    load: Load | float,
    *,
    distance: float = 2.0,
    thickness: float = 1.16,
    substrate: Elastic | None = None,
    shape: str | Indenter | Profile = "sphere",
    angle: float = 0.0,
    poisson: float = 0.48,
) -> Problem:
    """Return two equal balls; a number as load is the approach of both [m]."""
    x, y = 0.5 * distance * math.cos(angle), 0.5 * distance * math.sin(angle)
    load = load if isinstance(load, Load) else Load("approach", (load, load))
    return on_layer(balls_at((-x, -y), (x, y), shape=shape), load, thickness, substrate, poisson)


UNEQUAL = on_layer(
    (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 0.8, "sphere")), Load("approach", (0.1, 0.08)), poisson=0.3
)
LOPSIDED = on_layer(
    balls_at((0.0, 0.0), (2.2, 0.0), (0.0, 2.5)), Load("approach", (0.1, 0.1, 0.1)), poisson=0.3
)  # fmt: skip


def in_form(form: str, problem: Problem) -> Problem:
    """Return the problem with the given element form."""
    return replace(problem, elements=Elements(form))


LIGHT = 0.1


ONE_LOAD = Numerics(more_loads=())
"""Only the loads that are asked for."""
COARSER = replace(ONE_LOAD, growth=4.0)
"""Elements that grow fast: half the unknowns; T of the light pair changes by 0.2 %, its error bar by a factor of 3."""


def light_pair() -> Problem:
    """Return a pair that the two coarsest discretisations solve to a few per cent."""
    return pair(LIGHT, poisson=0.3)


def single(approach: float, thickness: float = 1.0, poisson: float = 0.48, shape: str | Indenter = "sphere") -> Problem:
    load = Load("approach", (approach,))
    return on_layer(balls_at((0.0, 0.0), shape=shape), load, thickness, poisson=poisson)


def coarse_plan(
    problem: Problem,
    model: str = "finite_strain",
    steps: Sequence[float] | None = (1.0,),
    extent: Extent | None = NEAR,
    accuracy: float = 0.3,
    numerics: Numerics = COARSER,
) -> RunPlan:
    """Return the plan of a model's run in a box of the given ``extent`` (None: the extent that the accuracy needs)."""
    effect = problem.finite_strain or FiniteStrain()
    problem = replace(problem, finite_strain=effect) if model == "finite_strain" else at_small_strain(problem)
    plan = plan_run(problem, accuracy, model, None, steps, numerics)
    if extent is None:
        return plan
    return replace(plan, extent=replace(extent, depth=0.0) if problem.substrate is None else extent)


@dataclass
class Rig:
    """A model on one mesh of this process, with its solver and load path."""

    plan: RunPlan
    run: ModelRun

    @property
    def model(self) -> Model:
        return self.run.model

    @property
    def solver(self) -> NewtonSolver:
        return self.run.solver

    @property
    def path(self) -> LoadPath:
        return self.run.path

    def contact_radii(self) -> np.ndarray:
        """Return the radius (balls,) [m] of every model ball's contact, as a run uses them for domain integrals."""
        import numpy as np  # noqa: PLC0415

        from finite_strain.force.contact_area import contact_areas  # noqa: PLC0415

        return np.sqrt(contact_areas(self.model) / math.pi)

    def in_plane_forces(self) -> np.ndarray:
        """Return T (balls, 2) [N] of whole balls by the domain integral."""
        from finite_strain.force.domain_integral import in_plane_forces  # noqa: PLC0415

        return in_plane_forces(self.model, self.run.box, self.contact_radii())

    def normal_forces(self) -> np.ndarray:
        """Return Q (balls,) [N] of whole balls."""
        return self.model.forces()[:, 2]

    def press(self, fractions: Sequence[float] | None = None) -> list[StepRecord]:
        """Follow the plan's load path, or these fractions, and converge the last equilibrium."""
        records = list(self.path.steps(self.plan.path if fractions is None else fractions))
        self.settle(record=records[-1])
        return records

    def settle(self, tolerance: float = 1e-9, record: StepRecord | None = None) -> None:
        """Converge the present equilibrium: load steps end with a loose tolerance, because multipliers follow."""
        from finite_strain.equilibrium.newton import StepRecord  # noqa: PLC0415

        record = record or StepRecord(self.path.history[-1].fraction)
        self.solver.solve(tolerance, float(self.normal_forces().max()), record)


def coarse_rig(
    plan: RunPlan, folder: Path, level: Discretisation = QUADRATIC, observer: Any = None, meshed: Any = None
) -> Rig:
    """Mesh a plan's box (or take a mesh) and return the model on it with its solver and load path."""
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain.observer import Silence  # noqa: PLC0415
    from finite_strain.one_discretisation import ModelRun, mesh_box  # noqa: PLC0415

    box = plan.box(level)
    meshed = meshed or mesh_box(box, folder / "mesh.msh", MPI.COMM_SELF)
    run = ModelRun(plan, meshed, box, level, observer or Silence(), "test")
    return Rig(plan, run)


def quadratic_rig(problem: Problem, folder: Path, numerics: Numerics = COARSER) -> Rig:
    """Return the model of a problem on the coarsest elements of order 2."""
    return coarse_rig(coarse_plan(problem, numerics=numerics), folder, QUADRATIC)


class Recorder:
    """An observer that records its calls, in `order` as s(tarted), a(ttempt), n(ewton) and d(one)."""

    def __init__(self) -> None:
        self.order = ""
        self.arguments: list[tuple[type, ...]] = []
        self.info: dict[str, Any] = {}
        self.attempts: list[dict[str, Any]] = []
        self.residuals: list[float] = []
        self.steps: list[Any] = []
        self.surfaces: list[Any] = []

    def started(self, info: dict[str, Any]) -> None:
        self.order += "s"
        self.info = info

    def attempt(self, mesh: str, fraction: float, cuts: int) -> None:
        self.order += "a"
        self.arguments.append((type(mesh), type(fraction), type(cuts)))
        self.attempts.append({"mesh": mesh, "fraction": fraction, "cuts": cuts})

    def newton(self, iteration: int, residual: float) -> None:
        self.order += "n"
        self.arguments.append((type(iteration), type(residual)))
        self.residuals.append(residual)

    def step_done(self, step: Any, surface: Any) -> None:
        self.order += "d"
        self.steps.append(step)
        self.surfaces.append(surface())


class Keeper(Recorder):
    """Also keeps what a run that is killed after each step leaves: copies of its folder, named by the step."""

    def __init__(self, folder: Path, kept: Path) -> None:
        super().__init__()
        self.folder, self.kept = folder, kept

    def step_done(self, step: Any, surface: Any) -> None:
        super().step_done(step, surface)
        shutil.copytree(self.folder, self.kept / str(step.record["step"]))
