"""Comparisons of `linear_bem`, R = 1 and E1 = 1 unless a scene is given in units."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from linear_bem.closed_forms import hertz_force
from linear_bem.indenter import Cone
from linear_bem.layer.response import LayerResponse
from linear_bem.problem import Ball, Elastic, Layer, Load, Problem
from runs.studies.framework.case import LINEAR, SMALL, Case
from runs.studies.framework.pair import PAPER_LOAD
from runs.studies.framework.records import Found, pull
from runs.studies.validation import formulas
from runs.studies.validation.comparison import SECOND, Comparison, Groups, Point

ACCURACY = 1e-6
FORCE_BAR = 1e-4
"""Relative error of a force: what `linear_bem.solver` requires of it between two discretisations."""
RADIUS_BAR = 1e-3
"""Relative error of a peak pressure, a contact radius and a stiffness over it: that of two unlike bodies' factors."""
STEP = 1e-3
"""Relative step in depth of the stiffness."""
CURVATURE = 100.0
"""Radius over thickness of the body that measures flat punches: strains stay small."""
NAN = math.nan
HALF_SPACE = Layer(1.0, 0.3, math.inf)
SLOPE, TIP = math.radians(20.0), 0.2
CHI, FAR = (0.1, 0.2, 0.4, 0.7, 1.0), (2.0, 5.0)
"""Contacts over the layer; series in chi are not compared at the far ones."""
SLENDER = (0.0003, 0.003, 0.01)
"""Depths over the thickness at which flat punches are measured."""
CONTRASTS = (0.1, 0.5, 2.0, 10.0)
"""Modulus of substrate over coating."""
Reference = Callable[[float], float]


def _case(part: str, name: str, ball: Ball, layer: Layer, depth: float, **more: Any) -> Case:
    substrate, steps = more.pop("substrate", None), more.pop("steps", (1.0,))
    problem = Problem(layer, (ball,), Load("approach", (depth,)), substrate)
    labels = {"part": part, "x": depth, **more}
    return Case(f"{part}-{name}", problem, LINEAR, ACCURACY, labels=labels, steps=steps)


def _ball(case: Case, found: Found) -> dict[str, Any]:
    ball: dict[str, Any] = found.steps(case.name)[-1]["balls"][0]
    return ball


def _forces(
    cases: Sequence[Case], found: Found, reference: Callable[[Case], tuple[float, float]], at: str
) -> list[Point]:
    """Return the cases' forces over Hertz's beside a reference's factor and its error."""
    points = []
    for case in cases:
        layer, depth = case.problem.layer, case.labels["x"]
        hertz = hertz_force(depth, case.problem.balls[0].radius, layer.contact_modulus)
        ours = _ball(case, found)["normal_force"] / hertz
        theirs, error = reference(case)
        x = case.labels.get("chi", depth)
        points.append(Point(f"{at} = {x:g}", x, ours, FORCE_BAR * ours, theirs, error))
    return points


def _hertz(found: Found) -> Groups:
    for case in found.done("hertz"):
        ball = _ball(case, found)
        radius, peak = math.sqrt(ball["contact_area"] / math.pi), ball["peak_pressure"]
        return {
            "p0 [MPa]": [Point("D = 2 mm", 2.0, peak / 1e6, RADIUS_BAR * peak / 1e6, 2798.3, 0.05)],
            "a [mm]": [Point("D = 2 mm", 2.0, radius * 1e3, RADIUS_BAR * radius * 1e3, 10.0, 0.0)],
        }
    return {}


def _spheres(quick: bool) -> list[Case]:
    depths = (0.05, 0.1, 0.3) if quick else (0.05, 0.1, 0.3, 0.5, 1.0)
    return [_case("sphere", f"D{d:g}", Ball((0.0, 0.0), 1.0), HALF_SPACE, d) for d in depths]


