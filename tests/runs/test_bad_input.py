"""Bad input: exit code 2, one clear message on standard error, no traceback, on one rank and on two."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.launch import ROOT, thirdbody

SCENES = ROOT / "runs" / "scenes"
LINEAR = SCENES / "paper_thin_pair_linear.toml"
GOOD = LINEAR.read_text(encoding="utf-8")
CHANGES = {
    "unknown key": ("[layer]", "[layer]\nthicknes = 2.0", "thicknes"),
    "negative thickness": ("thickness = 1.16", "thickness = -1.16", "thickness"),
    "poisson 0.6": ("poisson = 0.48", "poisson = 0.6", "between 0 and 0.5"),
    "overlapping balls": ("[1.0, 0.0]", "[0.9, 0.0]", "overlap"),
    "two load keys": ("[load]", "[load]\napproach = 0.1", "exactly one of"),
    "no toml": ("[layer]", "[layer", "is not TOML"),
    "sliding": ("[load]", "[reciprocation]\namplitude = 1\ncycles = 9\nfriction = 0.1\n\n[load]", "it as approach"),
}


def both(*values: object) -> Any:
    """Return a test's parameters, for two ranks."""
    return pytest.param(*values, 2, marks=pytest.mark.mpi)


def refused(ranks: int, *args: str | Path, says: str) -> str:
    done = thirdbody(*args, timeout=60.0, ranks=ranks)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("thirdbody: error:") == 1, done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    if ranks == 1:
        assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


@pytest.mark.parametrize(("change", "ranks"), [*((change, 1) for change in CHANGES), both("negative thickness")])
def test_a_bad_scene_is_refused(change: str, ranks: int, tmp_path: Path) -> None:
    old, new, says = CHANGES[change]
    assert old in GOOD
    scene = tmp_path / "scene.toml"
    scene.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    message = refused(ranks, "solve", scene, "--json", "--out", tmp_path / "out", says=says)
    assert str(scene) in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("place", "model", "ranks"),
    [
        ("below a file", "linear_bem", 1),
        ("/proc", "small_strain", 1),
        ("a file", "linear_bem", 1),
        both("below a file", "small_strain"),
    ],
)
def test_a_folder_that_cannot_be_written_is_refused(place: str, model: str, ranks: int, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("", encoding="utf-8")
    folder = {"below a file": file / "out", "/proc": Path("/proc/out"), "a file": file}[place]
    scene = SCENES / "paper_thin_pair.toml"
    refused(ranks, "solve", scene, "--model", model, "--out", folder, says=str(folder))


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (("solve", "none.toml"), "does not exist"),
        (("plan", "runs/scenes"), "is a folder"),
        (("compare", LINEAR), "needs [finite_strain]"),
        (("solve", LINEAR, "--model", "finite_strain"), "needs [finite_strain]"),
    ],
)
def test_a_request_that_no_model_meets_is_refused(args: tuple[str | Path, ...], says: str) -> None:
    refused(1, *args, says=says)


@pytest.mark.parametrize(
    "args", [("solve", "scene.toml", "--model", "quantum"), ("solve",), ("dissolve",), ("plan", "--x")]
)
def test_a_wrong_command_line_is_a_usage_error(args: tuple[str, ...]) -> None:
    done = thirdbody(*args, timeout=60.0)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "Usage" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.mpi
def test_a_usage_error_is_said_once_on_two_ranks() -> None:
    done = thirdbody("solve", "scene.toml", "--model", "quantum", timeout=60.0, ranks=2)
    assert done.returncode == 2
    assert done.stderr.count("Usage") == 1
