"""The observer of a load path: steps are passed on before they are printed, surfaces are gathered if they are kept."""

from __future__ import annotations

import pytest

from linear_bem.result import BallResult, Step
from runs.display.numbers import Scale
from runs.session.progress import Progress

STEP = Step((BallResult((0.0, 0.0), 1.0, 0.1, 0.2, (0.0, 0.0), 0.0, 1.0, 0.1),), {"step": 3, "iterations": 5})


def test_a_step_that_was_printed_has_been_passed_on(capsys: pytest.CaptureFixture[str]) -> None:
    printed = []
    Progress(Scale(1.0, 1.0), 0.2, root=True, take=lambda _: printed.append(capsys.readouterr().err)).step_done(
        STEP, lambda: None
    )
    assert printed == [""]
    assert "step 3   D = 0.1 R (50 %)   Q = 0.2 E R^2   5 iterations" in capsys.readouterr().err


@pytest.mark.parametrize("root", [True, False])
def test_a_surface_that_nobody_keeps_is_not_gathered(root: bool) -> None:
    gathered, kept = [], []

    def surface() -> str:
        gathered.append(root)
        return "the surface"

    Progress(Scale(1.0, 1.0), None, root=root, take=lambda _: None).step_done(STEP, surface)
    assert gathered == []
    # gathering is collective: every rank calls it, and rank 0 keeps what comes of it
    Progress(Scale(1.0, 1.0), None, root=root, take=lambda _: None, draw=kept.append).step_done(STEP, surface)
    assert gathered == [root]
    assert kept == (["the surface"] if root else [])


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


def test_the_linear_model_hands_its_lines_on() -> None:
    from linear_bem import Ball, Layer, Load, Problem  # noqa: PLC0415
    from runs.models import MODELS, Run  # noqa: PLC0415

    lines: list[str] = []
    ball = Problem(Layer(1.0, 0.3, 5.0), (Ball((0.0, 0.0), 1.0),), Load("approach", (0.1,)))
    MODELS["linear_bem"].solve(ball, Run(report=lines.append))
    assert lines == ["1 ball(s): first guess"]
