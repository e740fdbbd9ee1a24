"""Verdict on a case: energy and force balance of its load path, and agreement with its reference."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from linear_bem.grid.contacts import COARSEST
from linear_bem.result import FAINT, UNRESOLVED
from runs.studies.framework.saved_cases import DONE, Found
from runs.studies.stability.agreement import compared
from runs.studies.stability.matrix import LINEAR_ACCURACY, NO_LOAD

BALANCE = 0.02
"""Largest relative difference of stored energy and work; the work is integrated by power laws between load steps."""
FORCES = 1e-6
"""Largest relative difference of the forces on the balls and the reaction of the base."""
RESIDUAL = 1e-3
"""Largest recomputed residual of a linear answer, over the approach, the peak pressure or the load."""
SLOPE_ON_GRIDS = 1e-3
"""Relative error of the slope integral on a grid of 256 cells per ball: an error of the check, not of the answer."""
MEANINGFUL = 0.1
"""Largest relative error of T of a resolved answer; largest relative tolerance of a meaningful check on T."""
NOT_CONVERGED, NOT_RESOLVED = "not converged", "T not resolved"
STATE_UNRESOLVED, FORCE_UNRESOLVED = "state reported as unresolved", "T reported as unresolved"
ROUNDOFF = 1e-14
"""Tolerance on the difference of two routes to a zero T, over the normal force."""


def work(steps: Sequence[Mapping[str, Any]], meshed: Sequence[float] | None = None) -> float:
    """Return the work [J] that the balls did up to the last step: int Q dD, by power laws between steps.

    ``meshed``: per ball, Q on the mesh over Q of the answer at the last step. The answer is corrected for mesh and
    domain truncation, but the energy is not, so the path is scaled back to first order in Q / D.
    """
    total = 0.0
    for ball in range(len(steps[0]["balls"])):
        path = [(step["balls"][ball]["approach"], step["balls"][ball]["normal_force"]) for step in steps]
        if not any(depth for depth, _ in path):
            continue  # a ball that does not move does no work
        if min(min(pair) for pair in path) <= 0.0:
            return math.nan
        excess = (meshed[ball] - 1.0) * path[-1][0] / path[-1][1] if meshed is not None else 0.0
        path = [(d, q * (1.0 + excess * q / d)) for d, q in path]
        depth, force = path[0]
        # before the first step Q ~ D^(3/2), as in Hertz contact
        total += force * depth / 2.5
        for (d0, q0), (d1, q1) in pairwise(path):
            if d1 <= d0:
                return math.nan
            power = math.log(q1 / q0) / math.log(d1 / d0)
            total += (q1 * d1 - q0 * d0) / (power + 1.0)
    return total


def energy_balance(steps: Sequence[Mapping[str, Any]], meshed: Sequence[float] | None = None) -> float:
    """Return the relative difference of strain energy and work at the last step; nan for paths without them."""
    stored = steps[-1].get("record", {}).get("strain_energy") if steps else None
    if stored is None or len(steps) < 3:
        return math.nan
    return abs(work(steps, meshed) / stored - 1.0)


def meshed_forces(record: Mapping[str, Any]) -> list[float] | None:
    """Return, per ball, Q of the finest mesh over Q of the answer at full load; None if unknown."""
    meshes = record.get("solved", {}).get("accuracy", {}).get("meshes", [])
    if not meshes or not record.get("steps"):
        return None
    forces, balls = meshes[-1]["normal_forces"], record["steps"][-1]["balls"]
    forces = forces * len(balls) if len(forces) == 1 else forces
    if len(forces) != len(balls):
        return None  # some balls are mirror images; the record does not contain which ones
    return [force / ball["normal_force"] for force, ball in zip(forces, balls, strict=True)]


def recorded(steps: Sequence[Mapping[str, Any]], key: str) -> list[float]:
    """Return a value from the steps' records, where present."""
    return [value for step in steps if (value := step.get("record", {}).get(key)) is not None]


@dataclass
class Checks:
    """Outcome of a case's checks; ``unresolved``: reasons why its T is not resolved."""

    faults: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    passed: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unresolved: list[str] = field(default_factory=list)

    def judge(self, holds: bool, text: str, owed: bool = True) -> None:
        """Record one check; unless ``owed``, it need not hold for a state that the result calls unresolved."""
        (self.passed if holds else self.faults if owed else self.doubts).append(text)

    def judge_force(self, apart: float, allowed: float, words: str, owed: bool = True) -> None:
        """Record a check on T: difference and tolerance, relative to T; with too large a tolerance it can only fail."""
        text = f"{words} {100 * apart:.2g} %, tolerance {100 * allowed:.2g} %"
        if apart <= allowed and allowed > MEANINGFUL:
            self.notes.append(f"{text}, which is no check")
        else:
            self.judge(apart <= allowed, text, owed)


