"""The command evolve, killed or stopped by a signal: the same command continues to the result of one run."""

from __future__ import annotations

import csv
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from runs.evolution import evolving
from runs.process import signals
from runs.scene.scene_file import Scene
from tests.launch import ROOT, environment
from tests.runs.three_balls import evolved, leave_out_pictures_and_check, three


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return three(tmp_path_factory.mktemp("three"))


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the pictures and the comparison with the full model, which take longest."""
    leave_out_pictures_and_check(monkeypatch)


@pytest.fixture(scope="module")
def whole(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """The document and the folder of a run to the end."""
    out = tmp_path_factory.mktemp("whole") / "out"
    with pytest.MonkeyPatch.context() as patch:
        leave_out_pictures_and_check(patch)
        return evolved(scene, out), out


@pytest.mark.parametrize("ends", ["on the path", "before it is saved", "in the ensemble"])
def test_a_killed_run_goes_on_to_the_same_result(
    ends: str, scene: Scene, whole: tuple[dict[str, Any], Path], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    expected, reference = whole
    left = 10**6 if ends == "in the ensemble" else 25
    member = evolving.Evolution._member

    def dies() -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt

    def dies_soon(*given: Any) -> dict[str, Any]:
        nonlocal left
        left = 5
        return member(*given)

    with monkeypatch.context() as patch:
        for interval in ("SAVE_INTERVAL", "SAVE_RATIO", "PROGRESS_INTERVAL"):
            patch.setattr(evolving, interval, -1.0)
        if ends == "before it is saved":
            patch.setattr(evolving, "SAVE_INTERVAL", 1e9)
        patch.setattr(signals, "check", dies)
        patch.setattr(evolving.Evolution, "_member", dies_soon)
        with pytest.raises(KeyboardInterrupt):
            evolved(scene, tmp_path / "killed")
    half = json.loads((tmp_path / "killed" / "result.json").read_text(encoding="utf-8"))
    assert not half["solved"]["converged"]
    left_over = "what follows the path" if ends == "in the ensemble" else "the path"
    assert f"unfinished: {left_over} is not complete; the same command continues it" in half["solved"]["notes"]
    assert 0 < len(half["path"]) <= len(expected["path"])
    with open(tmp_path / "killed" / "steps.csv", encoding="utf-8", newline="") as table:
        assert len(list(csv.DictReader(table))) == len(half["path"]) * len(scene.problem.balls)
    said = re.findall(
        r"^(member \d of \d: )?cycle [\d.e+-]+ of [\d.e+-]+, \d+ steps", capsys.readouterr().err, re.MULTILINE
    )
    assert len(said) > 5
    assert len(half["ensemble"]) == (1 if ends == "in the ensemble" else 0)
    killed = evolved(scene, tmp_path / "killed")
    assert killed["solved"]["iterations"] == expected["solved"]["iterations"]
    assert (tmp_path / "killed" / "steps.csv").read_bytes() == (reference / "steps.csv").read_bytes()
    for key in ("path", "events", "ensemble", "balls", "rest", "position_error"):
        assert killed[key] == expected[key], key


SLOWLY = """
from runs.evolution import evolving, outcome, showing
evolving.SAVE_INTERVAL, evolving.PROGRESS_INTERVAL, showing.draw = 1e9, -1.0, lambda *given: None
outcome.direct_check = lambda *given: ([], [])
from runs.cli import main
main()
"""
"""The command, which never saves an unfinished path by itself, says every moment how far it is, and draws nothing."""


def test_a_signal_keeps_what_is_computed(scene: Scene, whole: tuple[dict[str, Any], Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = [sys.executable, "-c", SLOWLY, "evolve", str(scene.path), "--model", "point_load", "--out", str(out)]
    for number, waits_for in ((signal.SIGINT, "30 steps"), (signal.SIGTERM, "member 3 of 3")):
        with subprocess.Popen(words, cwd=ROOT, env=environment(), stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            for line in process.stderr:
                if waits_for in line:
                    break
            process.send_signal(number)
            rest = process.stderr.read()
            assert process.wait(timeout=60.0) == 128 + number
        assert "stopped; finished steps are saved, and the same command continues from there" in rest
        half = json.loads((out / "result.json").read_text(encoding="utf-8"))
        assert half["solved"]["iterations"] >= 30
        if number == signal.SIGINT:
            assert half["continuation"]["sigma"] >= half["path"][-1]["sigma"] > 0.0
        else:
            assert len(half["ensemble"]) == 2
    goes_on, expected = (dict(document) for document in (evolved(scene, out), whole[0]))
    for document in (goes_on, expected):
        document["solved"] = {key: value for key, value in document["solved"].items() if key != "seconds"}
    assert goes_on == expected
    assert (out / "steps.csv").read_bytes() == (whole[1] / "steps.csv").read_bytes()
