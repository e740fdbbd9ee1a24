r"""The point-load law: each ball acts on the others as if its force were concentrated at its axis.

T_i = -sum_j Q_i Q_j K'(L_ij) n_ij, n_ij the unit vector from i to j: positive (attraction) where the surface
descends towards the neighbour. For two equal balls on the paper's layers it is within 1 % of the full model for
L >= 2 R; it costs microseconds once the relation between force and approach of one ball is known.

If approaches are given, forces follow from that relation, computed by `linear_bem.solver.solve` for a single ball, at
the approach minus the point-load displacement by the neighbours (`linear_bem.coupled_point_loads`). The error estimate
is the next terms of the multipole series and an allowance for all later ones: the first moments, as a ball of radius R
on a slope s touches R s aside of its axis, and (a_i^2 + a_j^2)/10 times the Laplacian of K for Hertz's pressure (on
ellipses with semi-axes a > b, at most (a^2 + b^2)/20 times the Laplacian and (a^2 - b^2)/20 times K'' - K'/r per ball).
Unless forces are given, these terms also change the approach that the neighbours leave to a ball, and so its force.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from linear_bem.arguments import require_problem
from linear_bem.arrays import Array
from linear_bem.coupled_point_loads import PointState, couple, distances, estimated_relations
from linear_bem.depth import given_by_base, large_strain_note
from linear_bem.errors import UnsupportedProblem
from linear_bem.indenter import Cone, Punch
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.layer.ritz_indentation import estimates
from linear_bem.problem import Ball, Load, Problem
from linear_bem.profiles import curvature, is_ball
from linear_bem.result import Result, Solved
from linear_bem.solution import VERSIONS, ball_results
from linear_bem.solver import solve_contact

LATER_TERMS = 4.0
"""All later terms of the multipole series over its second one, per (a_i^2 + a_j^2) / L^2.

The full model gives at most 3 on layers of 0.6 R and 1.16 R up to D = 0.3 R and 0.5 R; less on thicker ones.
"""

STEEPEST = 3.0
"""Largest exponent of a ball's force over its approach: that of a thin incompressible layer; 1.5 on a half-space."""

ROUGH = 1e-4
"""Relative roughness of the Ritz estimate's approach, as its table is interpolated linearly; up to 0.95e-4 measured."""

FLAT_END = 5.0 / 3.0
"""Second moment of the pressure under a flat punch over that under a ball (Hertz), of equal force and contact area."""


class _Single:
    """A single ball: the ratio of `solve` to the Ritz estimate, interpolated in the logarithm of the approach.

    Between ``low`` and ``high`` [m]. ``error`` is the relative error of an approach at a given force.
    """

    def __init__(self, problem: Problem, ball: Ball, low: float, high: float) -> None:
        self._problem, self._radius = problem, ball.radius
        middle, half = 0.5 * (np.log(low) + np.log(high)), 0.5 * (np.log(high) - np.log(low))
        count = 1 if half < 1e-3 else 3 if half < 0.7 else 6
        nodes = np.cos((np.arange(count) + 0.5) * np.pi / count)
        self._middle, self._half = middle, max(half, 1e-12)
        forces = self._estimates("approach", np.exp(middle + half * nodes))[1]
        rows, errors = [], []
        for force, approach, radius in zip(forces, *self._estimates("normal_force", forces)[::2], strict=True):
            alone = replace(problem, balls=(replace(ball, position=(0.0, 0.0)),), load=Load("force", (float(force),)))
            b = solve_contact(alone).result().balls[0]
            errors.append(b.errors["approach"] / b.approach)
            area = b.contact_area / (np.pi * radius**2)
            rows.append([np.log(b.approach / approach), np.log(area), b.peak_pressure * radius**2 / force])
        self._fit = np.polynomial.chebyshev.chebfit(nodes, np.array(rows), count - 1)
        # the last two terms bound those left out, but for the estimate's roughness between nodes
        self.error = max(errors) + (float(np.max(np.abs(self._fit[-2:, 0]))) + ROUGH if count > 1 else 0.0)

    def _estimates(self, kind: str, values: Array) -> tuple[Array, Array, Array]:
        return estimates(self._problem.layer, self._problem.substrate, np.full(len(values), self._radius), kind, values)

    def _correction(self, approaches: Array) -> Array:
        z = (np.log(np.maximum(approaches, 1e-300)) - self._middle) / self._half
        return np.asarray(np.polynomial.chebyshev.chebval(np.clip(z, -1.2, 1.2), self._fit))

    def approach(self, forces: Array) -> Array:
        """Return the approaches [m] under forces [N], 0 without force."""
        d = self._estimates("normal_force", forces)[0]
        return np.asarray(d * np.exp(self._correction(d)[0]))

    def force(self, approaches: Array) -> Array:
        """Return the forces [N] at approaches [m], 0 where those are not positive."""
        d = approaches
        for _ in range(3):
            d = approaches / np.exp(self._correction(d)[0])
        return self._estimates("approach", d)[1]

    def area(self, forces: Array) -> Array:
        """Return the contact areas [m^2] under forces [N]."""
        d, _, radii = self._estimates("normal_force", forces)
        return np.asarray(np.pi * radii**2 * np.exp(self._correction(d)[1]))

    def peak(self, forces: Array) -> Array:
        """Return the peak pressures [Pa] under forces [N]."""
        d, _, radii = self._estimates("normal_force", forces)
        return np.asarray(self._correction(d)[2] * forces / np.where(radii > 0.0, radii, 1.0) ** 2)


