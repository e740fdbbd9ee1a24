"""Progress lines of a solution of many balls."""

import itertools

import pytest

from linear_bem import Ball, Cone, Layer, Load, Problem, report, solve
from tests.linear_bem.sampled_scenes import scene


def test_every_step_is_reported_and_a_report_may_end_the_solution():
    class Enough(Exception):
        pass

    lines = []

    def note(text):
        lines.append(text)
        if "sweep 2" in text:
            raise Enough

    with pytest.raises(Enough):
        solve(scene("force"), 1e-3, note)
    assert lines[0] == "105 ball(s): first guess"
    assert len(lines) == 3


def test_every_long_phase_reports_its_parts(monkeypatch):
    clock = itertools.count(0.0, 10.0)  # as on a very slow machine
    monkeypatch.setattr(report.time, "monotonic", lambda: next(clock))
    lines = []
    solve(scene("approach", "half-space", 110), 1e-2, lines.append)
    for phase in (
        "first guess: coupled point loads",
        "degree 4: 0 of ",
        "degree 4, sweep 1: 110 of 110 contacts alone",
        "T: 0 of ",
        "direct sums: equivalent loads",
        "residuals: 5 of ",
        "5 of ",
        "T: 60 of 110 slope integrals",
    ):
        assert any(line.startswith(phase) for line in lines), phase


def test_every_grid_and_its_long_parts_are_reported(monkeypatch):
    clock = itertools.count(0.0, 10.0)
    monkeypatch.setattr(report.time, "monotonic", lambda: next(clock))
    lines = []
    balls = (*(Ball((x, 0.0), shape=Cone(1.2, 1e-3)) for x in (0.0, 3.0, 6.0)), Ball((9.0, 0.0), 1.0))
    solve(Problem(Layer(1.0, 0.48, 1.25), balls, Load("approach", (0.1, 0.1, 0.1, -0.1))), 1e-2, lines.append)
    for phase in (
        "influence of patches on each other: 1 of 4 patches",
        "grid of 4096 cells: 4 patch(es), 32 cells across one contact's patch",
        "first pressures on the grid: 0 of 4 patches",
        "grid of 4096 cells, step 2: gap ",
        "T along x: 3 of 4 patches",
        "T along y: 3 of 4 patches",
        "height of rest: 0 of 1 balls without load",
    ):
        assert any(line.startswith(phase) for line in lines), (phase, lines)


def test_parts_are_reported_so_long_after_the_last_line_of_any_kind(monkeypatch):
    clock, lines = [0.0], []
    monkeypatch.setattr(report.time, "monotonic", lambda: clock[0])
    whole = report.Timed(lines.append)
    one, other = report.seldom(whole, "one: "), report.seldom(whole, "other: ")
    for passed, say, text in (
        (1.5, one, "dropped"),
        (1.5, other, "said"),
        (1.5, one, "dropped"),
        (0.1, whole, "step"),
        (1.5, one, "dropped"),
        (1.0, one, "said"),
    ):
        clock[0] += passed
        say(text)
    assert lines == ["other: said", "step", "one: said"]
