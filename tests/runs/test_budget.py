"""What a scene may say about the cost of its accuracy, and what a load path keeps while it is refined."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from linear_bem import Problem
from linear_bem.result import BallResult, Result, Step
from runs.commands.plan import plan_scene
from runs.display import surface
from runs.models import Run
from runs.scene.scene_file import InvalidScene, read_scene
from runs.session.session import Options, Session, path_so_far, unfinished
from tests.launch import STAND_IN, thirdbody
from tests.scenes import thin_pair


def scene(folder: Path, accuracy: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(thin_pair(accuracy), encoding="utf-8")
    return path


def test_a_scene_states_a_budget_in_seconds_and_unknowns(tmp_path: Path) -> None:
    read = read_scene(scene(tmp_path, "tangential_force = 0.01\nseconds = 600\nunknowns = 1e5"))
    assert read.budget == {"seconds": 600.0, "unknowns": 1e5}
    assert read.tangential_force == 0.01
    assert read_scene(scene(tmp_path, "tangential_force = 0.01")).budget == {}


@pytest.mark.parametrize("key", ["seconds", "unknowns"])
def test_a_budget_of_nothing_is_a_fault_of_its_key(key: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidScene, match=rf"\[accuracy\] {key}.*greater than 0.*-1"):
        read_scene(scene(tmp_path, f"{key} = -1"))


def test_a_plan_states_the_meshes_and_the_budget(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan_scene(read_scene(scene(tmp_path, "unknowns = 40000\nseconds = 900")), None, as_json=True, advises=False)
    models = json.loads(capsys.readouterr().out)["models"]
    (elements,) = (model for model in models if model["model"] == "finite_strain")
    assert elements["accuracy"] == {"asked": 0.02, "unknowns_at_most": 40000.0, "seconds_at_most": 900.0}
    assert [mesh.split(",")[0] for mesh in elements["meshes"]] == ["order 2", "order 3", "finer or wider ones"]
    assert elements["unknowns"] <= 40000
    assert elements["compare"]["load_steps"] > elements["load_steps"] == 1
    assert elements["compare"]["seconds"] > elements["seconds"]


def test_a_budget_too_small_for_any_mesh_is_refused_before_any_work(tmp_path: Path) -> None:
    done = thirdbody("solve", scene(tmp_path, "unknowns = 1000"), "--out", tmp_path / "out")
    assert done.returncode != 0
    assert "[accuracy] unknowns" in done.stderr


def step(fraction: float, mesh: int) -> Step:
    ball = BallResult((0.0, 0.0), 1.0, fraction, fraction**1.5, (float(mesh), 0.0), 0.1, 1.0, 1.0)
    return Step((ball,), {"fraction": fraction, "mesh": mesh})


def meshes(path: list[Step]) -> list[int]:
    return [state.record["mesh"] for state in path]


def test_a_coarser_meshs_answers_stay_until_a_finer_one_gets_there() -> None:
    path = [step(fraction, 1) for fraction in (0.3, 0.6, 1.0)]
    path = path_so_far(path, step(0.3, 2))
    assert meshes(path) == [2, 1, 1]
    path = path_so_far(path, step(0.6, 2))
    assert meshes(path) == [2, 2, 1]
    path = path_so_far(path, step(1.0, 2))
    assert meshes(path) == [2, 2, 2]


def test_a_coarser_meshs_surface_stays_until_a_finer_one_gets_there(tmp_path: Path) -> None:
    def kept(*steps: Step) -> float:
        """Return the approach of the surface that is kept after some steps, which a resumed run adds to the first."""

        def solve(problem: Problem, run: Run) -> Result:
            for each in steps:
                top = SimpleNamespace(points=np.full((1, 3), each.balls[0].approach), triangles=[], pressure=[])
                run.observer.step_done(each, lambda top=top: top)
            return unfinished(session.model, steps)

        options = Options(out=tmp_path / "out")
        with Session(
            "solve", read_scene(scene(tmp_path, "tangential_force = 0.01")), "finite_strain", options
        ) as session:
            session.model = replace(session.model, solve=solve)
            session.solve([step(1.0, 1).to_dict()] if steps[0].record["mesh"] == 2 else [], lambda _: None)
        top = surface.load(tmp_path / "out")
        assert top is not None
        return float(top.points[0, 0])

    assert kept(step(0.5, 1), step(1.0, 1), step(0.3, 2)) == 1.0
    assert kept(step(0.6, 2)) == 1.0
    assert kept(step(0.9, 2), step(1.1, 2)) == 1.1


def test_what_followed_on_the_same_mesh_is_replaced() -> None:
    path = [step(fraction, 1) for fraction in (0.3, 0.6, 1.0)]
    assert [state.record["fraction"] for state in path_so_far(path, step(0.6, 1))] == [0.3, 0.6]


def test_a_time_too_short_for_an_error_estimate_is_noted_before_the_work(tmp_path: Path) -> None:
    done = thirdbody(
        "solve", scene(tmp_path, "seconds = 30"), "--model", "finite_strain", "--out", tmp_path, program=STAND_IN
    )
    assert done.returncode == 0, done.stderr
    assert "[accuracy] seconds = 30 is less than the two coarsest meshes take" in done.stderr
    assert "1 min 44 s" in done.stderr.split("[accuracy] seconds", 1)[1].splitlines()[0]  # on one rank


def test_a_length_without_a_unit_is_noted_before_the_work(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        '[layer]\nthickness = 4\nyoung = "1 MPa"\npoisson = 0.48\n[balls]\nradius = "1000 mm"\n'
        'positions = [["-1000 mm", 0], ["1000 mm", 0]]\n[load]\napproach = "200 mm"\n[finite_strain]\n',
        encoding="utf-8",
    )
    done = thirdbody("solve", path, "--out", tmp_path / "out", program=STAND_IN)
    assert done.returncode == 0, done.stderr
    first, second = done.stderr.splitlines()[:2]
    assert first.startswith("warning: [layer] thickness = 4 is in metres, as it has no unit")
    assert second.startswith("finite_strain on 1 rank(s)")
