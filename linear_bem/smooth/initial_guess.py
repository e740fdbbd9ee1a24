"""The contact problem for separate smooth contacts: start, active balls, refinement in the degree of p^2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from linear_bem.coupled_point_loads import couple, influence
from linear_bem.errors import NotConverged
from linear_bem.indenter import Cone, Punch, Sphere
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.layer.ritz_indentation import estimates
from linear_bem.problem import Ball, Problem
from linear_bem.profiles import curvature, height, is_ball, mean_height
from linear_bem.smooth.many_balls import sweep_zones
from linear_bem.smooth.newton import Nodes, SmoothSolution, solve_zones
from linear_bem.smooth.zone import Zone, exponents

Array = NDArray[np.float64]

ROUGHEST = 1.5
"""Largest contact radius over layer thickness for which p^2 is a polynomial worth computing."""
SHARP = 3.0
"""Contact radius of a cone over the length by which its tip is rounded, tan(slope) R, from which on it has a grid."""
DENSE = 4
"""Up to this number of balls one dense Newton system holds all; more take sweeps."""


@dataclass(frozen=True)
class Start:
    """First guess: which balls touch, their zones, and all approaches [m]."""

    touching: list[int]
    zones: list[Zone]
    approaches: Array


def first_guess(problem: Problem, kernel: LayeredKernel) -> Start:
    """Return ellipses of Hertz's pressure from the coupled point-load estimate.

    A body that is no ball counts as one of the radius that its profile shows over the contact (`_radius_seen`).
    """
    _, mutual = influence(problem, kernel)
    radii = np.array([ball.radius for ball in problem.balls])
    others = [i for i, ball in enumerate(problem.balls) if not is_ball(ball)]

    def relation(d: Array) -> Array:
        return estimates(problem.layer, problem.substrate, radii, "approach", d)[1]

    def inverse(q: Array) -> Array:
        return estimates(problem.layer, problem.substrate, radii, "normal_force", q)[0]

    state = couple(problem, mutual, relation, inverse)
    for _ in range(4 if others else 0):
        depths = state.effective if problem.load.kind == "approach" else state.forces
        kind = "approach" if problem.load.kind == "approach" else "normal_force"
        for i in others:
            if depths[i] > 0.0:
                radii[i] = _radius_seen(problem, problem.balls[i], kind, float(depths[i]))
        state = couple(problem, mutual, relation, inverse)
    touching = [i for i in range(problem.size) if state.forces[i] > 0.0]
    zones = []
    contact_radii = estimates(problem.layer, problem.substrate, radii, "normal_force", state.forces)[2]
    for i in touching:
        force, radius = float(state.forces[i]), float(contact_radii[i])
        if isinstance(problem.balls[i].indenter, Sphere):
            radius = _sphere_radius(radius, problem.balls[i].radius)
        axes, shape = _hertz_axes(problem.balls[i], radius, float(radii[i]))
        peak = 1.5 * force / (np.pi * radius**2 * np.sqrt(np.prod(shape))) * kernel.singular
        zones.append(_hertz_zone(problem.balls[i].position, axes, peak))
    return Start(touching, zones, state.approaches)


def light_touch(ball: Ball, place: tuple[float, float], depth: float) -> Zone:
    """Return Hertz's ellipse of a ball that overlaps the surface by a small depth [m] about a point [m]."""
    radius = float(np.sqrt(ball.radius * depth))
    # p0 = 2 a E* / (pi R), and pressures are in units of pi E*
    return _hertz_zone(place, _hertz_axes(ball, radius, ball.radius)[0], 2.0 * radius / (np.pi**2 * ball.radius))


def _radius_seen(problem: Problem, ball: Ball, kind: str, value: float) -> float:
    """Return R [m] of the paraboloid that is as high at its estimated contact's edge as the ball is on average."""
    low, high = ball.radius * 1e-9, ball.radius * 1e9
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        edge = float(estimates(problem.layer, problem.substrate, np.array([middle]), kind, np.array([value]))[2][0])
        rise = mean_height(ball, edge)
        if not rise > 0.0:
            low = middle
            continue
        low, high = (middle, high) if edge**2 > 2.0 * rise * middle else (low, middle)
    return float(np.sqrt(low * high))


