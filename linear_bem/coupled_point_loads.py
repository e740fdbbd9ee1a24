r"""Many balls as point loads: the others act on each ball by their displacement at its axis only.

Ball i is pressed into a surface that the others have already moved by sum_j K(L_ij) Q_j, so its own
relation force(approach) holds at the effective approach d_i = D_i - sum_j K(L_ij) Q_j. With d as the
unknown the equations are semismooth and monotone, and balls with d <= 0 carry no load:

    d_i + sum_j K(L_ij) F_j(d_j) = D_i,     F_j = 0 where d_j <= 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from typing import Protocol

import numpy as np
from scipy.optimize import brentq
from scipy.sparse.linalg import LinearOperator, cg
from scipy.spatial.distance import pdist, squareform

from linear_bem.arrays import Array, Mask
from linear_bem.errors import NotConverged
from linear_bem.far_field.pairs_and_mesh import PointInfluence
from linear_bem.layer.ritz_indentation import estimates
from linear_bem.load_control import deepest
from linear_bem.media import Elastic, Layer
from linear_bem.problem import Problem
from linear_bem.report import Report, silent


class Influence(Protocol):
    """K(L_ij) between balls, 0 on the diagonal, as an operator: a matrix, or near pairs and a mesh."""

    def __matmul__(self, loads: Array, /) -> Array:
        """Return the displacement [m] at every ball from the loads [N] on the others."""
        ...


Relation = Callable[[Array], Array]
"""Forces [N] of balls from effective approaches [m] (0 where those are not positive)."""
DIRECT = 600
"""Number of balls up to which the matrix is formed and factored."""
FEW = 30
"""The same where products with the influence need a mesh."""
RESIDUAL = 1e-10
"""Relative residual of conjugate gradients."""
_NAMED = "rtol" if "rtol" in signature(cg).parameters else "tol"
"""scipy's keyword of that residual: `rtol` since 1.12, `tol` before 1.14."""
INEXACT = 1e-5
"""Relative residual of each linear system: three Newton steps reach 1e-13, with 0.6 of the matrix products of 1e-10."""


@dataclass(frozen=True, eq=False)
class PointState:
    """Effective approaches [m], approaches [m] and normal forces [N] of all balls."""

    effective: Array
    approaches: Array
    forces: Array


def distances(points: Array) -> Array:
    """Return the distances [m] between points, shape (points, 2), with inf on the diagonal (where K is 0)."""
    r = squareform(pdist(points))
    np.fill_diagonal(r, np.inf)
    return r


def estimated_relations(layer: Layer, substrate: Elastic | None, radii: Array) -> tuple[Relation, Relation]:
    """Return the functions force(approach) and approach(force) of isolated paraboloids with these radii [m] (Ritz)."""

    def force(approaches: Array) -> Array:
        return estimates(layer, substrate, radii, "approach", approaches)[1]

    def approach(forces: Array) -> Array:
        return estimates(layer, substrate, radii, "normal_force", forces)[0]

    return force, approach


def couple(
    problem: Problem,
    mutual: Influence,
    relation: Relation,
    inverse: Relation,
    tolerance: float = 1e-13,
    report: Report = silent,
) -> PointState:
    """Return the state of all balls for any kind of load.

    ``mutual`` holds K(L_ij) [m/N], 0 on the diagonal; ``inverse`` returns effective approaches from forces.
    ``tolerance`` bounds the residual over the largest approach; a total force is met to 10 ``tolerance`` (relative).
    ``report`` receives a line per Newton step. Raises `NotConverged`.
    """
    values = np.array(problem.load.values, dtype=float)

    def solved(approaches: Array, start: Array) -> PointState:
        scale = deepest(approaches)

        def with_slope(d: Array) -> tuple[Array, Array]:
            report("coupled point loads")
            force, step = relation(d), np.maximum(1e-6 * np.abs(d), 1e-9 * scale)
            return force, (relation(d + step) - force) / step

        effective = effective_approaches(mutual, with_slope, approaches, start, tolerance)
        return PointState(effective, approaches, relation(effective))

    if problem.load.kind == "force":
        effective = inverse(values)
        return PointState(effective, effective + mutual @ values, values)
    if problem.load.kind == "approach":
        return solved(values, values)
    total = float(values[0])
    equal = np.full(problem.size, total / problem.size)
    start = last = inverse(equal)

    def state(common: float) -> PointState:
        nonlocal last
        found = solved(np.full(problem.size, common), last)
        last = found.effective
        return found

    def excess(common: float) -> float:
        difference = float(np.sum(state(common).forces)) - total
        return difference if abs(difference) > 10.0 * tolerance * total else 0.0

    first = start + mutual @ equal
    lower = upper = float(np.max(first if np.max(first) > 0.0 else start))
    while excess(upper) < 0.0:
        upper *= 2.0
    while excess(lower) > 0.0:
        lower *= 0.5
    return state(brentq(excess, lower, upper, xtol=1e-15 * upper, rtol=max(1e-14, tolerance)))


