"""The command line: JSON alone on standard output, choice of the model, plans, one message from two ranks."""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from linear_bem.errors import UnsupportedProblem
from linear_bem.result import Result
from runs import studies
from runs.models import MODELS, Run, choose
from runs.process import exit_codes, signals
from runs.scene.scene_file import read_scene
from runs.session.session import Options, Session
from runs.studies.framework.study import run as run_study
from tests.launch import ROOT, environment, python, thirdbody
from tests.scenes import thin_pair

SCENES = ROOT / "runs" / "scenes"
LINEAR = SCENES / "paper_thin_pair_linear.toml"


def strict(text: str) -> Any:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


def solved(scene: Path, model: str, out: Path) -> Result:
    """Return what `thirdbody solve` computes before it draws."""
    with Session("solve", read_scene(scene), model, Options(out=out)) as session:
        return session.solve([], lambda so_far: None)


@pytest.mark.mpi
def test_solve_prints_the_contract_and_nothing_else(tmp_path: Path) -> None:
    done = thirdbody("solve", LINEAR, "--json", "--out", tmp_path / "out", timeout=60.0, ranks=2)
    assert done.returncode == 0, done.stderr
    result = strict(done.stdout)
    assert result["model"] == "linear_bem"
    assert result["scene"]["layer"] == {"thickness": 1.16, "young": 1.0, "poisson": 0.48}
    assert result["solved"]["converged"] is True
    assert {"converged", "iterations", "unknowns", "seconds", "ranks", "versions"} <= set(result["solved"])
    left, right = result["balls"]
    assert {"position", "radius", "approach", "normal_force", "tangential_force", "tangential_force_error"} <= set(left)
    # the reference value is good to 1e-5, the model is asked for 1e-4
    assert left["tangential_force"][0] == pytest.approx(-1.161292e-7, rel=1.1e-4)
    assert right["tangential_force"][0] == pytest.approx(1.161292e-7, rel=1.1e-4)
    assert strict((tmp_path / "out" / "result.json").read_text(encoding="utf-8")) == result
    assert done.stderr.count("results are in") == 1


def test_every_model_that_is_linear_answers_by_name(tmp_path: Path) -> None:
    forces = {}
    for model in ("linear_bem", "point_load"):
        result = solved(LINEAR, model, tmp_path / model)
        assert result.model == model
        forces[model] = result.balls[0].tangential_force[0]
    assert forces["point_load"] != forces["linear_bem"]
    # theory: the point-load law is good to 1 % for touching balls at the paper's load
    assert forces["point_load"] == pytest.approx(forces["linear_bem"], rel=0.01)


