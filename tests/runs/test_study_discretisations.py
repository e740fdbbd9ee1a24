"""The study of discretisations: five scenes that a plan takes, and errors against the finest one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from finite_strain.planning.run_plan import plan_run
from runs.studies.discretisations.answer import BAR, BY_ITSELF, LEVELS, PAIRED, SCENES, cases, present
from runs.studies.framework.levels import LevelCase
from runs.studies.framework.saved_cases import Found


def step(order: int, paired: float, alone: float, error: float) -> dict[str, Any]:
    ball = {
        "tangential_force": [paired, 0.0], "tangential_force_error": error,
        "tangential_force_routes": {"domain_without_pair": [alone, 0.0]},
    }  # fmt: skip
    small = {**ball, "tangential_force": [0.1 * paired, 0.0]}
    details = {"order": order, "fineness": 1.0, "unknowns": 100, "iterations": 9, "tangents": 5, "seconds": 2.0}
    return {"balls": [small, ball], "record": details}


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_has_a_plan_whose_sizes_grow_along_the_levels(name: str) -> None:
    plan = plan_run(SCENES[name], 0.02, "finite_strain")
    sizes = [plan.unknowns(level.discretisation()) for level in LEVELS]
    assert sizes[0] < sizes[1]
    assert sizes[0] < sizes[2] < sizes[3] < 2e5


def test_errors_are_those_of_the_ball_with_the_largest_force_against_the_finest(tmp_path: Path) -> None:
    one, *_ = cases(quick=False)
    assert isinstance(one, LevelCase)
    steps = [step(2, 0.97, 0.90, 0.05), step(3, 1.01, 0.98, 0.02), step(4, 1.0, 0.999, 0.001)]
    text = present(Found((one,), {one.name: {"state": "done", "steps": steps}}), tmp_path)
    rows = [line.split("|") for line in text.splitlines() if line.startswith("| thin pair")]
    heads = [word.strip() for word in next(line for line in text.splitlines() if BAR in line).split("|")]
    column = {head: [row[heads.index(head)].strip() for row in rows] for head in (BY_ITSELF, PAIRED, BAR)}
    assert [float(cell) for cell in column[BY_ITSELF]] == pytest.approx([10.0, 2.0, 0.1])
    assert [float(cell) for cell in column[PAIRED][:2]] == pytest.approx([3.0, 1.0])
    assert column[PAIRED][2] == "-"  # it is the reference
    assert [float(cell) for cell in column[BAR]] == pytest.approx([5.0, 2.0, 0.1])
    assert (tmp_path / "discretisations.csv").read_text(encoding="utf-8").count("\n") == 4
