"""Check of the error bars of T: the bar on every discretisation against a more accurate answer to the same problem."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from runs.comparison.linear_states import LinearStates
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import pair
from runs.studies.framework.records import Found, pull
from runs.studies.verification import convergence
from runs.studies.verification.part import COARSE, Part, claimed

NAME = "bars"
LEVELS = (Level(2, 1.0), Level(3, 1.0), Level(4, 1.0), Level(4, 1.5))
DEPTHS = (0.1, 0.3)
BETTER = 0.5
"""Largest bar of the more accurate answer, over the bar that it checks."""


def cases(quick: bool) -> list[Case]:
    """Return finite-strain cases, each on all discretisations; none in the quick version."""
    depths = () if quick else DEPTHS
    return [
        LevelCase(f"{NAME}-D{depth:g}", pair(depth), "finite_strain", COARSE, labels={"part": NAME}, levels=LEVELS)
        for depth in depths
    ]


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per answer with a reference: `linear_bem` at small strain, otherwise the finest mesh."""
    table = []
    for case in [*found.done(convergence.NAME), *found.done(NAME)]:
        steps, words = found.steps(case.name), "finest mesh"
        better = steps[-1]
        if case.model == "small_strain":
            (better,) = LinearStates(case.problem, None, {}).at_approach(steps[-1:])["steps"]
            words = "linear_bem"
        # the first has no coarser one to compare with, hence no bar
        table += [_row(case, step, better, words) for step in steps[1:] if step is not better]
    return table


def _row(case: Case, step: Mapping[str, Any], better: Mapping[str, Any], words: str) -> dict[str, Any]:
    (value, bar), (known, left) = (pull(each["balls"]) for each in (step, better))
    off, record = abs(value - known), step["record"]
    # a reference that is hardly more accurate decides nothing
    verdict = claimed(off <= bar + left, bar / abs(value)) if left <= BETTER * bar else None
    return {
        "model": case.model, "nu": case.problem.layer.poisson, "D": step["balls"][0]["approach"],
        "mesh": f"order {record['order']}, fineness {record['fineness']:g}", "better": words,
        "off": 100.0 * off / abs(known), "bar": 100.0 * bar / abs(value), "known": 100.0 * left / abs(known),
        "ratio": bar / off if off else None, "verdict": verdict,
    }  # fmt: skip


PART = Part(
    NAME,
    "Error bars of T",
    "Thin pair (h = 1.16 R, L = 2 R): the error bar on every discretisation against a more accurate answer to the same "
    f"problem. No claim is made where the bar of that reference is above {BETTER:g} of the one it checks.",
    cases,
    rows,
    {
        "model": "model", "nu": "nu", "D": "D / R", "mesh": "mesh", "better": "reference", "off": "error [%]",
        "bar": "error bar [%]", "known": "reference's bar [%]", "ratio": "bar / error",
    },
)  # fmt: skip
