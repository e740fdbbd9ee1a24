"""A certified solution: fields, numbers, and their error estimates."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any

import numpy as np
import scipy

from linear_bem.arrays import Array
from linear_bem.counts import grouped
from linear_bem.error_estimate import Errors
from linear_bem.errors import InvalidProblem, NotConverged
from linear_bem.lifted_balls import Contacts
from linear_bem.problem import Problem
from linear_bem.result import BallResult, Result, Solved
from linear_bem.smooth.contacts import SmoothContacts

VERSIONS = {"numpy": np.__version__, "scipy": scipy.__version__}
CERTIFIED = 1e-3
"""Largest recomputed residual (over approach, peak pressure, load) of an accepted solution."""


def is_certified(contacts: Contacts) -> bool:
    """Return whether all recomputed residuals are at most `CERTIFIED`."""
    return max(contacts.certificate.values()) <= CERTIFIED


def require_certified(contacts: Contacts) -> None:
    """Raise `NotConverged` if a recomputed residual exceeds `CERTIFIED`."""
    if not is_certified(contacts):
        name, worst = max(contacts.certificate.items(), key=lambda item: item[1])
        raise NotConverged(
            f"linear_bem: the recomputed residual {name} is {worst:.1e}, more than {CERTIFIED:g}; press the balls less "
            "deep, or take a thicker layer"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """A certified solution with its error estimates: ``contacts`` gives fields, `result` the numbers.

    In a periodic cell ``contacts`` are those of the balls' images inside it.

    ``tangential_force_error`` [N] per ball: the larger of the change of T with the last refinement and of the
    difference between the mutual formula and the slope integral, whose errors are independent. ``errors`` are those of
    forces, approaches, peak pressures and areas.
    """

    problem: Problem
    contacts: Contacts
    tangential_force_error: Array
    errors: Errors
    notes: tuple[str, ...] = ()
    accuracy: Mapping[str, object] = field(default_factory=dict)
    seconds: float = 0.0

    def pressure(self, x: Array, y: Array) -> Array:
        """Return the contact pressure [Pa], positive in compression, at surface points x, y [m], in their shape."""
        return self.contacts.pressure(x, y)

    def displacement(self, x: Array, y: Array) -> Array:
        """Return the surface displacement [m], positive into the layer, at surface points x, y [m], in their shape."""
        return self.contacts.displacement(x, y)

    def outline(self, ball: int) -> tuple[Array, Array]:
        """Return points x, y [m], each (n,), on the edge of one ball's contact; n = 0 if it does not touch."""
        self.require_ball(ball)
        x, y = self.contacts.outline(ball)
        to_x, to_y = self.problem.positions[ball] - self.contacts.problem.positions[ball]  # to another image
        return x + to_x, y + to_y

    def require_ball(self, ball: int) -> None:
        """Raise `InvalidProblem` for what is no number of a ball."""
        last = self.problem.size - 1
        if not (isinstance(ball, Integral) and 0 <= ball <= last):
            raise InvalidProblem(f"ball: must be a whole number from 0 to {last}, got {ball!r}")

    def __repr__(self) -> str:
        """Return one short line: kind and size of the discretisation, and what `Result` shows."""
        kind = "polynomials" if isinstance(self.contacts, SmoothContacts) else "grids"
        return f"Solution({kind}, {grouped(self.contacts.unknowns)} unknowns: {self.result()!r})"

    def summary(self) -> str:
        """Return the summary of `result`."""
        return self.result().summary()

    def _repr_html_(self) -> str:
        return self.result()._repr_html_()

    def plot(self) -> Any:
        """Return a matplotlib figure: a map of the contact pressure, contacts, and T on every ball as an arrow."""
        from linear_bem.plotting import plan_of_balls  # noqa: PLC0415  (matplotlib, only where something is drawn)

        return plan_of_balls(self.result().balls, self.pressure)

    def result(self) -> Result:
        """Return the numbers in the format that all models share."""
        c, routes = self.contacts, {"mutual": self.contacts.mutual_force, "slope": self.contacts.slope_force}
        error, errors = self.tangential_force_error, self.errors
        balls = ball_results(
            self.problem, c.approaches, c.normal_forces, routes, error, c.peak_pressures, c.contact_areas, errors
        )
        solved = Solved(
            converged=True,
            iterations=c.iterations,
            unknowns=c.unknowns,
            seconds=self.seconds,
            versions=VERSIONS,
            notes=self.notes,
            certificate=c.certificate,
            tolerances=dict.fromkeys(c.certificate, CERTIFIED),
            accuracy=self.accuracy,
        )
        return Result(model="linear_bem", balls=balls, solved=solved)


def ball_results(
    problem: Problem,
    approaches: Array,
    normal_forces: Array,
    routes: Mapping[str, Array],
    error: Array,
    peak_pressures: Array,
    contact_areas: Array,
    errors: Mapping[str, Array],
) -> tuple[BallResult, ...]:
    """Return the results of all balls from arrays with one entry per ball; T is that of the first of ``routes``."""
    out = []
    for i, ball in enumerate(problem.balls):
        forces = {name: (float(t[i, 0]), float(t[i, 1])) for name, t in routes.items()}
        out.append(
            BallResult(
                position=(float(ball.position[0]), float(ball.position[1])),
                radius=float(ball.radius),
                approach=float(approaches[i]),
                normal_force=float(normal_forces[i]),
                tangential_force=next(iter(forces.values())),
                tangential_force_error=float(error[i]),
                peak_pressure=float(peak_pressures[i]),
                contact_area=float(contact_areas[i]),
                tangential_force_routes=forces,
                errors={name: float(values[i]) for name, values in errors.items()},
            )
        )
    return tuple(out)


def solved(solution: object, what: str) -> Solution:
    """Return the solution; raise `InvalidProblem` for objects without fields, such as the result of `solve`."""
    if not isinstance(solution, Solution):
        raise InvalidProblem(f"{what}: needs the fields that solve_contact returns, got {type(solution).__name__}")
    return solution
