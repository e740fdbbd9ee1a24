"""Check of the error bars at every load step: small_strain against linear_bem, which is far more accurate."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from runs.studies.framework.case import LINEAR, SMALL
from runs.studies.framework.saved_cases import DONE, Found
from runs.studies.stability.agreement import share_of_error

WELL_KNOWN = 0.1
"""Largest error of the linear answer over the error bar that it checks."""


def path_bars(found: Found) -> list[dict[str, Any]]:
    """Return one row per small-strain case: its errors along the load compared with its error bars.

    Cases whose linear reference is not accurate enough are omitted.
    """
    rows = []
    for case in found.cases:
        name = case.labels["case"]
        shares = _shares(found, case.name, f"{name}-{LINEAR.replace('_', '-')}") if case.model == SMALL else []
        if not shares:
            continue
        depth, worst, error = max(shares, key=lambda entry: entry[1])
        rows.append(
            {
                "case": name,
                "steps": len(shares),
                "beyond their bar": sum(share > 1.0 for _, share, _ in shares),
                "largest error over bar": worst,
                "at D / R": depth,
                "error there [%]": 100.0 * error,
                "error over bar at full load": shares[-1][1] if found.state(case.name) == DONE else None,
            }
        )
    return rows


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return how many error bars hold at full load and do not before, and the worst row; empty if none is checked."""
    ends = [row["error over bar at full load"] for row in rows if row["error over bar at full load"] is not None]
    if not ends:
        return {}
    kept = sum(end <= 1.0 for end in ends)
    return {
        "ends": ends, "kept": kept, "before": sum(row["steps"] for row in rows) - len(ends),
        "beyond": sum(row["beyond their bar"] for row in rows) - (len(ends) - kept),
        "worst": max(rows, key=lambda row: row["largest error over bar"]),
    }  # fmt: skip


def _shares(found: Found, name: str, twin: str) -> list[tuple[float, float, float]]:
    """Return (approach over radius, error over bar, relative error) of T per load step, for the worst ball."""
    known = {step["record"].get("fraction"): step["balls"] for step in found.steps(twin)}
    entries = []
    for step in found.steps(name):
        others = known.get(step["record"].get("fraction"))
        if others is None:
            continue
        worst = (0.0, -1.0, 0.0)
        for one, two in zip(step["balls"], others, strict=True):
            bar = one["tangential_force_error"]
            if not bar or two["tangential_force_error"] > WELL_KNOWN * bar:
                continue
            off = math.dist(one["tangential_force"], two["tangential_force"])
            relative = off * share_of_error(one) / bar
            worst = max(worst, (one["approach"] / one["radius"], off / bar, relative), key=lambda entry: entry[1])
        if worst[1] >= 0.0:
            entries.append(worst)
    return entries
