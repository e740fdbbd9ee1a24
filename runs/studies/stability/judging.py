"""Whether a case ended right: energy and force balance of its load path, and what it is checked against."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from linear_bem.grid.contacts import COARSEST
from runs.studies.framework.records import DONE, Found
from runs.studies.stability.agreement import compared
from runs.studies.stability.matrix import NO_LOAD

BALANCE = 0.02
"""Largest relative difference of stored energy and work: the work is summed over load steps along power laws."""
FORCES = 1e-6
"""Largest relative difference of the forces on the balls and the reaction of the base."""
RESIDUAL = 1e-3
"""Largest recomputed residual of a linear answer, over the approach, the peak pressure or the load."""


SLOPE_ON_GRIDS = 1e-3
"""Part of T by which the slope integral is off on a grid of 256 cells a ball: the check's noise, not the answer's."""
NOT_CONVERGED = "not converged"
ROUNDOFF = 1e-14
"""Part of the normal force that two routes to a T of zero may differ by."""


def work(steps: Sequence[Mapping[str, Any]], meshed: Sequence[float] | None = None) -> float:
    """Return the work [J] that the balls did up to the last step: int Q dD, along power laws between steps.

    ``meshed`` is by which factor the mesh's own Q is larger than the answer's at the last step, per ball: the answer
    is freed from the mesh and from domain truncation, to first order in Q / D; the mesh's energy is not.
    """
    total = 0.0
    for ball in range(len(steps[0]["balls"])):
        path = [(step["balls"][ball]["approach"], step["balls"][ball]["normal_force"]) for step in steps]
        if min(min(pair) for pair in path) <= 0.0:
            return math.nan
        excess = (meshed[ball] - 1.0) * path[-1][0] / path[-1][1] if meshed is not None else 0.0
        path = [(d, q * (1.0 + excess * q / d)) for d, q in path]
        depth, force = path[0]
        # before the first step as in Hertz's contact, Q ~ D^(3/2)
        total += force * depth / 2.5
        for (d0, q0), (d1, q1) in pairwise(path):
            if d1 <= d0:
                return math.nan
            power = math.log(q1 / q0) / math.log(d1 / d0)
            total += (q1 * d1 - q0 * d0) / (power + 1.0)
    return total


def energy_balance(steps: Sequence[Mapping[str, Any]], meshed: Sequence[float] | None = None) -> float:
    """Return the relative difference of strain energy and work at the last step; nan where a path has neither."""
    stored = steps[-1].get("record", {}).get("strain_energy") if steps else None
    if stored is None or len(steps) < 3:
        return math.nan
    return abs(work(steps, meshed) / stored - 1.0)


def meshed_forces(record: Mapping[str, Any]) -> list[float] | None:
    """Return per ball by which factor the finest mesh's Q at full load is larger than the answer's; None: not known."""
    meshes = record.get("solved", {}).get("accuracy", {}).get("meshes", [])
    if not meshes or not record.get("steps"):
        return None
    forces, balls = meshes[-1]["normal_forces"], record["steps"][-1]["balls"]
    forces = forces * len(balls) if len(forces) == 1 else forces
    if len(forces) != len(balls):
        return None  # some balls are others' images, and the record does not tell which
    return [force / ball["normal_force"] for force, ball in zip(forces, balls, strict=True)]


def largest(steps: Sequence[Mapping[str, Any]], key: str) -> float:
    """Return the largest value of a step's record; nan where none has it."""
    return max((step["record"][key] for step in steps if step.get("record", {}).get(key) is not None), default=math.nan)


def smallest(steps: Sequence[Mapping[str, Any]], key: str) -> float:
    """Return the smallest value of a step's record; nan where none has it."""
    return min((step["record"][key] for step in steps if step.get("record", {}).get(key) is not None), default=math.nan)