def solve_point_load(problem: Problem) -> Result:
    """Return the result of the point-load law for any number of balls and any kind of load.

    Each kind of ball (radius and shape) needs 1 to 6 solutions of a single ball; with many kinds these dominate the
    time. Raises `UnsupportedProblem` for finite strain, a periodic cell, cones and punches.
    """
    require_problem(problem)
    problem = problem.without_empty_layer()
    if problem.finite_strain is not None:
        raise UnsupportedProblem("point_load: the effect finite_strain is not part of this model; drop the table")
    if problem.periodic is not None:
        raise UnsupportedProblem("point_load: the effect periodic is not part of this model; use linear_bem")
    sharp = next((b.shape for b in problem.balls if isinstance(b.shape, Cone | Punch)), None)
    if sharp is not None:
        raise UnsupportedProblem(
            f"balls.shape: point_load does not support cones and punches, got {sharp}; use linear_bem"
        )
    begun = time.perf_counter()
    kernel = LayeredKernel.of(problem)
    distance = distances(problem.positions)
    mutual = kernel.displacement(distance)
    state, areas, peaks, doubt = _coupled(problem, mutual)
    force, error = _law(problem, kernel, distance, state, areas, doubt)
    balls = ball_results(problem, state.approaches, state.forces, {"point_load": force}, error, peaks, areas, {})
    seconds = time.perf_counter() - begun
    deepest = int(np.argmax(state.approaches))
    base = given_by_base(problem, deepest, state.forces, areas)
    notes = large_strain_note(problem.layer, float(state.approaches[deepest]), base)
    return Result("point_load", balls, Solved(True, 1, problem.size, seconds, notes=notes, versions=VERSIONS))


def _coupled(problem: Problem, mutual: Array) -> tuple[PointState, Array, Array, Array]:
    """Return the state, contact areas [m^2], peak pressures [Pa] and relative errors of approaches at given forces.

    Balls of one radius and shape share a relation, which holds for the range of their forces.
    """
    radii = np.array([ball.radius for ball in problem.balls])
    rough = couple(problem, mutual, *estimated_relations(problem.layer, problem.substrate, radii)).effective
    kinds: dict[tuple[float, object], list[int]] = {}
    for i, ball in enumerate(problem.balls):
        kinds.setdefault((ball.radius, ball.shape), []).append(i)
    singles: list[_Single] = []

    def of_kinds(values: Array, relation: Callable[[_Single, Array], Array | float]) -> Array:
        out = np.empty(problem.size)
        for members, single in zip(kinds.values(), singles, strict=True):
            out[members] = relation(single, values[members])
        return out

    # unlike a ball's, the force of another body at a given approach may be far from the paraboloid's
    is_known = problem.load.kind == "force" or all(is_ball(ball) for ball in problem.balls)
    for _ in range(1 if is_known else 10):
        singles.clear()
        for members in kinds.values():
            pressed = rough[members][rough[members] > 0.0]
            low, high = (pressed.min(), pressed.max()) if pressed.size else (np.max(rough), np.max(rough))
            singles.append(_Single(problem, problem.balls[members[0]], float(low), float(high)))
        state = couple(problem, mutual, lambda d: of_kinds(d, _Single.force), lambda q: of_kinds(q, _Single.approach))
        before, rough = rough, estimates(problem.layer, problem.substrate, radii, "normal_force", state.forces)[0]
        if np.allclose(rough, before, rtol=1e-3, atol=0.0):
            break
    areas, peaks = (of_kinds(state.forces, of_force) for of_force in (_Single.area, _Single.peak))
    return state, areas, peaks, of_kinds(state.forces, lambda single, _: single.error)


