r"""The point-load law: each ball acts on the others as if its force were concentrated at its axis.

T_i = -sum_j Q_i Q_j K'(L_ij) n_ij, n_ij the unit vector from i to j: positive (attraction) where the surface
descends towards the neighbour. For two equal balls on the paper's layers it is within 1 % of the full model for
L >= 2 R; it costs microseconds once one ball's own relation between force and approach is known.

Where approaches are given the forces come from that relation, taken from `linear_bem` for a single
ball, at the approach less the neighbours' point-load displacement (`linear_bem.coupled_point_loads`). The error
estimate is the next term of the multipole series: the contact's size enters at second order,
(a_i^2 + a_j^2)/10 times the Laplacian of K, for Hertz's pressure; and an allowance for all later ones.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from linear_bem.coupled_point_loads import couple, influence
from linear_bem.errors import UnsupportedProblem
from linear_bem.indenter import Cone, Punch
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.layer.ritz_indentation import indentation_of_layer
from linear_bem.problem import Ball, Load, Problem
from linear_bem.result import BallResult, Result, Solved
from linear_bem.solver import solve

Array = NDArray[np.float64]


LATER_TERMS = 4.0
"""All later terms of the multipole series over its second one, per (a_i^2 + a_j^2) / L^2.

Against the full model 3 at most are found, on layers of 0.6 R and 1.16 R up to D = 0.3 R and 0.5 R; less on thicker
ones.
"""


class _Single:
    """One ball alone: `linear_bem` over the Ritz estimate, interpolated in the logarithm of the approach."""

    def __init__(self, problem: Problem, ball: Ball, low: float, high: float) -> None:
        self._estimate: Callable[..., tuple[float, float, float]] = lambda **given: _estimate(problem, ball, **given)
        middle, half = 0.5 * (np.log(low) + np.log(high)), 0.5 * (np.log(high) - np.log(low))
        count = 1 if half < 1e-3 else 3 if half < 0.7 else 6
        nodes = np.cos((np.arange(count) + 0.5) * np.pi / count)
        self._middle, self._half = middle, max(half, 1e-12)
        rows = []
        for z in nodes:
            force = self._estimate(approach=float(np.exp(middle + half * z)))[1]
            alone = replace(problem, balls=(replace(ball, position=(0.0, 0.0)),), load=Load("force", (force,)))
            b = solve(alone).balls[0]
            d, _, a = self._estimate(normal_force=force)
            rows.append(
                [np.log(b.approach / d), np.log(b.contact_area / (np.pi * a * a)), b.peak_pressure * a * a / force]
            )
        self._fit = np.polynomial.chebyshev.chebfit(nodes, np.array(rows), count - 1)

    def _correction(self, approach: float) -> Array:
        z = np.clip((np.log(approach) - self._middle) / self._half, -1.2, 1.2) if self._half > 1e-3 else 0.0
        return np.asarray(np.polynomial.chebyshev.chebval(z, self._fit))

    def approach(self, force: float) -> float:
        """Return the approach [m] under a force [N]."""
        d = self._estimate(normal_force=force)[0]
        return float(d * np.exp(self._correction(d)[0]))

    def force(self, approach: float) -> float:
        """Return the force [N] at an approach [m]."""
        d = approach
        for _ in range(3):
            d = approach / float(np.exp(self._correction(d)[0]))
        return self._estimate(approach=d)[1]

    def area_and_peak(self, force: float) -> tuple[float, float]:
        """Return contact area [m^2] and peak pressure [Pa] under a force [N]."""
        d, _, a = self._estimate(normal_force=force)
        c = self._correction(d)
        return float(np.pi * a * a * np.exp(c[1])), float(c[2] * force / (a * a))


def _estimate(problem: Problem, ball: Ball, **given: float) -> tuple[float, float, float]:
    s = indentation_of_layer(problem.layer, problem.substrate, ball.radius, **given)
    return s.approach, s.normal_force, s.contact_radius


def solve_point_load(problem: Problem) -> Result:
    """Return the point-load law's answer for any number of balls and any kind of load."""
    problem = problem.without_empty_layer()
    if problem.finite_strain is not None:
        raise UnsupportedProblem("point_load: the effect finite_strain is not part of this model; drop the table")
    sharp = next((b.shape for b in problem.balls if isinstance(b.shape, Cone | Punch)), None)
    if sharp is not None:
        raise UnsupportedProblem(
            f"balls.shape: point_load needs balls whose contact grows as a ball's does, got {sharp}; use linear_bem"
        )
    begun = time.perf_counter()
    kernel = LayeredKernel.of(problem)
    distance, mutual = influence(problem, kernel)
    singles = _singles(problem, mutual)

    def relation(d: Array) -> Array:
        return np.array([s.force(v) if v > 0.0 else 0.0 for s, v in zip(singles, d, strict=True)])

    def inverse(q: Array) -> Array:
        return np.array([s.approach(v) if v > 0.0 else 0.0 for s, v in zip(singles, q, strict=True)])

    state = couple(problem, mutual, relation, inverse)
    q = state.forces
    touch = [s.area_and_peak(v) if v > 0.0 else (0.0, 0.0) for s, v in zip(singles, q, strict=True)]
    area = np.array([a for a, _ in touch])
    force, error = _law(problem, kernel, distance, q, area)
    balls = tuple(
        BallResult(
            position=ball.position,
            radius=ball.radius,
            approach=float(state.approaches[i]),
            normal_force=float(q[i]),
            tangential_force=(float(force[i, 0]), float(force[i, 1])),
            tangential_force_error=float(error[i]),
            peak_pressure=touch[i][1],
            contact_area=touch[i][0],
            tangential_force_routes={"point_load": (float(force[i, 0]), float(force[i, 1]))},
        )
        for i, ball in enumerate(problem.balls)
    )
    solved = Solved(
        True,
        1,
        problem.size,
        time.perf_counter() - begun,
        versions={"numpy": np.__version__, "scipy": scipy.__version__},
    )
    return Result("point_load", balls, solved)


