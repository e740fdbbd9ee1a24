"""Forces of `linear_bem` compared with closed forms and fits, R = 1 and E1 = 1 unless a scene has units."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from linear_bem.closed_forms import hertz_force
from linear_bem.indenter import Cone
from linear_bem.layer.response import LayerResponse
from linear_bem.problem import Ball, Elastic, Layer, Load, Problem
from runs.studies.framework.case import LINEAR, Case
from runs.studies.framework.pair import PAPER_LOAD, THICK, THIN, as_seen_by, pair
from runs.studies.framework.saved_cases import Found, pull
from runs.studies.validation import formulas
from runs.studies.validation.comparison import FORCE_BAR, RADIUS_BAR, Comparison, Groups, Point

ACCURACY = 1e-6
CURVATURE = 100.0
"""Radius over thickness of the body that replaces flat punches: strains remain small."""
HALF_SPACE = Layer(1.0, 0.3, math.inf)
SLOPE, TIP = math.radians(20.0), 0.2
CHI, FAR = (0.1, 0.2, 0.4, 0.7, 1.0), (2.0, 5.0)
"""Values of chi; series in chi are not compared at those of `FAR`."""
Reference = Callable[[float], float]


def pressed(part: str, name: str, ball: Ball, layer: Layer, depth: float, **more: Any) -> Case:
    """Return a case of one body at a depth [m]; ``more`` are labels, and the substrate and load steps if any."""
    substrate, steps = more.pop("substrate", None), more.pop("steps", (1.0,))
    problem = Problem(layer, (ball,), Load("approach", (depth,)), substrate)
    labels = {"part": part, "x": depth, **more}
    return Case(f"{part}-{name}", problem, LINEAR, ACCURACY, labels=labels, steps=steps)


def _ball(case: Case, found: Found) -> dict[str, Any]:
    return dict(found.steps(case.name)[-1]["balls"][0])


def _forces(
    cases: Sequence[Case], found: Found, reference: Callable[[Case], tuple[float, float]], at: str
) -> list[Point]:
    """Return the cases' forces over Hertz's with a reference's factor and its error."""
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
    return [pressed("sphere", f"D{d:g}", Ball((0.0, 0.0), 1.0), HALF_SPACE, d) for d in depths]


def _sphere(reference: Reference, error: float) -> Callable[[Found], Groups]:
    def beside(case: Case) -> tuple[float, float]:
        return reference(case.labels["x"]), error

    return lambda found: {"half-space": _forces(found.done("sphere"), found, beside, "D / R")}


class Power:
    """The profile r^n; its name is part of a case's key."""

    def __init__(self, exponent: int) -> None:
        self.exponent = exponent

    def __call__(self, x: Any, y: Any) -> Any:
        """Return the height [m]."""
        return (x * x + y * y) ** (self.exponent / 2)

    def __repr__(self) -> str:
        return f"r^{self.exponent}"


def _powers() -> list[Case]:
    return [pressed("galin", f"n{n}", Ball((0.0, 0.0), 1.0, Power(n)), HALF_SPACE, 0.3, n=n) for n in (2, 4, 8)]


def _force(part: str, group: str, at: str, label: str, theirs: Reference) -> Callable[[Found], Groups]:
    """Return the comparison of a part's forces [N] with a formula of one of its labels."""

    def points(found: Found) -> Groups:
        known = [(case.labels[label], _ball(case, found)["normal_force"]) for case in found.done(part)]
        return {group: [Point(f"{at} = {x:g}", x, ours, FORCE_BAR * ours, theirs(x)) for x, ours in known]}

    return points


def _layers(quick: bool) -> list[Case]:
    """Return paraboloids of radius 100 h pressed in so that chi = sqrt(R D) / h has its values."""
    ball = Ball((0.0, 0.0), CURVATURE, "paraboloid")
    return [
        pressed(
            "layer", f"nu{nu:g}-chi{chi:g}", ball, Layer(1.0, nu, 1.0), chi * chi / CURVATURE, chi=chi, nu=nu
        )
        for nu, chis in ((0.5, CHI if quick else (*CHI, *FAR)), (0.3, CHI)) for chi in chis
    ]  # fmt: skip


def layered(references: Mapping[float, Reference], chis: Sequence[float]) -> Callable[[Found], Groups]:
    """Return the comparison with factors of chi, by Poisson's ratio."""

    def at_chi(case: Case) -> tuple[float, float]:
        return references[case.labels["nu"]](case.labels["chi"]), math.nan

    def points(found: Found) -> Groups:
        groups = {}
        for nu in references:
            cases = [c for c in found.done("layer") if c.labels["nu"] == nu and c.labels["chi"] in chis]
            if cases:
                groups[f"paraboloid, nu = {nu:g}"] = _forces(cases, found, at_chi, "chi")
        return groups

    return points


