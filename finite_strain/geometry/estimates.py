"""Expected state of a single ball, to size meshes, penalties and first guesses. No result depends on it."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

from linear_bem.closed_forms import Indentation, indentation_of_layer
from linear_bem.dual import height_faults, slope
from linear_bem.errors import InvalidProblem, UnsupportedProblem
from linear_bem.indenter import HeightFunction, Indenter
from linear_bem.problem import Ball, Problem

LEAST_SHARE = 0.1
"""Fraction of the deepest approach below which a ball's own approach no longer sets mesh size and penalty."""
PENETRATION = 1e-2
"""Mean penetration over the approach without multipliers, with which Newton's method finds the contact edge fast."""
PEAK = 1.5
"""Peak over mean contact pressure [Hertz]."""
STIFFENING = 5.0
"""Factor on the penalty when multipliers are added."""
_FARTHEST = 1e3
"""Limit of the search for a profile's width, in approaches plus apex radii."""
_FARTHER = 1.1
"""Factor between the distances from the axis at which a body is compared with its approach."""
_OUTWARD = np.geomspace(1e-9, 1.0, 400)
"""Distances from the axis, over the limit of the search, at which a section may end; the first end counts, as farther
out the height of a wavy body may be anything."""
_EXACT = 2e-12
"""Tolerance of a section's edge, over the approach plus the apex radius."""
_ROUNDS = 4
"""Fixed-point iterations between approach and radius for a prescribed force."""
_AROUND = np.exp(2j * np.pi * np.arange(1024) / 1024)
"""Directions about an axis, as complex numbers of length one."""
_LONG = 1e-6
"""Relative change of a body's height about its axis up to which it counts as round."""


@lru_cache(maxsize=4096)
def radius_seen(indenter: Indenter, approach: float) -> float:
    """Return the radius [m] of the paraboloid with the same section by the undeformed surface at an approach [m]."""

    def cuts(way: complex) -> list[float]:
        """Return half the section's lengths along a direction and across; the body need not be alike on both sides."""
        return [0.5 * sum(section_edge(indenter, approach, side) for side in (w, -w)) for w in (way, 1j * way)]

    found = cuts(1.0)
    heights = _heights_around(indenter, max(found))
    longer = -np.mean(heights * _AROUND**2)
    if abs(longer) > _LONG * np.mean(heights):  # not along x and y, but along the body and across
        found = cuts(cmath.sqrt(longer / abs(longer)))
    return found[0] * found[1] / (2.0 * approach)


def section_edge(indenter: Indenter, depth: float, way: complex, known: float = math.inf) -> float:
    """Return how far [m] a body's section by a plane at a ``depth`` [m] extends from the axis.

    ``way`` is the direction x + iy, a complex number of length one. A section is cut off at ``known`` [m], where it is
    known to end, and where a body with an edge has no height; raises `InvalidProblem` if another one has no end.
    """

    def above(r: float) -> float:
        with np.errstate(all="ignore"):  # a steep body's height may overflow
            height = indenter.height(r * way.real, r * way.imag)
        if isinstance(height, complex) or math.isnan(height):
            raise InvalidProblem(
                f"balls.shape: {type(indenter).__name__}.height must be a real number wherever the layer may touch, "
                f"got {height} at (x, y) = ({r * way.real:.3g}, {r * way.imag:.3g}) m; a body that ends before needs "
                "the property reach"
            )
        return float(height) - depth

    end = min(known, _end(indenter, depth))
    rise, outward = above(end) if end < indenter.reach else math.nan, end * _OUTWARD
    with np.errstate(all="ignore"):
        heights = np.broadcast_to(indenter.height(outward * way.real, outward * way.imag), outward.shape)
    beyond = np.flatnonzero(heights > depth)
    if beyond.size:
        inner = outward[beyond[0] - 1] if beyond[0] else 0.0
        return float(brentq(above, inner, outward[beyond[0]], xtol=_EXACT * (depth + indenter.apex_radius)))
    if end < min(known, indenter.reach):
        raise InvalidProblem(
            f"balls.shape: {type(indenter).__name__}.height must exceed the approach, {depth:.3g} m, far from the "
            f"axis, got {rise + depth:.3g} m at (x, y) = ({end * way.real:.3g}, {end * way.imag:.3g}) m; give a "
            "long body ends that rise, or the property reach"
        )
    return float(outward[~np.isnan(heights)][-1])


def _heights_around(indenter: Indenter, r: float) -> np.ndarray:
    """Return the heights [m] of a body at a distance [m] from its axis in all directions."""
    with np.errstate(all="ignore"):  # of a body that has no height there, which `radius_seen` refuses
        return np.broadcast_to(indenter.height(r * _AROUND.real, r * _AROUND.imag), _AROUND.shape)