def _singles(problem: Problem, mutual: Array) -> list[_Single]:
    """Return one relation per ball; balls of one radius and shape share it."""

    def relation(d: Array) -> Array:
        return np.array(
            [_estimate(problem, b, approach=v)[1] if v > 0.0 else 0.0 for b, v in zip(problem.balls, d, strict=True)]
        )

    def inverse(q: Array) -> Array:
        return np.array(
            [
                _estimate(problem, b, normal_force=v)[0] if v > 0.0 else 0.0
                for b, v in zip(problem.balls, q, strict=True)
            ]
        )

    rough = couple(problem, mutual, relation, inverse).effective
    kinds: dict[tuple[float, object], list[int]] = {}
    for i, ball in enumerate(problem.balls):
        kinds.setdefault((ball.radius, ball.shape), []).append(i)
    out: dict[int, _Single] = {}
    for members in kinds.values():
        pressed = rough[members][rough[members] > 0.0]
        low, high = (pressed.min(), pressed.max()) if pressed.size else (np.max(rough), np.max(rough))
        shared = _Single(problem, problem.balls[members[0]], float(low), float(high))
        out.update(dict.fromkeys(members, shared))
    return [out[i] for i in range(problem.size)]


def _law(problem: Problem, kernel: LayeredKernel, distance: Array, q: Array, area: Array) -> tuple[Array, Array]:
    """Return T [N] of every ball, shape (balls, 2), and the size of the terms left out."""
    xy = np.array([ball.position for ball in problem.balls], dtype=float)
    force, error = np.zeros((problem.size, 2)), np.zeros(problem.size)
    square = area / np.pi
    for i in range(problem.size):
        j = np.flatnonzero(np.isfinite(distance[i]))
        if j.size == 0:
            continue
        r = distance[i, j]
        towards = (xy[j] - xy[i]) / r[:, None]
        size = q[i] * q[j]
        force[i] = -(size * kernel.slope(r)) @ towards
        e = 1e-3 * r

        def laplacian(r: Array, e: Array = e) -> Array:
            up, down = kernel.slope(r + e), kernel.slope(r - e)
            return np.asarray((up - down) / (2.0 * e) + kernel.slope(r) / r)

        change = (laplacian(r + e) - laplacian(r - e)) / (2.0 * e)
        squares = square[i] + square[j]
        later = 1.0 + LATER_TERMS * squares / r**2
        error[i] = float(np.sum(size * np.abs(change) * squares / 10.0 * later))
    return force, error
