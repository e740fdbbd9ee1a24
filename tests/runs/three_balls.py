"""Three balls on foam that drift, as the tests of the command evolve run them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from runs.evolution import outcome, showing
from runs.evolution.evolving import evolve_scene
from runs.scene.scene_file import Scene, read_scene
from runs.session.session import Options

TEXT = """
[layer]
thickness = "80 mm"
young = "57.4 kPa"
poisson = 0.3
[balls]
radius = "10 mm"
positions = [[0, 0], ["31 mm", "4 mm"], ["11 mm", "35 mm"]]
shape = "sphere"
[load]
approach = "3 mm"
[reciprocation]
amplitude = "80 mm"
cycles = 400
friction = 20
perturbation = "0.1 mm"
seed = 3
ensemble = 3
"""


def three(folder: Path) -> Scene:
    file = folder / "three.toml"
    file.write_text(TEXT, encoding="utf-8")
    return read_scene(file)


def sliding(scene: Scene, **changes: Any) -> Scene:
    assert scene.reciprocation is not None
    return replace(scene, drift={**scene.drift, "reciprocation": scene.reciprocation.model_copy(update=changes)})


def evolved(scene: Scene, out: Path, model: str = "point_load") -> dict[str, Any]:
    evolve_scene(scene, model, Options(False, out, False), out.parent / "tables")
    document: dict[str, Any] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return document


def leave_out_pictures_and_check(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(showing, "draw", lambda *given: None)
    patch.setattr(outcome, "direct_check", lambda *given: ([], []))
