"""The comparison as a run: rows against the linear model, growth on disk, interruption, continuation, two ranks."""

from __future__ import annotations

import csv
import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from linear_bem import solve
from runs.reporting import page_of, read_folder
from runs.scene.scene_file import read_scene
from tests.launch import ROOT, STAND_IN, environment, thirdbody
from tests.runs.test_command_line import strict
from tests.scenes import thin_pair

SCENE = ROOT / "tests" / "runs" / "light_pair.toml"


def run(ranks: int, command: str, out: Path, *more: str, wrong: str = "") -> subprocess.CompletedProcess[str]:
    env = {"ELEMENTS": wrong}
    return thirdbody(command, SCENE, "--out", out, *more, ranks=ranks, env=env, program=STAND_IN)


def state(out: Path) -> str:
    return str(strict((out / "run.json").read_text(encoding="utf-8"))["state"])


def table(out: Path) -> list[dict[str, str]]:
    with open(out / "steps.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    out = tmp_path_factory.mktemp("compared") / "out"
    done = run(1, "compare", out, "--json")
    assert done.returncode == 0, done.stderr
    return strict(done.stdout), out


def test_the_document_holds_both_models_and_a_row_per_step_and_ball(compared: tuple[dict[str, Any], Path]) -> None:
    document, out = compared
    assert document["finite"]["model"] == "finite_strain"
    assert document["linear"]["model"] == "linear_bem"
    assert len(document["comparison"]) == 2 * len(document["finite"]["steps"]) == 6
    row = document["comparison"][-1]
    # the stand-in multiplies the linear force at equal approach by 1 + D / R
    assert row["strengthening_at_approach"] == pytest.approx(1.1, rel=1e-4)
    assert row["strengthening_at_approach_error"] == pytest.approx(0.005 * 1.1, rel=0.02)  # as the scene asks
    assert row["normal_force_linear_at_approach"] == pytest.approx(row["normal_force"], rel=1e-6)
    assert row["approach_linear_at_force"] == pytest.approx(row["approach"], rel=1e-4)
    assert "makes the separation force 1.100 ± 0.006 times" in document["answer"]
    assert "S leaves 1 ± 0.05: S_Q " in document["answer"]  # at the first load step
    assert document["sensitivity"]["lengths"] == pytest.approx(2.0, abs=0.01)
    page = page_of(read_folder(out))
    assert "Sensitivity of T to the inputs" in page
    assert "0.48 \u2192 0.49" in page
    assert len(table(out)) == 6
    assert float(table(out)[-1]["strengthening_at_force"]) == row["strengthening_at_force"]


def test_the_linear_state_has_the_normal_forces_of_the_finite_one(compared: tuple[dict[str, Any], Path]) -> None:
    document, _ = compared
    problem = read_scene(SCENE).problem
    row = document["comparison"][2]
    small = type(problem)(problem.layer, problem.balls, problem.load, problem.substrate)
    again = solve(small.with_load("force", (row["normal_force"],) * 2))
    assert row["tangential_linear"][0] == pytest.approx(again.balls[0].tangential_force[0], rel=1e-6)


def test_the_folder_holds_scene_log_and_figures(compared: tuple[dict[str, Any], Path]) -> None:
    _, out = compared
    assert (out / "scene.toml").read_text(encoding="utf-8") == SCENE.read_text(encoding="utf-8")
    log = (out / "run.log").read_text(encoding="utf-8")
    assert "numpy" in log
    assert "D = 0.1 R (100 % of the load)" in log
    for name in ("tangential_force.png", "tangential_force.svg", "surface.png"):
        assert (out / name).stat().st_size > 10_000, name
    assert not list(out.glob(".part*"))


def test_a_complete_run_is_shown_again_without_solving(compared: tuple[dict[str, Any], Path]) -> None:
    document, out = compared
    done = run(1, "compare", out, "--json", wrong="stop")
    assert done.returncode == 0, done.stderr
    assert strict(done.stdout) == document
    assert "complete already" in done.stderr
    assert "step" not in done.stderr
    shown = run(1, "compare", out)
    assert document["answer"] in shown.stdout
    assert "1 % more" in shown.stdout
    assert "1.100 ± 0.006" in shown.stdout


def test_a_folder_is_refused_to_another_run(compared: tuple[dict[str, Any], Path]) -> None:
    _, out = compared
    done = run(1, "solve", out)
    assert done.returncode == 2
    assert "holds another run (command is compare there and solve here)" in done.stderr
    assert "--fresh" in done.stderr


@pytest.mark.mpi
def test_a_killed_run_keeps_its_steps_and_the_same_command_continues_on_two_ranks_to_what_one_says(
    tmp_path: Path, compared: tuple[dict[str, Any], Path]
) -> None:
    out = tmp_path / "out"
    killed = run(1, "compare", out, wrong="kill")
    assert killed.returncode != 0
    half = strict((out / "result.json").read_text(encoding="utf-8"))
    assert len(half["finite"]["steps"]) == 2
    assert half["finite"]["solved"]["converged"] is False
    assert len(table(out)) == 4
    assert "unfinished: killed, or its machine failed; the same command completes it" in page_of(read_folder(out))
    done = run(2, "compare", out, "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("this run was stopped before: killed") == 1
    assert "this run was stopped before: killed" in (out / "run.log").read_text(encoding="utf-8")
    assert "step 2 " not in done.stderr
    assert done.stderr.count("step 3 ") == 1
    whole = strict(done.stdout)
    assert whole["finite"]["solved"]["ranks"] == 2
    assert_same(whole, compared[0])


def assert_same(whole: dict[str, Any], expected: dict[str, Any]) -> None:
    assert whole["answer"] == expected["answer"]
    for key in ("unknowns", "iterations", "notes"):  # of the states that were saved, too
        assert whole["linear"]["solved"][key] == expected["linear"]["solved"][key], key
    assert [row["step"] for row in whole["comparison"]] == [row["step"] for row in expected["comparison"]]
    for row, reference in zip(whole["comparison"], expected["comparison"], strict=True):
        assert row["strengthening_at_force"] == pytest.approx(reference["strengthening_at_force"], rel=1e-12)


@pytest.mark.mpi
def test_fresh_starts_again_and_not_converged_ends_all_ranks_with_one_message(
    tmp_path: Path, compared: tuple[dict[str, Any], Path]
) -> None:
    shutil.copytree(compared[1], tmp_path / "out")
    done = run(2, "compare", tmp_path / "out", "--fresh", wrong="stop")
    assert done.returncode == 1
    assert done.stderr.count("step 1 ") == 1
    assert done.stderr.count("thirdbody: error: step 2: DIVERGED_LINE_SEARCH") == 1
    assert "Traceback" not in done.stderr
    assert len(table(tmp_path / "out")) == 4
    assert state(tmp_path / "out") == "failed"


@pytest.mark.mpi
def test_a_failure_on_one_rank_ends_the_other(tmp_path: Path) -> None:
    began = time.monotonic()
    done = run(2, "compare", tmp_path / "out", wrong="lost")
    assert done.returncode == 1
    assert "RuntimeError: rank 1 has lost its way" in done.stderr
    assert time.monotonic() - began < 60.0  # it would wait without end


@pytest.mark.mpi
def test_a_folder_that_fails_during_the_run_ends_all_ranks_with_one_message(tmp_path: Path) -> None:
    done = run(2, "compare", tmp_path / "out", wrong="blocked")
    assert done.returncode == 2
    assert done.stderr.count("thirdbody: error:") == 1
    assert "result.json: cannot be written" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_signal_is_no_failed_iteration_and_the_run_continues_to_the_same_answer(
    tmp_path: Path, compared: tuple[dict[str, Any], Path]
) -> None:
    command = [sys.executable, "-m", "tests.runs.elements", "compare", str(SCENE), "--out", str(tmp_path / "out")]
    with subprocess.Popen(
        command, cwd=ROOT, env=environment({"ELEMENTS": "swallow"}), stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("waiting"):
                break
        process.send_signal(signal.SIGTERM)
        rest = process.stderr.read()
        assert process.wait(timeout=30.0) == 128 + signal.SIGTERM
    assert "taken for a failed iteration" in rest
    assert "the same command continues" in rest
    assert "Traceback" not in rest
    assert len(table(tmp_path / "out")) == 4
    assert state(tmp_path / "out") == "interrupted"
    done = run(1, "compare", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    assert "step 2 " not in done.stderr
    assert state(tmp_path / "out") == "finished"
    assert_same(strict(done.stdout), compared[0])


def test_solving_by_finite_elements_draws_its_path(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    text = SCENE.read_text(encoding="utf-8")
    scene.write_text(text.replace("[0.05, 0.075, 0.1]", "[0.05]"), encoding="utf-8")
    args = ("solve", scene, "--out", tmp_path / "out", "--model", "small_strain")
    done = thirdbody(*args, program=STAND_IN)
    assert done.returncode == 0, done.stderr
    assert "[finite_strain] left out" in done.stdout
    assert "load path of ball 0" in done.stdout
    saved = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert saved["model"] == "small_strain"
    assert len(saved["steps"]) == 2
    assert (tmp_path / "out" / "tangential_force.svg").stat().st_size > 10_000


def test_plan_names_the_models_of_a_comparison() -> None:
    done = thirdbody("plan", SCENE, "--no-advice", program=STAND_IN)
    assert done.returncode == 0, done.stderr
    assert "mirror plane x = 0" in done.stdout
    assert "about 1 min 07 s" in done.stdout  # the model, and the command around it
    assert "about 0.57 GB" in done.stdout
    assert "linear_bem: small strain" in done.stdout


def test_a_load_that_the_elements_lack_is_refused_before_long_work(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    text = thin_pair().replace("approach = 0.32", "force = 0.1")
    scene.write_text(text, encoding="utf-8")
    done = thirdbody("compare", scene, "--out", tmp_path / "out", program=STAND_IN)
    assert done.returncode == 2
    assert "load.force" in done.stderr
    assert not (tmp_path / "out").exists()
