"""The table [output]: which fields are written, on which steps, and what a model without fields says of it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import finite_strain
from finite_strain.output.field_catalogue import CATALOGUE
from runs.models import MODELS, Run
from runs.scene.scene_file import InvalidScene, read_scene
from tests.launch import thirdbody
from tests.runs.scene_texts import PAIR, write

SCENE = PAIR.replace("1.5 mm", "0.1 mm").replace("[load]", 'shape = "paraboloid"\n[load]')


@pytest.mark.parametrize(
    ("table", "names", "every"),
    [
        ('fields = ["displacement", "gap"]\nevery = 3', ("displacement", "gap"), 3),
        ("fields = []", (), 1),
        ("every = 2", tuple(CATALOGUE), 2),
    ],
)
def test_a_scene_chooses_fields_and_steps(
    table: str, names: tuple[str, ...], every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = read_scene(write(tmp_path, f"{SCENE}[finite_strain]\n[output]\n{table}\n"))
    heard: dict[str, Any] = {}
    monkeypatch.setattr(finite_strain, "solve", lambda problem, **options: heard.update(options) or SimpleNamespace())
    MODELS["finite_strain"].solve(scene.problem, Run(output=scene.output))
    assert heard["fields"] == finite_strain.FieldChoice(names, every)


def test_without_the_table_the_model_writes_what_it_does_by_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = read_scene(write(tmp_path, f"{SCENE}[finite_strain]\n"))
    assert scene.output is None
    heard: dict[str, Any] = {}
    monkeypatch.setattr(finite_strain, "solve", lambda problem, **options: heard.update(options) or SimpleNamespace())
    MODELS["finite_strain"].solve(scene.problem, Run(output=scene.output))
    assert "fields" not in heard
    assert finite_strain.FieldChoice() == finite_strain.FieldChoice(tuple(CATALOGUE), 1)


def test_an_unknown_field_and_a_step_of_zero_are_named_at_once(tmp_path: Path) -> None:
    with pytest.raises(InvalidScene) as caught:
        read_scene(write(tmp_path, f'{SCENE}[output]\nfields = ["gap", "mises"]\nevery = 0\n'))
    unknown, every = caught.value.faults
    assert "[output] fields: unknown mises" in unknown
    assert "von_mises" in unknown
    assert "[output] every: must be 1 or more" in every


def test_the_linear_model_says_that_it_has_no_fields_to_write(tmp_path: Path) -> None:
    scene = write(tmp_path, f'{SCENE}[output]\nfields = ["gap"]\n')
    done = thirdbody("solve", scene, "--json", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert any("[output] left out" in note for note in json.loads(done.stdout)["solved"]["notes"])