def _sphere(reference: Reference, error: float) -> Callable[[Found], Groups]:
    def points(found: Found) -> Groups:
        return {
            "half-space": _forces(
                found.done("sphere"), found, lambda case: (reference(case.labels["x"]), error), "D / R"
            )
        }

    return points


def _sneddon(depth: float) -> float:
    return formulas.sneddon_force(depth, 1.0, 1.0) / hertz_force(depth, 1.0, 1.0)


class _Power:
    """The profile r^n; its name is part of a case's key."""

    def __init__(self, exponent: int) -> None:
        self.exponent = exponent

    def __call__(self, x: Any, y: Any) -> Any:
        return (x * x + y * y) ** (self.exponent / 2)

    def __repr__(self) -> str:
        return f"r^{self.exponent}"


def _powers() -> list[Case]:
    return [_case("galin", f"n{n}", Ball((0.0, 0.0), 1.0, _Power(n)), HALF_SPACE, 0.3, n=n) for n in (2, 4, 8)]


def _galin(found: Found) -> Groups:
    points = []
    for case in found.done("galin"):
        n, ours = case.labels["n"], _ball(case, found)["normal_force"]
        theirs = formulas.power_force(0.3, n, HALF_SPACE.contact_modulus)
        points.append(Point(f"n = {n}", n, ours, FORCE_BAR * ours, theirs))
    return {"half-space": points}


def _hyperboloids() -> list[Case]:
    cone = Ball((0.0, 0.0), shape=Cone(SLOPE, TIP))
    return [_case("hyperboloid", f"D{d:g}", cone, HALF_SPACE, d) for d in (0.01, 0.1, 0.5, 2.0)]


def _hyperboloid(found: Found) -> Groups:
    points = []
    for case in found.done("hyperboloid"):
        depth, ours = case.labels["x"], _ball(case, found)["normal_force"]
        theirs = formulas.hyperboloid_force(depth, TIP, SLOPE, HALF_SPACE.contact_modulus)
        points.append(Point(f"D = {depth:g}", depth, ours, FORCE_BAR * ours, theirs))
    return {"slope 20 deg, tip radius 0.2": points}


def _layers(quick: bool) -> list[Case]:
    """Return paraboloids of radius 100 h pressed in so that chi = sqrt(R D) / h has its values."""
    ball = Ball((0.0, 0.0), CURVATURE, "paraboloid")
    return [
        _case(
            "layer", f"nu{nu:g}-chi{chi:g}", ball, Layer(1.0, nu, 1.0), chi * chi / CURVATURE, chi=chi, nu=nu
        )
        for nu, chis in ((0.5, CHI if quick else (*CHI, *FAR)), (0.3, CHI)) for chi in chis
    ]  # fmt: skip


def _layered(references: Mapping[float, Reference], chis: Sequence[float]) -> Callable[[Found], Groups]:
    """Return the comparison with factors of chi, by Poisson's ratio."""

    def at_chi(case: Case) -> tuple[float, float]:
        return references[case.labels["nu"]](case.labels["chi"]), NAN

    def points(found: Found) -> Groups:
        groups = {}
        for nu in references:
            cases = [c for c in found.done("layer") if c.labels["nu"] == nu and c.labels["chi"] in chis]
            if cases:
                groups[f"paraboloid, nu = {nu:g}"] = _forces(cases, found, at_chi, "chi")
        return groups

    return points


def _stiffness_case(part: str, name: str, layer: Layer, depth: float, **more: Any) -> Case:
    ball = Ball((0.0, 0.0), CURVATURE, more.pop("shape", "paraboloid"))
    return _case(part, name, ball, layer, depth, steps=(1.0 - STEP, 1.0, 1.0 + STEP), **more)