def _hertz_axes(ball: Ball, radius: float, seen: float) -> tuple[Array, Array]:
    """Return the axes (2, 2) [m] of Hertz's ellipse for a mean radius [m], and their lengths over it.

    ``seen`` is the ball's radius of curvature [m] over the contact. The axes go like
    curvature^(-2/3), nearly [Johnson 1985, eq. 4.28].
    """
    bend, turn = np.linalg.eigh(curvature(ball, radius))
    shape = (bend * seen) ** (-2.0 / 3.0)
    return turn * (radius * shape), shape


def _sphere_radius(parabolic: float, radius: float) -> float:
    """Return the contact radius [m] of a sphere where a paraboloid's would be ``parabolic``, at equal approach.

    a artanh(a/R) = a_p^2/R on a half-space [Sneddon 1965, Int. J. Eng. Sci. 3, 47]; always below R.
    """
    wanted, low, high = (parabolic / radius) ** 2, 0.0, 1.0 - 1e-12
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle * np.arctanh(middle) < wanted else (low, middle)
    return min(low, 0.97) * radius


def _hertz_zone(centre: tuple[float, float], axes: Array, peak: float) -> Zone:
    i, j = exponents(2)
    # 1 - xi^2 - eta^2 = -(T2(xi) + T2(eta))/2
    coefficients = np.where((i == 2) | (j == 2), -0.5 * peak**2, 0.0)
    return Zone(np.array(centre, dtype=float), axes, 2, coefficients)


def solve_smooth(
    problem: Problem,
    kernel: LayeredKernel,
    degree: int,
    start: Start | SmoothSolution,
    touching: list[int],
    approaches: Array,
    precision: float,
) -> SmoothSolution:
    """Return the solution at one degree of p^2, from a guess or from another degree's solution.

    ``precision`` is what the iteration stops at: the relative one of forces and approaches for many balls, the last
    relative step of the pressure's coefficients for few (not below 1e-9).
    """
    old = start.zones if isinstance(start, Start) else [n.zone for n in start.nodes]
    if any(_peaked(problem.balls[i], zone) for i, zone in zip(touching, old, strict=True)):
        raise NotConverged(
            "smooth contact: the pressure peaks at a sharp tip or a flat end's edge, which is for a grid"
        )
    zones = [z.reframed(degree) for z in old]
    place = {ball: k for k, ball in enumerate(touching)}
    load = problem.load
    groups: list[tuple[list[int], float]] = []
    if load.kind == "force":
        groups = [([place[i]], load.values[i] * kernel.singular) for i in touching]
    elif load.kind == "total_force":
        groups = [(list(place.values()), load.values[0] * kernel.singular)]
    radius = max(float(np.sqrt(z.jacobian)) for z in zones)
    if radius > ROUGHEST * kernel.thickness:
        raise NotConverged(
            f"smooth contact: contact radius {radius:g} m is {radius / kernel.thickness:.3g} layer thicknesses, "
            f"more than {ROUGHEST:g}"
        )
    shapes = [height(problem.balls[i]) for i in touching]
    if len(touching) > DENSE:
        return sweep_zones(kernel, shapes, zones, approaches[touching], groups, precision, 30 if degree == 2 else 60)
    return solve_zones(kernel, shapes, zones, approaches[touching], groups, max(precision, 1e-9))


def _peaked(ball: Ball, zone: Zone) -> bool:
    """Return whether the pressure peaks within or at the edge of a contact where no polynomial follows it."""
    body = ball.indenter
    if isinstance(body, Cone):
        return float(np.sqrt(zone.jacobian)) > SHARP * np.tan(body.slope) * body.tip_radius
    return isinstance(body, Punch)


def overlap(nodes: tuple[Nodes, ...]) -> bool:
    """Return whether two zones come closer than a twentieth of the smaller one's radius."""
    outlines = [np.array(n.zone.outline(48)) for n in nodes]
    centres = np.array([n.zone.centre for n in nodes])
    reach = np.array([np.max(np.hypot(*(o - c[:, None]))) for o, c in zip(outlines, centres, strict=True)])
    for i in range(len(nodes)):
        for j in range(i):
            if np.hypot(*(centres[i] - centres[j])) > 1.1 * (reach[i] + reach[j]):
                continue
            gap = np.hypot(*(outlines[i][:, :, None] - outlines[j][:, None, :])).min()
            if gap < 0.05 * min(reach[i], reach[j]):
                return True
    return False
