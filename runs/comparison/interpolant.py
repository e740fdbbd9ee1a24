"""Interpolation between the load steps of a comparison: S_Q, S_D and Q as functions of the approach, with errors.

At small load S - 1 is a power series in x = sqrt(D) and Q is proportional to x^3 (Hertz), so (S - 1) / x and Q / x^3
are smooth and are interpolated by cubic splines through the steps. The error is the sum of two terms: the error of the
two neighbouring steps (of Q also that of the approach times dQ / dD); and the largest change when one of the four
nearest steps is omitted (several times the error of the spline through all steps), times a factor that falls to 0 at
the steps.
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
"""Deviation of a ratio from 1 whose approach `leaves_one` looks for."""
ROUNDED = 1e-3
"""Smallest error of that approach over it: the ratio is interpolated linearly between tabulated approaches."""


@dataclass(frozen=True, eq=False)
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
            keys = "approach", name, f"{name}_error", "approach_error"
            approaches, values, errors, apart = np.array([[row.get(key) or 0.0 for key in keys] for row in known]).T
            if name == "normal_force":  # under forces it is known, but at which approach is not
                errors = errors + apart * np.abs(np.gradient(values, approaches, edge_order=2))
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


def leaves_one(rows: Sequence[Mapping[str, Any]], ball: int, scale: Scale, of_ball: str = "") -> str:
    """Return a sentence on the approaches at which the ratios of a ball leave 1 by `OFF`; empty if unknown."""
    curves = interpolants(rows, ball)
    parts = [f"{short} {_leaving(curves[name], scale)}" for name, short in RATIOS.items() if name in curves]
    return f"S{of_ball} leaves 1 \u00b1 {OFF:g}: {', '.join(parts)}." if parts else ""


def _leaving(curve: Interpolant, scale: Scale) -> str:
    """Return where a ratio leaves 1 by `OFF` first, and where it returns."""
    approaches = np.linspace(curve.approaches[0], curve.approaches[-1], 4 * POINTS)
    values, errors = np.array([curve(float(approach)) for approach in approaches]).T
    off, errors = np.abs(values - 1.0), np.nan_to_num(errors, nan=1e300)

    def first(excess: np.ndarray) -> float | None:
        """Return the approach at which an excess over `OFF` first passes zero from below."""
        beyond = np.flatnonzero(excess > 0.0)
        if not len(beyond):
            return None
        n = int(beyond[0])
        at = np.interp(0.0, excess[n - 1 : n + 1], approaches[n - 1 : n + 1]) if n else approaches[0]
        return float(at)

    early, at, late = (first(off + sign * errors - OFF) for sign in (1.0, 0.0, -1.0))
    start, end = (scale.both(approaches[i]) for i in (0, -1))
    if at is None:
        return f"{'perhaps' if early is not None else 'nowhere'} up to D = {end}"
    back = first(np.where(approaches > at, OFF - off, -1.0))
    returns = "" if back is None else f" (it returns at D = {scale.both(back)})"
    if at == approaches[0]:
        return f"{'' if late == at else 'perhaps '}before the first load step, D = {start}{returns}"
    if early in (None, approaches[0]) or late is None:
        return f"perhaps at D = {scale.both(at)}{returns}"
    unit, error = scale.units.length, max(at - early, late - at, ROUNDED * at)
    return f"at D = {with_error(at / unit.size, error / unit.size)} {unit.name}{returns}"