def test_a_model_asked_for_by_name_says_what_it_leaves_out(tmp_path: Path) -> None:
    scene = Path(__file__).with_name("light_pair.toml")
    done = thirdbody("solve", scene, "--model", "linear_bem", "--json", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    notes = strict(done.stdout)["solved"]["notes"]
    assert any("[finite_strain] left out" in note for note in notes)


def test_an_effect_that_no_model_supports_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(MODELS, "finite_strain")
    with pytest.raises(UnsupportedProblem, match=r": \[finite_strain\] [^\[]*no model supports this; remove a table"):
        choose(read_scene(SCENES / "paper_thin_pair.toml"))


def test_what_a_model_declares_of_an_effect_is_all_that_chooses_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def declare(name: str, **changes: frozenset[str]) -> None:
        monkeypatch.setitem(MODELS, name, dataclasses.replace(MODELS[name], **changes))

    both = frozenset({"substrate", "finite_strain"})
    scene = read_scene(LINEAR)
    assert scene.effects == ("substrate",)
    for name in ("linear_bem", "small_strain"):
        declare(name, effects=frozenset())
    assert choose(scene)[0].name == "point_load"  # finite_strain supports the effect, but another one selects it
    declare("point_load", effects=frozenset(), leaves_out=both)
    given = read_scene(SCENES / "paper_thin_pair.toml")
    model, problem, notes = choose(given, "point_load")
    assert (problem.substrate, problem.finite_strain) == (None, None)
    assert [note.split("]")[0] for note in notes] == ["[finite_strain", "[substrate"]
    assert {effect for effect in given.effects if effect in model.leaves_out} == both
    declare("finite_strain", effects=frozenset({"finite_strain"}))
    declare("point_load", leaves_out=frozenset())
    with pytest.raises(UnsupportedProblem, match=r"\[substrate\] [^\[]*no model supports this; remove a table"):
        choose(scene)
    with pytest.raises(UnsupportedProblem, match=r"model point_load lacks it; remove the table$"):
        choose(scene, "point_load")


def test_accuracy_of_the_scene_reaches_the_model(tmp_path: Path) -> None:
    errors, unknowns = {}, {}
    for wanted in ("1e-1", "1e-5"):
        scene = tmp_path / f"wanted{wanted}.toml"
        scene.write_text(thin_pair(f"tangential_force = {wanted}"), encoding="utf-8")
        result = solved(scene, "linear_bem", tmp_path / wanted)
        ball = result.balls[0]
        errors[wanted] = ball.tangential_force_error / abs(ball.tangential_force[0])
        unknowns[wanted] = result.solved.unknowns
    assert errors["1e-5"] <= 1e-5 < errors["1e-1"] <= 0.1
    assert unknowns["1e-5"] > unknowns["1e-1"]


RESTING = [path for path in sorted(SCENES.glob("*.toml")) if "[reciprocation]" not in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("scene", RESTING, ids=lambda path: path.stem)
def test_every_scene_of_balls_that_stay_is_solved(scene: Path) -> None:
    model, problem, _ = choose(read_scene(scene), "linear_bem")
    left, right = model.solve(problem, Run(None)).balls
    force = left.tangential_force[0]
    # layers thinner than 1.7 R separate touching balls at the paper's load, thicker ones attract them
    thin = {"paper_thin_pair", "paper_thin_pair_linear", "separation_16mm"}
    assert (force < 0.0) == (scene.stem in thin)
    assert left.tangential_force_error < 1e-3 * abs(force)
    assert force + right.tangential_force[0] == pytest.approx(0.0, abs=1e-9 * left.normal_force)


def test_the_default_folder_is_named_after_scene_command_and_model(tmp_path: Path) -> None:
    done = thirdbody("solve", LINEAR, cwd=tmp_path, env={"PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "paper_thin_pair_linear-solve-linear_bem" / "result.json").exists()
    assert "T / Q" in done.stdout
    assert "-1.1613e-07" in done.stdout


@pytest.mark.mpi
def test_plan_names_what_is_simulated_and_what_is_not() -> None:
    done = thirdbody("plan", LINEAR, "--no-advice", timeout=60.0, ranks=2)
    assert done.returncode == 0, done.stderr
    simulated, absent = done.stdout.split("not simulated:")
    assert "[substrate]" in simulated
    assert "[finite_strain]" in absent
    assert "unknowns" in absent
    assert done.stdout.count("not simulated:") == 1
    assert "changes of the scene" not in done.stdout


def test_plan_speaks_json() -> None:
    done = thirdbody("plan", LINEAR, "--json", "--no-advice")
    assert done.returncode == 0, done.stderr
    plan = strict(done.stdout)
    assert plan["effects_present"] == ["substrate"]
    assert plan["effects_absent"] == ["finite_strain", "reciprocation", "periodic", "rolling_resistance"]
    assert plan["models"][0]["model"] == "linear_bem"
    assert plan["models"][0]["unknowns"] > 0


def test_version_and_help() -> None:
    assert thirdbody("--version").stdout.startswith("thirdbody 0.")
    commands = thirdbody("--help").stdout
    for command in ("solve", "compare", "plan", "doctor"):
        assert command in commands


def test_without_the_packages_of_the_command_line_the_script_names_them(tmp_path: Path) -> None:
    code = "import sys; sys.modules['typer'] = None; from runs.entry import main; main()"
    done = python("-c", code, cwd=ROOT)
    assert done.returncode == 1
    assert "typer" in done.stderr
    assert 'pip install ".[cli]"' in done.stderr
    assert "Traceback" not in done.stderr


def test_packages_that_do_not_fit_together_end_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "numpy").mkdir()
    (tmp_path / "numpy" / "__init__.py").write_text("__version__ = '9'\n")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from runs.entry import main; main()"
    done = python("-c", code, cwd=ROOT)
    assert done.returncode == 1
    assert "do not fit together" in done.stderr
    assert "pip install --force-reinstall" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_dolfinx_that_cannot_be_imported_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "dolfinx").mkdir()
    (tmp_path / "dolfinx" / "__init__.py").write_text("raise ValueError('numpy.dtype size changed')\n")
    scene = Path(__file__).with_name("light_pair.toml")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv = ['thirdbody', 'solve', {str(scene)!r}, "
        f"'--out', {str(tmp_path / 'run')!r}]; from runs.entry import main; main()"
    )
    done = python("-c", code, cwd=ROOT)
    assert done.returncode == 1
    assert "numpy.dtype size changed; `thirdbody doctor` names the remedy" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_failure(closed: str, tmp_path: Path) -> None:
    command = f'"{sys.executable}" -m runs.cli solve "{LINEAR}" --model point_load --out "{tmp_path / "out"}" {closed}'
    done = subprocess.run(["sh", "-c", command], cwd=ROOT, env=environment(), check=False, timeout=60.0)
    assert done.returncode == 0
    assert json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["solved"]["converged"]


def test_a_folder_whose_name_is_no_text_is_written_and_reported(tmp_path: Path) -> None:
    out = os.fsencode(tmp_path) + b"/\xff"
    command = [sys.executable, "-m", "runs.cli"]
    for words in (["solve", LINEAR, "--model", "point_load", "--out", out], ["report", out]):
        done = subprocess.run([*command, *words], cwd=ROOT, env=environment(), capture_output=True, check=False)
        assert done.returncode == 0, done.stderr


def test_a_closed_pipe_is_an_error_that_python_raises_even_beside_petsc() -> None:
    pytest.importorskip("dolfinx")
    code = (
        "import os, finite_strain.compat\n"
        "end, entrance = os.pipe()\n"
        "os.close(end)\n"
        "try:\n    os.write(entrance, b'x')\nexcept BrokenPipeError:\n    print('raised')"
    )
    assert python("-c", code, cwd=ROOT).stdout == "raised\n"


@pytest.mark.parametrize(
    ("command", "load_steps", "saves"),
    [
        ("plan", "", False), ("solve", "", False), ("solve", "steps = [1e-3, 2.66666e-3]", True),
        ("study figures", "", True), ("study effects", "", False), ("study benchmarks", "", False),
    ],
)  # fmt: skip
def test_an_interrupted_command_speaks_of_saved_steps_where_it_saves_any(
    command: str, load_steps: str, saves: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def stop(*given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(signals, "resumable", False)
    if command == "solve":
        scene = tmp_path / "scene.toml"
        scene.write_text((ROOT / LINEAR).read_text(encoding="utf-8").replace("[load]", f"[load]\n{load_steps}"))
        Session("solve", read_scene(scene), "linear_bem", Options(out=tmp_path / "out")).__exit__(None, None, None)
    elif command.startswith("study"):
        study = importlib.import_module(f"runs.studies.{command.split()[1]}.answer").STUDY
        with pytest.raises(KeyboardInterrupt):
            run_study(dataclasses.replace(study, compute=stop), studies.Options(out=tmp_path / "out"))
    code, words = exit_codes._verdict(KeyboardInterrupt())
    assert code == 128 + signal.SIGINT
    assert ("finished steps are saved" in words) == saves
