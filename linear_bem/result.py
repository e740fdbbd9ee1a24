"""The result of any model, with its accuracy.

The dictionaries of ``to_dict`` are the public JSON format; their numbers are in SI units.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class BallResult:
    """State of one ball: forces [N] on the ball, lengths [m], pressure [Pa], area [m^2].

    ``tangential_force_error`` is the model's absolute error estimate [N]; ``tangential_force_routes`` holds T [N] by
    each of the independent formulas that the estimate is based on. ``errors`` holds absolute error estimates of the
    other quantities by their names, "normal_force", "approach", "peak_pressure", "contact_area", where the model has
    them.
    """

    position: tuple[float, float]
    radius: float
    approach: float
    normal_force: float
    tangential_force: tuple[float, float]
    tangential_force_error: float
    peak_pressure: float
    contact_area: float
    tangential_force_routes: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    errors: Mapping[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of this ball; ``errors`` only where the model has them."""
        data = {
            **vars(self),
            "position": list(self.position),
            "tangential_force": list(self.tangential_force),
            "tangential_force_routes": {k: list(v) for k, v in self.tangential_force_routes.items()},
            "errors": dict(self.errors),
        }
        return data if self.errors else {k: v for k, v in data.items() if k != "errors"}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> BallResult:
        """Return the ball that ``to_dict`` wrote."""
        x, y = data["position"]
        tx, ty = data["tangential_force"]
        routes = {k: (v[0], v[1]) for k, v in data.get("tangential_force_routes", {}).items()}
        numbers = {f.name: float(data[f.name]) for f in fields(cls) if f.type == "float"}
        errors = {k: float(v) for k, v in data.get("errors", {}).items()}
        return cls(position=(x, y), tangential_force=(tx, ty), tangential_force_routes=routes, errors=errors, **numbers)


@dataclass(frozen=True)
class Step:
    """One state on the load path; ``record`` holds what the solver reports of it."""

    balls: tuple[BallResult, ...]
    record: Mapping[str, Any] = field(default_factory=dict)

    @property
    def approach(self) -> float | list[float]:
        """The common approach [m], or one per ball where they differ."""
        values = [ball.approach for ball in self.balls]
        return values[0] if max(values) - min(values) <= 1e-14 * max(map(abs, values)) else values

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of this step."""
        return {"approach": self.approach, "balls": [b.to_dict() for b in self.balls], "record": dict(self.record)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Step:
        """Return the step that ``to_dict`` wrote."""
        return cls(tuple(BallResult.from_dict(b) for b in data["balls"]), dict(data.get("record", {})))


@dataclass(frozen=True)
class Solved:
    """How the result was computed: iterations, unknowns, wall time [s], ranks and library versions.

    ``notes`` are sentences that the user must see (accuracy not reached, ...). ``certificate`` holds recomputed
    residuals of the returned state, ``tolerances`` their limits. Where a model refines, ``accuracy`` holds the
    requested and the reached accuracy, the meshes and the reason to stop. ``linear_solver`` names the solver of the
    linear systems, where that depends on their size.
    """

    converged: bool
    iterations: int
    unknowns: int
    seconds: float
    ranks: int = 1
    versions: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    certificate: Mapping[str, float] = field(default_factory=dict)
    tolerances: Mapping[str, float] = field(default_factory=dict)
    accuracy: Mapping[str, Any] = field(default_factory=dict)
    linear_solver: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object; entries that a model leaves empty are left out."""
        present = {
            "accuracy": dict(self.accuracy),
            "tolerances": dict(self.tolerances),
            "linear_solver": self.linear_solver,
        }
        return {
            "converged": self.converged,
            "iterations": self.iterations,
            "unknowns": self.unknowns,
            "seconds": self.seconds,
            "ranks": self.ranks,
            "versions": dict(self.versions),
            "notes": list(self.notes),
            "certificate": dict(self.certificate),
            **{name: value for name, value in present.items() if value},
        }


@dataclass(frozen=True)
class Result:
    """A model's result: the final state of every ball, the load path if there is one, and how it was solved."""

    model: str
    balls: tuple[BallResult, ...]
    solved: Solved
    steps: tuple[Step, ...] = ()

    def to_dict(self, scene: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return the JSON object; ``scene`` is the scene as given."""
        return {
            "scene": dict(scene) if scene is not None else None,
            "model": self.model,
            "balls": [b.to_dict() for b in self.balls],
            "steps": [s.to_dict() for s in self.steps],
            "solved": self.solved.to_dict(),
        }
