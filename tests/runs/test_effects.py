"""What an effect brings in, and that a scene without it runs as if its code did not exist."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from linear_bem.errors import ThirdBodyError
from runs.scene.scene_file import read_scene
from runs.studies.effects import answer, measuring
from runs.studies.effects.answer import measure, report
from runs.studies.effects.measuring import Account, lasting
from runs.studies.effects.scenes import LINEAR, effects, toml


@pytest.fixture(scope="module")
def measured() -> tuple[dict[str, dict[str, Any]], Account]:
    """The study's rows of three effects, and the account of a linear scene."""
    of = {effect.name: effect for effect in effects()}
    mixed = of["mixed form"]
    # finite strain is added to the scene to which the mixed form is added in turn, so that its elements run once
    linear = LINEAR | {"layer": mixed.without["layer"]}
    substrate = dataclasses.replace(of["substrate"], without=linear, with_=of["substrate"].with_ | linear)
    finite = dataclasses.replace(of["finite strain"], without=linear, with_=mixed.without)
    # deeper than the study's scenes: a wider contact takes half the unknowns; the set-up compiles the forms of spheres
    deep = {"load": {"approach": 0.15}, "balls": LINEAR["balls"] | {"shape": "sphere"}}
    chosen = [
        dataclasses.replace(effect, without=effect.without | deep, with_=effect.with_ | deep)
        for effect in (substrate, finite, mixed)
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measuring, "PROBE", Path(__file__).with_name("coarse_probe.py"))
        linear: list[Account] = []

        def run(*given: Any) -> Account:
            account = measuring.run(*given)
            if account.document["model"] == "linear_bem":
                linear.append(account)
            return account

        patch.setattr(answer, "run", run)
        return {row["effect"]: row for row in measure(chosen)}, linear[0]


@pytest.fixture
def rows(measured: tuple[dict[str, dict[str, Any]], Account]) -> dict[str, dict[str, Any]]:
    return measured[0]


@pytest.mark.slow
def test_a_scene_without_an_effect_pays_nothing_for_it(rows: dict[str, dict[str, Any]]) -> None:
    for row in rows.values():
        assert row["pays nothing without"], "\n".join(f"{key}: {value}" for key, value in row.items())
        assert row["blocked"] > 0
    text = report(list(rows.values()), "thirdbody study effects")
    assert "its code did not exist: 3 of 3 effects" in text


def test_an_effect_brings_in_its_own_modules_forms_and_unknowns(rows: dict[str, dict[str, Any]]) -> None:
    finite = rows["finite strain"]
    brought = {"finite_strain.equilibrium.newton", "meshes.layer", "dolfinx", "petsc4py", "gmsh"}
    assert brought <= set(finite["modules of its own"].split())
    assert finite["forms without"] == 0
    assert finite["forms of its own"] >= 3
    assert finite["with"] > 10 * finite["unknowns without"]
    mixed = rows["mixed form"]
    assert mixed["forms of its own"] > 0
    assert 1.0 < mixed["with"] / mixed["unknowns without"] < 1.3  # a pressure per vertex
    assert rows["substrate"]["modules of its own"] == ""
    assert rows["mixed form"]["functions of its own elsewhere"]


@pytest.fixture
def linear(measured: tuple[dict[str, dict[str, Any]], Account]) -> Account:
    return measured[1]


def test_a_module_that_is_taken_away_is_missed_by_the_scene_that_needs_it(linear: Account) -> None:
    assert "linear_bem.smooth.tangential_forces" in linear.modules
    with pytest.raises(ThirdBodyError, match=r"without linear_bem\.smooth\.tangential_forces ended with"):
        measuring.run(LINEAR, blocked=["linear_bem.smooth.tangential_forces"])


def test_a_function_that_is_taken_away_is_missed_by_the_scene_that_calls_it(linear: Account) -> None:
    called = linear.functions
    assert "linear_bem.solver:solve_contact" in called
    assert not [name for name in called if not name.startswith(("linear_bem.", "runs."))]
    with pytest.raises(ThirdBodyError, match=r"linear_bem\.solver:solve_contact \(refused"):
        measuring.run(LINEAR, blocked=["linear_bem.solver:solve_contact"])


def test_every_scene_of_the_study_is_a_scene(tmp_path: Any) -> None:
    for effect in effects():
        for scene in (effect.without, effect.with_):
            file = tmp_path / "scene.toml"
            file.write_text(toml(scene), encoding="utf-8")
            assert read_scene(file).problem.size == 2


def test_results_are_alike_only_where_every_entry_is() -> None:
    one = {"balls": [{"force": 1.0, "position": [0.0, 1.0]}], "seconds": 1.0, "model": "linear_bem"}
    assert lasting(one) == lasting(one | {"seconds": 2.0})
    for other in (
        {**one, "balls": [{"force": 1.01, "position": [0.0, 1.0]}]},
        {**one, "model": "point_load"},
        {**one, "more": 1.0},
        {**one, "balls": [{"force": None, "position": [0.0, 1.0]}]},
    ):
        assert lasting(one) != lasting(other)


def test_what_a_scene_pays_for_is_distinguished() -> None:
    def account(modules: set[str], functions: set[str]) -> Account:
        return Account(frozenset(modules), frozenset(functions), (), {"solved": {"unknowns": 7}})

    here, there = account({"a"}, {"a:f"}), account({"a", "b"}, {"a:f", "a:g", "b:h"})
    assert measuring.own_functions(here, there) == ["a:g"]
    assert here.unknowns == 7