def _pairs() -> list[Case]:
    """Return the paper's pair under its load and under a hundredth of it, on a rigid base."""
    pairs = {h: as_seen_by(LINEAR, pair(1.0, h, substrate=None, shape="paraboloid")) for h in (THIN, THICK)}
    return [
        Case(
            f"carbone-h{h:g}-Q{load:g}", problem.with_load("force", (load, load)), LINEAR, ACCURACY,
            labels={"part": "carbone", "h": h, "Q": load},
        )
        for h, problem in pairs.items() for load in (PAPER_LOAD, PAPER_LOAD / 100.0)
    ]  # fmt: skip


def _carbone(found: Found) -> Groups:
    t = np.array([0.01, 0.1, 1.0, 5.0, 20.0])
    points: Groups = {}
    for nu in (0.0, 0.48, 0.5):
        ours, known = LayerResponse(Elastic(1.0, nu), None)(t), formulas.carbone_response(t, nu)
        # roundoff: the formula's numerator is a difference of terms of size 2 t
        roundoff = 8.0 * np.finfo(float).eps * (1.0 + t / known / np.cosh(t) ** 2)
        points[f"response, nu = {nu:g}"] = [
            Point(f"k h = {x:g}", float(x), float(a), 0.0, float(b), float(b * e))
            for x, a, b, e in zip(t, ours, known, roundoff, strict=True)
        ]
    for case in found.done("carbone"):
        balls = found.steps(case.name)[-1]["balls"]
        value, bar = pull(balls)
        radius, force = math.sqrt(balls[0]["contact_area"] / math.pi), balls[0]["normal_force"]
        layer = case.problem.layer
        theirs, other = (formulas.carbone_force(force, radius, 2.0, layer, uniform) for uniform in (False, True))
        point = Point(f"Q = {force:.3g} E R^2", force, value, bar, theirs, abs(theirs - other))
        points.setdefault(f"T of two balls, h = {layer.thickness:g} R", []).append(point)
    return points


def cases(quick: bool) -> list[Case]:
    """Return every case once; several sources may use the same one."""
    cone = Ball((0.0, 0.0), shape=Cone(SLOPE, TIP))
    hyperboloids = [pressed("hyperboloid", f"D{d:g}", cone, HALF_SPACE, d) for d in (0.01, 0.1, 0.5, 2.0)]
    of_hertz = pressed("hertz", "ball", Ball((0.0, 0.0), 0.05, "paraboloid"), Layer(2e10, 0.3, math.inf), 2e-3)
    return [
        of_hertz, *_spheres(quick), *_powers(), *hyperboloids, *_layers(quick), *_pairs(),
    ]  # fmt: skip


SPHERE = "sphere on a half-space, nu = 0.3"
BONDED = "bonded layer; chi = sqrt(R D) / h"
FACTOR = "force over a half-space's"
DIMITRIADIS: Mapping[float, Reference] = {
    0.5: lambda chi: formulas.series(formulas.DIMITRIADIS, chi),
    0.3: lambda chi: formulas.dimitriadis_factor(chi, 0.3),
}
E_STAR = HALF_SPACE.contact_modulus
GALIN = _force("galin", "half-space", "n", "n", lambda n: formulas.power_force(0.3, n, E_STAR))
HYPERBOLOID = _force(
    "hyperboloid", "slope 20 deg, tip radius 0.2", "D", "x",
    lambda depth: formulas.hyperboloid_force(depth, TIP, SLOPE, E_STAR),
)  # fmt: skip
COMPARISONS = (
    Comparison(
        "hertz", "peak pressure and contact radius", "half of the two spheres: paraboloid, R = 50 mm", LINEAR, _hertz
    ),
    Comparison("sneddon", "Q over Hertz's", SPHERE, LINEAR, _sphere(formulas.sneddon_factor, 0.0)),
    Comparison("kontomaris", "Q over Hertz's", SPHERE, LINEAR, _sphere(formulas.kontomaris_factor, math.nan)),
    Comparison("galin", "Q", "bodies r^n on a half-space, nu = 0.3, D = 0.3", LINEAR, GALIN),
    Comparison("hyperboloid", "Q", "rounded cone on a half-space, nu = 0.3", LINEAR, HYPERBOLOID),
    Comparison("lebedev", FACTOR, BONDED, LINEAR, layered({0.5: formulas.lebedev_factor}, (*CHI, *FAR))),
    Comparison("dimitriadis", FACTOR, BONDED, LINEAR, layered(DIMITRIADIS, CHI)),
    Comparison("carbone", "response, and T of two balls", "bonded layer", LINEAR, _carbone),
)
