"""How deep balls may be pressed: loads that are refused, and notes where small strain does not hold."""

import math

import numpy as np

from linear_bem.indenter import Paraboloid, Sphere
from linear_bem.layer.ritz_indentation import indentation_of_layer
from linear_bem.media import Elastic, Layer, SurfaceResponse
from linear_bem.problem import Problem

LINEAR_UP_TO = 0.5
"""Approach over the layer's thickness above which a note is given, if only the layer is deformed.

At 0.43 finite strain already makes T of touching balls 1.8 times as large (study `strengthening`, h = 1.16 R).
"""
COMPARED_UP_TO = 1.2
"""Approach over a sphere's radius up to which T is compared with finite strain (study `strengthening`, foam)."""
UNSURE = 0.25
"""Share of an approach that `dent` may miss: where it leaves the layer less, nothing is said."""
LARGE_STRAIN, MEANINGLESS = "the largest approach is", "deeper than layer and base can give"
"""How the note begins that says so, and what it says of a depth that no small strain could explain."""
THROUGH = 2.0
"""Approach of a single ball over the thickness of a layer on a rigid base from which a force is refused. At finite
strain, forces that press to 0.87 of the thickness give 1.03 to 1.35 of it here (neo-Hookean layers of 0.6 and 1 R,
nu = 0 to 0.49)."""
ABSURD = 100.0
"""Approach of a round ball over its radius from which a load is refused."""
CHECK_UNITS = "check the load's unit, bare numbers are in metres and newtons"


def depth_faults(problem: Problem) -> list[str]:
    """Return the fault of a load that presses through a layer on a rigid base, or a round ball absurdly deep.

    Under a force the approach is estimated, of a single round ball. A found approach, or one beyond the given ones in
    a table, may exceed the layer's thickness: `large_strain_note` says so.
    """
    layer, load, balls = problem.layer, problem.load, problem.balls
    if isinstance(layer, SurfaceResponse):
        return []
    given, shared = load.kind == "approach", load.kind == "total_force"
    values = np.full(len(balls), load.values[0] / len(balls)) if shared else np.array(load.values)
    ball = int(np.argmax(values if given else values / np.array([each.radius for each in balls])))
    radius, value, depth = balls[ball].radius, float(values[ball]), float(values[ball])
    is_round = isinstance(balls[ball].indenter, Sphere | Paraboloid)
    if not value > 0.0 or not (given or is_round):
        return []
    got, remedy = f"got {value:g} m", "press less deep"
    if not given:
        depth = indentation_of_layer(layer, problem.substrate, radius, normal_force=value).approach
        got = f"got {value:g} N on a ball, which gives about {depth:.2g} m"
        remedy = f"check the units of {load.kind} and of the layer's young"
    where = f"load.{load.kind}" + ("" if shared else f"[{ball}]")
    times = 1.0 if given else THROUGH
    if problem.substrate is None and depth >= times * layer.thickness > 0.0:
        limit = "be less than" if given else f"press a ball less deep than {times:g} times"
        return [
            f"{where}: must {limit} the thickness of a layer on a rigid base, {layer.thickness:g} m, {got}; {remedy}, "
            "or add the substrate that gives way"
        ]
    if is_round and depth >= ABSURD * radius:
        limit = "be less than" if given else "press a ball less deep than"
        return [f"{where}: must {limit} {ABSURD:g} times its radius, {radius:g} m, {got}; {remedy}"]
    return []


def dent(substrate: Elastic | None, thickness: float, force: float, contact_area: float) -> float:
    """Return about how deep [m] a substrate gives way under a layer: Hertz's dent of a force [N], spread by the layer.

    The contact [m^2] is taken to be at least as wide as the layer is thick [m].
    """
    if substrate is None or not math.isfinite(thickness):
        return 0.0
    return 0.75 * force / (substrate.contact_modulus * max(math.sqrt(contact_area / math.pi), thickness))


def large_strain_note(layer: Layer, deepest: float, base: float = 0.0) -> tuple[str, ...]:
    """Return a note where small strain does not hold, given the largest approach and what the base gives of it [m]."""
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
    return (f"{said}{taken}: strains are of that size, and a small-strain model is valid up to about {LINEAR_UP_TO:g}",)


def ball_depth_note(share: float) -> tuple[str, ...]:
    """Return a note where the largest approach of a round ball over its radius exceeds 1.25 times `COMPARED_UP_TO`."""
    if not share > 1.25 * COMPARED_UP_TO:
        return ()
    return (
        f"{LARGE_STRAIN} {share:.2g} of its ball's radius: small strain is compared with finite strain up to "
        f"{COMPARED_UP_TO:g} of it; {CHECK_UNITS}",
    )
