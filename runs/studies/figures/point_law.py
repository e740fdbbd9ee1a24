"""The sign of T by the point-load law: a function of L/h and the materials alone.

T/T0 = 1 - rho^2 s'(rho) with rho = L/h, s the smooth part of the layered kernel and T0 the attraction on a half-space
of the layer's material. The law neglects size and shape of the contacts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from linear_bem import Elastic
from linear_bem.arrays import Array
from linear_bem.layer.kernel import smooth_kernel
from linear_bem.layer.response import LayerResponse
from runs.studies.figures.part import Columns

NEAREST, FARTHEST = 0.25, 400.0
"""Range of L/h in which sign changes are sought."""


@dataclass(frozen=True)
class PointLaw:
    """T/T0 over L/h for one pair of materials (nu1, E1/E2, nu2), from a spline through ``count`` quadratures."""

    poisson: float
    ratio: float
    substrate_poisson: float = 0.3
    count: int = 160

    def attraction(self, rho: Array | float) -> Array:
        """Return T/T0 at L/h = ``rho``."""
        y = np.log(np.asarray(rho, dtype=float))
        spline = _spline(self)
        # with f(y) = rho s(rho): rho^2 s' = f' - f
        return np.asarray(1.0 - spline(y, 1) + spline(y))

    def sign_changes(self) -> Array:
        """Return the values of L/h at which T changes sign."""
        spline = _spline(self)
        y = np.linspace(np.log(NEAREST), np.log(FARTHEST), 8 * self.count)
        values = 1.0 - spline(y, 1) + spline(y)
        k = np.flatnonzero(values[:-1] * values[1:] < 0.0)
        share = values[k] / (values[k] - values[k + 1])
        return np.asarray(np.exp(y[k] + share * (y[k + 1] - y[k])))


@lru_cache(maxsize=8)
def _spline(law: PointLaw) -> CubicSpline:
    """Return rho s(rho) over log rho."""
    response = LayerResponse(Elastic(1.0, law.poisson), Elastic(1.0 / law.ratio, law.substrate_poisson))
    y = np.linspace(np.log(NEAREST) - 0.1, np.log(FARTHEST) + 0.1, law.count)
    return CubicSpline(y, smooth_kernel(response, np.exp(y)) * np.exp(y))


def against_solver(
    names: tuple[str, str],
    places: Sequence[tuple[float, float]],
    law: Callable[[float, float], Any],
    full: Callable[[float, float], float],
) -> tuple[dict[str, Any], Columns]:
    """Return the agreement of T/T0 by the law with the full solver at points of a map, as numbers and as a table."""
    checks = [
        {**dict(zip(names, place, strict=True)), "law": float(law(*place)), "full": full(*place)} for place in places
    ]
    numbers = {
        "signs_agree": sum(c["law"] * c["full"] > 0.0 for c in checks),
        "checked": len(checks),
        "largest_difference": max(abs(c["law"] - c["full"]) for c in checks),
        "checks": checks,
    }
    return numbers, {key: [c[key] for c in checks] for key in (*names, "law", "full")}