def effective_approaches(
    mutual: Influence,
    relation: Callable[[Array], tuple[Array, Array]],
    approaches: Array,
    start: Array,
    tolerance: float = 1e-13,
) -> Array:
    """Return the effective approaches [m] under given ones [m], by a damped semismooth Newton method.

    ``relation`` is a `Relation` with the derivatives [N/m]; ``start`` [m] is the first guess; ``tolerance`` bounds the
    residual over the largest approach. Raises `NotConverged`.
    """
    d, scale = start, deepest(approaches)

    def residual(d: Array) -> tuple[Array, Array]:
        force, slope = relation(d)
        return np.asarray(d + mutual @ force - approaches), slope

    r, slope = residual(d)
    norm = np.inf
    for _ in range(100):
        norm = float(np.max(np.abs(r)))
        if norm <= tolerance * scale:
            return d
        # with s = dF/dd the step x of (1 + K s) x = -r is symmetric in y = s x: (1/s + K) y = -r
        active = slope > 0.0
        safe = np.where(active, slope, 1.0)
        loads = solve_coupled(mutual, 1.0 / safe, -r, active, INEXACT)
        move = np.where(active, loads / safe, -r - mutual @ loads)
        length = 1.0
        while True:
            trial = d + length * move
            after, steeper = residual(trial)
            if np.linalg.norm(after) < (1.0 - 1e-4 * length) * np.linalg.norm(r) or length < 1e-6:
                break
            length *= 0.5
        if length < 1e-6:
            if norm <= 1e-9 * scale:
                return d
            break
        d, r, slope = trial, after, steeper
    raise NotConverged(
        f"point loads: the effective approaches did not converge, residual {norm:.1e} m of approach {scale:.1e} m; "
        "press the balls less deep"
    )


def solve_coupled(
    influence: Influence, compliance: Array, right: Array, free: Mask, residual: float = RESIDUAL
) -> Array:
    """Solve (diag(``compliance``) + K) loads = ``right`` at ``free`` balls and return the loads, 0 at the others.

    Large systems are solved by conjugate gradients to ``residual``, relative to ``right``. The matrix is positive
    definite, because any pressures on separate areas store energy. Raises `NotConverged`.
    """
    count = len(right)
    if isinstance(influence, PointInfluence) and count <= DIRECT and influence.mesh is None:
        influence = influence.near.toarray() - influence.own * np.eye(count)
    elif isinstance(influence, PointInfluence) and count <= FEW:
        influence = np.array([influence @ load for load in np.eye(count)])
    if isinstance(influence, np.ndarray) and count <= DIRECT:
        matrix = influence[np.ix_(free, free)] + np.diag(compliance[free])
        out = np.zeros(count)
        out[free] = np.linalg.solve(matrix, right[free])
        return out
    if np.any(compliance[free] <= 0.0):
        raise NotConverged("point loads: a ball's own compliance is not positive; press the balls less deep")
    # symmetric scaling by the compliances makes the diagonal 1
    scale = np.where(free, 1.0 / np.sqrt(np.where(free, compliance, 1.0)), 0.0)
    operator = LinearOperator((count, count), lambda q: q + scale * (influence @ (scale * q)))
    found, failed = cg(operator, scale * right, atol=0.0, maxiter=1000, **{_NAMED: residual})
    if failed:
        raise NotConverged(
            f"point loads: conjugate gradients did not reach a residual of {residual:g}; press the balls less deep"
        )
    return np.asarray(scale * found)
