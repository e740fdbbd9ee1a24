"""One mesh driven along the load path: model, solver, force meter, and the answer at each finished step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from finite_strain.distortion import smallest_volume_ratio
from finite_strain.forces import ForceMeter
from finite_strain.kinematics import Finite, Kinematics, Small
from finite_strain.loading import LoadPath, StepRecord
from finite_strain.model import Model
from finite_strain.newton import NewtonSolver
from finite_strain.planning import RunPlan
from finite_strain.together import on_root
from finite_strain.traction import TractionRoute
from meshes.box import Box
from meshes.layer import write_layer_mesh


class MeshRun:
    """A model on one mesh with its load path and force meter; ``write`` meshes its box into the file."""

    def __init__(
        self, plan: RunPlan, box: Box, mesh_file: Path, comm: MPI.Comm, observer: Any, name: str,
        write: Callable[[Box, Path], Any] = write_layer_mesh,
    ) -> None:  # fmt: skip
        self.plan, self.comm, self.name = plan, comm, name
        on_root(comm, lambda: write(box, mesh_file))
        self.model = Model(plan.problem, plan.reduction, kinematics_of(plan), mesh_file, comm)
        self.solver = NewtonSolver(self.model, lambda i, r: observer.newton({"iteration": i, "residual": r}))
        self.meter = ForceMeter(self.model, box)
        self.traction = TractionRoute(self.model, self.meter, self.solver)
        self.path = LoadPath(
            plan.problem, self.model, self.solver,
            lambda fraction, cuts: observer.attempt({"mesh": name, "fraction": fraction, "cuts": cuts}),
            self._compare_routes,
        )  # fmt: skip
        self._route_difference = np.zeros((len(plan.reduction.balls), 2))
        self._began = time.monotonic()

    def close(self) -> None:
        """Free matrix, factors and vectors (collective)."""
        self.solver.close()
        self.model.close()

    def _compare_routes(self) -> None:
        """Note by how much traction and domain integral differ, as T / Q^2, before the first augmentation."""
        excess = self.traction.excess(_radii(self.contact_states()))
        squared = self.path.normal_forces()[:, None] ** 2
        self._route_difference = np.divide(excess, squared, out=np.zeros_like(excess), where=squared > 0.0)

    def contact_states(self) -> list[dict[str, float]]:
        """Return penetration, peak pressure, contact area of every model ball, whole balls (collective)."""
        states = []
        for contact, ball in zip(self.model.contacts, self.plan.reduction.balls, strict=True):
            state = contact.extremes(self.model.nodal, self.comm)
            state["contact_area"] *= ball.copies
            # single quadrature points rattle about the pressure; its projection to the vertices does not
            smooth = self.model.project(contact, contact.true_pressure(self.model.nodal))
            state["peak_pressure"] = self.comm.allreduce(float(smooth.max(initial=0.0)), op=MPI.MAX)
            states.append(state)
        return states

    def per_squared_force(self, states: list[dict[str, float]]) -> np.ndarray:
        """Return the domain integral's T / Q^2 (balls, 2) [1/N]."""
        forces = np.array(self.path.history[-1].forces)
        squared = forces[:, None] ** 2
        domain = self.meter.domain(_radii(states))
        return np.divide(domain, squared, out=np.zeros((len(forces), 2)), where=squared > 0.0)

    def row(self, record: StepRecord, states: list[dict[str, float]]) -> dict[str, Any]:
        """Return what this mesh answers at a finished step, as finer meshes compare themselves with it (collective)."""
        return {
            "fraction": record.fraction,
            "per_squared_force": self.per_squared_force(states).tolist(),
            "route_difference": self._route_difference.tolist(),
            "normal_forces": list(record.normal_forces),
            "approaches": list(self.path.history[-1].approaches),
        }

    def details(self, records: Sequence[StepRecord], states: list[dict[str, float]]) -> dict[str, Any]:
        """Return the solver's account of a finished step, the last of those since the last account (collective)."""
        reduction, record = self.plan.reduction, records[-1]
        now, began = time.monotonic(), self._began
        self._began = now
        reaction = self.model.base_reaction()
        pressed = sum(f / ball.copies for f, ball in zip(record.normal_forces, reduction.balls, strict=True))
        return {
            "fraction": record.fraction,
            "iterations": sum(each.newton_iterations for each in records),
            "augmentations": sum(each.augmentations for each in records),
            "force_iterations": sum(each.force_iterations for each in records),
            "route_iterations": self.traction.iterations,
            "route_pinned": self.traction.pinned,
            "cuts": max(each.cuts for each in records),
            "residual": record.residual,
            "penetration": max(s["penetration"] for s in states),
            "open_gap": max(s["open_gap"] for s in states),
            "force_balance": abs(pressed - reaction) / pressed,
            "smallest_volume_ratio": smallest_volume_ratio(self.model.space, self.model.nodal, self.model.comm),
            "strain_energy": 2 ** len(reduction.planes) * self.model.strain_energy(),
            **self.solver.account(),
            "seconds": now - began,
        }


def kinematics_of(plan: RunPlan) -> Kinematics:
    """Return the kinematics that the plan's model and the scene's law ask for."""
    if plan.model == "small_strain":
        return Small()
    effect = plan.problem.finite_strain
    return Finite() if effect is None else Finite(effect.law)


def _radii(states: list[dict[str, float]]) -> list[float]:
    return [math.sqrt(state["contact_area"] / math.pi) for state in states]
