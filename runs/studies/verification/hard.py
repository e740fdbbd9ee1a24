"""Hard cases: each ends in an answer that its check confirms, or in a refusal or a stop with step and reason.

Cases shared with the study ``stability`` reuse the answers in its folder; the others are defined here.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from runs.studies.framework.case import FINITE, LINEAR, SMALL, Case
from runs.studies.framework.pair import pair
from runs.studies.framework.records import Found
from runs.studies.stability.judging import NOT_RESOLVED, energy_balance, took, verdict
from runs.studies.stability.matrix import Check, Hard, case_of, hard_cases
from runs.studies.verification.part import COARSE, Part, worded

NAME = "hard"
ACCURACY = 0.1
TAKEN = (
    "usual", "one-step", "coarse", "incompressible", "nearly-incompressible", "equal-substrate", "very-deep", "deepest",
    "lifted",
)  # fmt: skip
"""Cases of the study ``stability`` that belong here; where two are checked against each other, the reference first."""


def chosen() -> list[Hard]:
    """Return every hard case of this study."""
    linear = "linear_bem, another model of the same problem"
    known = {hard.name: hard for hard in hard_cases()}

    def asked(hard: Hard) -> tuple[str, ...]:
        """Return the models used for a shared case: small strain only if linear_bem checks it."""
        return tuple(m for m in hard.models if m == FINITE or (m in (SMALL, LINEAR) and SMALL in hard.checks))

    return [
        *(dataclasses.replace(known[name], models=asked(known[name])) for name in TAKEN),
        Hard(
            "thin-layer", "h = 0.2 R, D = 0.05 R", pair(0.05, 0.2), (LINEAR, SMALL, FINITE),
            {SMALL: Check(linear, "hard-thin-layer-linear-bem")},
        ),
        Hard("touching-deep", "L = 2 R, D = 1 R in h = 1.16 R: 0.86 of its thickness", pair(1.0), (FINITE,)),
        Hard(
            "resting", "one ball pressed in by 0.2 R, its neighbour only rests", pair((0.2, 0.0)),
            (LINEAR, SMALL, FINITE),
            {SMALL: Check(linear, "hard-resting-linear-bem")},
        ),
    ]  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """Return every case and model; only the refusal in the quick version."""
    hards = [hard for hard in chosen() if not quick or hard.name == "deepest"]
    return [_case(hard, model, quick) for hard in hards for model in hard.models]


def _case(hard: Hard, model: str, quick: bool) -> Case:
    case = case_of(hard, model, COARSE if quick else hard.accuracy or ACCURACY)
    labels = {"part": NAME, **case.labels}
    check = labels["check"]
    if check is not None and not check["other"].startswith(NAME):
        labels["check"] = {**check, "other": f"{NAME}-{check['other']}"}
    same = ("stability", case.name) if hard.name in TAKEN else None
    return dataclasses.replace(case, name=f"{NAME}-{case.name}", labels=labels, same_as=same)


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per case and model; a stop or refusal with a reason is neither right nor wrong."""
    return [_row(found, case) for case in found.of_part(NAME)]


def judged(found: Found, case: Case) -> tuple[str, str]:
    """Return how a case ended and why, as the study ``stability`` judges it.

    An unresolved T counts as wrong, except for a ball that only rests: nothing holds it against its neighbour, so its
    T is zero within its error.
    """
    ended, why = verdict(found, case.name, case.labels)
    if ended != NOT_RESOLVED:
        return ended, why
    rests = case.problem.load.kind == "approach" and min(case.problem.load.values) <= 0.0
    return ("right", "T is zero within its error") if rests else ("WRONG", why)


def _row(found: Found, case: Case) -> dict[str, Any]:
    steps = found.steps(case.name)
    ended, why = judged(found, case)
    row: dict[str, Any] = {"case": case.labels["words"], "model": case.model, "ended": ended, "why": why}
    row["verdict"] = worded(found, case, ended)
    if steps:
        ball = steps[-1]["balls"][0]
        row |= {
            "D": ball["approach"],
            "T": (ball["tangential_force"][0], ball["tangential_force_error"]),
            **took(found, case),
            "balance": energy_balance(steps),
            "cpu": found.records[case.name].get("cpu_seconds"),
        }
    return row


PART = Part(
    NAME,
    "Hard cases",
    "Each is checked by energy against work (2 %), force balance (1e-6), elements not folded "
    "over, and where a second route exists by another case. R = 1, E1 = 1. More of them, and more models, are in the "
    "study `stability`.",
    cases,
    rows,
    {
        "case": "case", "model": "model", "ended": "ended", "D": "D / R", "T": "T", "steps": "steps",
        "cuts": "cut-backs", "J": "J", "penetration": "penetration", "cpu": "CPU seconds", "why": "checks, or reason",
    },
)  # fmt: skip
