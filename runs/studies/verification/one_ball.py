"""One ball: force over approach compared with the linear model, Hertz's limit, and another code at finite strain."""

import dataclasses
from typing import Any

import numpy as np

from linear_bem.problem import Ball
from runs.models import MODELS, Run
from runs.studies.framework.case import FINITE, SMALL, Case
from runs.studies.framework.pair import as_seen_by, pressed
from runs.studies.framework.saved_cases import Found
from runs.studies.validation.large_strain import case_of, forces
from runs.studies.verification.part import Part, claimed

NAME = "one-ball"
LIGHT = 0.25
"""Share of the approach that, with the full approach, gives the extrapolation to Hertz's limit."""
LINEAR_BAND, AXISYMMETRIC_BAND = 1e-3, 0.005
"""Relative tolerance of Q of `linear_bem`; relative mesh error of the other code."""
HERTZ_BAND = 1e-3
"""Relative error of the straight line to Hertz's limit: 8e-5 with the forces of `linear_bem`."""
AXISYMMETRIC = {
    1.0: {0.05: 1.31192, 0.1: 1.49866, 0.2: 1.81359, 0.3: 2.07726, 0.4: 2.29680, 0.5: 2.48424},
    2.0: {0.05: 1.11838, 0.1: 1.17867, 0.2: 1.25985, 0.3: 1.32289, 0.4: 1.37158, 0.5: 1.40815},
}
"""Q over Hertz's at D / R for h / R, nu = 0.4999, of another code: axisymmetric, Q2/P1, quadrature-point contact."""
Reference = tuple[str, float, float]
"""Name, force over Hertz's, relative band."""


def cases(quick: bool) -> list[Case]:
    """Return the limits at small strain, then the indentations at finite strain; the quick version has a coarse one."""
    if quick:
        return [_small("thick", 0.1, 1.0, 0.48, 0.05)]
    small = [
        _small("hertz", 0.045, 20.0, 0.48, 0.05),
        _small("thick", 0.1, 1.0, 0.48, 0.02),
        _small("thin-compressible", 0.0225, 0.05, 0.3, 0.005),
        _small("thin-incompressible", 0.0225, 0.05, 0.5, 0.005),
    ]
    finite = [
        dataclasses.replace(
            of, name=f"{NAME}-{of.name}", labels={"part": NAME, "kind": "finite"}, same_as=("validation", of.name)
        )
        for of in map(case_of, AXISYMMETRIC)
    ]
    return [*small, *finite]


def _small(name: str, depth: float, h: float, nu: float, accuracy: float) -> Case:
    problem = as_seen_by(SMALL, pressed([Ball((0.0, 0.0), 1.0, "paraboloid")], depth, h, nu))
    steps = (LIGHT, 1.0) if name == "hertz" else (1.0,)
    return Case(f"{NAME}-{name}", problem, SMALL, accuracy, labels={"part": NAME, "kind": "small"}, steps=steps)


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per case and load step, and one for Hertz's limit."""
    table: list[dict[str, Any]] = []
    for case in found.of_part(NAME):
        answers = forces(found, case)
        for depth, ratio, bar, hertz in answers:
            reference = _reference(case, depth, hertz)
            if reference is not None:
                table.append(_row(case, depth, (ratio, bar), reference))
        if case.name == f"{NAME}-hertz" and len(answers) > 1:
            # linear in sqrt(R D) / h
            depths, ratios, bars, _ = np.array([answers[0], answers[-1]]).T
            weights = extrapolation_weights(depths**0.5)
            limit, error = float(weights @ ratios), float(np.abs(weights) @ bars)
            table.append(_row(case, 0.0, (limit, error), ("Hertz", 1.0, HERTZ_BAND)))
    return table


def _reference(case: Case, depth: float, hertz: float) -> Reference | None:
    """Return the reference for the force at an approach [m]; None where the other code has no answer."""
    if case.model != FINITE:
        small = as_seen_by(SMALL, case.problem).with_load("approach", (depth,))
        force = MODELS["linear_bem"].solve(small, Run(1e-4)).balls[0].normal_force
        return "linear_bem", force / hertz, LINEAR_BAND
    known = [v for d, v in AXISYMMETRIC[case.problem.layer.thickness].items() if abs(d - depth) < 1e-9]
    return ("axisymmetric elements", known[0], AXISYMMETRIC_BAND) if known else None


def _row(case: Case, depth: float, ratio: tuple[float, float], reference: Reference) -> dict[str, Any]:
    name, expected, band = reference
    off = ratio[0] / expected - 1.0
    # the error bar of small_strain is its difference from linear_bem, which no answer exceeds
    bar = case.accuracy if case.model == SMALL else ratio[1] / expected
    return {
        "model": case.model, "h": case.problem.layer.thickness, "nu": case.problem.layer.poisson, "D": depth,
        "ratio": ratio, "reference": name, "expected": expected, "off": 100.0 * off, "bar": 100.0 * bar,
        "band": 100.0 * band, "verdict": claimed(bool(abs(off) <= bar + band), bar),
    }  # fmt: skip


def extrapolation_weights(x: np.ndarray) -> np.ndarray:
    """Return the weights of two values at x (2,) that extrapolate them linearly to x = 0."""
    return np.array([x[1], -x[0]]) / (x[1] - x[0])


PART = Part(NAME, "One ball", cases, rows)
