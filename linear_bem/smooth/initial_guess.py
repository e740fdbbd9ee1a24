"""First guess of separate smooth contacts, and the choice of the solver for them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from linear_bem.arrays import Array
from linear_bem.coupled_point_loads import PointState, Relation, couple, estimated_relations
from linear_bem.errors import NotConverged
from linear_bem.far_field.pairs_and_mesh import FarField, PointInfluence
from linear_bem.indenter import Cone, Punch, Sphere
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.layer.ritz_indentation import estimates
from linear_bem.load_control import deepest, force_groups
from linear_bem.media import Elastic, Layer
from linear_bem.problem import Ball, Problem
from linear_bem.profiles import curvature, height, is_ball, mean_height
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.many_balls import sweep_zones
from linear_bem.smooth.newton import solve_zones
from linear_bem.smooth.polynomials import PARABOLA
from linear_bem.smooth.zone import Zone, stacked

ROUGHEST = 1.5
"""Largest contact radius over layer thickness at which polynomials are used."""
STEEP, POINTED = 0.75, 1.0
"""Contact radius over the sphere's, over a cone's tan(slope) R, above which `is_steep`."""
SHARP = 3.0
"""Largest contact radius of a cone over tan(slope) R, R the radius of its tip, at which polynomials are used."""
DENSE = 4
"""Largest number of balls in one dense Newton system; more balls are solved by sweeps."""
GUESSED = 1e-5
"""Relative residual of the point-load estimate from which solvers start."""
ALONE = 0.5
"""Effective over given approach if the coupled point loads have no solution."""
Media = tuple[Layer, Elastic | None]
"""Layer and substrate."""


@dataclass(frozen=True, eq=False)
class Start:
    """First guess: which balls touch, their zones, and all approaches [m]."""

    problem: Problem
    kernel: LayeredKernel
    touching: tuple[int, ...]
    zones: Zone
    approaches: Array


Guess = Start | SmoothContacts
"""From what a solution starts: a first guess, or the contacts at another degree."""


def first_guess(problem: Problem, kernel: LayeredKernel, report: Report = silent) -> Start:
    """Return ellipses of Hertz's pressure from the coupled point-load estimate.

    A body that is neither a sphere nor a paraboloid is replaced by the paraboloid of `_radii_seen`. ``report`` receives
    a line per step.
    """
    field = FarField.of(kernel, problem.positions, np.zeros(problem.size), GUESSED)
    mutual = PointInfluence(field, problem.positions, kernel.singular)
    media: Media = problem.layer, problem.substrate
    if kernel.cell is not None and kernel.far_ratio > 1.0:
        # images nearly cancel the dent of a soft base: added to the layer's half-space, it cancels exactly
        mutual.own -= kernel.singular * float(kernel.smooth(0.0))
        media = Layer(problem.layer.young, problem.layer.poisson, np.inf), None
    radii = np.array([ball.radius for ball in problem.balls], dtype=float)
    others = [i for i, ball in enumerate(problem.balls) if not is_ball(ball)]
    state = _coupled(problem, mutual, estimated_relations(*media, radii), report)
    for _ in range(4 if others else 0):
        kind, values = "normal_force", state.forces
        if problem.load.kind == "approach":
            kind, values = "approach", state.effective
        pressed = [i for i in others if values[i] > 0.0]
        radii[pressed] = _radii_seen(media, [problem.balls[i] for i in pressed], kind, values[pressed])
        state = _coupled(problem, mutual, estimated_relations(*media, radii), report)
    report("contacts")
    touching, deep = tuple(np.flatnonzero(state.forces > 0.0).tolist()), deepest(state.approaches)
    zones = []
    contact_radii = estimates(problem.layer, problem.substrate, radii, "normal_force", state.forces)[2]
    for i in touching:
        force, radius = float(state.forces[i]), float(contact_radii[i])
        if isinstance(problem.balls[i].indenter, Sphere):
            radius = _sphere_radius(radius, problem.balls[i].radius)
        axes = _within(problem.balls[i], _hertz_axes(problem.balls[i], radius, float(radii[i])), deep)
        peak = 1.5 * force / (np.pi * abs(np.linalg.det(axes))) * kernel.singular
        zones.append(_hertz_zone(problem.balls[i].position, axes, peak))
    return Start(problem, kernel, touching, stacked(zones), state.approaches)


def _coupled(
    problem: Problem, mutual: PointInfluence, relations: tuple[Relation, Relation], report: Report
) -> PointState:
    """Return the coupled point-load estimate of paraboloids of these radii [m].

    Contacts that merge under given approaches have none: the balls would lift each other. `ALONE` then replaces it.
    """
    try:
        return couple(problem, mutual, *relations, GUESSED, report)
    except NotConverged:
        if problem.load.kind != "approach":
            raise
        approaches = np.array(problem.load.values)
        return PointState(ALONE * approaches, approaches, relations[0](ALONE * approaches))


def light_touch(ball: Ball, place: tuple[float, float], depth: float) -> Zone:
    """Return Hertz's ellipse of a ball that overlaps the surface by a small depth [m] about a point [m]."""
    radius = float(np.sqrt(ball.radius * depth))
    # p0 = 2 a E* / (pi R), and pressures are in units of pi E*
    flat = mean_height(ball, radius) < 0.1 * depth  # as under a punch, whose curvature is 0
    axes = radius * np.eye(2) if flat else _hertz_axes(ball, radius, ball.radius)
    return _hertz_zone(place, axes, 2.0 * radius / (np.pi**2 * ball.radius))


