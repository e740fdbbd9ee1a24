"""The answer at a load step: mesh and distance taken off what the finest mesh says, and what may be left of both.

T / Q^2 is the domain integral's, extrapolated from the meshes, and so is Q where the approach is
prescribed (D where the force is). What the model's end does to first order is then taken off. The error of
T at given force is the root of the sum of squares of two estimates of what T / Q^2 may be off by, since
either alone can be small by chance: the mesh error, estimated more cautiously than the extrapolation and
the largest on the load path so far; and what the traction route differs by, now or (its median) on the path
so far, whichever is more. Two meshes may agree by chance, so the first is not less than what elements such as
those at the contact's edge leave. To it come what is left of the far field, and where the approach is prescribed
the error of Q. The error of Q (of D where the force is prescribed) is the largest share of it that the meshes
differed by on the path so far, again not less than what such elements leave. Where the balls' T do not add up to
zero, as action and reaction must, all errors of T are raised by the share that they do not explain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from finite_strain.companion import MeshRecord
from finite_strain.extent import STIFFENING, scale_of_force
from finite_strain.extrapolation import (
    EDGE_ERROR,
    FILM,
    FORCE_ERROR,
    FORCE_ERROR_ORDER,
    FORCE_EXPONENT,
    INDENTATION_ORDER,
    MOST_CANCELLED,
    MOST_OF_FORCE,
    force_ratio,
    indentation,
)
from finite_strain.far_field import REMAINS, SHIFT_REMAINS, FarField
from finite_strain.planning import RunPlan
from linear_bem.result import BallResult, Step


@dataclass(frozen=True)
class _Distance:
    """What the model's end adds to T / Q^2 (balls, 2), by the factor of Q and the addend to D it takes off."""

    ratio: np.ndarray
    force_factor: np.ndarray
    approach: np.ndarray
    ratio_size: np.ndarray
    """(balls,): the size of the first, bottom and sides added up whatever their signs."""
    shift_size: np.ndarray
    """(balls,): the same of D, over D, where Q follows it."""