def stiffness(steps: Sequence[dict[str, Any]]) -> tuple[float, float]:
    """Return the contact radius [m] and dQ/dD [N/m] of three steps around a depth.

    As the depth grows, so does the contact; at its edge the pressure is 0, so the growth does no work at first order:
    dQ/dD is the force over depth of a flat punch as large as the contact.
    """
    low, here, high = (step["balls"][0] for step in steps)
    slope = (high["normal_force"] - low["normal_force"]) / (high["approach"] - low["approach"])
    return math.sqrt(here["contact_area"] / math.pi), slope


def _punches(quick: bool) -> list[Case]:
    bodies = {"r2": "paraboloid"} if quick else {"r2": "paraboloid", "r4": _Power(4)}
    return [
        _stiffness_case("punch", f"{body}-nu{nu:g}-D{d:g}", Layer(1.0, nu, 1.0), d, shape=shape, nu=nu, body=body)
        for nu in (0.0, 0.5) for body, shape in bodies.items() for d in (SLENDER[:2] if quick else SLENDER)
    ]  # fmt: skip


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
            point = Point(f"a / h = {radius:.3g}", radius, ours, RADIUS_BAR * ours, references[nu](radius), NAN)
            body = "" if case.labels["body"] == "r2" else ", from a body r^4"
            groups.setdefault(f"flat punch, nu = {nu:g}{body}", []).append(point)
        return groups

    return points


def _garcia(found: Found) -> Groups:
    paraboloids = _layered({0.5: lambda chi: formulas.series(formulas.GARCIA, chi)}, CHI)(found)
    return paraboloids | _punch({0.5: lambda x: formulas.series(formulas.GARCIA_PUNCH, x)})(found)


def _pairs() -> list[Case]:
    """Return the paper's pair under its load and under a hundredth of it, on a rigid base."""
    balls = tuple(Ball((side, 0.0), 1.0, "paraboloid") for side in (-1.0, 1.0))
    return [
        Case(
            f"carbone-h{h:g}-Q{load:g}", Problem(Layer(1.0, 0.48, h), balls, Load("force", (load, load))), LINEAR,
            ACCURACY, labels={"part": "carbone", "h": h, "Q": load},
        )
        for h in (1.16, 6.0) for load in (PAPER_LOAD, PAPER_LOAD / 100.0)
    ]  # fmt: skip


def _carbone(found: Found) -> Groups:
    t = np.array([0.01, 0.1, 1.0, 5.0, 20.0])
    points: Groups = {}
    for nu in (0.0, 0.48, 0.5):
        ours, known = LayerResponse(Elastic(1.0, nu), None)(t), formulas.carbone_response(t, nu)
        # the formula's numerator is a difference of terms of size 2 t
        roundoff = 8.0 * np.finfo(float).eps * (1.0 + t / known / np.cosh(t) ** 2)
        points[f"response, nu = {nu:g}"] = [
            Point(f"k h = {x:g}", float(x), float(a), 0.0, float(b), float(b * e))
            for x, a, b, e in zip(t, ours, known, roundoff, strict=True)
        ]
    for case in found.done("carbone"):
        balls = found.steps(case.name)[-1]["balls"]
        value, bar = pull(balls)
        radius, force, layer = (
            math.sqrt(balls[0]["contact_area"] / math.pi),
            balls[0]["normal_force"],
            case.problem.layer,
        )
        theirs, other = (formulas.carbone_force(force, radius, 2.0, layer, uniform) for uniform in (False, True))
        point = Point(f"Q = {force:.3g} E R^2", force, value, bar, theirs, abs(theirs - other))
        points.setdefault(f"T of two balls, h = {layer.thickness:g} R", []).append(point)
    return points


def _coated(part: str, name: str, young: float, depth: float, ratio: float) -> Case:
    layer = Layer(young, 0.3, 1.0)
    return _stiffness_case(part, name, layer, depth, substrate=Elastic(ratio, 0.3), ratio=ratio)


def _alike() -> list[Case]:
    return [_coated("gao", f"E{e:g}-D{d:g}", e, d, 1.0) for d in SLENDER for e in (0.95, 1.05)]