def _radii_seen(media: Media, balls: Sequence[Ball], kind: str, values: Array) -> Array:
    """Return the radii R [m] of paraboloids with the mean height of the balls at their estimated contact edges."""
    own = np.array([ball.radius for ball in balls])
    low, high = own * 1e-9, own * 1e9
    for _ in range(40):  # bisection starts near the ball's own size: profiles may overflow far from it
        middle = np.sqrt(low * high)
        edges = estimates(*media, middle, kind, values)[2]
        heights = np.array([mean_height(ball, float(edge)) for ball, edge in zip(balls, edges, strict=True)])
        flatter = 2.0 * heights * middle >= edges**2
        low, high = np.where(flatter, low, middle), np.where(flatter, middle, high)
    return np.asarray(np.sqrt(low * high))


def _hertz_axes(ball: Ball, radius: float, seen: float) -> Array:
    """Return the axes (2, 2) [m] of Hertz's ellipse for a mean radius [m].

    ``seen`` is the ball's radius of curvature [m] over the contact. The axes scale nearly with
    curvature^(-2/3) [Johnson 1985, eq. 4.28]. Of a ball, and within a flat end, they are those of a circle.
    """
    if is_ball(ball) or mean_height(ball, radius) == 0.0:
        return radius * np.eye(2)
    bend, turn = np.linalg.eigh(curvature(ball, radius))
    return np.asarray(turn * (radius * (bend * seen) ** (-2.0 / 3.0)))


def _within(ball: Ball, axes: Array, depth: float) -> Array:
    """Return the axes (2, 2) [m], cut to where the body is lower than twice the ``depth`` [m]: no contact is longer."""
    if is_ball(ball):
        return axes  # as short already
    share = np.geomspace(1.0, 1e-3, 100)
    x, y = np.array(ball.position)[:, None, None] + axes[:, :, None] * share
    return np.asarray(axes * share[np.argmax(height(ball)(x, y) < 2.0 * depth, axis=1)])


def _sphere_radius(parabolic: float, radius: float) -> float:
    """Return the contact radius a [m] of a sphere from that of a paraboloid at equal approach, at most 0.97 R.

    a artanh(a/R) = a_p^2/R on a half-space [Sneddon 1965, Int. J. Eng. Sci. 3, 47].
    """
    wanted = (parabolic / radius) ** 2
    if wanted > 0.97 * np.arctanh(0.97):
        return 0.97 * radius
    return float(brentq(lambda a: a * np.arctanh(a) - wanted, 0.0, 0.97, xtol=1e-16)) * radius


