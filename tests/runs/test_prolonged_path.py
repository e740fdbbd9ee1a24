"""A run of ``evolve`` with other cycles or members: it goes on from what is saved, to what one run gives."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from linear_bem.errors import OutputUnusable
from runs.evolution import evolving, outcome, showing
from runs.evolution.evolving import evolve_scene
from runs.process import signals
from runs.scene.scene_file import read_scene
from runs.session.output_folder import OutputFolder
from runs.session.session import Options
from tests.runs.killing import killed_after
from tests.runs.three_balls import TEXT

OneRun = Callable[[float, list[list[float]]], Path]
THREE = [[0.0, 0.0], [0.031, 0.004], [0.011, 0.035]]
MANY = [[0.025 * i + 0.003 * (j % 3), 0.025 * j + 0.002 * (i % 4)] for i in range(11) for j in range(10)]


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    monkeypatch.setattr(outcome, "direct_check", lambda *given: ([], []))


def evolved(folder: Path, cycles: float, places: list[list[float]], members: int = 2) -> dict[str, Any]:
    """Return the document without times."""
    folder.mkdir(exist_ok=True)
    file = folder / "scene.toml"
    text = re.sub("(?<=positions = ).*", str(places), TEXT.replace("cycles = 400", f"cycles = {cycles}"))
    text = text.replace("ensemble = 3", f"ensemble = {members}\ntolerance = 1e-4")
    file.write_text(text, encoding="utf-8")
    evolve_scene(read_scene(file), "point_load", Options(False, folder / "out", False), folder / "tables")
    return document_in(folder)


@pytest.fixture(scope="module")
def one_run(tmp_path_factory: pytest.TempPathFactory) -> OneRun:
    """Return the folder of one run of so many cycles from these places, computed once."""
    done: dict[tuple[float, int], Path] = {}

    def folder(cycles: float, places: list[list[float]]) -> Path:
        key = cycles, len(places)
        if key not in done:
            done[key] = tmp_path_factory.mktemp("one")
            evolved(done[key], cycles, places, members_of(places))
        return done[key]

    return folder


def document_in(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "out" / "result.json").read_text(encoding="utf-8"))
    del document["solved"]["seconds"]
    return document


def members_of(places: list[list[float]]) -> int:
    return 2 if places is THREE else 1


@pytest.mark.parametrize("then", [[3.0, 90.0, 400.0, 500.0], [400.0, 90.0]])
def test_another_number_of_cycles_goes_on_to_what_one_run_gives(
    then: list[float], tmp_path: Path, one_run: OneRun
) -> None:
    for cycles in then:
        document = evolved(tmp_path / "changed", cycles, THREE)
    one = one_run(then[-1], THREE)
    assert document == document_in(one)
    assert (tmp_path / "changed/out/steps.csv").read_bytes() == (one / "out/steps.csv").read_bytes()


@pytest.mark.parametrize("places", [THREE, MANY])
def test_only_what_is_missing_is_computed(
    places: list[list[float]], tmp_path: Path, capsys: pytest.CaptureFixture[str], one_run: OneRun
) -> None:
    members = members_of(places)
    short = evolved(tmp_path / "changed", 30.0, places, members)
    long = evolved(tmp_path / "changed", 40.0, places, members)
    said = capsys.readouterr().err
    assert f"continues at cycle {short['continuation']['sigma'] * 20.0 / 0.32:.4g} of 40, after " in said
    assert long == document_in(one_run(40.0, places))
    cut = evolved(tmp_path / "changed", 20.0, places, members)
    less = one_run(20.0, places)
    assert cut == document_in(less)
    files = (sorted(p.name for p in (folder / "out" / "path").glob("*")) for folder in (tmp_path / "changed", less))
    assert next(files) == next(files)


def test_another_number_of_members_keeps_those_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_run: OneRun
) -> None:
    followed: list[int] = []
    member = evolving.Evolution._member

    def counted(evolution: evolving.Evolution, path: Any, number: int) -> dict[str, Any]:
        followed.append(number)
        return member(evolution, path, number)

    evolved(tmp_path / "changed", 30.0, THREE, 2)
    with monkeypatch.context() as patch:
        patch.setattr(evolving.Evolution, "_member", counted)
        more = evolved(tmp_path / "changed", 30.0, THREE, 3)
    assert followed == [0, 2]  # the first is that of the saved path
    assert more == evolved(tmp_path / "three", 30.0, THREE, 3)
    assert evolved(tmp_path / "three", 30.0, THREE, 2) == document_in(one_run(30.0, THREE))
    assert evolved(tmp_path / "three", 40.0, THREE, 3) == evolved(tmp_path / "longer", 40.0, THREE, 3)


@pytest.mark.parametrize(("after", "places"), [(4, THREE), (12, MANY)])
def test_a_longer_run_that_is_killed_goes_on_too(
    after: int, places: list[list[float]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_run: OneRun
) -> None:
    members = members_of(places)
    evolved(tmp_path / "changed", 30.0, places, members)

    with monkeypatch.context() as patch:
        for interval in ("SAVE_INTERVAL", "SAVE_RATIO"):
            patch.setattr(evolving, interval, -1.0)
        patch.setattr(signals, "check", killed_after(after))
        with pytest.raises(KeyboardInterrupt):
            evolved(tmp_path / "changed", 70.0, places, members)
    for cycles in (35.0, 70.0):
        document = evolved(tmp_path / "changed", cycles, places, members)
        assert document == document_in(one_run(cycles, places))


def test_what_follows_a_saved_path_is_not_computed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []

    def stops(*given: Any) -> dict[str, Any]:
        raise KeyboardInterrupt

    def check(*given: Any) -> tuple[list[Any], list[Any]]:
        asked.append("check")
        return [], []

    monkeypatch.setattr(outcome, "direct_check", check)
    with monkeypatch.context() as patch:
        patch.setattr(outcome, "equilibrium", stops)
        with pytest.raises(KeyboardInterrupt):
            evolved(tmp_path / "stopped", 30.0, THREE)
    capsys.readouterr()
    document = evolved(tmp_path / "stopped", 30.0, THREE)
    said = capsys.readouterr().err
    assert asked == ["check"]
    assert "the saved path is complete, to cycle 30" in said
    assert said.count(": saved") == 2  # the check, and the path by a coarser tolerance
    assert document == evolved(tmp_path / "one", 30.0, THREE)


def test_a_path_of_an_older_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(evolving, "FORMAT", evolving.FORMAT - 1)
        evolved(tmp_path, 3.0, THREE)
    with pytest.raises(OutputUnusable, match=rf"format is {evolving.FORMAT - 1} there and {evolving.FORMAT} here"):
        evolved(tmp_path, 4.0, THREE)


def test_a_moving_path_says_how_to_go_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    evolved(tmp_path / "short", 3.0, THREE)
    said = " ".join(capsys.readouterr().out.split())
    assert "still moving after 3 cycles, to go on raise [reciprocation] cycles and run the same command again" in said


def test_a_finished_folder_whose_cycles_change_is_unfinished(tmp_path: Path) -> None:
    first = OutputFolder(tmp_path, {"reciprocation": {"cycles": 3, "seed": 1}}, "")
    first.save({"answer": 1}, [])
    first.finish()
    assert first.complete
    first.close()
    again = OutputFolder(tmp_path, {"reciprocation": {"cycles": 4, "seed": 1}}, "")
    assert not again.complete
    assert again.saved == {"answer": 1}
    again.close()
