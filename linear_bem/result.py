"""The result of any model, with its accuracy.

The dictionaries of ``to_dict`` are the public JSON format; their numbers are in SI units.
"""

from __future__ import annotations

import html
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from linear_bem.counts import grouped
from linear_bem.errors import InvalidProblem

COLUMNS = ("ball", "x [m]", "y [m]", "D [m]", "Q [N]", "Tx [N]", "Ty [N]", "± [N]", "peak p [Pa]", "area [m²]")
"""Headings of the table of balls in `Result.summary`."""
LONGEST = 20
"""Largest number of balls in that table; of more balls, it shows those with the largest T."""
ROUNDOFF = 1e-9
"""A component of T below this share of it is shown as 0."""
UNRESOLVED = "the state is not resolved"
"""Beginning of a note by `finite_strain`: elements at full load are nearly turned inside out."""
FAINT = "T is too small to be resolved"
"""Beginning of a note by `finite_strain`: at full load the error of a ball's T is above half of the largest T."""


@dataclass(frozen=True)
class BallResult:
    """State of one ball: forces [N] on the ball, lengths [m], pressure [Pa], area [m^2].

    Approach and normal force are positive where the ball is pressed in; ``tangential_force`` is T along x and y.
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
        routes = {k: (v[0], v[1]) for k, v in dict(data.get("tangential_force_routes", {})).items()}
        numbers = {f.name: float(data[f.name]) for f in fields(cls) if f.type in ("float", float)}
        errors = {k: float(v) for k, v in dict(data.get("errors", {})).items()}
        return cls(position=(x, y), tangential_force=(tx, ty), tangential_force_routes=routes, errors=errors, **numbers)


@dataclass(frozen=True)
class Step:
    """One state on the load path; ``record`` holds the solver's report on it."""

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
    accuracy: Mapping[str, Any] = field(default_factory=dict)
    tolerances: Mapping[str, float] = field(default_factory=dict)
    linear_solver: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object, without those fields of some models only that are empty."""
        optional = ("accuracy", "tolerances", "linear_solver")
        return {
            name: dict(value) if isinstance(value, Mapping) else list(value) if isinstance(value, tuple) else value
            for name, value in vars(self).items()
            if value or name not in optional
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Solved:
        """Return the account that ``to_dict`` wrote."""
        return cls(**{**data, "notes": tuple(data.get("notes", ()))})


@dataclass(frozen=True, repr=False)
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

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Result:
        """Return the result that ``to_dict`` wrote; the scene is left out; raises `InvalidProblem`."""
        if not (isinstance(data, Mapping) and {"model", "balls", "solved"} <= data.keys()):
            keys = ", ".join(data) if isinstance(data, Mapping) else type(data).__name__
            raise InvalidProblem(
                f"result: must have the keys model, balls and solved, got {keys or 'none'}; of a comparison take one "
                'model\'s part: Result.from_dict(json.loads(text)["finite"]), or "linear"'
            )
        try:
            balls = tuple(BallResult.from_dict(ball) for ball in data["balls"])
            steps = tuple(Step.from_dict(step) for step in data.get("steps", ()))
            return cls(data["model"], balls, Solved.from_dict(data["solved"]), steps)
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidProblem(
                f"result: must be what Result.to_dict gives, got one in which a key is missing or wrong: {error}"
            ) from error

    def to_json(self, scene: Mapping[str, Any] | None = None) -> str:
        """Return the JSON text; `from_json` gives back the same numbers to the last bit."""
        return json.dumps(self.to_dict(scene), ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str) -> Result:
        """Return the result that `to_json` wrote."""
        try:
            return cls.from_dict(json.loads(text))
        except (TypeError, json.JSONDecodeError) as error:
            said = f"from_json: must be the text that to_json wrote, got {text!r:.60}: {error}"
            raise InvalidProblem(f"{said}; of a file: Result.from_json(Path(file).read_text())") from error

    def __repr__(self) -> str:
        """Return one short line: model, number of balls, the largest T with its error."""
        size, error = max((math.hypot(*b.tangential_force), b.tangential_force_error) for b in self.balls)
        count = f"{len(self.balls)} ball{'s' if len(self.balls) > 1 else ''}"
        return f"Result({self.model}: {count}, largest T {size:.4g} ± {error:.1g} N)"

    def _rows(self) -> list[tuple[str, ...]]:
        order = range(len(self.balls))
        if len(self.balls) > LONGEST:
            largest = sorted(order, key=lambda i: -math.hypot(*self.balls[i].tangential_force))
            order = sorted(largest[:LONGEST])  # type: ignore[assignment]
        return [
            (str(i), *(f"{v:.6g}" for v in (*b.position, b.approach, b.normal_force, *_without_roundoff(b))),
             f"{b.tangential_force_error:.1g}", f"{b.peak_pressure:.5g}", f"{b.contact_area:.5g}")
            for i, b in ((i, self.balls[i]) for i in order)
        ]  # fmt: skip

    def _remarks(self) -> list[str]:
        left = len(self.balls) - LONGEST
        more = [f"{left} more balls; shown are those with the largest T"] if left > 0 else []
        solved = self.solved
        cost = f"{grouped(solved.unknowns)} unknowns, {solved.iterations} iterations, {solved.seconds:.2g} s"
        return [*more, cost, *(f"note: {note}" for note in solved.notes)]

    def summary(self) -> str:
        """Return model, state of the balls (at most `LONGEST`) in SI units, cost and notes as text."""
        rows = [COLUMNS, *self._rows()]
        widths = [max(len(row[k]) for row in rows) for k in range(len(COLUMNS))]
        table = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
        return "\n".join([repr(self), *table, *self._remarks()])

    def _repr_html_(self) -> str:
        """Return `summary` as a table for notebooks."""

        def line(cells: tuple[str, ...], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        body = "".join(line(row, "td") for row in self._rows())
        remarks = "<br>".join(html.escape(remark) for remark in self._remarks())
        return f"<p>{html.escape(repr(self))}</p><table>{line(COLUMNS, 'th')}{body}</table><p>{remarks}</p>"

    def plot(self) -> Any:
        """Return a matplotlib figure: contacts from above, to scale, and T on every ball as an arrow."""
        from linear_bem.plotting import plan_of_balls  # noqa: PLC0415  (matplotlib, only where something is drawn)

        return plan_of_balls(self.balls)


def _without_roundoff(ball: BallResult) -> tuple[float, ...]:
    size = math.hypot(*ball.tangential_force)
    return tuple(0.0 if abs(v) <= ROUNDOFF * size else v for v in ball.tangential_force)