def _hertz_zone(centre: tuple[float, float], axes: Array, peak: float) -> Zone:
    return Zone(np.array(centre, dtype=float), axes, 2, peak**2 * PARABOLA)


def solve_smooth(
    start: Guess, degree: int, precision: float, pair_precision: float | None, report: Report
) -> SmoothContacts:
    """Return the contacts of the balls that touch in ``start``, at one degree of p^2.

    ``precision`` bounds the last relative change of forces and approaches in sweeps (more than `DENSE` balls), else the
    last relative step of the pressure's coefficients (not below 1e-9). ``pair_precision`` and ``report`` go to
    `sweep_zones`. Raises `NotConverged`.
    """
    problem, kernel, touching = start.problem, start.kernel, list(start.touching)
    if any(_peaked(problem.balls[i], zone) for i, zone in zip(touching, start.zones, strict=True)):
        raise NotConverged(
            "smooth contact: the pressure peaks at a sharp tip or at the edge of a flat end; round it off"
        )
    zones = start.zones.reframed(degree)
    seldom(report)(f"degree {degree}: {len(zones)} contacts")
    groups = force_groups(problem.load, touching, kernel.singular)
    radius = float(np.max(zones.radius))
    if radius > ROUGHEST * kernel.thickness:
        raise NotConverged(
            f"smooth contact: contact radius {radius:g} m is {radius / kernel.thickness:.3g} layer thicknesses, "
            f"more than {ROUGHEST:g}; press the balls less deep"
        )
    shapes, approaches = [height(problem.balls[i]) for i in touching], start.approaches.copy()
    given = kernel, shapes, zones, approaches[touching], groups
    if len(touching) > DENSE or kernel.cell is not None:
        smooth = sweep_zones(*given, precision, pair_precision, report)
    else:
        smooth = solve_zones(*given, max(precision, 1e-9))
    approaches[touching] = smooth.approaches
    if problem.load.kind == "total_force":
        approaches[:] = smooth.approaches[0]
    return SmoothContacts(problem, kernel, start.touching, smooth, approaches, pair_precision or precision, report)


def _peaked(ball: Ball, zone: Zone) -> bool:
    """Return whether the pressure has a peak that no polynomial represents: at a cone's tip or at a punch's edge."""
    body = ball.indenter
    if isinstance(body, Cone):
        return zone.radius > SHARP * np.tan(body.slope) * body.tip_radius
    return isinstance(body, Punch)


def overlap(kernel: LayeredKernel, zones: Zone) -> bool:
    """Return whether two zones, or their images, come closer than a twentieth of the smaller one's radius."""
    outlines = np.stack(zones.outline(48), axis=1)
    reach = np.max(np.hypot(*(outlines - zones.centre[:, :, None]).transpose(1, 0, 2)), axis=1)
    widest = 2.2 * float(np.max(reach))
    if kernel.cell is None:
        first, second = cKDTree(zones.centre).query_pairs(widest, output_type="ndarray").T
        shifts = np.zeros((len(first), 2))
    else:
        first, second, shifts = kernel.cell.pairs(zones.centre, widest)
    for i, j, shift in zip(first, second, shifts, strict=True):
        if np.hypot(*(zones.centre[i] - zones.centre[j] - shift)) > 1.1 * (reach[i] + reach[j]):
            continue
        gap = np.hypot(*(outlines[i][:, :, None] - outlines[j][:, None, :] - shift[:, None, None])).min()
        if gap < 0.05 * min(reach[i], reach[j]):
            return True
    return False


def is_steep(guess: Start) -> bool:
    """Return whether a contact comes close to the equator of its sphere, or is wide against the tip of its cone.

    The profiles are singular at r = R, and at r = i tan(slope) R: polynomials then converge slowly.
    """
    for i, zone in zip(guess.touching, guess.zones, strict=True):
        ball = guess.problem.balls[i]
        if isinstance(ball.indenter, Sphere) and zone.radius > STEEP * ball.radius:
            return True
        if isinstance(ball.indenter, Cone) and zone.radius > POINTED * math.tan(ball.indenter.slope) * ball.radius:
            return True
    return False