class Answer:
    """Turns what the meshes of a run say into answers for the balls of its scene."""

    def __init__(self, plan: RunPlan, far: FarField, coarser: list[MeshRecord], size: float) -> None:
        self.plan, self.far = plan, far
        self.coarser = coarser[::-1][:2]
        """The one or two coarser meshes, finest first."""
        self.sizes = [size, *(record.size for record in self.coarser)]

    def step(
        self, row: dict[str, Any], states: list[dict[str, float]], details: dict[str, Any],
        earlier: list[Step], tolerance: float,
    ) -> Step:  # fmt: skip
        """Return the finished step; ``row``, ``states`` and ``details`` are the finest mesh's, ``earlier`` its steps.

        ``tolerance`` [N] is what the solver leaves open of every force.
        """
        others = [record.at(row["fraction"]) for record in self.coarser]
        raw, routes = np.array(row["per_squared_force"]), np.array(row["route_difference"])
        mesh = force_ratio([raw, *(state.per_squared_force for state in others)], self.sizes)
        ratio = self.sizes[1] / self.sizes[0]
        forces, force_error = indentation(np.array(row["normal_forces"]), others[0].normal_forces, ratio)
        approaches, approach_error = indentation(np.array(row["approaches"]), others[0].approaches, ratio)
        force_change = self._at_least(force_error, forces, earlier, "normal_force")
        approach_change = self._at_least(approach_error, approaches, earlier, "approach")
        kind, growth = self.plan.problem.load.kind, self._growth_at_edge(states)
        edge = EDGE_ERROR * growth**INDENTATION_ORDER
        force_error, approach_error = force_change, approach_change
        if kind == "approach" or (kind == "total_force" and len(forces) > 1):
            force_error = np.maximum(force_error, edge * forces)
        if kind != "approach":
            approach_error = np.maximum(approach_error, edge / FORCE_EXPONENT * np.abs(approaches))
        away = self._distance(forces, approaches)
        forces, approaches = forces * away.force_factor, approaches - away.approach
        squared, value = forces**2, mesh.value - away.ratio
        size = np.abs(value).max(axis=1) * squared
        mesh_error = np.max([mesh.error.max(axis=1), *(s.record["mesh_error"] for s in earlier)], axis=0)
        difference = np.abs(routes).max(axis=1)
        past = [np.array(s.record["route_difference"]) for s in earlier]
        route_error = np.maximum(difference, np.median([*past, difference], axis=0))
        far_error = squared * REMAINS * away.ratio_size
        cancelled = np.clip(self._scale(forces), size, MOST_CANCELLED * size)
        least = np.minimum(FORCE_ERROR * growth**FORCE_ERROR_ORDER, MOST_OF_FORCE) * cancelled
        at_force = np.hypot(np.maximum(squared * mesh_error, least), squared * route_error) + far_error + tolerance
        through_force = 2.0 * size * _share(force_error, forces)
        shift = 2.0 * size * SHIFT_REMAINS * STIFFENING * away.shift_size
        error = np.hypot(at_force, through_force) + shift
        imbalance, doubt = self._imbalance(squared[:, None] * value, error)
        error, at_force = doubt * error, doubt * at_force
        record = {
            "step": len(earlier) + 1,
            **details,
            "mesh_error": mesh_error.tolist(),
            "least_error": self._per_ball(least),
            "imbalance": imbalance,
            "mesh_order": [[None if np.isnan(o) else float(o) for o in orders] for orders in mesh.order],
            "route_difference": difference.tolist(),
            "normal_force_error": self._per_ball(force_error),
            "approach_error": self._per_ball(approach_error),
            "normal_force_change": self._per_ball(force_change),
            "approach_change": self._per_ball(approach_change),
            "far_field_error": self._per_ball(far_error + shift),
            "far_field_correction": self._per_ball(squared * np.abs(away.ratio).max(axis=1)),
            "tangential_force_error_at_force": self._per_ball(at_force),
        }
        named = {
            "domain": value,
            "traction": value + routes,
            "domain_main_mesh": raw,
            "domain_companion_mesh": others[0].per_squared_force,
        }
        reduction, balls = self.plan.reduction, []
        for index, (image, ball) in enumerate(zip(reduction.images, self.plan.problem.balls, strict=True)):
            b = image.model_ball
            turned = {
                name: reduction.to_scene(index, (float(squared[b] * v[b, 0]), float(squared[b] * v[b, 1])))
                for name, v in named.items()
            }
            balls.append(
                BallResult(
                    position=ball.position,
                    radius=ball.radius,
                    approach=float(approaches[b]),
                    normal_force=float(forces[b]),
                    tangential_force=turned["domain"],
                    tangential_force_error=float(error[b]),
                    peak_pressure=states[b]["peak_pressure"],
                    contact_area=states[b]["contact_area"],
                    tangential_force_routes=turned,
                )
            )
        return Step(tuple(balls), record)

    def _imbalance(self, forces: np.ndarray, error: np.ndarray) -> tuple[float, float]:
        """Return the size of the sum of T (balls, 2) [N] over the scene, and by how much it raises all errors (balls,).

        An endless layer is the same everywhere, so the sum is zero: by symmetry in many scenes, by chance in none.
        """
        reduction = self.plan.reduction
        turned = [reduction.to_scene(i, tuple(forces[im.model_ball])) for i, im in enumerate(reduction.images)]
        imbalance, granted = math.hypot(*np.sum(turned, axis=0)), sum(self._per_ball(error))
        return imbalance, math.hypot(1.0, imbalance / granted) if granted > 0.0 else 1.0

    def _scale(self, forces: np.ndarray) -> float:
        """Return what T near its zero is measured against [N], for forces of the model's balls [N]."""
        return scale_of_force(self.plan.problem, np.array(self._per_ball(forces)))

    def _growth_at_edge(self, states: list[dict[str, float]]) -> np.ndarray:
        """Return how element sizes grow with the distance at the contacts' edges (balls,); 0 without contact.

        On a film it is their size over what counts as the contact's radius there.
        """
        assert self.plan.resolution is not None
        resolution = self.plan.resolution.coarser(self.sizes[0])
        radii = [math.sqrt(state["contact_area"] / math.pi) for state in states]
        sizes = [resolution.at_edge(radius, self.plan.smallest_contact) if radius > 0.0 else 0.0 for radius in radii]
        film = FILM * self.plan.problem.layer.thickness
        return np.array([min(s * max(1.0, r / film), 1.0) for s, r in zip(sizes, radii, strict=True)])

    def _at_least(self, error: np.ndarray, values: np.ndarray, earlier: list[Step], name: str) -> np.ndarray:
        """Return what two meshes differ by in Q or D (balls,), raised to the largest share of it at an earlier step."""
        error = error.copy()
        for step in earlier:
            for b, ball in enumerate(self.plan.reduction.balls):
                before = getattr(step.balls[ball.index], name)
                share = step.record[f"{name}_change"][ball.index] / before if before > 0.0 else 0.0
                error[b] = max(error[b], share * values[b])
        return error

    def _per_ball(self, values: np.ndarray) -> list[float]:
        return [float(values[image.model_ball]) for image in self.plan.reduction.images]

    def _distance(self, forces: np.ndarray, approaches: np.ndarray) -> _Distance:
        """Return the first-order effect of the model's end on its balls, for their forces [N] and approaches [m]."""
        reduction, kind = self.plan.reduction, self.plan.problem.load.kind
        everywhere = np.array([forces[image.model_ball] for image in reduction.images])
        own = [ball.index for ball in reduction.balls]
        excess = self.far.tangential_forces(everywhere)[own]
        for b, ball in enumerate(reduction.balls):
            excess[b, list(ball.fixed_axes)] = 0.0
        moved = self.far.approaches(everywhere)[own]
        ratio = np.divide(excess, forces[:, None] ** 2, out=np.zeros_like(excess), where=forces[:, None] > 0.0)
        moved_size, pulls = (part[own] for part in self.far.sizes(everywhere))
        ratio_size = np.divide(pulls, forces**2, out=np.zeros_like(pulls), where=forces > 0.0)
        ratio_size *= [0.0 if len(ball.fixed_axes) == 2 else 1.0 for ball in reduction.balls]
        none = np.zeros_like(forces)
        if kind == "approach":  # the unbounded layer yields more (or less) to the same force: Q follows D
            deeper = np.where(approaches > 0.0, 1.0 + _share(moved, approaches), 1.0)
            factor = np.maximum(deeper, 0.0) ** STIFFENING
            return _Distance(ratio, factor, none, ratio_size, _share(moved_size, approaches))
        if kind == "total_force":
            moved = np.full_like(moved, np.average(moved, weights=forces))
        return _Distance(ratio, np.ones_like(forces), moved, ratio_size, none)


def _share(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Return part over whole, zero where the whole is not positive."""
    return np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0.0)
