"""One discretisation of a run: the problem's model and its small-strain pair, each with its load path."""

import math
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI

from finite_strain import compat
from finite_strain.discretisation.checkpoint import Snapshot
from finite_strain.discretisation.discrete_model import Meshed, Model
from finite_strain.discretisation.point_location import Locations
from finite_strain.equilibrium.load_path import LoadPath, State
from finite_strain.equilibrium.newton import NewtonSolver, StepRecord
from finite_strain.force.contact_area import contact_areas
from finite_strain.force.contact_pressure import Extremes
from finite_strain.force.domain_integral import in_plane_forces
from finite_strain.geometry.load_control import prescribed
from finite_strain.mpi import on_root
from finite_strain.observer import Observer
from finite_strain.planning.records import ContactState, Discretisation, SolverAccount
from finite_strain.planning.run_plan import RunPlan
from linear_bem.memory import give_back
from meshes.box import Box
from meshes.layer import write_layer_mesh

LARGEST_PENETRATION = 1e-4
"""Largest penetration at a node, over the ball's radius, that `ModelRun.enforce` accepts."""
STIFFER, ROUNDS = 4.0, 3
"""Factor on the penalties above that limit, and how often: each time the penetration halves, and the last tangent still
serves as preconditioner (alternatives: `thirdbody study discretisations`)."""


def mesh_box(box: Box, file: Path, comm: MPI.Comm) -> Meshed:
    """Mesh a box into a file and read it (collective)."""
    on_root(comm, lambda: write_layer_mesh(box, file))
    return compat.read_mesh(file, comm)


class ModelRun:
    """A model with its load path on one mesh."""

    def __init__(
        self, plan: RunPlan, meshed: Meshed, box: Box, level: Discretisation, observer: Observer, name: str,
        locations: Locations | None = None,
    ) -> None:  # fmt: skip
        problem, self.box, self.locations = plan.problem, box, locations
        self.model = Model(problem, plan.reduction, meshed, level.order, plan.numerics.contact_degree)
        control = prescribed(problem).on(plan.reduction)
        self.solver = NewtonSolver(self.model, control, plan.numerics, observer.newton)
        self.extremes = Extremes(self.model)
        attempt, shortest = partial(observer.attempt, name), plan.numerics.shortest_step
        self.path = LoadPath(problem, self.solver, attempt, level.penalty, shortest, plan.path[0])

    def close(self) -> None:
        """Free matrix, factors and vectors (collective)."""
        self.solver.close()
        self.model.close()
        give_back()  # 12 GB after 220 thousand unknowns of order 4

    def enforce(self, record: StepRecord) -> int:
        """Stiffen the contact of an equilibrium with multipliers, `ROUNDS` times; return how often in all (collective).

        Ends when no ball penetrates more than `LARGEST_PENETRATION`. Penalties that were stiff from the start count.
        """
        if not record.augmented:
            return 0
        ahead = round(math.log(self.path.ahead, STIFFER))
        accepted = LARGEST_PENETRATION * np.array([ball.radius for ball in self.model.contact.balls])

        def wanted() -> bool:
            return bool(np.any(self.extremes.penetrations() > accepted))

        return ahead + self.path.stiffen(record, STIFFER, ROUNDS - ahead, wanted)

    def predicted_by(self, snapshot: Snapshot) -> State:
        """Return a snapshot as a state of this model (collective)."""
        values, source = snapshot.at(self.model.fields, self.locations)
        return State(snapshot.fraction, values, tuple(snapshot.approaches), source)

    def snapshot(self, fraction: float) -> Snapshot:
        """Return the present state (collective)."""
        return Snapshot.take(fraction, self.model.fields, self.model.contact.approaches, self.path.source)

    def state(self, fraction: float) -> ContactState:
        """Return the results of the model in its present state (collective)."""
        model = self.model
        forces, areas = model.forces(), contact_areas(model)
        extremes = self.extremes()
        return ContactState(
            fraction=fraction, approach=model.contact.approaches.copy(), normal_force=forces[:, 2],
            tangential_force=in_plane_forces(model, self.box, np.sqrt(areas / math.pi)),
            traction_force=forces[:, :2], contact_area=areas, peak_pressure=extremes[:, 0], peak_excess=extremes[:, 2],
            penetration=extremes[:, 1], mean_gap=model.readings.mean_gaps(),
        )  # fmt: skip


class MeshRun:
    """The problem's model and, if the plan is paired, the small-strain model on the same mesh and order."""

    def __init__(
        self, plan: RunPlan, level: Discretisation, mesh: Path | Meshed, comm: MPI.Comm, observer: Observer, name: str
    ):
        self.plan, self.level, self.comm, self.name = plan, level, comm, name
        box = plan.box(level)
        meshed = mesh_box(box, mesh, comm) if isinstance(mesh, Path) else mesh
        locations = Locations()
        self.own = ModelRun(plan, meshed, box, level, observer, name, locations)
        self.small: ModelRun | None = None
        if plan.is_paired:
            self.small = ModelRun(plan.pair, meshed, box, level, observer, f"{name}, small strain", locations)

    def close(self) -> None:
        """Free the objects of both models (collective)."""
        for run in filter(None, (self.own, self.small)):
            run.close()

    def account(self, records: Sequence[StepRecord], state: ContactState, began: float) -> SolverAccount:
        """Return the cost of ``records``, the load steps since ``began`` [s of `time.monotonic`].

        Collective. Linear solves are counted since the caller last reset the solver's ``effort``.
        """
        model, solver, record, effort = self.own.model, self.own.solver, records[-1], self.own.solver.effort
        reaction, pressed = model.base_reaction(), float(model.part_forces().sum())
        return SolverAccount(
            fraction=record.fraction,
            iterations=sum(each.newton_iterations for each in records),
            tangents=sum(each.tangents for each in records),
            augmentation_iterations=sum(each.augmentation_iterations for each in records),
            augmented=record.augmented, cuts=max(each.cuts for each in records), residual=record.residual,
            tolerance=solver.tolerance,
            penetration=float(state.penetration.max()), force_balance=abs(pressed - reaction) / pressed,
            **vars(self.own.path.distorted()),
            film=self.own.path.film(),
            strain_energy=2 ** len(self.plan.reduction.planes) * model.strain_energy(),
            linear_solver=solver.choice.method,
            linear_iterations=effort.linear_iterations, linear_fallbacks=effort.linear_fallbacks,
            residuals=solver.residuals, seconds=time.monotonic() - began,
        )  # fmt: skip
