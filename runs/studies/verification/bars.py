"""Whether the error bars of T hold: every discretisation's own bar against a better answer of the same problem."""

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
"""Part of a bar to which the better answer must be known."""


def cases(quick: bool) -> list[Case]:
    """Return finite strain on one discretisation after the other; the quick version has none."""
    depths = () if quick else DEPTHS
    return [
        LevelCase(f"{NAME}-D{depth:g}", pair(depth), "finite_strain", COARSE, labels={"part": NAME}, levels=LEVELS)
        for depth in depths
    ]


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per answer that has a better one: `linear_bem`'s at small strain, else that of the finest mesh."""
    table = []
    for case in [*found.done(convergence.NAME), *found.done(NAME)]:
        steps, words = found.steps(case.name), "finest mesh"
        better = steps[-1]
        if case.model == "small_strain":
            (better,) = LinearStates(case.problem, None, {}).at_approach(steps[-1:])["steps"]
            words = "linear_bem"
        # the first has no change since a coarser one, and so no bar
        table += [_row(case, step, better, words) for step in steps[1:] if step is not better]
    return table


def _row(case: Case, step: Mapping[str, Any], better: Mapping[str, Any], words: str) -> dict[str, Any]:
    (value, bar), (known, left) = (pull(each["balls"]) for each in (step, better))
    off, record = abs(value - known), step["record"]
    # a better answer that is hardly better judges nothing
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
    "Thin pair (h = 1.16 R, L = 2 R): the bar of every discretisation against what a better answer of the same problem "
    f"says. Nothing is claimed where that answer is not known to {BETTER:g} of the bar.",
    cases,
    rows,
    {
        "model": "model", "nu": "nu", "D": "D / R", "mesh": "mesh", "better": "better answer", "off": "off [%]",
        "bar": "own bar [%]", "known": "better answer's bar [%]", "ratio": "bar over error",
    },
)  # fmt: skip
