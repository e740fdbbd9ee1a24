"""Interpolation between the load steps of a comparison: S_Q, S_D and Q as functions of the approach, with errors.

At small load S - 1 is a power series in x = sqrt(D) and Q is proportional to x^3 (Hertz), so (S - 1) / x and Q / x^3
are smooth and are interpolated by cubic splines through the steps. The error is the sum of two terms: the error of the
two neighbouring steps; and the largest change when one of the four nearest steps is omitted (several times the error
of the spline through all steps), times a factor that falls to 0 at the steps.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from runs.display.numbers import Scale, with_error

DEGREE = 3
POINTS = 41
"""Rows of the table between the first load step and the last."""
COLUMNS = {"normal_force": (0.0, 3), "strengthening_at_force": (1.0, 1), "strengthening_at_approach": (1.0, 1)}
"""Interpolated quantities: value at zero load, and leading power of x in the deviation from it."""
RATIOS = {"strengthening_at_force": "S_Q", "strengthening_at_approach": "S_D"}
OFF = 0.05
"""Deviation of a ratio from 1 whose approach `where_off` looks for."""
ROUNDED = 1e-3
"""Smallest error of that approach over it: the ratio is interpolated linearly between tabulated approaches."""


@dataclass(frozen=True)
class Interpolant:
    """A quantity over the approach D: values and errors (n,) at rising approaches (n,), n >= 2."""

    approaches: np.ndarray
    values: np.ndarray
    errors: np.ndarray
    at_no_load: float = 1.0
    power: int = 1

    def __call__(self, approach: float) -> tuple[float, float]:
        """Return value and error at an approach between the first and the last; raises `ValueError` outside."""
        x, at = np.sqrt(self.approaches), math.sqrt(approach)
        if not x[0] * (1.0 - 1e-9) <= at <= x[-1] * (1.0 + 1e-9):
            raise ValueError(
                f"approach: must lie between {self.approaches[0]:g} and {self.approaches[-1]:g}, got {approach:g}"
            )
        right = int(np.clip(np.searchsorted(x, at), 1, len(x) - 1))
        share = (at - x[right - 1]) / (x[right] - x[right - 1])
        own = (1.0 - share) * self.errors[right - 1] + share * self.errors[right]
        every = np.arange(len(x))
        value, inner = self._spline(every, at), every[max(right - 2, 1) : min(right + 2, len(x) - 1)]
        missed = max((abs(self._spline(every[every != i], at) - value) for i in inner), default=0.0)
        return value, float(own + min(1.0, 16.0 * share * (1.0 - share)) * missed)

    def _spline(self, chosen: np.ndarray, at: float) -> float:
        x = np.sqrt(self.approaches[chosen])
        y = (self.values[chosen] - self.at_no_load) / x**self.power
        spline = make_interp_spline(x, y, k=min(DEGREE, len(x) - 1))
        return float(self.at_no_load + spline(at) * at**self.power)


def interpolants(rows: Sequence[Mapping[str, Any]], ball: int) -> dict[str, Interpolant]:
    """Return an interpolant of every quantity of one ball that at least three load steps have."""
    path = [row for row in rows if row["ball"] == ball and row["approach"] > 0.0]
    found = {}
    for name, (at_no_load, power) in COLUMNS.items():
        known = [row for row in path if row.get(name) is not None and math.isfinite(row[name])]
        if len(known) >= 3 and np.all(np.diff([row["approach"] for row in known]) > 0.0):
            columns = [[row["approach"], row[name], row.get(f"{name}_error") or 0.0] for row in known]
            approaches, values, errors = np.array(columns).T
            found[name] = Interpolant(approaches, values, errors, at_no_load, power)
    return found


def table(rows: Sequence[Mapping[str, Any]], ball: int) -> list[dict[str, float]]:
    """Return rows between the first load step and the last: the ball, its approach, each quantity with its error."""
    curves = interpolants(rows, ball)
    if set(curves) != set(COLUMNS):
        return []
    first = max(curve.approaches[0] for curve in curves.values())
    last = min(curve.approaches[-1] for curve in curves.values())
    answer = []
    for approach in np.linspace(first, last, POINTS):
        row = {"ball": ball, "approach": float(approach)}
        for name, curve in curves.items():
            row[name], row[f"{name}_error"] = curve(float(approach))
        answer.append(row)
    return answer


def where_off(rows: Sequence[Mapping[str, Any]], ball: int, scale: Scale) -> str:
    """Return a sentence on the approaches from which the ratios of a ball differ from 1 by `OFF`; empty if unknown."""
    curves, parts = interpolants(rows, ball), []
    for name, short in RATIOS.items():
        if name in curves:
            curve = curves[name]
            at, error = _first_off(curve)
            first, last = (scale.both(curve.approaches[end]) for end in (0, -1))
            if at is None:
                parts.append(f"{short} {'perhaps ' if error else ''}nowhere up to D = {last}")
            elif at == curve.approaches[0]:
                parts.append(f"{short} already at the first load step (D = {first})")
            else:
                parts.append(f"{short} from D = {with_error(at / scale.radius, error / scale.radius)} R on")
    return f"S differs from 1 by {100 * OFF:.0f} % or more: {', '.join(parts)}." if parts else ""


def _first_off(curve: Interpolant) -> tuple[float | None, float]:
    """Return the first approach [m] at which a ratio is `OFF` from 1, with its error, or None.

    With None the second number is 0 unless the ratio's errors leave open whether it is.
    """
    approaches = np.linspace(curve.approaches[0], curve.approaches[-1], 4 * POINTS)
    values, errors = np.array([curve(float(approach)) for approach in approaches]).T

    def first(off: np.ndarray) -> float | None:
        beyond = np.flatnonzero(off > OFF)
        if not len(beyond):
            return None
        n = max(int(beyond[0]), 1)
        return float(approaches[0] if off[0] > OFF else np.interp(OFF, off[n - 1 : n + 1], approaches[n - 1 : n + 1]))

    early, at, late = (first(np.abs(values - 1.0) + sign * errors) for sign in (1, 0, -1))
    if at is None:
        return None, 0.0 if early is None else math.inf
    assert early is not None  # errors are not negative
    return at, max(at - early, (late or approaches[-1]) - at, ROUNDED * at)