def _gao(found: Found) -> Groups:
    """Return the slope of the effective modulus by the coating's, at the mean radius of both contacts."""
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


def _coatings(quick: bool) -> list[Case]:
    """Return the punches, and by elements too where the fit is farthest off."""
    every = [_coated("perriot", f"ratio{r:g}-D{d:g}", 1.0, d, r) for r in CONTRASTS for d in SLENDER]
    if quick:
        return every
    elements = [
        dataclasses.replace(case, name=f"{case.name}-elements", model=SMALL, accuracy=0.2, steps=(1.0,))
        for case in every
        if case.labels["ratio"] == CONTRASTS[0] and case.labels["x"] == SLENDER[1]
    ]
    return [*every, *elements]  # fmt: skip


def _perriot(found: Found) -> Groups:
    groups: Groups = {}
    for case in found.done("perriot"):
        ratio, steps = case.labels["ratio"], found.steps(case.name)
        if case.model == SMALL:
            linear = found.steps(case.name.removesuffix("-elements"))[1]["balls"][0]["normal_force"]
            force, bar = steps[-1]["balls"][0]["normal_force"], steps[-1]["record"]["normal_force_error"][0]
            point = Point(f"Q at D = {case.labels['x']:g}", ratio, linear, FORCE_BAR * linear, force, bar)
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
    """Return every scene once; several sources may be compared on one."""
    of_hertz = _case("hertz", "ball", Ball((0.0, 0.0), 0.05, "paraboloid"), Layer(2e10, 0.3, math.inf), 2e-3)
    return [
        of_hertz, *_spheres(quick), *_powers(), *_hyperboloids(), *_layers(quick), *_punches(quick), *_pairs(),
        *_alike(), *_coatings(quick),
    ]  # fmt: skip


SPHERE = "sphere on a half-space, nu = 0.3"
BONDED = "bonded layer; chi = sqrt(R D) / h"
COATED = "flat punch on a coated half-space, nu = 0.3"
FACTOR = "force over a half-space's"
DIMITRIADIS: Mapping[float, Reference] = {
    0.5: lambda chi: formulas.series(formulas.DIMITRIADIS, chi),
    0.3: lambda chi: formulas.dimitriadis_factor(chi, 0.3),
}
PUNCH: Mapping[float, Reference] = {
    0.0: lambda x: formulas.punch_factor(x, 0.0),
    0.5: lambda x: formulas.punch_factor(x, 0.5),
}
COMPARISONS = (
    Comparison(
        "hertz", "peak pressure and contact radius", "half of the two spheres: paraboloid, R = 50 mm", LINEAR, _hertz
    ),
    Comparison("sneddon", "Q over Hertz's", SPHERE, LINEAR, _sphere(_sneddon, 0.0)),
    Comparison("kontomaris", "Q over Hertz's", SPHERE, LINEAR, _sphere(formulas.kontomaris_factor, NAN)),
    Comparison("galin", "Q", "bodies r^n on a half-space, nu = 0.3, D = 0.3", LINEAR, _galin),
    Comparison("hyperboloid", "Q", "rounded cone on a half-space, nu = 0.3", LINEAR, _hyperboloid),
    Comparison("lebedev", FACTOR, BONDED, LINEAR, _layered({0.5: formulas.lebedev_factor}, (*CHI, *FAR))),
    Comparison("dimitriadis", FACTOR, BONDED, LINEAR, _layered(DIMITRIADIS, CHI)),
    Comparison("garcia", FACTOR, BONDED, LINEAR, _garcia),
    Comparison("punch", FACTOR, BONDED, LINEAR, _punch(PUNCH)),
    Comparison("carbone", "response, and T of two balls", "bonded layer", LINEAR, _carbone),
    Comparison("gao", "slope of the effective modulus by the coating's", COATED, LINEAR, _gao),
    Comparison("perriot", "effective modulus over the coating's", COATED, LINEAR, _perriot),
)
