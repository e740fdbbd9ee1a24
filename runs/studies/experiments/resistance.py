"""Rolling resistance (share of its load below which T moves no ball), and the reports that hold for each share."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runs.studies.experiments import cases
from runs.studies.experiments.cases import CASES, Case, distances
from runs.studies.experiments.points import ABOUT, PAIR, POINTS, YES, Documents, at_cycles
from runs.studies.framework.page import render
from runs.studies.framework.study import timed

SHARES = (7e-5, 1e-2)
"""Shares of the runs: |T|/Q of the 16 mm balls where they stay, checked by `needed`; and a hundred times that."""
FITTED = ("16 mm balls separate to about 50 mm", "they stay there")
"""Reports that the first share is fitted to, which are no evidence for it."""


def resisted(share: float) -> list[Case]:
    """Return the essential cases (except lines of seven) with a share, with the quick version's ensemble."""
    chosen = [case for case in CASES if case.essential and "seven" not in case.name]
    return [dataclasses.replace(case, rolling=share) for case in chosen]


def compute(folder: Path, *, fresh: bool = False) -> None:
    """Run every case with every share, at small strain."""
    for share in SHARES:
        for case in resisted(share):
            with timed(f"{case.name}, rolling resistance {share:g}"):
                cases.evolve(case, case.read(quick=True), "linear_bem", folder, fresh=fresh)


def found(folder: Path) -> dict[float, dict[str, Any]]:
    """Return the saved documents by share and case."""
    out: dict[float, dict[str, Any]] = {}
    for share in SHARES:
        runs = {c.name: cases.evolve(c, c.read(True), "linear_bem", folder, compute=False) for c in resisted(share)}
        out[share] = {name: document for name, document in runs.items() if document is not None}
    return out


def needed(free: Mapping[str, Any]) -> tuple[float, float]:
    """Return the shares at which the 16 mm balls stop ``ABOUT`` farther and nearer than 50 mm, by their free run."""
    distance = distances(free, 0, 1)[1]
    ratio = [abs(m["tangential_force"][0][0]) / m["normal_force"][0] for m in free["path"]]
    near, far = np.exp(np.interp([0.05 + 1e-3 * ABOUT, 0.05 - 1e-3 * ABOUT], distance, np.log(ratio)))
    return float(near), float(far)


def section(free: Documents, by_share: Mapping[float, Documents]) -> str:
    """Return the verdicts on the reports for every share, in Markdown; empty without runs."""
    shares = [share for share, documents in by_share.items() if documents]
    if not shares or PAIR not in free:
        return ""
    low, high = needed(free[PAIR])
    rows, holds = [], dict.fromkeys(shares, True)
    for point in POINTS:
        if any(name not in by_share[share] for share in shares for name in point.cases):
            continue
        words = {share: point.judge(by_share[share]).verdict for share in shares}
        if YES in words.values():  # a report that no share reproduces says nothing about shares
            holds = {share: good and words[share] == YES for share, good in holds.items()}
            rows.append({"the paper reports": point.title, **{f"{s:g} Q": word for s, word in words.items()}})
    every = [f"{share:g} Q" for share in shares if holds[share]]
    return render(
        __file__, "resistance.md.jinja", about=ABOUT, low=low, high=high, every=every, rows=rows,
        history=_history(free, by_share, rows),
    )  # fmt: skip


def _history(
    free: Documents, by_share: Mapping[float, Documents], rows: Sequence[Mapping[str, str]]
) -> dict[str, Any] | None:
    """Return the data of the fit of the share, the reports that test it, and the end of the fitted pair."""
    share = SHARES[0]
    document = by_share.get(share, {}).get(PAIR)
    if document is None:
        return None
    names = [row["the paper reports"] for row in rows]
    tests = [name for name in names if name not in FITTED]
    others = [f"{s:g} Q" for s, runs in by_share.items() if runs and s != share]
    there = [p for p in POINTS if p.title in tests and all(name in free for name in p.cases)]
    ratio = abs(document["path"][-1]["tangential_force"][0][0]) / document["path"][-1]["normal_force"][0]
    return {
        "share": share,
        "fitted": [f'"{name}"' for name in names if name in FITTED],
        "tests": tests,
        "unresisted": sum(point.judge(free).verdict == YES for point in there),
        "others": others,
        "kept": sum(all(row[o] == YES for o in others) for row in rows if row["the paper reports"] not in FITTED),
        "at": ", ".join(f"{1e3 * at_cycles(document, n):.1f}" for n in (50, 100, 200)),
        "rest": "at rest" if document["rest"]["at_rest"] else f"still moving, with |T|/Q = {ratio:.2g}",
    }