def verdict(found: Found, name: str, labels: Mapping[str, Any]) -> tuple[str, str]:
    """Return verdict and reason: right, T not resolved, refused with a reason, not checked, WRONG, or the case's state.

    If equilibrium holds and the result itself states that it is not resolved, the verdict is `STATE_UNRESOLVED`; if the
    result gives only a bound of T, it is `FORCE_UNRESOLVED`. T is not resolved if all checks pass and its error is
    above `MEANINGFUL` of T.
    """
    state, steps, record = found.state(name), found.steps(name), found.records.get(name, {})
    # a case's working files are deleted when it ends
    reason = (record.get("reason") or "").split("; its finished steps are kept in ")[0]
    if state == "refused":
        return ("refused with a reason" if reason else "WRONG"), reason or "refused without a reason"
    if state != DONE and not (state == NOT_CONVERGED and steps):
        return state, reason
    checks, check = Checks(), labels["check"]
    _judge_path(checks, record)
    if check is not None and (state == DONE or check["at"] == NO_LOAD):
        outcome = compared(found, name, check)
        if outcome is None:
            checks.notes.append(f"not compared with {check['other']}, which has no answer with an error")
        else:
            checks.judge_force(*outcome, f"{check['words']}: T differs by", owed=False)
    if state != DONE:
        reason += f"; what it reached: {'; '.join(checks.passed) or 'not checked'}"
        faults = checks.faults + checks.doubts
        return ("WRONG", "; ".join([*faults, reason])) if faults else (state, reason)
    said = [note for note in record.get("solved", {}).get("notes", []) if note.startswith((UNRESOLVED, FAINT))]
    distorted = any(note.startswith(UNRESOLVED) for note in said)
    if checks.faults or (checks.doubts and not distorted):
        return "WRONG", "; ".join(checks.faults + checks.doubts)
    if said or checks.unresolved:
        why = "; ".join([*(said or checks.unresolved), *checks.doubts, *checks.passed, *checks.notes])
        return STATE_UNRESOLVED if distorted else FORCE_UNRESOLVED if said else NOT_RESOLVED, why
    return ("right" if checks.passed else "not checked"), "; ".join(checks.passed + checks.notes)


def _judge_path(checks: Checks, record: Mapping[str, Any]) -> None:
    steps, solved = record.get("steps", []), record.get("solved", {})
    energy = energy_balance(steps, meshed_forces(record))
    forces = max(recorded(steps, "force_balance"), default=math.nan)
    if not math.isnan(energy):
        checks.judge(energy <= BALANCE, f"energy against work: {100 * energy:.2g} %", owed=False)
    if not math.isnan(forces):
        held = checks.notes if forces <= FORCES else checks.faults  # required of any state, and no statement about T
        held.append(f"forces against base: {100 * forces:.2g} %")
    folded = min(recorded(steps, "smallest_volume_ratio"), default=math.nan)
    if folded <= 0.0:
        checks.faults.append(f"an element is folded over: smallest J = {folded:.2g}")
    balls = steps[-1]["balls"] if steps else []
    _judge_routes(checks, balls, solved.get("unknowns", 0))
    _judge_third_law(checks, balls, steps[-1].get("record", {}) if steps else {})
    error, size = max((_error(ball) for ball in balls), default=0.0), max((_size(ball) for ball in balls), default=0.0)
    if error > MEANINGFUL * size > 0.0:
        known = f"{100 * error / size:.2g} %" if math.isfinite(error) else "an unknown part"
        checks.unresolved.append(f"the error of T is {known} of T")
    residuals = solved.get("certificate", {})
    if "force_balance" not in residuals and residuals:  # recomputed by linear_bem from the pressures it returns
        largest = max(residuals.values())
        checks.judge(largest <= RESIDUAL, f"largest recomputed residual {largest:.2g}")


def _judge_routes(checks: Checks, balls: Sequence[Mapping[str, Any]], unknowns: int) -> None:
    """Check that the two routes to T of a linear answer agree to the accuracy requested; its error is no measure."""
    allowed_share = SLOPE_ON_GRIDS if unknowns >= COARSEST**2 else LINEAR_ACCURACY
    for number, ball in enumerate(balls):
        routes = ball.get("tangential_force_routes", {})
        if {"mutual", "slope"} <= set(routes):
            apart = math.dist(routes["mutual"], routes["slope"])
            allowed = allowed_share * _size(ball) + ROUNDOFF * ball["normal_force"]
            text = f"mutual formula against slope integral, ball {number}: {apart:.2g}, tolerance {allowed:.2g}"
            checks.judge(apart <= allowed, text)


def _judge_third_law(checks: Checks, balls: Sequence[Mapping[str, Any]], record: Mapping[str, Any]) -> None:
    """Check that T of all balls sums to zero; skipped for equal loads, where symmetry makes it trivial.

    The finite elements use it to correct T, so the ``record`` of their step holds sum and error before that.
    """
    loads = [ball["normal_force"] for ball in balls]
    if len(balls) < 2 or min(loads) > (1.0 - 1e-6) * max(loads):
        return
    left_over = math.hypot(*(sum(ball["tangential_force"][axis] for ball in balls) for axis in (0, 1)))
    errors, size = sum(_error(ball) or math.inf for ball in balls), sum(_size(ball) for ball in balls)
    if record.get("imbalance_error") is not None:
        left_over, errors = record["imbalance"], record["imbalance_error"]
    if size > 0.0:
        checks.judge_force(left_over / size, errors / size, "third law: T of all balls adds up to")


def _size(ball: Mapping[str, Any]) -> float:
    return math.hypot(*ball["tangential_force"])


def _error(ball: Mapping[str, Any]) -> float:
    """Return the error of a ball's T; an unknown one is saved as None."""
    return math.inf if ball["tangential_force_error"] is None else float(ball["tangential_force_error"])


def last_good(steps: Sequence[Mapping[str, Any]], state: str, reason: str) -> float:
    """Return the load fraction reached; after a failure on the first mesh, only the message contains it."""
    if steps:
        return float(steps[-1].get("record", {}).get("fraction", 1.0))
    named = re.search(r"last good state is at (\S+) of the full load", reason)
    return float(named[1]) if state == NOT_CONVERGED and named else 0.0
