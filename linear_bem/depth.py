"""How deep balls may be pressed: loads that are refused, and notes where small strain does not hold."""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from linear_bem.arrays import Array, Mask
from linear_bem.layer.ritz_indentation import estimates
from linear_bem.media import Elastic, Layer, SurfaceResponse
from linear_bem.problem import Problem
from linear_bem.profiles import is_ball
from linear_bem.touching import to_nearest, wrapped

LINEAR_UP_TO = 0.25
"""Approach over the layer's thickness above which a note is given, if only the layer is deformed.

At 0.28 (0.43) finite strain makes T of touching balls 1.28 (1.78) times as large for nu = 0.48, h = 1.16 R; for
nu = 0.4 it has the other sign at 0.43 (study `strengthening`).
"""
COMPARED_UP_TO = 1.2
"""Approach over a sphere's radius up to which T is compared with finite strain (study `strengthening`, foam)."""
UNSURE = 0.25
"""Relative error of `dent`. If the layer takes a smaller share of the approach than this, no note is given."""
LARGE_STRAIN, MEANINGLESS = "the largest approach is", "deeper than layer and base can give"
"""First words of the note on large strains, and its words on approaches that layer and base cannot give."""
BETWEEN = "forces between balls"
"""What finite strain may change, in the note on large strains."""
OVERLAP = 0.01
"""Overlap of two pressed balls over the smaller radius from which a note names it."""
THROUGH = 2.0
"""Approach of a single ball over the thickness of a layer on a rigid base from which a force is refused. At finite
strain, forces that press to 0.87 of the thickness give 1.03 to 1.35 of it here (neo-Hookean layers of 0.6 and 1 R,
nu = 0 to 0.49)."""
ABSURD = 100.0
"""Approach of a round ball over its radius from which a load is refused."""
CHECK_UNITS = "check the load and its unit (bare numbers are in metres and newtons)"


def depth_faults(problem: Problem) -> list[str]:
    """Return the fault of a load that presses through a layer on a rigid base, or a round ball absurdly deep.

    Under forces the approaches of single round balls are estimated. Approaches that result from forces, or from the
    extrapolation of a pair table, may exceed the layer's thickness: `large_strain_note` says so.
    """
    is_round = np.array([is_ball(ball) for ball in problem.balls])
    radii = np.array([ball.radius for ball in problem.balls])
    kind = problem.load.kind
    if isinstance(problem.layer, SurfaceResponse) or (kind != "approach" and not is_round.any()):
        return []
    if kind == "total_force" and not is_round.all():
        return []
    found = _of_approaches if kind == "approach" else _of_forces
    return found(problem, radii, is_round)


def _of_approaches(problem: Problem, radii: Array, is_round: Mask) -> list[str]:
    h, depths = problem.layer.thickness, np.array(problem.load.values)
    ball = int(np.argmax(depths))
    if problem.substrate is None and depths[ball] >= h > 0.0:
        return [
            f"load.approach[{ball}]: must be less than the thickness of a layer on a rigid base, {h:g} m, got "
            f"{depths[ball]:g} m; reduce the approach, or add the elastic substrate"
        ]
    return [
        f"load.approach[{ball}]: must be less than {ABSURD:g} times the ball's radius, {radii[ball]:g} m, got "
        f"{depths[ball]:g} m; check its unit"
        for ball in np.flatnonzero(is_round & (depths >= ABSURD * radii))[:1]
    ]


def _of_forces(problem: Problem, radii: Array, is_round: Mask) -> list[str]:
    h, load = problem.layer.thickness, problem.load
    rigid = problem.substrate is None and h < math.inf
    depths = np.where(is_round, _expected(problem, radii), 0.0)
    deepest, lost = int(np.argmax(depths)), int(np.argmax(depths / radii))
    if rigid and depths[deepest] >= THROUGH * h:
        ball, limit = deepest, f"{THROUGH:g} times the thickness of the layer on a rigid base, {h:g} m"
    elif depths[lost] >= ABSURD * radii[lost]:
        ball, limit = lost, f"{ABSURD:g} times its radius, {radii[lost]:g} m"
    else:
        return []
    total = load.kind == "total_force"
    where, value = (f"load.{load.kind}", load.values[0]) if total else (f"load.force[{ball}]", load.values[ball])
    young = f"the layer's young ({problem.layer.young:g} Pa)"
    return [
        f"{where}: must press a ball less deep than {limit}, got {value:g} N, under which ball {ball} is pressed about "
        f"{depths[ball]:.2g} m deep; check the units of {load.kind} and of {young}"
        + (", or add the elastic substrate" if rigid else "")
    ]


