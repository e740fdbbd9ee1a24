"""The observer of a load path: steps are passed on before they are printed, surfaces are gathered if they are kept."""

from __future__ import annotations

import functools
import io
import logging
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from linear_bem.result import BallResult, Step
from runs import cli
from runs.display.numbers import Scale
from runs.process import ranks
from runs.session.progress import Clock, Progress
from runs.session.terminal import on_terminal, waiting
from tests.launch import ROOT

SHIPPED = ROOT / "runs" / "scenes" / "paper_thin_pair.toml"

STEP = Step((BallResult((0.0, 0.0), 1.0, 0.1, 0.2, (0.0, 0.0), 0.0, 1.0, 0.1),), {"step": 3, "iterations": 5})


def test_a_step_that_was_printed_has_been_passed_on(capsys: pytest.CaptureFixture[str]) -> None:
    printed = []
    Progress(Scale(1.0, 1.0), 0.2, root=True, take=lambda _: printed.append(capsys.readouterr().err)).step_done(
        STEP, lambda: None
    )
    assert printed == [""]
    assert "step 3   D = 0.1 R (50 % of the load)   Q = 0.2 E R\u00b2   5 iterations" in capsys.readouterr().err


def test_the_steps_of_three_balls_are_told_of_the_one_with_the_largest_force(
    capsys: pytest.CaptureFixture[str],
) -> None:
    balls = [
        BallResult((x, 0.0), 1.0, 0.1, q, (t, 0.0), 0.0, 1.0, 0.1)
        for x, q, t in ((-2.0, 0.2, 1e-3), (0.0, 0.2 + 1e-12, 0.0), (2.0, 0.2, -1e-3))
    ]
    progress = Progress(Scale(1.0, 1.0), 0.2, root=True, take=lambda _: None)
    progress.step_done(Step(tuple(balls), {"step": 1}), lambda: None)
    said = capsys.readouterr().err
    assert "step 1   ball 0   D = 0.1 R (50 % of the load)   Q = 0.2 E R\u00b2   T/Q = 0.005 (attraction)" in said


