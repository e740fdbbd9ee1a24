"""Whether a case ended right: energy and force balance of its load path, and its agreement with another case."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from runs.studies.records import DONE, Found
from runs.studies.stability.matrix import FIRST_STEP, SAME_FORCE

BALANCE = 0.02
"""Largest relative difference of stored energy and work: the work is summed over load steps along power laws."""
FORCES = 1e-6
"""Largest relative difference of the forces on the balls and the reaction of the base."""
RESIDUAL = 1e-3
"""Largest recomputed residual of a linear answer, over the approach, the peak pressure or the load."""


def work(steps: Sequence[Mapping[str, Any]]) -> float:
    """Return the work [J] that the balls did up to the last step: int Q dD, along power laws between steps."""
    total = 0.0
    for ball in range(len(steps[0]["balls"])):
        path = [(step["balls"][ball]["approach"], step["balls"][ball]["normal_force"]) for step in steps]
        depth, force = path[0]
        if depth <= 0.0 or force <= 0.0:
            return math.nan
        # before the first step as in Hertz's contact, Q ~ D^(3/2)
        total += force * depth / 2.5
        for (d0, q0), (d1, q1) in pairwise(path):
            if min(d0, q0, d1, q1) <= 0.0 or d1 <= d0:
                return math.nan
            power = math.log(q1 / q0) / math.log(d1 / d0)
            total += (q1 * d1 - q0 * d0) / (power + 1.0)
    return total


def energy_balance(steps: Sequence[Mapping[str, Any]]) -> float:
    """Return the relative difference of strain energy and work at the last step; nan where a path has neither."""
    stored = steps[-1].get("record", {}).get("strain_energy") if steps else None
    if stored is None or len(steps) < 3:
        return math.nan
    return abs(work(steps) / stored - 1.0)


def largest(steps: Sequence[Mapping[str, Any]], key: str) -> float:
    """Return the largest value of a step's record; nan where none has it."""
    return max((step["record"][key] for step in steps if step.get("record", {}).get(key) is not None), default=math.nan)


def smallest(steps: Sequence[Mapping[str, Any]], key: str) -> float:
    """Return the smallest value of a step's record; nan where none has it."""
    return min((step["record"][key] for step in steps if step.get("record", {}).get(key) is not None), default=math.nan)


