r"""Many balls as point loads: each feels the others' displacement at its axis only.

Ball i is pressed into a surface that the others have already moved by sum_j K(L_ij) Q_j, so its own
relation force(approach) holds at the effective approach d_i = D_i - sum_j K(L_ij) Q_j. With d as the
unknown the equations are semismooth and monotone, and balls with d <= 0 carry no load:

    d_i + sum_j K(L_ij) F_j(d_j) = D_i,     F_j = 0 where d_j <= 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem

Array = NDArray[np.float64]
Relation = Callable[[Array], Array]
"""Forces [N] of balls from effective approaches [m] (0 where those are not positive)."""


@dataclass(frozen=True)
class PointState:
    """Effective approaches [m], approaches [m] and normal forces [N] of all balls."""

    effective: Array
    approaches: Array
    forces: Array


def influence(problem: Problem, kernel: LayeredKernel) -> tuple[Array, Array]:
    """Return distances L_ij [m] (inf on the diagonal) and K(L_ij) [m/N] (0 there)."""
    xy = np.array([ball.position for ball in problem.balls], dtype=float)
    distance = np.hypot(*(xy[:, None, :] - xy[None, :, :]).transpose(2, 0, 1))
    np.fill_diagonal(distance, np.inf)
    mutual = np.zeros_like(distance)
    apart = np.isfinite(distance)
    mutual[apart] = kernel.displacement(distance[apart])
    return distance, mutual


def couple(problem: Problem, mutual: Array, relation: Relation, inverse: Relation) -> PointState:
    """Return the state of all balls for any kind of load; ``inverse`` gives effective approaches from forces."""
    load = problem.load
    values = np.array(load.values, dtype=float)
    if load.kind == "force":
        effective = inverse(values)
        return PointState(effective, effective + mutual @ values, values)
    if load.kind == "approach":
        effective = _effective(mutual, relation, values)
        forces = relation(effective)
        return PointState(effective, values, forces)
    total = float(values[0])
    share = inverse(np.full(problem.size, total / problem.size))
    common = float(np.max(share + mutual @ np.full(problem.size, total / problem.size)))
    lower, upper = 0.0, math.inf
    effective = share
    for _ in range(200):
        effective = _effective(mutual, relation, np.full(problem.size, common), effective)
        force = float(np.sum(relation(effective)))
        if abs(force - total) <= 1e-12 * total:
            break
        lower, upper = (common, upper) if force < total else (lower, common)
        step = common * (1.0 + 1e-4)
        beyond = float(np.sum(relation(_effective(mutual, relation, np.full(problem.size, step), effective))))
        trial = common + (total - force) * (step - common) / (beyond - force) if beyond > force else math.inf
        if not lower < trial < upper:
            trial = 2.0 * common if not np.isfinite(upper) else 0.5 * (lower + upper)
        if abs(trial - common) <= 1e-14 * common:
            break
        common = trial
    return PointState(effective, np.full(problem.size, common), relation(effective))


def _effective(mutual: Array, relation: Relation, approaches: Array, start: Array | None = None) -> Array:
    """Return the effective approaches under given approaches, by a damped semismooth Newton method."""
    d = approaches.copy() if start is None else start.copy()
    scale = float(np.max(np.abs(approaches)))

    def residual(d: Array) -> Array:
        return np.asarray(d + mutual @ relation(d) - approaches)

    r = residual(d)
    norm = math.inf
    for _ in range(100):
        norm = float(np.max(np.abs(r)))
        if norm <= 1e-13 * scale:
            return d
        step = np.maximum(1e-6 * np.abs(d), 1e-9 * scale)
        slope = (relation(d + step) - relation(d)) / step
        move = np.linalg.solve(np.eye(len(d)) + mutual * slope, -r)
        length = 1.0
        while True:
            trial = d + length * move
            after = residual(trial)
            if np.linalg.norm(after) < (1.0 - 1e-4 * length) * np.linalg.norm(r) or length < 1e-6:
                break
            length *= 0.5
        if length < 1e-6:
            if norm <= 1e-9 * scale:
                return d
            break
        d, r = trial, after
    raise NotConverged(
        f"point loads: the effective approaches did not converge, residual {norm:.1e} m of approach {scale:.1e} m"
    )
