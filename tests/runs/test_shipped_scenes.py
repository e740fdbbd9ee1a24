"""The scenes that are shipped: what they claim about the paper, and that every model they call for can take them."""

from __future__ import annotations

from pathlib import Path

import pytest

from finite_strain.planning.forecast import chances, likely
from finite_strain.planning.records import Discretisation
from finite_strain.planning.run_plan import plan_run
from runs.models import choose, standing
from runs.scene.effects import EFFECTS
from runs.scene.scene_file import read_scene
from tests.launch import ROOT

SCENES = sorted((ROOT / "runs" / "scenes").glob("*.toml"))
FINITE = [path for path in SCENES if "[finite_strain]" in path.read_text(encoding="utf-8")]
AS_WRITTEN = [path for path in FINITE if "[reciprocation]" not in path.read_text(encoding="utf-8")]
"""Scenes whose own balls are meshed: an evolution meshes one ball and pairs."""


def test_the_papers_cases_and_its_three_ball_sizes_are_there() -> None:
    names = {path.stem for path in SCENES}
    assert {"paper_thin_pair", "paper_thick_pair", "paper_thin_pair_linear"} <= names
    assert {"separation_16mm", "separation_10mm", "separation_7mm"} <= names


@pytest.mark.parametrize("diameter", [16, 10, 7])
def test_the_experiment_is_the_papers(diameter: int) -> None:
    problem = read_scene(ROOT / f"runs/scenes/separation_{diameter}mm.toml").problem
    radius = 0.5e-3 * diameter
    assert problem.substrate is None
    assert problem.layer.thickness == pytest.approx(0.01)
    assert problem.layer.poisson == 0.48
    assert problem.load.values == pytest.approx((1.5e-3, 1.5e-3))
    assert [ball.radius for ball in problem.balls] == pytest.approx([radius, radius])
    assert [ball.position[0] for ball in problem.balls] == pytest.approx([-radius, radius])


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_default_model_has_every_effect_of_the_scene(path: Path) -> None:
    scene = read_scene(path)
    model, problem, notes = choose(standing(scene))
    assert set(scene.effects) <= model.effects | {name for name, effect in EFFECTS.items() if effect.of_drift}
    assert model.name == ("finite_strain" if path in FINITE else "linear_bem")
    assert problem == scene.problem
    assert notes == ()


@pytest.mark.parametrize("path", AS_WRITTEN, ids=lambda path: path.stem)
def test_the_layer_of_the_scene_can_be_meshed(path: Path, tmp_path: Path) -> None:
    pytest.importorskip("gmsh")
    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    plan = plan_run(read_scene(path).problem, 0.02, "finite_strain")
    for number, level in enumerate((*likely(chances(plan)), Discretisation(3, 2.0))):
        mesh = tmp_path / f"{number}.msh"
        write_layer_mesh(plan.box(level), mesh)
        assert mesh.stat().st_size > 5_000
