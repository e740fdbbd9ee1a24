"""Two laws with numbers of the same names are two runs; an effect added later leaves runs without it as they are."""

from __future__ import annotations

from dataclasses import make_dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from linear_bem import Elements, Problem
from linear_bem.errors import OutputUnusable
from linear_bem.result import Result
from runs.evolution.pair_table import FEW, PairTable
from runs.evolution.providers import table_of
from runs.models import MODELS, choose
from runs.scene.scene_file import InvalidScene, Scene, read_scene
from runs.session import session
from runs.session.session import Options, Session
from runs.studies.framework.case import Case

LATER: Any = make_dataclass("Problem", [("ageing", object, None)], bases=(Problem,), frozen=True)
"""A problem with an effect that is added later."""
SCENE = """title = "foam"
[layer]
thickness = "3 mm"
young = "2 MPa"
poisson = 0.3
[balls]
radius = "2.5 mm"
positions = [["-3 mm", 0], ["3 mm", 0]]
[load]
approach = "0.3 mm"
[finite_strain]
law = "LAW"
exponents = [2.0]
weights = [1.0]
"""


def scene(law: str, folder: Path) -> Scene:
    path = folder / f"{law}.toml"
    path.write_text(SCENE.replace("LAW", law), encoding="utf-8")
    return read_scene(path)


def test_a_run_of_another_law_is_refused(tmp_path: Path) -> None:
    options = Options(out=tmp_path / "run")
    with Session("solve", scene("ogden", tmp_path), None, options):
        pass
    with Session("solve", scene("ogden", tmp_path), None, options):
        pass
    with pytest.raises(OutputUnusable, match=r"law\.name is ogden there and hyperfoam here"):
        Session("solve", scene("hyperfoam", tmp_path), None, options)


def test_an_effect_added_later_leaves_runs_without_it_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options, given = Options(out=tmp_path / "run"), scene("ogden", tmp_path)
    with Session("solve", given, None, options):
        pass

    def chosen(*arguments: Any) -> tuple[Any, ...]:
        model, problem, notes = choose(*arguments)
        return model, LATER(**vars(problem)), notes

    monkeypatch.setattr(session, "choose", chosen)
    with Session("solve", given, None, options) as same:
        assert "ageing" in vars(same.problem)


def test_an_effect_added_later_leaves_answers_of_studies_and_tables_of_pairs_without_it_as_they_are(
    tmp_path: Path,
) -> None:
    now = scene("ogden", tmp_path).problem
    without, aged = LATER(**vars(now)), LATER(**vars(now), ageing=Elements("mixed"))  # any part

    def key(problem: Problem) -> str:
        return Case("any", problem, "finite_strain", 0.1).key()

    def table(problem: Problem) -> Path:
        return table_of(MODELS["finite_strain"], problem, 0.1, tmp_path).path

    assert key(now) == key(without) != key(aged)
    assert table(now) == table(without) != table(aged)


def test_a_table_of_pairs_is_of_one_law(tmp_path: Path) -> None:
    def solve(*_: object) -> Result:
        raise NotImplementedError

    tables = [
        PairTable(scene(law, tmp_path).problem, "finite_strain", solve, tmp_path, {}) for law in ("ogden", "hyperfoam")
    ]
    assert tables[0].path != tables[1].path


@pytest.mark.parametrize("name", ["small_strain", "finite_strain"])
def test_tables_of_finite_elements_have_few_pairs_and_are_of_one_form(name: str, tmp_path: Path) -> None:
    problem = scene("ogden", tmp_path).problem
    problem = problem if name == "finite_strain" else replace(problem, finite_strain=None)
    forms = [None, Elements("displacement"), Elements("mixed")]
    tables = [table_of(MODELS[name], replace(problem, elements=form), 0.1, tmp_path) for form in forms]
    assert len({table.path for table in tables}) == 3
    assert all(table.slow for table in tables)
    assert len(tables[0].distances) == len(FEW)


def test_a_name_is_no_quantity_that_was_written(tmp_path: Path) -> None:
    path = tmp_path / "soft.toml"
    path.write_text(SCENE.replace("LAW", "hyperfoam").replace("0.3\n", "0.48\n", 1), encoding="utf-8")
    with pytest.raises(InvalidScene, match=r"up to 0\.45, got 0\.48; use"):
        read_scene(path)
