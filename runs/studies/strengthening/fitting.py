"""Fits of the strengthening factor, S = 1 + c1 x + c2 x^2, weighted by error bars, and the x that collapses curves."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from runs.comparison.interpolant import Interpolant

Row = Mapping[str, Any]
Known = tuple[float, float, float]
"""Measure of the load, factor and its error."""
DEGREES = (2, 3, 4, 5)
SMALL_LOAD = 0.07
"""Largest approach over R of the points that give the slope at zero load."""
VARIABLES: dict[str, Callable[[Row, float], float]] = {
    "sqrt(D/R)": lambda row, h: math.sqrt(row["D"]),
    "D/R": lambda row, h: row["D"],
    "a/R": lambda row, h: row["a"],
    "sqrt(D/h)": lambda row, h: math.sqrt(row["D"] / h),
    "a/h": lambda row, h: row["a"] / h,
    "(Q/E1 R^2)^(1/3)": lambda row, h: row["Q"] ** (1.0 / 3.0),
}
"""Measures x of the load that might collapse the curves, from a row and h/R; all except D/R are ~ sqrt(D)."""


@dataclass(frozen=True)
class Fit:
    """S = 1 + c[0] x + c[1] x^2 + ..., ``errors`` of the coefficients, its range of x, and its largest misfit."""

    variable: str
    coefficients: tuple[float, ...]
    errors: tuple[float, ...]
    least: float
    greatest: float
    misfit: float

    def __call__(self, x: float) -> float:
        """Return S at x."""
        return 1.0 + sum(c * x**power for power, c in enumerate(self.coefficients, start=1))

    def formula(self) -> str:
        """Return the fit as a line to compute by hand."""
        powers = ["x", *(f"x^{n}" for n in range(2, len(self.coefficients) + 1))]
        terms = [f"{c:+.3f} {power}" for c, power in zip(self.coefficients, powers, strict=True)]
        return (
            f"1 {' '.join(terms)}, x = {self.variable} from {self.least:.3g} to {self.greatest:.3g}, "
            f"within {self.misfit:.2g}"
        )


def fit(points: Sequence[Known], variable: str, degree: int) -> Fit | None:
    """Return the weighted fit through (x, S, error); None where there are fewer points than coefficients.

    The errors of the points are bounds, probably of equal sign along a curve rather than independent. So the errors of
    the coefficients come from shifting all points together or each alone, whichever gives more.
    """
    if len(points) < degree:
        return None
    x, s, error = np.array(points).T
    error = np.maximum(error, 1e-6)
    powers = x[:, None] ** np.arange(1, degree + 1)
    solve = np.linalg.pinv(powers / error[:, None]) / error
    coefficients = solve @ (s - 1.0)
    alone = np.sqrt(np.sum((solve * error) ** 2, axis=1))
    together = np.abs(solve @ error)
    misfit = float(np.max(np.abs(1.0 + powers @ coefficients - s)))
    errors = tuple(float(e) for e in np.maximum(alone, together))
    return Fit(variable, tuple(float(c) for c in coefficients), errors, float(x.min()), float(x.max()), misfit)


def simplest(points: Sequence[Known], variable: str) -> Fit | None:
    """Return the fit of the lowest degree, from the second, that passes through all error bars; else of the highest."""
    best = None
    for degree in DEGREES:
        if len(points) <= degree:
            break
        best = fit(points, variable, degree)
        if best is not None and all(abs(best(x) - s) <= error for x, s, error in points):
            break
    return best


def points(rows: Sequence[Row], variable: str, thickness: float) -> list[Known]:
    """Return (x, S_Q, error) of the rows that have a factor."""
    measure = VARIABLES[variable]
    return [(measure(row, thickness), row["S_Q"], row["S_Q_error"]) for row in rows if row["S_Q"] is not None]


def initial_slope(rows: Sequence[Row], variable: str, thickness: float) -> Fit | None:
    """Return the fit of second degree to small loads only: its first coefficient is the slope at zero load."""
    small = [row for row in rows if row["D"] <= SMALL_LOAD]
    return fit(points(small, variable, thickness), variable, 2) if len(small) >= 3 else None


def collapse(curves: Mapping[str, tuple[Sequence[Row], float]]) -> list[Fit]:
    """Return one fit through all curves (rows and thickness, by name) for every measure of the load, best first."""
    together = {x: [point for rows, h in curves.values() for point in points(rows, x, h)] for x in VARIABLES}
    return sorted(_fits(together), key=lambda f: f.misfit)


def best(measures: Mapping[str, Sequence[Known]]) -> Fit | None:
    """Return the fit of lowest degree, and of these the closest, among measures of the load with (x, S, error) each."""
    return min(_fits(measures), key=lambda fit: (len(fit.coefficients), fit.misfit), default=None)


def _fits(measures: Mapping[str, Sequence[Known]]) -> list[Fit]:
    return [found for variable, known in measures.items() if (found := simplest(known, variable)) is not None]


def at_depth(rows: Sequence[Row], depth: float, factor: str = "S_Q", measure: str = "D") -> tuple[float, float] | None:
    """Return factor and error at an approach (or at a force Q), interpolated; None outside the rows.

    A factor without its own error (``geometry``) gets that of the interpolation.
    """
    known = [row for row in rows if row[factor] is not None]
    if len(known) < 2 or not known[0][measure] * (1 - 1e-9) <= depth <= known[-1][measure] * (1 + 1e-9):
        return None
    columns = [[row[measure], row[factor], row.get(f"{factor}_error", 0.0)] for row in known]
    at_no_load, power = (0.0, 3) if factor == "Q" else (1.0, 1)
    loads, values, errors = np.array(columns).T
    return Interpolant(loads, values, errors, at_no_load, power)(depth)


def sign_change(rows: Sequence[Row], key: str) -> float | None:
    """Return the approach over R at which a tangential force changes its sign, interpolated; None where it does not."""
    for before, after in pairwise(rows):
        # T / Q^2 is nearly a straight line in D
        y0, y1 = (row[key] / row["Q"] ** 2 for row in (before, after))
        if y0 * y1 < 0.0:
            return float(before["D"] + (after["D"] - before["D"]) * y0 / (y0 - y1))
    return None
