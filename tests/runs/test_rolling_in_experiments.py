"""Resistance to rolling in the study of the experiments: the share that an end needs, and what a share changes."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from runs.studies.experiments import resistance
from runs.studies.experiments.cases import CASES
from runs.studies.experiments.points import NO, PAIR, POINTS, YES, Finding

LEFT = next(point for point in POINTS if point.title == "they stay there")
APART = next(point for point in POINTS if point.title == "16 mm balls separate to about 50 mm")


def pair(end: float, at_rest: bool) -> dict[str, Any]:
    """The document of two balls that move apart to ``end`` [m], |T|/Q = exp(-distance / 5 mm)."""
    distances = np.linspace(0.016, end, 200)
    moments = [
        {
            "cycle": 100.0 * (d - 0.016) / (end - 0.016),
            "positions": [[0.0, 0.0], [float(d), 0.0]],
            "tangential_force": [[-float(np.exp(-d / 0.005)), 0.0], [float(np.exp(-d / 0.005)), 0.0]],
            "normal_force": [1.0, 1.0],
            "contacts": [],
        }
        for d in distances
    ]
    return {"path": moments, "rest": {"at_rest": at_rest}}


def test_the_share_that_an_end_needs_is_the_force_there() -> None:
    low, high = resistance.needed(pair(0.065, at_rest=False))
    assert low == pytest.approx(np.exp(-11.0), rel=1e-3)
    assert high == pytest.approx(np.exp(-9.0), rel=1e-3)


@pytest.mark.parametrize(
    ("end", "at_rest", "verdict"), [(0.065, False, NO), (0.052, True, YES), (0.052, False, YES), (0.030, True, NO)]
)
def test_balls_stay_where_they_were_seen_only_if_they_are_there_later(end: float, at_rest: bool, verdict: str) -> None:
    assert LEFT.judge({PAIR: pair(end, at_rest)}).verdict == verdict


@pytest.mark.parametrize(("end", "verdict"), [(0.0445, NO), (0.05, YES), (5.0, NO)])
def test_balls_separate_to_about_the_distance_that_was_seen_and_not_to_any_other(end: float, verdict: str) -> None:
    assert APART.judge({PAIR: pair(end, at_rest=True)}).verdict == verdict


def test_the_page_says_which_share_explains_every_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resistance, "POINTS", (LEFT, APART))
    free, by_share = {PAIR: pair(0.065, at_rest=False)}, {1e-4: {PAIR: pair(0.05, at_rest=True)}}
    one = resistance.section(free, by_share)
    assert "one value explains all 2 reports that any value explains: 0.0001 Q" in one
    none = resistance.section(free, {1e-2: {PAIR: pair(0.02, at_rest=True)}, **by_share})
    assert "one value explains all 2 reports that any value explains: 0.0001 Q" in none
    assert f"| {NO} | {YES} |" in none
    assert resistance.section(free, {1e-4: {}}) == ""


def test_the_page_says_which_reports_the_share_is_fitted_to(monkeypatch: pytest.MonkeyPatch) -> None:
    other = dataclasses.replace(LEFT, title="another report", judge=lambda _: Finding(YES, ""))
    monkeypatch.setattr(resistance, "POINTS", (APART, LEFT, other))
    free, share = {PAIR: pair(0.065, at_rest=False)}, resistance.SHARES[0]
    moving, resting = (resistance.section(free, {share: {PAIR: pair(0.052, end)}}) for end in (False, True))
    assert '"16 mm balls separate to about 50 mm" and "they stay there" are fitted and are no evidence' in moving
    assert "The other 1 reports are the test" in moving
    assert "1 of them hold without resistance." in moving
    assert 'criterion of "they stay there" was changed after a first look' in moving
    assert "34.0, 52.0, 52.0 mm apart after 50, 100 and 200 cycles, and then still moving, with |T|/Q = 3e-05" in moving
    assert "and then at rest" in resting


def test_a_case_with_a_share_is_a_run_of_its_own() -> None:
    case = next(case for case in resistance.resisted(1e-2) if case.name == PAIR)
    assert case.read(quick=True).drift["rolling_resistance"].share == 1e-2
    free = next(case for case in CASES if case.name == PAIR)
    assert "rolling_resistance" not in free.read(quick=True).drift