def verdict(found: Found, name: str, labels: Mapping[str, Any]) -> tuple[str, str]:
    """Return how a case ended, in a word, and why: right, named refusal, not checked, WRONG, or its state."""
    state, steps = found.state(name), found.steps(name)
    # what a case leaves on its way is cleared once it ends
    reason = (found.records.get(name, {}).get("reason") or "").split("; its finished steps are kept in ")[0]
    notes: list[str] = []
    if state == "refused":
        return ("named refusal" if reason else "WRONG"), reason or "refused without a reason"
    if state != DONE:
        if state == NOT_CONVERGED and steps:
            faults, passed = _own_checks(steps)
            if labels["check"] is not None and labels["check"]["at"] == NO_LOAD:
                _agreement(found, name, labels["check"], faults, passed, notes)
            reason += f"; what it reached: {'; '.join(passed) or 'not checked'}"
            return ("WRONG", "; ".join([*faults, reason])) if faults else (state, reason)
        return state, reason
    found_faults, passed = _own_checks(
        steps, meshed_forces(found.records[name]), found.records[name].get("solved", {}).get("unknowns", 0)
    )
    residuals = found.records[name].get("solved", {}).get("certificate", {})
    if "force_balance" not in residuals and residuals:  # recomputed by linear_bem from the pressures it returns
        text = f"largest recomputed residual {max(residuals.values()):.2g}"
        (passed if max(residuals.values()) <= RESIDUAL else found_faults).append(text)
    if labels["check"] is not None:
        _agreement(found, name, labels["check"], found_faults, passed, notes)
    if found_faults:
        return "WRONG", "; ".join(found_faults)
    return ("right" if passed else "not checked"), "; ".join(passed + notes)


def _agreement(
    found: Found, name: str, check: Mapping[str, Any], faults: list[str], passed: list[str], notes: list[str]
) -> None:
    """Judge a case by the one that it is checked against."""
    outcome = compared(found, name, check)
    if outcome is None:
        notes.append(f"not compared with {check['other']}, which has no answer with an error")
        return
    difference, allowed = outcome
    text = f"{check['words']}: T differs by {100 * difference:.2g} %, tolerance {100 * allowed:.2g} %"
    (passed if difference <= allowed else faults).append(text)


def _own_checks(
    steps: Sequence[Mapping[str, Any]], meshed: Sequence[float] | None = None, unknowns: int = 0
) -> tuple[list[str], list[str]]:
    """Return faults and passed checks of a load path by itself."""
    faults: list[str] = []
    passed: list[str] = []
    energy, forces = energy_balance(steps, meshed), largest(steps, "force_balance")
    for value, limit, words in ((energy, BALANCE, "energy against work"), (forces, FORCES, "forces against base")):
        if math.isnan(value):
            continue
        text = f"{words}: {100 * value:.2g} %"
        (passed if value <= limit else faults).append(text)
    folded = smallest(steps, "smallest_volume_ratio")
    if folded <= 0.0:
        faults.append(f"an element is folded over: smallest J = {folded:.2g}")
    passed += _routes(steps, unknowns, faults)
    _third_law(steps, faults, passed)
    error, size = _error(steps)
    if size > 0.0 and error > size:
        faults.append("the error of T is larger than T")
    return faults, passed


def _routes(steps: Sequence[Mapping[str, Any]], unknowns: int, faults: list[str]) -> list[str]:
    """Return whether a linear answer's two routes to T agree within its error; elements have theirs in the error."""
    passed: list[str] = []
    noise = SLOPE_ON_GRIDS if unknowns >= COARSEST**2 else 0.0
    for number, ball in enumerate(steps[-1]["balls"] if steps else []):
        routes = ball.get("tangential_force_routes", {})
        if {"mutual", "slope"} <= set(routes):
            apart, size = math.dist(routes["mutual"], routes["slope"]), math.hypot(*ball["tangential_force"])
            allowed = 1.001 * ball["tangential_force_error"] + ROUNDOFF * ball["normal_force"]
            text = (
                f"mutual formula against slope integral, ball {number}: {apart:.2g}, "
                f"tolerance {max(allowed, noise * size):.2g}"
            )
            (passed if apart <= max(allowed, noise * size) else faults).append(text)
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
            f"third law: T of all balls adds up to {100 * left_over / size:.2g} %, tolerance "
            f"{100 * errors / size:.2g} %"
        )
        (passed if left_over <= errors else faults).append(text)


def last_good(steps: Sequence[Mapping[str, Any]], state: str, reason: str) -> float:
    """Return the part of the load that was reached; a stop on the first mesh says it in words alone."""
    if steps:
        return float(steps[-1].get("record", {}).get("fraction", 1.0))
    told = re.search(r"last good state is at (\S+) of the full load", reason)
    return float(told[1]) if state == NOT_CONVERGED and told else 0.0


def _error(steps: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    balls = steps[-1]["balls"] if steps else []
    return (
        max((math.inf if (e := ball["tangential_force_error"]) is None else e for ball in balls), default=0.0),
        max((math.hypot(*ball["tangential_force"]) for ball in balls), default=0.0),
    )