def compared(found: Found, name: str, check: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return by which part of T a case differs from the one it is checked against, and by which it may.

    None where either has not come as far as the load compared at, or has no error there.
    """
    met = _balls_compared(found, name, check["other"], check["at"])
    if met is None or any(ball["tangential_force_error"] is None for balls in met for ball in balls):
        return None  # saved as nan: an answer that does not know its error
    mine, theirs = met
    factor = check["factor"]
    worst, granted = 0.0, check["within"]
    size = max(math.hypot(*ball["tangential_force"]) for ball in mine)
    for one, two in zip(mine, theirs, strict=True):
        scaled = [factor * t for t in two["tangential_force"]]
        worst = max(worst, math.dist(one["tangential_force"], scaled) / size)
        bars = one["tangential_force_error"] + factor * two["tangential_force_error"]
        if not check["within"]:
            granted = max(granted, bars / size)
    return worst, granted


def _balls_compared(found: Found, name: str, other: str, at: str) -> tuple[list[Any], list[Any]] | None:
    """Return the balls of both cases at the load that they are compared at; None where one has not come there."""
    mine, theirs = found.steps(name), found.steps(other)
    if at == FIRST_STEP:
        together = mine and theirs and mine[0]["record"].get("fraction") == theirs[0]["record"].get("fraction")
        return (mine[0]["balls"], theirs[0]["balls"]) if together else None
    if found.state(name) != DONE or found.state(other) != DONE:
        return None
    balls = mine[-1]["balls"]
    if at == SAME_FORCE:
        return (balls, at_force(theirs, balls)) if len(theirs) > 1 else None
    return balls, theirs[-1]["balls"]


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


def verdict(found: Found, name: str, labels: Mapping[str, Any]) -> tuple[str, str]:
    """Return how a case ended, in a word, and why: right, named refusal, not checked, WRONG, or its state."""
    state, steps = found.state(name), found.steps(name)
    reason = found.records.get(name, {}).get("reason") or ""
    if state == "refused":
        return ("named refusal" if reason else "WRONG"), reason or "refused without a reason"
    if state != DONE:
        if state == "not converged" and steps:
            faults, passed = _own_checks(steps)
            reason += f"; what it reached: {'; '.join(passed) or 'not checked'}"
            return ("WRONG", "; ".join([*faults, reason])) if faults else (state, reason)
        return state, reason
    found_faults, passed = _own_checks(steps)
    notes: list[str] = []
    residuals = found.records[name].get("solved", {}).get("certificate", {})
    if "force_balance" not in residuals and residuals:  # recomputed by linear_bem from the pressures it returns
        text = f"largest recomputed residual {max(residuals.values()):.2g}"
        (passed if max(residuals.values()) <= RESIDUAL else found_faults).append(text)
    if labels["check"] is not None:
        outcome = compared(found, name, labels["check"])
        words = labels["check"]["words"]
        if outcome is None:
            notes.append(f"not compared with {labels['check']['other']}, which has no answer with an error")
        else:
            difference, granted = outcome
            text = f"{words}: T differs by {100 * difference:.2g} %, {100 * granted:.2g} % granted"
            (passed if difference <= granted else found_faults).append(text)
    if found_faults:
        return "WRONG", "; ".join(found_faults)
    return ("right" if passed else "not checked"), "; ".join(passed + notes)


def _own_checks(steps: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[str]]:
    """Return faults and passed checks of a load path by itself."""
    faults: list[str] = []
    passed: list[str] = []
    energy, forces = energy_balance(steps), largest(steps, "force_balance")
    for value, limit, words in ((energy, BALANCE, "energy against work"), (forces, FORCES, "forces against base")):
        if math.isnan(value):
            continue
        text = f"{words}: {100 * value:.2g} %"
        (passed if value <= limit else faults).append(text)
    folded = smallest(steps, "smallest_volume_ratio")
    if folded <= 0.0:
        faults.append(f"an element is folded over: smallest J = {folded:.2g}")
    passed += _routes(steps, faults)
    _third_law(steps, faults, passed)
    error, size = _error(steps)
    if size > 0.0 and error > size:
        faults.append("the error of T is larger than T")
    return faults, passed


def _routes(steps: Sequence[Mapping[str, Any]], faults: list[str]) -> list[str]:
    """Return whether a linear answer's two routes to T agree within its error; elements have theirs in the error."""
    passed: list[str] = []
    for number, ball in enumerate(steps[-1]["balls"] if steps else []):
        routes = ball.get("tangential_force_routes", {})
        if {"mutual", "slope"} <= set(routes):
            apart = math.dist(routes["mutual"], routes["slope"])
            text = f"mutual formula against slope integral, ball {number}: {apart:.2g}"
            (passed if apart <= 1.001 * ball["tangential_force_error"] else faults).append(text)
    return passed


def _third_law(steps: Sequence[Mapping[str, Any]], faults: list[str], passed: list[str]) -> None:
    """Judge whether unlike balls pull each other alike; it is symmetry where they are alike, and no check."""
    balls = steps[-1]["balls"] if steps else []
    loads = [ball["normal_force"] for ball in balls]
    if len(balls) < 2 or min(loads) > (1.0 - 1e-6) * max(loads):
        return
    left_over = math.hypot(*(sum(ball["tangential_force"][axis] for ball in balls) for axis in (0, 1)))
    errors, size = (
        sum(values)
        for values in zip(
            *((ball["tangential_force_error"] or math.inf, math.hypot(*ball["tangential_force"])) for ball in balls),
            strict=True,
        )
    )
    if size > 0.0:
        text = (
            f"third law: T of all balls adds up to {100 * left_over / size:.2g} %, {100 * errors / size:.2g} % granted"
        )
        (passed if left_over <= errors else faults).append(text)


def _error(steps: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    balls = steps[-1]["balls"] if steps else []
    return (
        max((math.inf if (e := ball["tangential_force_error"]) is None else e for ball in balls), default=0.0),
        max((math.hypot(*ball["tangential_force"]) for ball in balls), default=0.0),
    )