def _law(
    problem: Problem, kernel: LayeredKernel, distance: Array, state: PointState, area: Array, doubt: Array
) -> tuple[Array, Array]:
    """Return T [N] of every ball, shape (balls, 2), and the size of the neglected terms [N].

    ``doubt`` (balls,) are the relative errors of approaches at given forces.
    """
    q, r = state.forces, np.where(np.isfinite(distance), distance, 1.0)
    pull = -kernel.slope(r)
    products = np.outer(q, q)
    np.fill_diagonal(products, 0.0)
    towards = (problem.positions - problem.positions[:, None]) / r[:, :, None]
    force = np.einsum("ij,ijk->ik", products * pull, towards)
    flat = np.array([moments(ball, part) for ball, part in zip(problem.balls, area, strict=True)])
    sloped = on_slopes(flat, q, force)
    error, left = neglected(next_terms(kernel, r), r, pull, sloped[:, None] + sloped)
    if problem.load.kind != "force":
        np.fill_diagonal(left, 0.0)
        share = unsure(left @ q + doubt * state.effective, state.effective)
        error = error + np.abs(pull) * (share[:, None] + share)
    return force, np.sum(products * error, axis=1)


def neglected(terms: Array, r: Array, pull: Array, sums: Array) -> tuple[Array, Array]:
    """Return the neglected parts of T over both forces [1/N] and of the displacement over the force [m/N].

    At distances ``r`` [m]; ``terms`` are the `next_terms` there, ``pull`` is -K' [1/N]; ``sums``, of the shape of ``r``
    and 3, add both contacts' `moments` `on_slopes`.
    """
    mean, apart, shift = np.moveaxis(sums, -1, 0)
    later = 1.0 + LATER_TERMS * (mean + apart) / r**2
    of_pull, of_surface = ((terms[k] * mean + terms[k + 1] * apart) * later / 10.0 for k in (0, 2))
    return of_pull + 0.5 * (terms[2] + terms[3]) * shift, of_surface + np.abs(pull) * shift


def unsure(left: Array, effective: Array) -> Array:
    """Return the relative error of forces, given that of their ``effective`` approaches [m]; 0 without force."""
    return STEEPEST * np.divide(left, effective, out=np.zeros_like(effective), where=effective > 0.0)


def next_terms(kernel: LayeredKernel, r: Array) -> Array:
    """Return the sizes at distances ``r`` [m] that the `moments` multiply, shape 4 and that of r.

    Slopes of K'' + K'/r and K'' - K'/r [1/(N m^2)], and these [1/(N m)]; half of their sum is the larger of K'', K'/r.
    """
    step = 1e-3 * r

    def bent(r: Array) -> Array:
        bend, ratio = (kernel.slope(r + step) - kernel.slope(r - step)) / (2.0 * step), kernel.slope(r) / r
        return np.stack([bend + ratio, bend - ratio])

    return np.abs(np.concatenate([(bent(r + step) - bent(r - step)) / (2.0 * step), bent(r)]))


def on_slopes(flat: Array, normal: Array, tangential: Array) -> Array:
    """Return `moments` (balls, 3) with the shift [m] of each contact on the slope T/Q [N] under it."""
    slope = np.hypot(*tangential.T) / np.where(normal > 0.0, normal, np.inf)
    return np.column_stack([flat[:, :2], flat[:, 2] * slope])


def moments(ball: Ball, area: float) -> tuple[float, float, float]:
    """Return half of the sum and of the difference of a contact's squared semi-axes [m^2], and its shift per slope [m].

    The ratio of the axes is nearly Hertz's; for bodies that are not balls both squares are multiplied by `FLAT_END`.
    """
    square = area / np.pi
    if is_ball(ball) or square == 0.0:
        return square, 0.0, ball.radius
    low, high = np.linalg.eigvalsh(curvature(ball, float(np.sqrt(square))))
    aspect = (high / low) ** (2.0 / 3.0)
    half = 0.5 * FLAT_END * square
    return half * (aspect + 1.0 / aspect), half * (aspect - 1.0 / aspect), 1.0 / low
