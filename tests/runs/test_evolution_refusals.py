"""What evolve and other commands refuse in scenes whose balls drift."""

from __future__ import annotations

from pathlib import Path

import pytest

from linear_bem.errors import UnsupportedProblem
from runs.evolution.evolving import evolve_scene
from runs.scene.scene_file import read_scene
from runs.session.session import Options
from tests.launch import ROOT, thirdbody
from tests.runs.three_balls import TEXT


@pytest.mark.parametrize(
    ("command", "change", "says"),
    [
        ("solve", ("", ""), "use `thirdbody evolve"),
        ("compare", ("", ""), "use `thirdbody evolve"),
        ("evolve", ("[reciprocation]", "[accuracy]\ntangential_force = 0.01\n[nothing]"), "unknown table"),
        ("evolve", ("amplitude = \"80 mm\"", "amplitude = 0"), "[reciprocation] amplitude: must be greater than 0"),
        ("evolve", ("ensemble = 3", "ensemble = 3\nforce = \"pairs\""), 'did you mean "forces"'),
        ("evolve", ("ensemble = 3", "direction = [\"1 mm\", 0]"), "direction: number 0: must be a plain number"),
        ("evolve", ("radius = \"10 mm\"", "radius = [0.01, 0.01, 0.008]"), 'use forces = "direct"'),
    ],
)  # fmt: skip
def test_refusals_name_what_is_wrong(command: str, change: tuple[str, str], says: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(TEXT.replace(*change) if change[0] else TEXT, encoding="utf-8")
    done = thirdbody(command, file, "--out", tmp_path / "out")
    assert done.returncode == 2, done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr


def test_a_scene_that_does_not_slide_cannot_evolve(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedProblem, match=r"needs \[reciprocation\]"):
        evolve_scene(read_scene(ROOT / "runs/scenes/separation_16mm.toml"), None, Options(False, tmp_path, False))
