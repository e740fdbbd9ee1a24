"""T of the finite elements over T of the linear model: small strain at the paper's load, finite strain at zero load."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from runs.comparison.linear_states import LinearStates
from runs.studies.framework.case import FINITE, SMALL, Case
from runs.studies.framework.pair import PAPER_LOAD, THIN, as_seen_by, pair
from runs.studies.framework.saved_cases import Found, pull
from runs.studies.verification.one_ball import extrapolation_weights
from runs.studies.verification.part import COARSE, Part, claimed

NAME = "small-load"
THICKNESSES, DISTANCES = (0.5, THIN, 2.0, 6.0), (2.0, 3.0)
ACCURACY = 0.02
"""Accuracy requested at finite strain, where the pair's small-strain answer removes most of the error."""
UNKNOWNS = 400_000
"""Largest number of unknowns at small strain, whose mesh alone must give the accuracy `WANTED`."""
LIGHT = 0.004
"""Approach over R of the larger of two loads; the smaller is a third of it."""
TWO_LOADS: tuple[float, ...] = (1.0 / 3.0, 1.0)
WANTED = 0.01
"""Permitted deviation, over |T| or, where T is near its zero, over a tenth of the half-space's mutual force."""


def cases(quick: bool) -> list[Case]:
    """Return both kinematics for every thickness and distance; the quick version has a coarse one."""
    if quick:
        return [dataclasses.replace(_case(SMALL, THIN, 2.0), accuracy=COARSE)]
    return [_case(model, h, distance) for h in THICKNESSES for distance in DISTANCES for model in (SMALL, FINITE)]


def _case(model: str, h: float, distance: float) -> Case:
    name = f"{NAME}-{model.replace('_', '-')}-h{h:g}-L{distance:g}"
    labels = {"part": NAME, "h": h, "L": distance}
    if model == FINITE:
        return Case(name, pair(LIGHT, h, distance=distance), model, ACCURACY, labels=labels, steps=TWO_LOADS)
    problem = as_seen_by(model, pair(1.0, h, distance=distance, shape="paraboloid")).with_load(
        "force", (PAPER_LOAD,) * 2
    )
    return Case(name, problem, model, WANTED, labels=labels, budget={"unknowns": UNKNOWNS})


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per case that is done."""
    return [_row(case, found.steps(case.name)) for case in found.done(NAME)]


def _row(case: Case, steps: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    from finite_strain.geometry.extent import scale_of_force  # noqa: PLC0415  (only where elements are pressed)

    if case.model == SMALL:
        steps = steps[-1:]
    linear = LinearStates(case.problem, None, {}).along("force", steps)["steps"]
    ratios, bars = np.array([_ratio(step, other) for step, other in zip(steps, linear, strict=True)]).T
    depths = np.array([step["balls"][0]["approach"] for step in steps])
    value, bar = float(ratios[-1]), float(bars[-1])
    if len(steps) > 1:
        # the mesh error is the same at both loads: only the ratios are extrapolated, the larger error bar remains
        weights = extrapolation_weights(depths[[0, -1]] ** 0.5)
        value, bar = float(weights @ ratios[[0, -1]]), float(max(bars[0], bars[-1]))
    ball = linear[-1]["balls"][0]
    size, _ = pull(linear[-1]["balls"])
    scale = scale_of_force(case.problem, np.full(2, ball["normal_force"]))
    share = abs(size) / max(abs(size), scale)
    # the error bar of small_strain is its difference from linear_bem, which no answer exceeds
    within = None if case.model == SMALL else "yes" if abs(value - 1.0) <= bar else "no"
    return {
        "model": case.model, "h": case.labels["h"], "L": case.labels["L"],
        "D": " and ".join(f"{d:.3g}" for d in depths[[0, -1]]) if len(steps) > 1 else f"{depths[0]:.3g}",
        "T/Q": size / ball["normal_force"], "ratio": (value, bar), "off": 100.0 * (value - 1.0), "bar": 100.0 * bar,
        "of scale": 100.0 * (value - 1.0) * share, "in bar": within,
        "verdict": claimed(abs(value - 1.0) * share <= WANTED, bar * share if within else 0.0),
    }  # fmt: skip


def _ratio(step: Mapping[str, Any], linear: Mapping[str, Any]) -> tuple[float, float]:
    """Return T over the linear T at the same force, and its error bar."""
    size, other = pull(linear["balls"])
    error = step["record"]["tangential_force_error_at_force"][0] + other
    return pull(step["balls"])[0] / size, error / abs(size)


PART = Part(NAME, "T against the linear model as the load goes to 0", cases, rows)
