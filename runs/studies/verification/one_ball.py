"""One ball: force against approach, beside closed forms, the linear model, and published results at finite strain."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from scipy.optimize import brentq

from linear_bem.closed_forms import (
    bonded_compressible_force,
    bonded_incompressible_force,
    hertz_force,
    long_force,
    sneddon_sphere,
    zhang_force,
)
from linear_bem.problem import Ball, FiniteStrain, Layer, Load, Problem
from runs.models import MODELS, Run
from runs.studies.framework.case import Case
from runs.studies.framework.pair import as_seen_by
from runs.studies.framework.records import Found
from runs.studies.verification.part import COARSE, Part, claimed

NAME = "one-ball"
DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.5)
"""Approaches over R that are asked for, and shown: the nearest load steps."""
LIGHT = 0.25
"""Part of the approach at which Hertz's limit is extrapolated from, besides the whole."""
LINEAR_BAND = 1e-3
"""Relative tolerance of Q of `linear_bem`."""
AXISYMMETRIC_BAND, LONG_BAND, ZHANG_BAND = 0.005, 0.01, 0.04
"""The references' own: what their meshes or their fits leave open."""
AXISYMMETRIC = {
    1.0: {0.05: 1.31192, 0.1: 1.49866, 0.2: 1.81359, 0.3: 2.07726, 0.4: 2.29680, 0.5: 2.48424},
    2.0: {0.05: 1.11838, 0.1: 1.17867, 0.2: 1.25985, 0.3: 1.32289, 0.4: 1.37158, 0.5: 1.40815},
}
"""Q over Hertz's at D / R for h / R, nu = 0.4999, of another code: axisymmetric, Q2/P1, quadrature-point contact."""
Reference = tuple[str, float, float]
"""Name, force [N], relative band; a band of inf makes no claim."""


def single(approach: float, thickness: float, poisson: float, shape: str) -> Problem:
    """Return one ball on a bonded layer with a rigid base; R = 1, E1 = 1."""
    ball = Ball((0.0, 0.0), 1.0, shape)
    return Problem(Layer(1.0, poisson, thickness), (ball,), Load("approach", (approach,)), None, FiniteStrain())


def cases(quick: bool) -> list[Case]:
    """Return the limits at small strain, then the indentations at finite strain."""
    if quick:
        return [_case("finite-strain-h1", single(0.03, 1.0, 0.5, "sphere"), "finite_strain", COARSE, "finite")]
    wanted: list[tuple[str, float, float, float, float]] = [
        ("hertz", 0.045, 20.0, 0.48, 0.05),
        ("thick", 0.1, 1.0, 0.48, 0.02),
        ("thin-compressible", 0.0225, 0.05, 0.3, 0.005),
        ("thin-incompressible", 0.0225, 0.05, 0.5, 0.005),
    ]
    found = [
        _case(name, single(depth, h, nu, "paraboloid"), "small_strain", accuracy, "small")
        for name, depth, h, nu, accuracy in wanted
    ]
    for h in (1.0, 2.0, 10.0):
        found.append(_case(f"finite-strain-h{h:g}", single(0.5, h, 0.5, "sphere"), "finite_strain", 0.05, "finite"))
    return found


def _case(name: str, problem: Problem, model: str, accuracy: float, kind: str) -> Case:
    labels = {"part": NAME, "kind": kind, "h": problem.layer.thickness, "nu": problem.layer.poisson}
    deepest = max(problem.load.values)
    steps = [d / deepest for d in DEPTHS if d < deepest] if kind == "finite" else [LIGHT] if name == "hertz" else []
    return Case(f"{NAME}-{name}", as_seen_by(model, problem), model, accuracy, labels=labels, steps=(*steps, 1.0))


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per case, load step shown, and reference."""
    table: list[dict[str, Any]] = []
    for case in found.of_part(NAME):
        steps = found.steps(case.name)
        for step in shown(steps):
            table += [_row(case, step, reference) for reference in references(case, step["balls"][0]["approach"])]
        if case.name == f"{NAME}-hertz" and len(steps) > 1:
            table.append(_limit(case, steps))
    return table


def shown(steps: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the load steps nearest to `DEPTHS`, and the last."""
    if not steps:
        return []
    depths = [step["balls"][0]["approach"] for step in steps]
    chosen = {int(np.argmin([abs(d - wanted) for d in depths])) for wanted in DEPTHS if wanted <= 1.1 * depths[-1]}
    return [steps[i] for i in sorted(chosen | {len(steps) - 1})]


