"""Flat punches on layers and coatings, computed from the slope dQ/dD of a smooth body; E1 = 1, h = 1."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from linear_bem.problem import Ball, Elastic, Layer
from runs.studies.framework.case import LINEAR, SMALL, Case
from runs.studies.framework.saved_cases import Found
from runs.studies.validation import formulas
from runs.studies.validation.comparison import FORCE_BAR, RADIUS_BAR, SECOND, Comparison, Groups, Point
from runs.studies.validation.small_strain import BONDED, CHI, CURVATURE, FACTOR, Power, Reference, layered, pressed

STEP = 1e-3
"""Relative step in depth of the secant that gives the stiffness."""
SLENDER = (0.0003, 0.003, 0.01)
"""Depths over the thickness at which the stiffness is computed."""
CONTRASTS = (0.1, 0.5, 2.0, 10.0)
"""Modulus of substrate over coating."""


def punch_case(part: str, name: str, layer: Layer, depth: float, **more: Any) -> Case:
    """Return a case with output at, just above and just below a depth [m]; ``more``: labels, shape and substrate."""
    ball = Ball((0.0, 0.0), CURVATURE, more.pop("shape", "paraboloid"))
    return pressed(part, name, ball, layer, depth, steps=(1.0 - STEP, 1.0, 1.0 + STEP), **more)


def stiffness(steps: Sequence[dict[str, Any]]) -> tuple[float, float]:
    """Return the contact radius [m] and dQ/dD [N/m] of three steps around a depth.

    The contact grows with the depth, but the pressure at its edge is 0, so its growth has no effect at first order:
    dQ/dD is the force over depth of a flat punch as large as the contact.
    """
    low, here, high = (step["balls"][0] for step in steps)
    slope = (high["normal_force"] - low["normal_force"]) / (high["approach"] - low["approach"])
    return math.sqrt(here["contact_area"] / math.pi), slope


def _punch(references: Mapping[float, Reference]) -> Callable[[Found], Groups]:
    """Return the comparison with factors of a / h, by Poisson's ratio."""

    def points(found: Found) -> Groups:
        groups: Groups = {}
        for case in found.done("punch"):
            nu = case.labels["nu"]
            if nu not in references:
                continue
            radius, slope = stiffness(found.steps(case.name))
            ours = slope / (2.0 * case.problem.layer.contact_modulus * radius)
            point = Point(f"a / h = {radius:.3g}", radius, ours, RADIUS_BAR * ours, references[nu](radius), math.nan)
            body = "" if case.labels["body"] == "r2" else ", from a body r^4"
            groups.setdefault(f"flat punch, nu = {nu:g}{body}", []).append(point)
        return groups

    return points


def _coated(part: str, name: str, young: float, depth: float, ratio: float) -> Case:
    layer = Layer(young, 0.3, 1.0)
    return punch_case(part, name, layer, depth, substrate=Elastic(ratio, 0.3), ratio=ratio)


def _gao(found: Found) -> Groups:
    """Return the derivative of the effective modulus by the coating's, at the mean radius of both contacts."""
    by_depth: dict[float, list[tuple[float, float]]] = {}
    for case in found.done("gao"):
        radius, slope = stiffness(found.steps(case.name))
        by_depth.setdefault(case.labels["x"], []).append((radius, slope / (2.0 * radius) * (1.0 - 0.3**2)))
    points = []
    for pair in by_depth.values():
        if len(pair) == 2:
            (a, soft), (b, stiff) = pair
            # radii differ by little, and the modulus of equal materials does not depend on the radius
            x, ours = 0.5 * (a + b), (stiff - soft) / 0.1
            points.append(Point(f"a / h = {x:.3g}", x, ours, RADIUS_BAR, formulas.gao_weight(x, 0.3)))
    return {"nu = 0.3": points}


def _perriot(found: Found) -> Groups:
    groups: Groups = {}
    for case in found.done("perriot"):
        ratio, steps = case.labels["ratio"], found.steps(case.name)
        if case.model == SMALL:
            beside = found.steps(case.name.removesuffix("-elements"))
            if beside:
                linear = beside[1]["balls"][0]["normal_force"]
                force = steps[-1]["balls"][0]["normal_force"]
                # the accuracy requested: the error bar of small_strain is its difference from linear_bem
                bars = FORCE_BAR * linear, case.accuracy * linear
                point = Point(f"Q at D = {case.labels['x']:g}", ratio, linear, bars[0], force, bars[1])
                groups[f"{SECOND}: substrate {ratio:g} times as stiff, beside small_strain elements"] = [point]
            continue
        radius, slope = stiffness(steps)
        ours = slope / (2.0 * radius) * (1.0 - 0.3**2)
        ends = [formulas.perriot_modulus(radius, 1.0, ratio, n) for n in (1.06, 1.32)]
        middle, half = 0.5 * sum(ends), 0.5 * abs(ends[0] - ends[1])
        point = Point(f"a / h = {radius:.3g}", radius, ours, RADIUS_BAR * ours, middle, half)
        groups.setdefault(f"substrate {ratio:g} times as stiff", []).append(point)
    return groups


def cases(quick: bool) -> list[Case]:
    """Return every case once; a coating also with finite elements, where the fit deviates most."""
    bodies = {"r2": "paraboloid"} if quick else {"r2": "paraboloid", "r4": Power(4)}
    punches = [
        punch_case("punch", f"{body}-nu{nu:g}-D{d:g}", Layer(1.0, nu, 1.0), d, shape=shape, nu=nu, body=body)
        for nu in (0.0, 0.5) for body, shape in bodies.items() for d in (SLENDER[:2] if quick else SLENDER)
    ]  # fmt: skip
    alike = [_coated("gao", f"E{e:g}-D{d:g}", e, d, 1.0) for d in SLENDER for e in (0.95, 1.05)]
    coatings = [_coated("perriot", f"ratio{r:g}-D{d:g}", 1.0, d, r) for r in CONTRASTS for d in SLENDER]
    elements = [
        dataclasses.replace(case, name=f"{case.name}-elements", model=SMALL, accuracy=0.05, steps=(1.0,))
        for case in coatings
        if case.labels["ratio"] == CONTRASTS[0] and case.labels["x"] == SLENDER[1] and not quick
    ]
    return [*punches, *alike, *coatings, *elements]


COATED = "flat punch on a coated half-space, nu = 0.3"
PUNCH: Mapping[float, Reference] = {nu: partial(formulas.punch_factor, poisson=nu) for nu in (0.0, 0.5)}
PARABOLOIDS = layered({0.5: lambda chi: formulas.series(formulas.GARCIA, chi)}, CHI)
PUNCHES = _punch({0.5: lambda x: formulas.series(formulas.GARCIA_PUNCH, x)})
COMPARISONS = (
    Comparison("garcia", FACTOR, BONDED, LINEAR, lambda found: PARABOLOIDS(found) | PUNCHES(found)),
    Comparison("punch", FACTOR, BONDED, LINEAR, _punch(PUNCH)),
    Comparison("gao", "slope of the effective modulus by the coating's", COATED, LINEAR, _gao),
    Comparison("perriot", "effective modulus over the coating's", COATED, LINEAR, _perriot),
)