def reach_of(indenter: Indenter, approach: float, least: float) -> float:
    """Return a distance [m] from the axis, about ``least`` or more, beyond which a body touches nowhere.

    ``least`` holds for round bodies; a long one may be lower than its ``approach`` [m] farther out.
    """
    r, end = least, _end(indenter, approach)
    while r < end:
        heights = _heights_around(indenter, r)
        if not np.min(heights) < min(approach, (1.0 - _LONG) * np.max(heights)):
            break
        r *= _FARTHER
    return min(r, indenter.reach)


def _end(indenter: Indenter, depth: float) -> float:
    return min(indenter.reach, _FARTHEST * (depth + indenter.apex_radius))


def alone(
    problem: Problem, ball: Ball, *, approach: float | None = None, normal_force: float | None = None
) -> Indentation:
    """Return the state of a single ball at an approach [m] or a force [N], as a paraboloid of radius `radius_seen`.

    Without load, all values are zero.
    """
    layer, substrate, body = problem.layer, problem.substrate, body_of(ball)
    if not (approach or normal_force or 0.0) > 0.0:
        return Indentation(0.0, 0.0, 0.0)
    if approach is not None:
        return indentation_of_layer(layer, substrate, radius_seen(body, approach), approach=approach)
    seen = ball.radius
    for _ in range(_ROUNDS):
        state = indentation_of_layer(layer, substrate, seen, normal_force=normal_force)
        seen = math.sqrt(seen * radius_seen(body, state.approach))
    return indentation_of_layer(layer, substrate, seen, normal_force=normal_force)


def with_expressions(problem: Problem) -> Problem:
    """Return the problem with an `Indenter` for each function f(x, y); raises `UnsupportedProblem` if impossible."""
    balls = tuple(
        ball if isinstance(ball.shape, str | Indenter) else replace(ball, shape=HeightFunction(ball.radius, ball.shape))
        for ball in problem.balls
    )
    if balls == problem.balls:
        return problem
    faults = height_faults(ball.shape for ball in balls)
    if faults:
        raise UnsupportedProblem("\n".join(faults))
    return replace(problem, balls=balls)


def body_of(ball: Ball) -> Indenter:
    """Return the body of a ball; see `with_expressions`."""
    assert isinstance(ball.indenter, Indenter)
    return ball.indenter


def steepest(indenter: Indenter, r: float) -> float:
    """Return the largest slope of a body at a distance [m] from its axis, along x and y, on the sides that it has."""
    with np.errstate(all="ignore"):  # a body may have no height on one side
        slopes = np.hypot(*slope(indenter, r * np.array([1.0, 0.0, -1.0, 0.0]), r * np.array([0.0, 1.0, 0.0, -1.0])))
    return float(np.nanmax(slopes, initial=0.0))


def penalties(problem: Problem, balls: Sequence[Ball], approaches: np.ndarray) -> np.ndarray:
    """Return the penalty (balls,) [Pa/m] at approaches (balls,) [m]: expected mean pressure over mean penetration."""
    depths = np.maximum(approaches, LEAST_SHARE * np.max(approaches))
    return _mean_pressures(problem, balls, depths) / (PENETRATION * depths)


def is_stable(problem: Problem, balls: Sequence[Ball], approaches: np.ndarray) -> bool:
    """Return whether a contact load of fixed direction keeps the surface smooth at approaches (balls,) [m].

    Under a load p per undeformed area by a penalty k, an incompressible half-space of shear modulus mu with surface
    displacements w (normal) and u (along the surface) of wavenumber q has the second variation
    mu q (w^2 + u^2) + k w^2 / 2 - p q u w. It is positive if p < 2 mu; else it is negative at wavenumbers above
    2 mu k / (p^2 - 4 mu^2), which the elements under a deep indenter resolve. A pressure has no such term.
    """
    pressed = np.maximum(approaches, LEAST_SHARE * np.max(approaches))
    return bool(PEAK * np.max(_mean_pressures(problem, balls, pressed)) < 2.0 * problem.layer.shear_modulus)


def _mean_pressures(problem: Problem, balls: Sequence[Ball], approaches: np.ndarray) -> np.ndarray:
    """Return the expected mean pressure (balls,) [Pa] of single balls."""
    states = [alone(problem, ball, approach=float(a)) for ball, a in zip(balls, approaches, strict=True)]
    return np.array([state.normal_force / (math.pi * state.contact_radius**2) for state in states])
