"""Comparisons of `finite_strain`: one sphere on a neo-Hookean incompressible layer, R = 1 and E1 = 1."""

import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from linear_bem import solve
from linear_bem.closed_forms import hertz_force, long_force
from linear_bem.problem import Ball, Layer, Problem
from runs.studies.framework.case import FINITE, Case
from runs.studies.framework.pair import as_seen_by, pressed
from runs.studies.framework.saved_cases import Found
from runs.studies.validation import formulas
from runs.studies.validation.comparison import SECOND, Comparison, Groups, Point

BALL = Ball((0.0, 0.0), 1.0)
COARSE = 0.2
"""Required accuracy of T; a single ball has no T, so this selects the coarsest pair of discretisations."""
DEEP, THICKEST, HALF_SPACE_DEPTH = 10.0, 10.0 / 3.0, 0.1
"""h/R of the layer that represents a half-space, and of the thickest of Long et al.; D/R up to which Hertz holds."""
SEAM = 0.5
"""Thickness over R at which the fit of Long et al. changes its coefficients."""
DEPTHS: Mapping[float, tuple[float, ...]] = {
    1.0: (0.05, 0.1, 0.2, 0.3, 0.4, 0.5), 2.0: (0.05, 0.1, 0.2, 0.3, 0.4, 0.5), SEAM: (0.05, 0.1, 0.15, 0.2),
    DEEP: (0.02, 0.05, 0.1, 0.2, 0.3, 0.5),
}  # fmt: skip
"""Thickness over R, and depths over R with output."""


def case_of(thickness: float) -> Case:
    """Return the case of a sphere pressed into a layer, nu = 0.5, with output at all its depths."""
    depths = DEPTHS[thickness]
    steps = tuple(d / depths[-1] for d in depths)
    labels = {"part": "half-space" if thickness == DEEP else "long", "h": thickness}
    problem = pressed([BALL], depths[-1], thickness, 0.5)
    return Case(f"sphere-h{thickness:g}", problem, FINITE, COARSE, labels=labels, steps=steps)


def forces(found: Found, case: Case) -> list[tuple[float, float, float, float]]:
    """Return depth, force over Hertz's, its error bar, and Hertz's force of every answer."""
    rows = []
    for step in found.steps(case.name):
        ball, bar = step["balls"][0], step["record"]["normal_force_error"][0]
        hertz = hertz_force(ball["approach"], 1.0, case.problem.layer.contact_modulus)
        rows.append((ball["approach"], ball["normal_force"] / hertz, bar / hertz, hertz))
    return rows


def cases() -> list[Case]:
    """Return the cases of every layer, and of the one that represents a half-space."""
    return [case_of(h) for h in DEPTHS]


def _long(found: Found) -> Groups:
    groups = {}
    for case in found.done("long"):
        layer, points, other = case.problem.layer, [], []
        for depth, ours, bar, hertz in forces(found, case):
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # a point outside the range of the fit is a mistake of this study
                theirs = long_force(depth, 1.0, layer, layer.thickness) / hertz
            points.append(Point(f"D / R = {depth:g}", depth, ours, bar, theirs, math.nan))
            if layer.thickness == SEAM:
                beyond = long_force(depth, 1.0, layer, SEAM * (1.0 - 1e-9)) / hertz
                other.append(Point(f"D / R = {depth:g}", depth, ours, bar, beyond, math.nan))
        groups[f"h = {layer.thickness:g} R"] = points
        if other:
            groups[f"{SECOND}: h = {SEAM:g} R, by the coefficients for R / h > 2"] = other
    return groups


def _at_small_strain(problem: Problem, depth: float) -> float:
    return solve(as_seen_by("small_strain", problem).with_load("approach", (depth,)), 1e-4).balls[0].normal_force


def _softening(found: Found) -> Iterator[tuple[float, float, float]]:
    """Yield depth, force on the half-space over that at small strain, and its error."""
    for case in found.done("half-space"):
        for depth, ours, bar, _ in forces(found, case):
            sneddon = formulas.sneddon_force(depth, 1.0, case.problem.layer.contact_modulus)
            factor = _at_small_strain(case.problem, depth) / sneddon
            value = ours / factor / formulas.sneddon_factor(depth)
            # the effect of the thickness is removed as at small strain; half of it counts as the error
            yield depth, value, value * (bar / ours + 0.5 * abs(factor - 1.0))


def _beside(found: Found, reference: Callable[[float], float], deepest: float) -> Groups:
    """Return the comparison of the half-space's force over Hertz's with a reference."""
    points = []
    for depth, value, bar in _softening(found):
        sneddon = formulas.sneddon_factor(depth)
        if depth <= deepest * (1.0 + 1e-9):
            at = f"D / R = {depth:g}"
            points.append(Point(at, depth, value * sneddon, bar * sneddon, reference(depth), math.nan))
    return {f"h = {DEEP:g} R, thickness taken off as at small strain": points} if points else {}


def _lin(found: Found) -> Groups:
    """Return the half-space's force, and finite over small strain compared with Long et al.'s thickest layer."""
    groups = _beside(
        found, lambda depth: formulas.lin_force(depth, 1.0, 1.0, 2.0) / hertz_force(depth, 1.0, 1.0), math.inf
    )
    thick, points = pressed([BALL], 1.0, THICKEST, 0.5), []
    for depth, value, bar in _softening(found):
        if depth >= 0.1:
            theirs = long_force(depth, 1.0, thick.layer, THICKEST) / _at_small_strain(thick, depth)
            points.append(Point(f"D / R = {depth:g}", depth, value, bar, theirs, math.nan))
    if points:
        groups[f"{SECOND}: finite over small strain, beside Long et al. on h = {THICKEST:g} R"] = points
    return groups


SPHERE = "sphere on a half-space, nu = 0.5"
COMPARISONS = (
    Comparison("long", "Q over Hertz's", "sphere on a bonded layer, nu = 0.5", FINITE, _long),
    Comparison(
        "shojaeifard", "Q over Hertz's", SPHERE, FINITE, lambda found: _beside(found, lambda _: 1.0, HALF_SPACE_DEPTH)
    ),
    Comparison("lin", "Q over Hertz's", SPHERE, FINITE, _lin),
)


def curve(thickness: float, depths: Any) -> list[float]:
    """Return the fit of Long et al. over Hertz's force at depths over R, for the figure."""
    layer = Layer(1.0, 0.5, thickness)
    return [long_force(d, 1.0, layer, thickness) / hertz_force(d, 1.0, layer.contact_modulus) for d in depths]