@pytest.mark.parametrize(
    ("force", "said"), [((-6e-4, 8e-4), "T/Q = -0.005 (separation)"), ((6e-5, 8e-4), "|T|/Q = 0.00401")]
)
def test_a_step_says_which_component_of_the_force_it_shows(
    force: tuple[float, float], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of three balls T is along its own line, as in the tables."""
    balls = [
        BallResult(place, 1.0, 0.1, 0.2, t, 0.0, 1.0, 0.1)
        for place, t in (((-2.0, 0.0), force), ((0.0, 0.0), (0.0, 0.0)), ((2.0, 0.0), (0.0, 0.0)))
    ]
    Progress(Scale(1.0, 1.0), 0.2, root=True, take=lambda _: None).step_done(Step(tuple(balls), {}), lambda: None)
    assert said in capsys.readouterr().err.split("   ")


def test_the_share_of_the_load_is_that_of_the_deepest_ball(capsys: pytest.CaptureFixture[str]) -> None:
    balls = [
        BallResult((x, 0.0), 1.0, d, 0.2, (t, 0.0), 0.0, 1.0, 0.1) for x, d, t in ((-2.0, 0.1, 1e-3), (0.0, 0.2, -5e-4))
    ]
    progress = Progress(Scale(1.0, 1.0), 0.2, root=True, take=lambda _: None)
    progress.step_done(Step(tuple(balls), {"step": 1}), lambda: None)
    assert "D = 0.1 R (100 % of the load)" in capsys.readouterr().err


@pytest.mark.parametrize("root", [True, False])
def test_a_surface_that_nobody_keeps_is_not_gathered(root: bool) -> None:
    gathered, kept = [], []

    def surface() -> str:
        gathered.append(root)
        return "the surface"

    Progress(Scale(1.0, 1.0), None, root=root, take=lambda _: None).step_done(STEP, surface)
    assert gathered == []
    # gathering is collective: every rank calls it, and rank 0 keeps what comes of it
    Progress(Scale(1.0, 1.0), None, root=root, take=lambda _: None, draw=lambda _, top: kept.append(top)).step_done(
        STEP, surface
    )
    assert gathered == [root]
    assert kept == (["the surface"] if root else [])


class Time:
    """A time that the test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_the_time_left_follows_the_plan_first_and_then_the_pace() -> None:
    at = Time()
    clock = Clock([10.0, 30.0], at)
    assert clock.left == pytest.approx(40.0)
    at.now += 90.0  # forms are compiled
    clock.begin()
    at.now += 20.0  # twice as slow as planned
    clock.reached(0.999999)
    assert clock.left == pytest.approx(30.0 * 24.0 / 14.0, rel=1e-4)  # a tenth of the plan, 4 s, at the plan's pace
    clock.next_mesh(1000.0)
    at.now += 30.0
    clock.reached(0.5)
    assert clock.done == pytest.approx(25.0 / 40.0)
    assert clock.left == pytest.approx(15.0 * 54.0 / 29.0)
    clock.reached(1.0)
    assert clock.left == pytest.approx(0.0)
    clock.next_mesh(4000.0)  # finer than planned: 4^1.5 times the work
    assert clock.left == pytest.approx(8.0 * 30.0 * 54.0 / 44.0)
    assert Clock().left is None
    assert Clock().done is None


def test_a_first_mesh_that_takes_long_says_little_about_the_large_ones() -> None:
    at = Time()
    clock = Clock([1.0, 39.0], at)
    at.now += 10.0
    clock.next_mesh(1000.0)
    assert 39.0 < clock.left < 3.0 * 39.0


def test_what_was_saved_before_counts_for_no_pace() -> None:
    at = Time()
    clock = Clock([10.0, 30.0], at)
    clock.next_mesh(1000.0, saved=0.5)
    assert clock.left == pytest.approx(15.0)
    at.now += 10.0
    clock.reached(0.75)
    assert clock.left == pytest.approx(7.5 * 14.0 / 11.5)  # 7.5 s of the plan took 10 s, and 7.5 s are left


STARTED = {"mesh": "main", "unknowns": 1000, "ranks": 1, "load_steps": 2, "symmetry_planes": 1, "resumed_steps": 0}


def run(expected: tuple[float, ...]) -> None:
    progress = Progress(Scale(1.0, 1.0), 0.2, root=True, take=lambda _: None, expected=expected)
    with progress:
        progress.attempt("coarse", 0.5, 0)
        progress.attempt("coarse", 1.0, 0)
        progress.started(STARTED)
        progress.step_done(STEP, lambda: None)


def test_lines_tell_the_time_passed_and_left(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run((10.0, 30.0))
    assert "0.0 s left" not in capsys.readouterr().err
    monkeypatch.setattr("runs.session.progress.SOON", 0.0)
    run((10.0, 30.0))
    coarse, later, main, step = capsys.readouterr().err.splitlines()
    assert coarse.startswith("coarse mesh: 50 % of the load   0.0 s in all, about 40 s left")
    assert "about" in later
    assert main == "main mesh: 1 000 unknowns, 1 rank(s), 2 load step(s), half model"
    assert "in all, about" in step
    run(())
    assert "left" not in capsys.readouterr().err


def test_every_state_of_a_mesh_brings_the_end_nearer(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    at = Time()
    monkeypatch.setattr("runs.session.progress.Clock", functools.partial(Clock, now=at))
    progress = Progress(Scale(1.0, 1.0), 0.2, root=True, take=lambda _: None, expected=(10.0, 120.0))
    progress.attempt("coarse", 1.0, 0)
    at.now += 10.0
    progress.started({**STARTED, "states": 6})  # three loads, one of them between the load steps
    left = []
    for load in (0.25, 0.5, 1.0):
        for mesh in ("finer", "finer, small strain"):
            progress.attempt(mesh, load, 0)
            progress.attempt(mesh, load, 1)
            left.append(progress.clock.left)
            at.now += 20.0
        if load > 0.25:
            progress.step_done(STEP, lambda: None)
    assert left == pytest.approx([120.0, 100.0, 80.0, 60.0, 40.0, 20.0])
    assert progress.clock.left == pytest.approx(0.0)
    said = capsys.readouterr().err
    assert "finer, small strain mesh: 25 % of the load   30 s in all, about 1 min 40 s left" in said


class Terminal(io.StringIO):
    """A standard error that a person watches."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_has_a_bar_and_a_pipe_and_ranks_have_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    for launched, shown in ((False, True), (True, False)):
        screen = Terminal()
        monkeypatch.setattr(sys, "stderr", screen)
        monkeypatch.setattr(ranks, "launched", lambda launched=launched: launched)
        assert on_terminal() == shown
        run((10.0, 30.0))
        assert ("\x1b[" in screen.getvalue()) == shown
        assert "step 3   D = 0.1 R" in screen.getvalue()
        assert ("1 of 2 load steps" in screen.getvalue()) == shown


@pytest.mark.parametrize("person", [False, True])
def test_a_long_computation_says_that_it_goes_on(person: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    screen: Any = Terminal() if person else io.StringIO()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", screen)
    with waiting("60 balls", first=0.01):
        deadline = time.monotonic() + 20.0
        while "60 balls" not in screen.getvalue() and time.monotonic() < deadline:
            time.sleep(0.01)
    assert "60 balls" in screen.getvalue()
    quick = io.StringIO()
    monkeypatch.setattr(sys, "stderr", quick)
    with waiting("60 balls"):
        pass
    assert not quick.getvalue()


def test_a_long_scene_file_is_said_to_be_read(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cli, "waiting", functools.partial(waiting, first=0.01))
    real = cli.read_scene
    monkeypatch.setattr(cli, "read_scene", lambda _: time.sleep(0.5) or real(SHIPPED))
    with cli.read(tmp_path / "many.toml") as scene:
        assert scene.path == SHIPPED
    assert f"reading {tmp_path / 'many.toml'}: " in capsys.readouterr().err


def test_lines_of_a_solver_are_printed_and_logged_every_few_seconds(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now, logged = [0.0], []
    monkeypatch.setattr("runs.session.progress.time.monotonic", lambda: now[0])
    progress = Progress(Scale(1.0, 1.0), None, root=True, take=lambda _: None, log=logged.append)
    for second, text in ((1.0, "guess"), (3.0, "sweep 1"), (4.0, "sweep 2"), (6.0, "sweep 3")):
        now[0] = second
        progress.note(text)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split("   ")[0] for line in lines] == ["sweep 1", "sweep 3"]
    assert logged == lines


def test_compiling_is_announced_once_and_only_while_the_run_lasts(capsys: pytest.CaptureFixture[str]) -> None:
    log = logging.getLogger("finite_strain")
    progress = Progress(Scale(1.0, 1.0), None, root=True, take=lambda _: None)
    log.setLevel(logging.WARNING)
    with progress:
        log.info("compiling")
        log.info("compiling")
    log.info("compiling")
    assert capsys.readouterr().err == "compiling\n"
    assert (log.level, log.propagate) == (logging.WARNING, True)  # as the user of this process has set it
    log.setLevel(logging.NOTSET)


def test_the_linear_model_hands_its_lines_on() -> None:
    from linear_bem import Ball, Layer, Load, Problem  # noqa: PLC0415
    from runs.models import MODELS, Run  # noqa: PLC0415

    lines: list[str] = []
    ball = Problem(Layer(1.0, 0.3, 5.0), (Ball((0.0, 0.0), 1.0),), Load("approach", (0.1,)))
    MODELS["linear_bem"].solve(ball, Run(report=lines.append))
    assert lines == ["1 ball(s): first guess"]
