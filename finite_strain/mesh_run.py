"""One mesh driven along the load path: model, solver, force meter, and the answer at each finished step."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from finite_strain.companion import CAUTIOUS_ORDER, FORCE_RATIO_ORDER, Companion, extrapolated, gain
from finite_strain.forces import ForceMeter
from finite_strain.kinematics import Finite, Kinematics, Small
from finite_strain.loading import LoadPath, StepRecord
from finite_strain.model import Model
from finite_strain.newton import NewtonSolver
from finite_strain.planning import RunPlan
from finite_strain.together import on_root
from linear_bem.result import BallResult, Step
from meshes.box import Box
from meshes.layer import write_layer_mesh


class MeshRun:
    """A model on one mesh with its load path and force meter."""

    def __init__(self, plan: RunPlan, box: Box, mesh_file: Path, comm: MPI.Comm, observer: Any, name: str) -> None:
        self.plan, self.comm, self.name = plan, comm, name
        on_root(comm, lambda: write_layer_mesh(box, mesh_file))
        self.model = Model(plan.problem, plan.reduction, kinematics_of(plan), mesh_file, comm)
        self.solver = NewtonSolver(self.model, lambda i, r: observer.newton({"iteration": i, "residual": r}))
        self.meter = ForceMeter(self.model, box)
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
        forces = self.path.normal_forces()
        domain = self._domain_per_squared_force(forces, self.contact_states())
        self._route_difference = self.meter.traction(self.solver) - domain

    def contact_states(self) -> list[dict[str, float]]:
        """Return penetration, peak pressure, contact area of every model ball, whole balls (collective)."""
        states = []
        for contact, ball in zip(self.model.contacts, self.plan.reduction.balls, strict=True):
            state = contact.extremes(self.model.nodal, self.comm)
            state["contact_area"] *= ball.copies
            states.append(state)
        return states

    def per_squared_force(self, states: list[dict[str, float]]) -> np.ndarray:
        """Return the domain integral's T / Q^2 (balls, 2) [1/N]."""
        return self._domain_per_squared_force(np.array(self.path.history[-1].forces), states)

    def _domain_per_squared_force(self, forces: np.ndarray, states: list[dict[str, float]]) -> np.ndarray:
        radii = [math.sqrt(state["contact_area"] / math.pi) for state in states]
        squared = forces[:, None] ** 2
        return np.divide(self.meter.domain(radii), squared, out=np.zeros((len(forces), 2)), where=squared > 0.0)

    def answer(self, record: StepRecord, earlier: list[Step], companion: Companion) -> Step:
        """Return the finished step with forces, routes and errors for every ball of the scene (collective).

        The mesh error is that of a lower order than the extrapolation's, and the largest (of T / Q^2) on the
        load path so far: where the difference of the two meshes changes its sign it is small by chance.
        """
        states = self.contact_states()
        raw = self.per_squared_force(states)
        coarse = companion.at(record.fraction)
        difference = raw - coarse.per_squared_force
        ratio = raw + gain(FORCE_RATIO_ORDER) * difference
        forces, force_error = extrapolated(np.array(record.normal_forces), coarse.normal_forces)
        approaches, approach_error = extrapolated(np.array(self.path.history[-1].approaches), coarse.approaches)
        squared = forces**2
        size = np.abs(ratio).max(axis=1) * squared
        mesh_error = gain(CAUTIOUS_ORDER) * np.abs(difference).max(axis=1)
        mesh_error = np.max([mesh_error, *(step.record["mesh_error"] for step in earlier)], axis=0)
        routes = np.abs(self._route_difference).max(axis=1)
        error_at_force = squared * (mesh_error + routes) + self.solver.tolerance
        error = error_at_force + 2.0 * size * np.divide(
            force_error, forces, out=np.zeros_like(forces), where=forces > 0
        )
        balls = []
        reduction = self.plan.reduction
        for index, (image, ball) in enumerate(zip(reduction.images, self.plan.problem.balls, strict=True)):
            b = image.model_ball

            def turned(values: np.ndarray, index: int = index, b: int = b) -> tuple[float, float]:
                x, y = squared[b] * values[b]
                return reduction.to_scene(index, (float(x), float(y)))

            balls.append(
                BallResult(
                    position=ball.position,
                    radius=ball.radius,
                    approach=float(approaches[b]),
                    normal_force=float(forces[b]),
                    tangential_force=turned(ratio),
                    tangential_force_error=float(error[b]),
                    peak_pressure=states[b]["peak_pressure"],
                    contact_area=states[b]["contact_area"],
                    tangential_force_routes={
                        "domain": turned(ratio),
                        "traction": turned(ratio + self._route_difference),
                        "domain_main_mesh": turned(raw),
                        "domain_companion_mesh": turned(coarse.per_squared_force),
                    },
                )
            )
        now = time.monotonic()
        whole = 2 ** len(reduction.planes)
        reaction = self.model.base_reaction()
        pressed = sum(f / ball.copies for f, ball in zip(record.normal_forces, reduction.balls, strict=True))
        details = {
            "step": len(earlier) + 1,
            "fraction": record.fraction,
            "iterations": record.newton_iterations,
            "augmentations": record.augmentations,
            "force_iterations": record.force_iterations,
            "cuts": record.cuts,
            "residual": record.residual,
            "penetration": max(s["penetration"] for s in states),
            "open_gap": max(s["open_gap"] for s in states),
            "force_balance": abs(pressed - reaction) / pressed,
            "strain_energy": whole * self.model.strain_energy(),
            "mesh_error": mesh_error.tolist(),
            "normal_force_error": [float(force_error[i.model_ball]) for i in reduction.images],
            "approach_error": [float(approach_error[i.model_ball]) for i in reduction.images],
            "tangential_force_error_at_force": [float(error_at_force[i.model_ball]) for i in reduction.images],
            "seconds": now - self._began,
        }
        self._began = now
        return Step(tuple(balls), details)


def kinematics_of(plan: RunPlan) -> Kinematics:
    """Return the kinematics that the plan's model and the scene's law ask for."""
    if plan.model == "small_strain":
        return Small()
    effect = plan.problem.finite_strain
    return Finite() if effect is None else Finite(effect.law)
