"""The study of deep loads: scenes that a plan takes, and a page that says what ended a path."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from finite_strain.planning.run_plan import plan_run
from runs.studies.deep.answer import cases, present
from runs.studies.framework.levels import LevelCase
from runs.studies.framework.saved_cases import Found


@pytest.mark.parametrize("scene", cases(quick=False), ids=lambda case: case.name)
def test_every_scene_has_a_plan(scene: LevelCase) -> None:
    plan = plan_run(scene.problem, 0.05, "finite_strain")
    assert scene.steps is not None
    assert plan.deepest == pytest.approx(scene.steps[-1] * max(scene.problem.load.values))
    assert all(plan.unknowns(level.discretisation()) < 1e5 for level in scene.levels)


def step(depth: float, stretch: float, **more: Any) -> dict[str, Any]:
    """Return a step of one ball on a quarter of whose scene Q = D^2, with the energy of that path."""
    ball = {"approach": depth, "normal_force": depth**2, "tangential_force": [0.0, 0.0], "tangential_force_error": 0.0}
    record = {
        "order": 3, "fineness": 1.0, "unknowns": 100, "fraction": depth / 2.0, "iterations": 5,
        "smallest_volume_ratio": 0.4, "smallest_surface_stretch": stretch, "smallest_seen_area": 0.5,
        "surface_crossing": 0.0, "force_on_mesh": depth**2,
        "distorted_at": {"volume_ratio": [0.1, 0.2], "surface_stretch": [1.0, 0.0]}, "strain_energy": depth**3 / 3.0,
    }  # fmt: skip
    return {"balls": [ball], "record": {**record, **more}}


def test_the_page_names_the_crease_the_energy_balance_and_the_reason_of_a_stop(tmp_path: Path) -> None:
    case = next(case for case in cases(quick=False) if case.name == "one-ball-on-6-R")
    steps = [step(0.01, 0.9), step(1.0, 0.8), step(2.0, 0.6, stopped="the film is thin")]
    text = present(Found((case,), {case.name: {"state": "done", "steps": steps}}), tmp_path)
    assert "from D = 2 R on the free surface is compressed below a stretch of 0.65" in text
    assert "every part of the surface keeps at least 0.5 of its undeformed area" in text
    assert "- order 3, fineness 1 ended at D = 2 R: the film is thin" in text
    last = next(line for line in text.splitlines() if line.startswith("| 2 |")).split("|")
    # the first step's work is taken as Hertz's, a millionth of the whole
    assert abs(float(last[-3])) < 1e-4
    assert (tmp_path / "deep.csv").read_text(encoding="utf-8").count("\n") == 4
    assert (tmp_path / "deep.png").stat().st_size > 10_000


def test_the_page_says_from_where_on_the_surface_overhangs(tmp_path: Path) -> None:
    case = next(case for case in cases(quick=False) if case.name == "one-ball-on-6-R")
    steps = [step(1.0, 0.8), step(2.0, 0.8, smallest_seen_area=-0.1)]
    text = present(Found((case,), {case.name: {"state": "done", "steps": steps}}), tmp_path)
    assert "From D = 2 R on the surface overhangs" in text
    assert "beside a ball that is pressed in beyond its equator" in text
    steps[1] = step(2.0, 0.8, smallest_seen_area=-0.1, surface_crossing=0.02)
    text = present(Found((case,), {case.name: {"state": "done", "steps": steps}}), tmp_path)
    assert "by 0.02 R: flanks meet there" in text


def test_the_page_names_the_point_that_is_near_a_crease(tmp_path: Path) -> None:
    case = next(case for case in cases(quick=False) if case.name == "one-ball-on-6-R")
    steps = [step(1.0, 0.9), step(1.5, 0.7), step(2.0, 0.74)]
    text = present(Found((case,), {case.name: {"state": "done", "steps": steps}}), tmp_path)
    assert "from D = 1.5 R on the surface stretch at one point (r = 1.00 R) is near the crease limit of 0.65" in text
    assert "the smallest stretch is 0.70.**" in text
    text = present(Found((case,), {case.name: {"state": "done", "steps": steps[:1]}}), tmp_path)
    assert "the smallest surface stretch is 0.90: no crease" in text
