"""Difference of T between two cases: at full load, in the limit of zero load, or at the same force."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from runs.studies.framework.saved_cases import DONE, Found
from runs.studies.stability.matrix import NO_LOAD, SAME_FORCE

FAR_ENOUGH = 4.0
"""Largest approach used to extrapolate to zero load, over that of the first step."""


def compared(found: Found, name: str, check: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the relative difference of T between a case and its reference, and the tolerance.

    None if either case did not reach the load of the comparison, or has no error estimate there.
    """
    other = check["other"]
    path, against = found.steps(name), found.steps(other)
    if check["at"] == NO_LOAD:
        return at_no_load(path, against)
    if found.state(name) != DONE or found.state(other) != DONE:
        return None
    mine, theirs = path[-1]["balls"], against[-1]["balls"]
    if check["at"] == SAME_FORCE:
        if len(against) < 2:
            return None
        theirs = at_force(against, mine)
    if any(ball["tangential_force_error"] is None for ball in (*mine, *theirs)):
        return None  # saved as nan: no error estimate
    factor = check["factor"]
    worst, allowed = 0.0, check["within"]
    size = max(math.hypot(*ball["tangential_force"]) for ball in mine)
    for one, two in zip(mine, theirs, strict=True):
        scaled = [factor * t for t in two["tangential_force"]]
        worst = max(worst, math.dist(one["tangential_force"], scaled) / size)
        bars = one["tangential_force_error"] + factor * two["tangential_force_error"]
        if not check["within"]:
            allowed = max(allowed, bars / size)
    return worst, allowed


def at_no_load(mine: Sequence[Mapping[str, Any]], theirs: Sequence[Mapping[str, Any]]) -> tuple[float, float] | None:
    """Return the relative difference of T between two theories in the limit of zero load, and its tolerance.

    The ratio of the two (the component of mine along theirs), as a function of the square root of the approach, is
    extrapolated by the parabola through the first common step, the last one up to `FAR_ENOUGH` times as deep, and one
    between. The tolerance is the extrapolated error bar plus the difference from the straight line through the first
    and the last step.
    """
    pairs = [
        (one, two)
        for one, two in zip(mine, theirs, strict=False)
        if one["record"].get("fraction") == two["record"].get("fraction")
    ]
    if not pairs or pairs[0][0] is not mine[0]:
        return None
    worst, allowed = 0.0, 0.0
    for ball in range(len(mine[0]["balls"])):
        both = [(one["balls"][ball], two["balls"][ball]) for one, two in pairs]
        near = [two for two in both if two[0]["approach"] <= FAR_ENOUGH * both[0][0]["approach"]]
        if any(b["tangential_force_error"] is None for two in near for b in two):
            return None
        roots = np.array([math.sqrt(one["approach"]) for one, _ in near])
        forces = np.array([[ball["tangential_force"] for ball in two] for two in near])
        ratios = np.sum(forces[:, 0] * forces[:, 1], axis=1) / np.sum(forces[:, 1] ** 2, axis=1)
        errors = np.array([[ball["tangential_force_error"] for ball in two] for two in near])
        bars = np.sum(errors / np.linalg.norm(forces, axis=2), axis=1)
        (line, _), (parabola, spread) = (_at_zero(roots, ratios, bars, points) for points in (2, 3))
        worst = max(worst, abs(parabola - 1.0))
        allowed = max(allowed, spread + abs(parabola - line))
    return worst, allowed


def _at_zero(x: np.ndarray, y: np.ndarray, errors: np.ndarray, points: int) -> tuple[float, float]:
    """Return value and error at x = 0 of the polynomial through ``points`` of the data, both ends included."""
    chosen = np.unique(np.linspace(0, len(x) - 1, points).astype(int))
    weights = np.linalg.solve(np.vander(x[chosen], increasing=True).T, np.eye(len(chosen))[0])
    return float(weights @ y[chosen]), float(np.abs(weights) @ errors[chosen])


def at_force(steps: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return T and its error on a load path at the normal forces of ``balls``, interpolated by power laws.

    Beyond the end of the path the last two steps are extrapolated; relative errors are those of the step above.
    """
    found = []
    for number, ball in enumerate(balls):
        path = [step["balls"][number] for step in steps]
        first = next((n for n, b in enumerate(path[1:-1]) if b["normal_force"] >= ball["normal_force"]), len(path) - 2)
        low, high = path[first], path[first + 1]
        share = math.log(ball["normal_force"] / low["normal_force"])
        share /= math.log(high["normal_force"] / low["normal_force"])
        grown = math.hypot(*high["tangential_force"]) / math.hypot(*low["tangential_force"])
        factor, error = grown ** (share - 1.0), high["tangential_force_error"]
        found.append(
            {
                "tangential_force": [factor * t for t in high["tangential_force"]],
                "tangential_force_error": None if error is None else factor * error,
            }
        )
    return found
