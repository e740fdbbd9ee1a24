"""What an evolution says of its end: the error of T against the full linear model, groups, what holds the balls."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from linear_bem import Periodic, solve
from linear_bem.arrays import Array
from linear_bem.errors import UnsupportedProblem
from runs.evolution import outcome, pair_table, showing
from runs.evolution.evolving import evolve_scene
from runs.evolution.forces import State
from runs.evolution.hard_balls import HardBalls
from runs.scene.scene_file import InvalidScene, read_scene
from runs.scene.units import Unit
from runs.session.session import Options

TEXT = """
[layer]
thickness = 2.0
young = 1.0
poisson = 0.4
[balls]
radius = {radius}
positions = [[1.0, 1.0], [3.3, 1.2], [1.4, 3.4], [5.5, 4.4]]
[load]
approach = 0.2
[reciprocation]
amplitude = 300
cycles = 0.01
friction = 1
{forces}
{more}
"""
CELL = "[periodic]\nlengths = [8.0, 9.0]"


def evolved(folder: Path, model: str, more: str, radius: str = "1.0", forces: str = "") -> dict[str, Any]:
    file = folder / "four.toml"
    file.write_text(TEXT.format(more=more, radius=radius, forces=forces), encoding="utf-8")
    evolve_scene(read_scene(file), model, Options(False, folder / f"out-{model}", False), folder.parent / "pair-tables")
    document: dict[str, Any] = json.loads((folder / f"out-{model}" / "result.json").read_text(encoding="utf-8"))
    return document


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    monkeypatch.setattr(outcome, "position_error", lambda *given: None)
    monkeypatch.setattr(pair_table, "MANY", (1.0, 1.3, 1.6, 2.2, 3.0, 4.0))


@pytest.mark.parametrize("more", ["", CELL], ids=["free", "cell"])
@pytest.mark.parametrize("model", ["point_load", "linear_bem"])
def test_the_error_at_the_end_covers_the_full_linear_model(
    model: str, more: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = evolved(tmp_path, model, more)
    balls = document["balls"]
    scene = read_scene(tmp_path / "four.toml")
    there = scene.problem.at(np.array([ball["position"] for ball in balls]))
    full = solve(replace(there, periodic=Periodic((8.0, 9.0)) if more else None), accuracy=1e-3).balls
    away = [np.subtract(b["tangential_force"], f.tangential_force) for b, f in zip(balls, full, strict=True)]
    errors = np.array([b["tangential_force_error"] for b in balls])
    assert np.all(np.hypot(*np.array(away).T) <= errors + [f.tangential_force_error for f in full])
    largest = max(np.hypot(*f.tangential_force) for f in full)
    path = np.array(document["path"][-1]["tangential_force"])
    share = np.max(np.hypot(*(path - [f.tangential_force for f in full]).T)) / largest
    assert document["direct_check"][-1]["share"] == pytest.approx(share, rel=0.05)
    if model == "point_load":  # so does the error on the path, where there is nothing to compare with
        assert share * largest <= document["path"][-1]["tangential_force_error"][0] <= 0.5 * largest
    assert np.max(errors) < 1.1 * share * largest
    # an arrangement in a cell has neither width nor length
    assert ("narrow_over_wide" in document["ensemble"][0]) == (not more)
    said = capsys.readouterr().out
    assert "T at the end differs from the full linear model" in said
    # what is printed and saved as the end is the full model where that is the model asked for
    assert ("the final state of the balls is the full linear model's" in said) == (model == "linear_bem")
    assert ("positions are not wrapped into the cell" in said) == bool(more)
    assert "of processor time with what follows the path, without pictures" in " ".join(said.split())
    assert ("the table of pairs took" in " ".join(said.split())) == (model == "linear_bem")


def test_too_many_balls_for_the_full_model_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runs.evolution.outcome.MEASURED", 3)
    monkeypatch.setattr("runs.evolution.providers.MEASURED", 3)
    monkeypatch.setattr(showing, "LISTED", 3)
    assert evolved(tmp_path, "linear_bem", CELL)["direct_check"] is None
    said = " ".join(capsys.readouterr().out.split())
    assert "other arrangements may differ more" in said
    assert "result.json has the final state of each of the 4 balls" in said


def test_unequal_balls_in_a_cell_get_a_remedy_that_works(tmp_path: Path) -> None:
    radii = "[1.0, 0.9, 1.0, 1.0]"
    with pytest.raises(UnsupportedProblem, match="--model point_load"):
        evolved(tmp_path, "linear_bem", CELL, radii)
    with pytest.raises(InvalidScene, match="--model point_load"):
        evolved(tmp_path, "linear_bem", CELL, radii, 'forces = "direct"')
    assert evolved(tmp_path, "point_load", CELL, radii)["solved"]["converged"]


def test_sentences_of_the_end() -> None:
    rest = {"at_rest": True, "holding": 0, "speed": 0.0, "force_over_load": 3.1e-3}
    assert "no tangential force above [reciprocation] rest is left" in outcome.rest_sentence(rest, 5.0)
    assert ": the rolling resistance of 0.004 of the load holds the balls" in outcome.rest_sentence(rest, 5.0, 4e-3)
    assert ": 1 contact holds the balls" in outcome.rest_sentence(rest | {"holding": 1}, 5.0)
    moving = rest | {"at_rest": False, "speed": 5.9e-5}
    assert "the fastest ball is driven by 5.9e-05 of its load" in outcome.rest_sentence(moving, 100.0)
    begin = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [3.0, 4.0]])
    alone = {"contacts": 0, "groups": [1, 1, 1, 1], "positions": (2.0 * begin).tolist()}
    length = Unit("mm", 1e-3)
    said = outcome.arrangement_sentence(alone, begin, None, length)
    assert said == "no contacts; 4 clusters of 1; nearest distance 6000 mm (3000 mm in the scene)"
    assert "(1000 mm in the scene)" in outcome.arrangement_sentence(alone, begin, np.array([4.0, 9.0]), length)
    together = {"contacts": 4, "groups": [4], "positions": begin.tolist()}
    assert outcome.arrangement_sentence(together, begin, None, length) == "4 balls in one cluster, 4 contacts"
    pairs = {"contacts": 1, "groups": [2, 1, 1], "positions": begin.tolist()}
    assert outcome.arrangement_sentence(pairs, begin, None, length).startswith(
        "1 contact; 1 cluster of 2, 2 clusters of 1"
    )
    assert (
        outcome.clusters([9, 4, *[2] * 3, *[1] * 200])
        == "1 cluster of 9, 1 cluster of 4, 3 clusters of 2, 200 smaller ones"
    )


def test_where_an_equilibrium_is_or_was_sought_is_said_in_the_unit_of_the_scene() -> None:
    def parted(x: Array) -> State:  # apart, and less so the farther they are
        push = 1e-9 * float(np.hypot(*(x[1] - x[0]))) ** -4.0
        return State(np.array([[-push, 0.0], [push, 0.0]]), np.ones(2), np.zeros(2))

    balls = HardBalls(np.full(2, 0.005))
    found = outcome.equilibrium(parted, balls, np.array([[0.0, 0.0], [0.015, 0.0]]), 1e-4, 0.0)
    said = showing._balance(found, 0.005, Unit("mm", 1e-3))
    assert re.match(r"no equilibrium found: none within \d+(\.\d+)? mm of the final positions; where the search", said)
    there = {"verdict": "stable", "free_motions": 0, "growth": [], "distance_from_end": 1.23e-4}
    said = showing._balance(there, 0.005, Unit("mm", 1e-3))
    assert said == "the path ends 0.12 mm from an equilibrium: stable (no free motion)"
