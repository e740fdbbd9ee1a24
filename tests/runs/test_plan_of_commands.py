"""What `plan` says of commands against what they took, which some of its constants were chosen with."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from runs import models
from runs.commands import plan as planning
from runs.commands.plan import plan_scene
from runs.scene.scene_file import read_scene

ONE = "[balls]\nradius = 1.0\npositions = [[0, 0]]\n"
PAIR = "[balls]\nradius = 1.0\npositions = [[-1.0, 0], [1.0, 0]]\n"
RUBBER = '[finite_strain]\nlaw = "neo_hookean"\n'
SLIDING = "[reciprocation]\namplitude = 7.0\ncycles = 20\nfriction = 0.3\ndirection = [1, 0]\n"


def scene(thickness: float, poisson: float, accuracy: float, balls: str, load: str, more: str = RUBBER) -> str:
    layer = f"[layer]\nthickness = {thickness}\nyoung = 1.0\npoisson = {poisson}\n"
    return f'title = "a"\n{layer}{balls}[load]\n{load}\n[accuracy]\ntangential_force = {accuracy}\n{more}'


APART = PAIR.replace("1.0, 0]", "1.5, 0]")
UNLIKE = PAIR.replace("= 1.0", "= [1.0, 0.7]")
LINE = "[balls]\nradius = 1.0\npositions = [[-2, 0], [0, 0], [2, 0]]\n"
TRIANGLE = '[balls]\nradius = 1.0\npositions = [[-1.1, 0], [1.1, 0], [0.2, 2.2]]\nshape = "paraboloid"\n'
EQUILATERAL = "[balls]\nradius = 1.0\npositions = [[-1.2, 0], [1.2, 0], [0, 2.0784]]\n"
SOFT = "[substrate]\nyoung = 5.0\npoisson = 0.3\n"
COMMANDS = {
    "small strain": (scene(1.5, 0.3, 0.05, TRIANGLE, "approach = 0.08", ""), 12.5, 1425e6),
    "one ball, thin": (scene(0.5, 0.49, 0.05, ONE, "approach = 0.15"), 6.8, 407e6),
    "on a substrate": (
        scene(1.5, 0.4, 0.05, ONE, "force = 0.15", RUBBER + SOFT), 6.8, 444e6,
    ),
    "apart": (scene(2.0, 0.3, 0.1, APART, "force = 0.12"), 10.8, 546e6),
    "unlike": (scene(1.5, 0.45, 0.1, UNLIKE, "total_force = 0.2"), 27.7, 957e6),
    "three": (scene(1.0, 0.45, 0.1, LINE, "approach = 0.2"), 12.3, 546e6),
    "deep": (scene(2.0, 0.48, 0.05, PAIR + 'shape = "paraboloid"\n', "approach = 0.3"), 13.1, 578e6),
    "gent": (scene(1.0, 0.48, 0.1, PAIR, "approach = 0.2", '[finite_strain]\nlaw = "gent"\nlimit = 30\n'), 9.5, 495e6),
    "mixed": (scene(1.0, 0.4995, 0.1, PAIR, "approach = 0.12"), 13.7, 608e6),
    "three balls": (scene(1.2, 0.45, 0.05, EQUILATERAL, "force = 0.08"), 45.6, 1312e6),
    "pair on a substrate": (scene(1.5, 0.4, 0.01, PAIR, "approach = 0.1", RUBBER + SOFT), 28.3, 1422e6),
    "accurate": (scene(1.16, 0.48, 0.003, PAIR, "approach = 0.2"), 44.2, 1824e6),
    "compare": (scene(3.0, 0.4, 0.1, PAIR, "approach = 0.25"), 27.8, 682e6),
    "evolve": (scene(2.0, 0.3, 0.2, PAIR, "approach = 0.15", RUBBER + SLIDING), 120.3, 857e6),
}  # fmt: skip
"""Scene, processor time [s] and memory [bytes] of the command on one rank, forms compiled before, both cores busy."""


@pytest.mark.parametrize("name", COMMANDS)
def test_a_plan_estimates_what_commands_take(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("gmsh")
    text, seconds, memory = COMMANDS[name]
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(planning.Adviser, "advise", lambda _: [])  # other tests' subject
    monkeypatch.setattr(planning, "PATIENCE", 0.0)
    monkeypatch.setattr(models, "slowness", lambda: 1.0)  # they were measured on the machine of the plan's constants
    plan_scene(read_scene(path), "small_strain" if name == "small strain" else None, as_json=True)
    document = json.loads(capsys.readouterr().out)
    model = document["models"][0]
    planned = document["evolution"] if name == "evolve" else model
    said, needed = planned["processor_seconds"], planned["processor_memory_bytes"]
    if name == "compare":
        said = model["compare"]["processor_seconds"]
    assert seconds / 1.5 < said < 1.5 * seconds
    assert memory / 1.3 < needed < 1.3 * memory
