"""Whether a case ended right: energy and force balance of its load path, and its agreement with another case."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from runs.studies.records import DONE, Found

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

    None where either has no answer, or one without an error.
    """
    other = check["other"]
    if found.state(name) != DONE or found.state(other) != DONE:
        return None
    mine, theirs = found.steps(name)[-1]["balls"], found.steps(other)[-1]["balls"]
    if any(ball["tangential_force_error"] is None for ball in (*mine, *theirs)):
        return None  # saved as nan: an answer that does not know its error
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


def verdict(found: Found, name: str, labels: Mapping[str, Any]) -> tuple[str, str]:
    """Return how a case ended, in a word, and why: right, named refusal, not checked, WRONG, or its state."""
    state, steps = found.state(name), found.steps(name)
    reason = found.records.get(name, {}).get("reason") or ""
    if state == "refused":
        return ("named refusal" if reason else "WRONG"), reason or "refused without a reason"
    if state != DONE:
        return state, reason
    found_faults, passed = _own_checks(steps)
    residuals = found.records[name].get("solved", {}).get("certificate", {})
    if "force_balance" not in residuals and residuals:  # recomputed by linear_bem from the pressures it returns
        text = f"largest recomputed residual {max(residuals.values()):.2g}"
        (passed if max(residuals.values()) <= RESIDUAL else found_faults).append(text)
    if labels["check"] is not None:
        outcome = compared(found, name, labels["check"])
        words = labels["check"]["words"]
        if outcome is None:
            passed.append(f"not compared with {labels['check']['other']}, which has no answer with an error")
        else:
            difference, granted = outcome
            text = f"{words}: T differs by {100 * difference:.2g} %, {100 * granted:.2g} % granted"
            (passed if difference <= granted else found_faults).append(text)
    if found_faults:
        return "WRONG", "; ".join(found_faults)
    return ("right" if passed else "not checked"), "; ".join(passed)


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


def _error(steps: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    balls = steps[-1]["balls"] if steps else []
    return (
        max((math.inf if (e := ball["tangential_force_error"]) is None else e for ball in balls), default=0.0),
        max((math.hypot(*ball["tangential_force"]) for ball in balls), default=0.0),
    )
