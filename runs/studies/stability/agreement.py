"""By how much a case's T agrees with that of another: at full load, in the limit of no load, or at the same force."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from runs.studies.framework.records import DONE, Found
from runs.studies.stability.matrix import NO_LOAD, SAME_FORCE

FAR_ENOUGH = 4.0
"""How many times as deep as at the first step two theories are compared, to extrapolate to no load."""


def compared(found: Found, name: str, check: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return by which part of T a case differs from the one it is checked against, and by which it may.

    None where either has not come as far as the load compared at, or has no error there.
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
        return None  # saved as nan: an answer that does not know its error
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
    """Return by which part T differs from another theory's in the limit of no load, and by which it may.

    Departures shrink like the square root of the approach: the ratio at the first common step, and at the last one up
    to `FAR_ENOUGH` times as deep, go along a straight line over it. Bars are the larger ones of the two steps.
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
        if any(b["tangential_force_error"] is None for b in both[0]):
            return None
        deep = FAR_ENOUGH * both[0][0]["approach"]
        (root, ratio), *_, (far, there) = [
            (math.sqrt(one["approach"]), _ratio(one, two)) for one, two in both[:1] + both if one["approach"] <= deep
        ]
        limit = ratio if far == root else (ratio * far - there * root) / (far - root)
        worst = max(worst, abs(limit - 1.0))
        bars = [sum(share_of_error(b) for b in two) for two in both if two[0]["approach"] <= deep]
        allowed = max(allowed, bars[0], bars[-1])
    return worst, allowed


def share_of_error(ball: Mapping[str, Any]) -> float:
    """Return the error of a ball's T over T."""
    return float(ball["tangential_force_error"] / math.hypot(*ball["tangential_force"]))


def _ratio(one: Mapping[str, Any], two: Mapping[str, Any]) -> float:
    """Return one T over another, along the latter."""
    (ax, ay), (bx, by) = one["tangential_force"], two["tangential_force"]
    return float((ax * bx + ay * by) / (bx * bx + by * by))


def at_force(steps: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the balls of a load path where it passes the normal forces of ``balls``, along power laws.

    The last two steps are continued where it ends before; errors keep their share of T.
    """
    found = []
    for number, ball in enumerate(balls):
        path = [step["balls"][number] for step in steps]
        first = next((n for n, b in enumerate(path[1:-1]) if b["normal_force"] >= ball["normal_force"]), len(path) - 2)
        low, high = path[first], path[first + 1]
        share = math.log(ball["normal_force"] / low["normal_force"])
        share /= math.log(high["normal_force"] / low["normal_force"])
        grown = math.hypot(*high["tangential_force"]) / math.hypot(*low["tangential_force"])
        factor = grown ** (share - 1.0)
        found.append(
            {
                "tangential_force": [factor * t for t in high["tangential_force"]],
                "tangential_force_error": factor * high["tangential_force_error"],
            }
        )
    return found