def _expected(problem: Problem, radii: Array) -> Array:
    """Return the approach (balls,) [m] of single balls under given forces."""
    layer, base, values = problem.layer, problem.substrate, np.array(problem.load.values)
    forces = np.broadcast_to(values / (radii.size / values.size), radii.shape)
    depths = estimates(layer, base, radii, "normal_force", forces)[0]
    if problem.load.kind == "total_force" and depths.min() < depths.max():  # one approach, whose forces add up

        def excess(approach: float) -> float:
            return float(
                np.sum(estimates(layer, base, radii, "approach", np.full(radii.shape, approach))[1]) - values[0]
            )

        depths = np.full(radii.shape, brentq(excess, depths.min(), depths.max()))
    return depths


def dent(substrate: Elastic | None, thickness: float, force: float, contact_area: float) -> float:
    """Return about how deep [m] a substrate is dented under a layer: Hertz's dent of a force [N], spread by the layer.

    The contact [m^2] is taken to be at least as wide as the layer is thick [m].
    """
    if substrate is None or not math.isfinite(thickness):
        return 0.0
    return 0.75 * force / (substrate.contact_modulus * max(math.sqrt(contact_area / math.pi), thickness))


def given_by_base(problem: Problem, ball: int, forces: Array, contact_areas: Array) -> float:
    """Return about how deep [m] the substrate is dented under a ball, by its own force and by the others'.

    Given the forces [N] and contact areas [m^2] of all balls (balls,).
    """
    own = dent(problem.substrate, problem.layer.thickness, float(forces[ball]), float(contact_areas[ball]))
    return own + given_by_others(problem, ball, forces)


def given_by_others(problem: Problem, ball: int, forces: Array) -> float:
    """Return about how deep [m] the substrate is dented under a ball by the forces [N] of the others."""
    substrate, h = problem.substrate, problem.layer.thickness
    if substrate is None or not math.isfinite(h) or problem.size == 1 or problem.periodic is not None:
        return 0.0  # in a cell approaches do not contain the mean level of the base
    away = np.hypot(*(np.delete(problem.positions, ball, axis=0) - problem.positions[ball]).T)
    return float(np.sum(np.delete(forces, ball) / away)) / (math.pi * substrate.contact_modulus)


def large_strain_note(layer: Layer, deepest: float, base: float) -> tuple[str, ...]:
    """Return a note where small strain does not hold, given the largest approach and the base's part of it [m]."""
    if isinstance(layer, SurfaceResponse):  # it may deform to any depth
        return ()
    own = deepest - base
    share = own / layer.thickness
    if not share > LINEAR_UP_TO or own < UNSURE * deepest:
        return ()
    said = f"{LARGE_STRAIN} {deepest / layer.thickness:.2g} of the layer's thickness"
    if share >= 1.0:
        return (f"{said}, {MEANINGLESS}: {CHECK_UNITS}",)
    taken = f", of which the layer takes {share:.2g}" if base > 0.05 * deepest else ""
    return (
        f"{said}{taken}: strains are of that size, and small strain is a rough model (finite strain may change "
        f"{BETWEEN} by tens of per cent, or their sign)",
    )


def ball_depth_note(share: float, base: float) -> tuple[str, ...]:
    """Return a note where a round ball is pressed deeper into the layer than 1.25 times `COMPARED_UP_TO` of its radius.

    Given the largest approach and the part of it by which the other balls dent the base, both over the radius.
    """
    own = share - base
    if not own > 1.25 * COMPARED_UP_TO or own < UNSURE * share:
        return ()
    taken = f", of which the layer takes {own:.2g}" if base > 0.05 * share else ""
    return (
        f"{LARGE_STRAIN} {share:.2g} of its ball's radius{taken}: small strain is compared with finite strain up to "
        f"{COMPARED_UP_TO:g} of it; {CHECK_UNITS}",
    )


def overlap_note(problem: Problem, approaches: Array) -> tuple[str, ...]:
    """Return a note where unlike balls, pressed to different depths [m] (balls,), pass through each other.

    `Problem` checks balls that rest on one plane; of equal balls the distance is least there.
    """
    whole = [k for k, ball in enumerate(problem.balls) if is_ball(ball) and not ball.asperity]
    radii = np.array([problem.balls[k].radius for k in whole])
    if len(set(radii)) < 2:
        return ()
    cell = problem.cell
    centres = np.column_stack([wrapped(problem.positions[whole], cell), radii - approaches[whole]])
    tree = cKDTree(centres, boxsize=None if cell is None else (*cell, 0.0))
    first, second = tree.query_pairs(2.0 * radii.max(), output_type="ndarray").reshape(-1, 2).T
    apart = centres[first] - centres[second]
    apart[:, :2] = to_nearest(apart[:, :2], cell)
    overlaps = radii[first] + radii[second] - np.linalg.norm(apart, axis=1)
    shares = overlaps / np.minimum(radii[first], radii[second])
    if not np.any(shares > OVERLAP):
        return ()
    worst = int(np.argmax(shares))
    pair = f"balls {whole[first[worst]]} and {whole[second[worst]]}"
    return (
        f"{pair} pass through each other by {overlaps[worst]:.2g} m, as one is pressed deeper than the other: they "
        "would touch; increase their distance",
    )
