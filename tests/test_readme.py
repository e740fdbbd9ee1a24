"""The README's blocks do what they say."""

from __future__ import annotations

import re
import tomllib

import pytest

from runs.scene.scene_file import read_scene
from tests.launch import ROOT, python

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, flags=re.DOTALL | re.MULTILINE)


def test_the_python_block_has_eight_lines_and_meets_the_reference(tmp_path):
    (block,) = blocks("python")
    assert len([line for line in block.splitlines() if line.strip()]) == 8
    script = tmp_path / "readme.py"
    script.write_text(block, encoding="utf-8")
    done = python(str(script))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("T = -1.1612")


def test_the_scene_block_is_a_scene(tmp_path):
    (block,) = blocks("toml")
    assert "layer" in tomllib.loads(block)
    file = tmp_path / "scene.toml"
    file.write_text(block, encoding="utf-8")
    scene = read_scene(file)
    assert scene.problem.finite_strain is not None
    assert scene.problem.layer.thickness == pytest.approx(0.010)


def test_every_command_named_in_the_command_line_block_exists():
    block = next(b for b in blocks("sh") if "thirdbody solve" in b)
    names = set(re.findall(r"^thirdbody (\w+)", block, flags=re.MULTILINE))
    done = python("-m", "runs.cli", "--help")
    assert names
    for name in names:
        assert re.search(rf"\b{name}\b", done.stdout), f"README names `thirdbody {name}`"


def test_every_path_that_the_readme_names_exists():
    for path in re.findall(r"\b((?:runs|tests|linear_bem|finite_strain|meshes)/[\w./]*)", TEXT):
        assert (ROOT / path).exists(), path
