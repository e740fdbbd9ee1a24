"""What any model answers, and how well: one shape for all models.

The dictionaries of ``to_dict`` are the public JSON contract; their numbers are SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class BallResult:
    """State of one ball: forces [N] on the ball, lengths [m], pressure [Pa], area [m^2].

    ``tangential_force_error`` is the model's own absolute estimate [N]; ``tangential_force_routes``
    names the values [N] of the independent routes that it was drawn from.
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

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of this ball."""
        return {
            "position": list(self.position),
            "radius": self.radius,
            "approach": self.approach,
            "normal_force": self.normal_force,
            "tangential_force": list(self.tangential_force),
            "tangential_force_error": self.tangential_force_error,
            "peak_pressure": self.peak_pressure,
            "contact_area": self.contact_area,
            "tangential_force_routes": {k: list(v) for k, v in self.tangential_force_routes.items()},
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> BallResult:
        """Return the ball that ``to_dict`` wrote."""
        x, y = data["position"]
        tx, ty = data["tangential_force"]
        routes = {k: (v[0], v[1]) for k, v in data.get("tangential_force_routes", {}).items()}
        plain = {
            k: float(data[k])
            for k in (
                "radius", "approach", "normal_force", "tangential_force_error", "peak_pressure", "contact_area",
            )
        }  # fmt: skip
        return cls(position=(x, y), tangential_force=(tx, ty), tangential_force_routes=routes, **plain)


@dataclass(frozen=True)
class Step:
    """One state on the load path; ``record`` holds the solver's own account of it."""

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
    """How the answer was reached: iterations, size, wall time [s], ranks and library versions.

    ``notes`` are plain sentences the reader must see (accuracy not reached, ...); ``certificate``
    holds recomputed residuals of the returned state, ``tolerances`` what they were held to. ``accuracy``, where a
    model refines, tells what was asked and reached, the meshes used and why it stopped. ``linear_solver`` names what
    solved its linear systems, where that is chosen by their size.
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
        """Return the JSON object of this account."""
        told: dict[str, Any] = {"accuracy": dict(self.accuracy)} if self.accuracy else {}
        told |= {"tolerances": dict(self.tolerances)} if self.tolerances else {}
        told |= {"linear_solver": self.linear_solver} if self.linear_solver else {}
        return {
            "converged": self.converged,
            "iterations": self.iterations,
            "unknowns": self.unknowns,
            "seconds": self.seconds,
            "ranks": self.ranks,
            "versions": dict(self.versions),
            "notes": list(self.notes),
            "certificate": dict(self.certificate),
            **told,
        }


@dataclass(frozen=True)
class Result:
    """A model's answer: the final state of every ball, the load path where there is one, and how it was solved."""

    model: str
    balls: tuple[BallResult, ...]
    solved: Solved
    steps: tuple[Step, ...] = ()

    def to_dict(self, scene: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return the JSON object of the public contract; ``scene`` is the scene as given."""
        return {
            "scene": dict(scene) if scene is not None else None,
            "model": self.model,
            "balls": [b.to_dict() for b in self.balls],
            "steps": [s.to_dict() for s in self.steps],
            "solved": self.solved.to_dict(),
        }
