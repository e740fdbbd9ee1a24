"""A run's folder whose files are damaged: what is safe is computed again, what is not is refused with the remedy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, Problem
from linear_bem.errors import OutputUnusable
from runs.commands.solve import solve_scene
from runs.display import surface
from runs.evolution.drift import Moment
from runs.evolution.forces import State
from runs.evolution.hard_balls import HardBalls
from runs.evolution.pair_table import PairTable
from runs.evolution.record import Record, file_name
from runs.reporting import page_of
from runs.reporting.folder import read_folder
from runs.scene.scene_file import read_scene
from runs.session.output_folder import OutputFolder, difference
from runs.session.session import Options
from tests.launch import ROOT
from tests.runs.three_balls import evolved, sliding, three


def test_a_damaged_mark_is_named_and_replaced_where_asked(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run = OutputFolder(out, {"command": "solve"}, "")
    run.save({"answer": 1}, [])
    run.close()
    (out / "run.json").write_text('{"identity": {"comm', encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"run\.json: is damaged.*--fresh"):
        OutputFolder(out, {"command": "solve"}, "")
    again = OutputFolder(out, {"command": "solve"}, "", fresh=True)
    assert again.saved is None
    again.close()


def test_a_damaged_result_is_computed_again(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run = OutputFolder(out, {"command": "solve"}, "")
    run.save({"answer": 1}, [])
    run.finish()
    run.close()
    (out / "result.json").write_text('{"answer"', encoding="utf-8")
    again = OutputFolder(out, {"command": "solve"}, "")
    assert not again.complete
    assert again.saved is None
    again.save({"unfinished": 1}, [])
    again.stop(KeyboardInterrupt)
    again.close()
    once_more = OutputFolder(out, {"command": "solve"}, "")
    assert not once_more.complete  # what an interrupted run left is no result
    once_more.close()


def test_what_a_complete_run_has_lost_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, out = read_scene(ROOT / "runs" / "scenes" / "paper_thin_pair_linear.toml"), tmp_path / "out"

    def said() -> str:
        solve_scene(scene, "point_load", Options(out=out))
        return capsys.readouterr().err

    assert "deleted" not in said() + said()
    (out / "steps.csv").unlink()
    assert "(--fresh computes again, also what was deleted: steps.csv)" in said()
    (out / "run.log").unlink()
    assert "deleted: steps.csv, run.log)" in said()
    result = out / "result.json"
    whole = result.read_bytes()
    result.write_bytes(whole[:100])
    assert f"{result} is damaged or was deleted: it is made again" in said()
    result.unlink()
    assert "is damaged or was deleted" in said()
    assert result.exists()
    assert (out / "steps.csv").exists()


@pytest.mark.parametrize(
    ("edited", "fault"), [({}, "lacks the key 'balls'"), ({"balls": [3]}, r"has a wrong value \(")]
)
def test_an_edited_result_is_named(edited: dict[str, Any], fault: str, tmp_path: Path) -> None:
    scene, out = read_scene(ROOT / "runs" / "scenes" / "paper_thin_pair_linear.toml"), tmp_path / "out"
    solve_scene(scene, "point_load", Options(out=out))
    whole = json.loads((out / "result.json").read_text(encoding="utf-8"))
    (out / "result.json").write_text(json.dumps((whole if edited else {}) | edited), encoding="utf-8")
    named = rf"result\.json: {fault}.*edited.*with --fresh"
    with pytest.raises(OutputUnusable, match=named):
        solve_scene(scene, "point_load", Options(out=out))
    with pytest.raises(OutputUnusable, match=named):
        page_of(read_folder(out))
    # a run that goes on from its saved steps
    (out / "result.json").write_text('{"steps": [{}]}', encoding="utf-8")
    (out / "run.json").write_text((out / "run.json").read_text().replace("finished", "failed"), encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"result\.json: lacks the key 'balls'"):
        solve_scene(scene, "point_load", Options(out=out))


def test_an_edited_path_of_a_drift_is_named(tmp_path: Path) -> None:
    scene, out = sliding(three(tmp_path), ensemble=1, cycles=0.5), tmp_path / "out"
    evolved(scene, out)
    (out / "result.json").write_text("{}", encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"result\.json: lacks the key 'path'.*with --fresh"):
        evolved(scene, out)
    (out / "result.json").write_text('{"path": [{}]}', encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"result\.json: lacks the key 'sigma'.*with --fresh"):
        evolved(sliding(scene, cycles=0.6), out)


def test_a_damaged_surface_is_named_with_what_it_is_for(tmp_path: Path) -> None:
    (tmp_path / surface.NAME).write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(OutputUnusable, match=r"surface\.npz: cannot be read.*only for a picture"):
        surface.load(tmp_path)


@pytest.mark.parametrize(("damaged", "left"), [(2, 2), (0, 0)])
def test_a_path_continues_from_the_last_moment_before_a_damaged_one(damaged: int, left: int, tmp_path: Path) -> None:
    count = 101
    balls, record = HardBalls(np.ones(count)), Record()
    assert balls.many
    for number in range(4):
        x = np.stack([3.0 * np.arange(count), np.full(count, float(number))], axis=1)
        state = State(np.zeros((count, 2)), np.ones(count), np.zeros(count))
        moment = Moment(float(number), x, state, np.array([], int), np.array([]), 1.0, 0.5, 0.1, False)
        record.take(moment, balls, last=number == 3)
    document = record.to_dict(balls, tmp_path / "path")
    assert Record.from_dict(document, balls, tmp_path / "path").ended(3.0)
    file = tmp_path / "path" / file_name(damaged)
    file.write_bytes(file.read_bytes()[:100])
    found = Record.from_dict(document, balls, tmp_path / "path")
    assert [moment.sigma for moment in found.moments] == [float(number) for number in range(left)]
    assert (found.continuation is None) == (left == 0)
    if found.continuation is not None:
        assert found.continuation.sigma == left - 1
        assert np.array_equal(found.continuation.positions, found.moments[-1].positions)
    assert found.written == left
    assert file.name in found.damage


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('{"identity"', "Expecting ':'"),
        ("{}", "'identity'"),
        ("[]", "list indices"),
        ('{"single": 3}', "single: Input should be"),
        ('{"pairs": [{}]}', "pairs.0.distance: Field required"),
    ],
)
def test_a_damaged_table_of_pairs_is_named_and_computed_again(text: str, fault: str, tmp_path: Path) -> None:
    problem = Problem(
        Layer(1.0, 0.3, 2.0), (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0)), Load("approach", (0.1, 0.1))
    )

    def opened(folder: Path = tmp_path) -> PairTable:
        return PairTable(problem, "linear_bem", lambda *_: pytest.fail("nothing is to be solved"), folder, {})

    table = opened()
    assert not table.damage
    if "single" in text or "pairs" in text:
        text = json.dumps(table.data | json.loads(text))
    table.path.write_text(text, encoding="utf-8")
    again = opened()
    assert again.missing == table.missing
    assert again.damage.startswith(f"{table.path}: cannot be read ({fault}")
    assert again.damage.endswith("; its runs are computed again")
    assert not opened(table.path).damage  # a file in place of the folder: refused when the table is saved


def test_a_run_of_many_other_balls_is_named_by_the_first_of_them() -> None:
    balls = [{"radius": 1.0, "position": [3.0 * k, 0.0]} for k in range(200)]
    larger = [{**ball, "radius": 2.0} for ball in balls]
    said = difference({"problem": {"balls": balls}}, {"problem": {"balls": larger}})
    assert said.startswith("balls[0].radius is 1.0 there and 2.0 here, balls[1].radius")
    assert len(said) < 200
    assert difference({"problem": {"balls": balls}}, {"quick": True}) == (
        "problem is a table there and None here, quick is None there and True here"
    )
    assert difference({"balls": balls}, {"balls": balls[1:]}) == "balls is a list of 200 there and a list of 199 here"
