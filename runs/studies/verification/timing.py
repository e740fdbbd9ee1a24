"""Time to T within 5, 2 and 1 %: the thin pair, on one rank and on all."""

from __future__ import annotations

from typing import Any

from runs.studies.framework.case import Case
from runs.studies.framework.pair import pair
from runs.studies.framework.records import Found, pull
from runs.studies.verification.part import COARSE, Part, claimed

NAME = "timing"
DEPTHS, ASKED = (0.1, 0.3), (0.05, 0.02, 0.01)
UNKNOWNS = 60e3
"""Budget: enough for 1 %, and what a machine of 8 GB holds."""


def cases(quick: bool) -> list[Case]:
    """Return every depth and accuracy, on all ranks first."""
    places = [(0.0125, COARSE)] if quick else [(depth, asked) for depth in DEPTHS for asked in ASKED]
    return [
        Case(
            f"{NAME}-D{depth:g}-{100 * asked:g}-{'one-rank' if alone else 'all-ranks'}",
            pair(depth), "finite_strain", asked, labels={"part": NAME, "depth": depth, "asked": asked},
            budget={"unknowns": UNKNOWNS}, alone=alone,
        )
        for alone in ((False,) if quick else (False, True))
        for depth, asked in places
    ]  # fmt: skip


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per case: accuracy asked and reached, difference from the best at the same depth, and time."""
    table = []
    mine = found.done(NAME)
    for case in mine:
        alike = [other for other in mine if other.labels["depth"] == case.labels["depth"]]
        best = min(alike, key=lambda other: found.records[other.name]["solved"]["accuracy"]["reached"])
        record = found.records[case.name]
        accuracy = record["solved"]["accuracy"]
        value, other = (pull(found.steps(each.name)[-1]["balls"]) for each in (case, best))
        off = abs(value[0] / other[0] - 1.0)
        table.append(
            {
                "D": case.labels["depth"], "asked": 100.0 * case.labels["asked"],
                "reached": 100.0 * accuracy["reached"], "off": None if case is best else 100.0 * off,
                "ranks": record["ranks"], "meshes": len(accuracy["meshes"]),
                "unknowns": record["solved"]["unknowns"], "wall": record["wall_seconds"],
                "cpu": record["cpu_seconds"], "stopped": accuracy["stopped"],
                "verdict": claimed(
                    bool(accuracy["met"]) and off * abs(other[0]) <= value[1] + other[1], accuracy["reached"]
                ),
            }
        )  # fmt: skip
    return table


PART = Part(
    NAME,
    "Time to an accuracy of T",
    "Thin pair (h = 1.16 R, L = 2 R, nu = 0.48), from the first mesh to the last. Wall seconds depend on "
    "the load of the machine; processor seconds are summed over ranks. The target is 1 % at D = 0.1 R "
    "within 2 minutes on 2 ranks.",
    cases,
    rows,
    {
        "D": "D / R", "asked": "asked [%]", "reached": "reached [%]", "off": "from the best [%]", "ranks": "ranks",
        "meshes": "meshes", "unknowns": "unknowns", "wall": "wall seconds", "cpu": "CPU seconds",
        "stopped": "stopped because",
    },
)  # fmt: skip