def references(case: Case, depth: float) -> list[Reference]:
    """Return what the force at an approach [m] is compared with."""
    layer = case.problem.layer
    found: list[Reference] = [("linear_bem", linear_force(case.problem, depth), LINEAR_BAND)]
    if case.labels["kind"] == "small":
        slender = depth**0.5 / layer.thickness
        if slender > 2.0 and layer.poisson < 0.45:
            found.append(("thin-layer law", bonded_compressible_force(depth, 1.0, layer), 0.01))
        if slender > 2.0 and layer.poisson == 0.5:
            found.append(("thin-layer law", bonded_incompressible_force(depth, 1.0, layer), np.inf))
        return found
    if layer.thickness >= 10.0:
        factor = half_space_sphere(depth, layer) / linear_force(as_seen_by("small_strain", case.problem), depth)
        return [("Zhang 2014, half-space", zhang_force(depth, 1.0, layer) / factor, ZHANG_BAND)]
    table = AXISYMMETRIC[layer.thickness]
    other = hertz_force(depth, 1.0, layer.contact_modulus) * float(
        np.interp(depth**0.5, [d**0.5 for d in table], list(table.values()))
    )
    published: list[Reference] = []
    with warnings.catch_warnings(), suppress(UserWarning):  # outside the range of the fit
        warnings.simplefilter("error")
        published.append(("Long 2011", long_force(depth, 1.0, layer, layer.thickness), LONG_BAND))
    if min(table) <= depth <= max(table) * (1.0 + 1e-9):
        published.append(("axisymmetric elements", other, AXISYMMETRIC_BAND))
    return published


def linear_force(problem: Problem, depth: float) -> float:
    """Return the force [N] of `linear_bem` at an approach [m]."""
    small = as_seen_by("small_strain", problem).with_load("approach", (depth,))
    return MODELS["linear_bem"].solve(small, Run(1e-4)).balls[0].normal_force


def half_space_sphere(depth: float, layer: Layer) -> float:
    """Return Sneddon's force [N] on a unit sphere at an approach [m], small strain."""
    radius = brentq(lambda a: sneddon_sphere(a, 1.0, 1.0)[0] - depth, 1e-6, 1.0 - 1e-9)
    return sneddon_sphere(radius, 1.0, layer.contact_modulus)[1]


def _row(case: Case, step: Mapping[str, Any], reference: Reference) -> dict[str, Any]:
    name, force, band = reference
    ball, layer = step["balls"][0], case.problem.layer
    hertz = hertz_force(ball["approach"], 1.0, layer.contact_modulus)
    bar = step["record"]["normal_force_error"][0] / ball["normal_force"]
    off = ball["normal_force"] / force - 1.0
    return {
        "model": case.model, "h": layer.thickness, "nu": layer.poisson, "D": ball["approach"],
        "ratio": (ball["normal_force"] / hertz, bar * ball["normal_force"] / hertz),
        "reference": name, "expected": force / hertz, "off": 100.0 * off, "bar": 100.0 * bar,
        "band": 100.0 * band if np.isfinite(band) else None,
        "verdict": claimed(bool(abs(off) <= bar + band), bar) if np.isfinite(band) else None,
    }  # fmt: skip


def _limit(case: Case, steps: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return Q over Hertz's extrapolated to no load, linearly in sqrt(R D) / h."""
    layer = case.problem.layer
    depth, force, error = (
        np.array([of(step) for step in (steps[0], steps[-1])])
        for of in (
            lambda s: s["balls"][0]["approach"],
            lambda s: s["balls"][0]["normal_force"],
            lambda s: s["record"]["normal_force_error"][0],
        )
    )
    hertz = np.array([hertz_force(d, 1.0, layer.contact_modulus) for d in depth])
    weights = extrapolation_weights(depth**0.5)
    value, bar = float(weights @ (force / hertz)), float(np.abs(weights) @ (error / hertz))
    return {
        "model": case.model, "h": layer.thickness, "nu": layer.poisson, "D": 0.0, "ratio": (value, bar),
        "reference": "Hertz", "expected": 1.0, "off": 100.0 * (value - 1.0), "bar": 100.0 * bar, "band": 0.0,
        "verdict": claimed(bool(abs(value - 1.0) <= bar), bar),
    }  # fmt: skip


def extrapolation_weights(x: np.ndarray) -> np.ndarray:
    """Return the weights of two values at x (2,) that extrapolate them linearly to x = 0."""
    return np.array([x[1], -x[0]]) / (x[1] - x[0])


PART = Part(
    NAME,
    "One ball",
    "Q over Hertz's force of a paraboloid on a half-space, bonded layer on a rigid base. Small strain: paraboloid "
    "against `linear_bem` and the thin-layer laws (no claim where the law is still far), extrapolated to no load "
    "against Hertz. Finite strain: sphere, nu = 0.5 (mixed form), against the fit of Long et al. 2011 (within 1 "
    "%), another code's axisymmetric elements (0.5 %), and Zhang et al. 2014 (4 %; the half-space's formula times "
    "what the layer adds at small strain).",
    cases,
    rows,
    {
        "model": "model", "h": "h / R", "nu": "nu", "D": "D / R", "ratio": "Q / Q Hertz", "reference": "reference",
        "expected": "there", "off": "off [%]", "bar": "own bar [%]", "band": "reference's band [%]",
    },
)  # fmt: skip
