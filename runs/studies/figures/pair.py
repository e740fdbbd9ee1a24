"""The paper's pair of balls, varied: T over thickness, modulus, distance and kind of load."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev
from scipy.interpolate import Akima1DInterpolator
from scipy.optimize import brentq

from linear_bem import BallResult, Elastic, Problem, solve
from linear_bem.arrays import Array
from runs.scene.scene_file import Scene, read_scene

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "paper_thin_pair_linear.toml"
CURVES = 1e-3
"""Required relative accuracy of T for drawn curves."""


def at_features(quick: bool) -> float:
    """Return the required relative accuracy of T at features (sign changes, extrema)."""
    return CURVES if quick else 1e-5


@cache
def scene() -> Scene:
    """Return the scene of the paper's pair."""
    return read_scene(SCENE)


@dataclass(frozen=True)
class Pair:
    """The scene's pair with some values replaced (None: that of the scene); dimensionless like the scene.

    ``approach`` prescribes the approach of both balls in place of ``force``; ``half_space`` True
    omits the substrate and makes the layer infinitely thick.
    """

    thickness: float | None = None
    distance: float | None = None
    young: float | None = None
    poisson: float | None = None
    ratio: float | None = None
    approach: float | None = None
    half_space: bool = False

    def problem(self) -> Problem:
        """Return the contact problem."""
        base = scene().problem
        given: dict[str, Any] = {key: getattr(self, key) for key in ("thickness", "young", "poisson")}
        layer = replace(base.layer, **{key: value for key, value in given.items() if value is not None})
        substrate = base.substrate
        if substrate is not None and self.ratio is not None:
            substrate = Elastic(layer.young / self.ratio, substrate.poisson)
        if self.half_space:
            layer, substrate = replace(layer, thickness=np.inf), None
        changed = replace(base, layer=layer, substrate=substrate)
        if self.distance is not None:
            changed = changed.at([(-0.5 * self.distance, 0.0), (0.5 * self.distance, 0.0)])
        return changed if self.approach is None else changed.with_load("approach", (self.approach,) * 2)

    def attraction(self, accuracy: float) -> float:
        """Return Tx on the left ball: positive attracts, negative separates."""
        return left_ball(self, accuracy).tangential_force[0]


@cache
def left_ball(pair: Pair, accuracy: float) -> BallResult:
    """Return the state of the left ball: roots and maps ask for some pairs twice."""
    return solve(pair.problem(), accuracy).balls[0]


class Curve:
    """T over one value of the pair: samples for drawing with accuracy `CURVES`, features with ``accuracy``."""

    def __init__(self, vary: Callable[[float], Pair], samples: Sequence[float] | Array, accuracy: float) -> None:
        self.vary, self.accuracy = vary, accuracy
        self.at = np.asarray(samples, dtype=float)
        self.values = np.array([self.drawn(float(x)) for x in self.at])

    def __call__(self, x: float) -> float:
        """Return T to the accuracy of features."""
        return self.vary(x).attraction(self.accuracy)

    def drawn(self, x: float) -> float:
        """Return T to the accuracy of curves."""
        return self.vary(x).attraction(CURVES)

    def sign_changes(self) -> list[float]:
        """Return the roots between samples of opposite sign.

        A root of the drawn curve is found to 1e-6 in log x; a straight line through T 1e-4 to either side then has an
        error of second order, about 1e-8.
        """
        step = 1e-4
        roots = []
        for a, b, u, v in zip(self.at[:-1], self.at[1:], self.values[:-1], self.values[1:], strict=True):
            if u * v < 0.0:
                near = brentq(lambda s: self.drawn(float(np.exp(s))), np.log(a), np.log(b), xtol=1e-6)
                below, above = (self(float(np.exp(near + s))) for s in (-step, step))
                roots.append(float(np.exp(near + step * (below + above) / (below - above))))
        return roots

    def extremum(self, sign: float, where: Any = slice(None), *, exact: bool = True) -> tuple[float, float]:
        """Return place and size of the largest (sign +1) or smallest (-1) value."""
        return extremum(self if exact else self.drawn, self.at[where], self.values[where], sign)


def extremum(function: Callable[[float], float], at: Array, values: Array, sign: float) -> tuple[float, float]:
    """Return place and size of the largest (sign +1) or smallest (-1) value near samples.

    They are those of the polynomial of fifth degree in log x around the best sample.
    """
    best = int(np.argmax(sign * values))
    low, high = np.log(at[max(best - 1, 0)]), np.log(at[min(best + 1, len(at) - 1)])

    def over_best(places: Array) -> Array:
        return np.array([function(float(np.exp(s))) / values[best] for s in places])

    curve = Chebyshev.interpolate(over_best, 5, [low, high])
    turns = [float(z.real) for z in curve.deriv().roots() if abs(z.imag) < 1e-9 and low <= z.real <= high]
    found = max((low, high, *turns), key=lambda s: sign * float(curve(s)) * values[best])
    return float(np.exp(found)), float(curve(found)) * float(values[best])


def line_through(
    at: Sequence[float] | Array, values: Sequence[float] | Array, zeros: Sequence[float], power: float = 0.0
) -> tuple[Array, Array]:
    """Return a dense line through samples and zeros: Akima's curve (little overshoot) of T x^power over log x.

    Points are graded geometrically towards each zero, so that |T| on logarithmic axes goes down to it.
    """
    x = np.concatenate([at, zeros])
    y = np.concatenate([np.asarray(values) * np.asarray(at) ** power, np.zeros(len(zeros))])
    order = np.argsort(x)
    spline = Akima1DInterpolator(np.log(x[order]), y[order])
    near = np.outer(zeros, np.concatenate([1.0 - 10.0 ** -np.arange(1.0, 6.0), 1.0 + 10.0 ** -np.arange(1.0, 6.0)]))
    dense = np.unique(np.concatenate([np.geomspace(min(at), max(at), 800), near.ravel(), zeros]))
    dense = dense[(dense >= min(at)) & (dense <= max(at))]
    return dense, spline(np.log(dense)) / dense**power


def halved(low: float, high: float, times: int, holds: Callable[[float], bool]) -> tuple[float, float]:
    """Return an interval around the value up to which ``holds`` is true, by ``times`` bisections."""
    for _ in range(times):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high
