"""The output folder: one run's own, whole at every moment, refused to other runs."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

from linear_bem.errors import OutputUnusable
from runs.process.files import read_json, replacing, write_csv, write_text
from runs.process.json_values import plain, to_json
from runs.reporting import read_folder
from runs.session.output_folder import OutputFolder
from tests.launch import python

IDENTITY = {"command": "solve", "problem": {"layer": {"thickness": 1.0, "young": 2.0}}}


def test_the_same_run_opens_its_folder_again(tmp_path: Path) -> None:
    first = OutputFolder(tmp_path / "a" / "b", IDENTITY, "scene")
    assert first.saved is None
    assert not first.complete
    first.save({"value": 1.0}, [{"step": 0, "force": (1.0, 2.0)}])
    first.close()
    again = OutputFolder(tmp_path / "a" / "b", IDENTITY, "scene")
    assert again.saved == {"value": 1.0}
    assert not again.complete
    again.finish()
    assert again.complete
    assert (again.path / "steps.csv").read_text(encoding="utf-8") == "step,force_x,force_y\n0,1.0,2.0\n"
    again.close()


def test_a_value_with_its_error_has_two_columns(tmp_path: Path) -> None:
    write_csv(tmp_path / "rows.csv", [{"T": (1.0, 0.1), "step": 2}, {"T": None, "step": 3}])
    assert (tmp_path / "rows.csv").read_text(encoding="utf-8") == "T,step,error of T\n1.0,2,0.1\n,3,\n"


def test_another_run_is_refused_by_what_differs(tmp_path: Path) -> None:
    OutputFolder(tmp_path, IDENTITY, "scene").close()
    other = {**IDENTITY, "problem": {"layer": {"thickness": 3.0, "young": 2.0}}}
    with pytest.raises(OutputUnusable, match=r"layer\.thickness is 1\.0 there and 3\.0 here"):
        OutputFolder(tmp_path, other, "scene")
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["identity"] == IDENTITY


def test_fresh_drops_the_old_run_and_no_stranger(tmp_path: Path) -> None:
    old = OutputFolder(tmp_path, IDENTITY, "scene")
    old.save({"value": 1.0}, [])
    old.fields.mkdir()
    (old.fields / "fields.xdmf").write_text("old", encoding="utf-8")
    (tmp_path / "mine.txt").write_text("keep", encoding="utf-8")
    old.close()
    new = OutputFolder(tmp_path, {"command": "compare"}, "scene", fresh=True)
    assert new.saved is None
    assert not new.fields.exists()
    assert (tmp_path / "mine.txt").exists()
    new.close()


def test_a_folder_with_files_of_no_run_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("", encoding="utf-8")
    for fresh in (False, True):
        with pytest.raises(OutputUnusable, match=r"holds files of no run \(thesis\.tex\)"):
            OutputFolder(tmp_path, IDENTITY, "scene", fresh=fresh)
    assert [p.name for p in tmp_path.iterdir() if p.name != ".lock"] == ["thesis.tex"]


@pytest.mark.parametrize("left", ["scene.toml", ".part.7.run.json", "run.json"])
def test_what_a_run_left_that_found_no_room_is_gone_on_from(left: str, tmp_path: Path) -> None:
    (tmp_path / left).write_text('{"identity": ', encoding="utf-8")
    OutputFolder(tmp_path, IDENTITY, "scene").close()
    assert (tmp_path / "scene.toml").read_text(encoding="utf-8") == "scene"
    OutputFolder(tmp_path, IDENTITY, "scene").close()


def test_two_runs_cannot_share_a_folder(tmp_path: Path) -> None:
    first = OutputFolder(tmp_path, IDENTITY, "scene")
    with pytest.raises(OutputUnusable, match="another run is writing there now"):
        OutputFolder(tmp_path, IDENTITY, "scene")
    first.close()
    OutputFolder(tmp_path, IDENTITY, "scene").close()


BEGUN_AND_KILLED = """
import os, sys
from tests.runs.test_store import IDENTITY, OutputFolder, Path
OutputFolder(Path(sys.argv[1]), IDENTITY, "scene")
(Path(sys.argv[1]) / ".part.1.a.png").touch()
os.kill(os.getpid(), 9)
"""


def test_a_run_whose_process_was_killed_is_seen_as_stopped(tmp_path: Path) -> None:
    assert python("-c", BEGUN_AND_KILLED, tmp_path).returncode == -9
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["state"] == "running"
    assert read_folder(tmp_path).state == "stopped"
    again = OutputFolder(tmp_path, IDENTITY, "scene")
    assert again.stopped
    assert not list(tmp_path.glob(".part*"))
    assert read_folder(tmp_path).state == "running"
    again.stop(KeyboardInterrupt)
    again.close()
    assert read_folder(tmp_path).state == "interrupted"
    once_more = OutputFolder(tmp_path, IDENTITY, "scene")
    assert not once_more.stopped
    once_more.close()
    (tmp_path / ".lock").unlink()  # as in a copy: nothing says whether it goes on
    assert read_folder(tmp_path).state == "running"


def test_two_writers_of_one_file_do_not_disturb_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "table.json"
    with replacing(target) as draft:
        draft.write_text("mine", encoding="utf-8")
        with monkeypatch.context() as other:
            other.setattr(os, "getpid", lambda: -1)
            write_text(target, "theirs")
    assert target.read_text(encoding="utf-8") == "mine"
    assert [p.name for p in tmp_path.iterdir()] == ["table.json"]


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    folder = OutputFolder(tmp_path, IDENTITY, "scene")
    folder.save({"value": 1.0}, [])
    endless: dict[str, object] = {}
    endless["self"] = endless
    with pytest.raises(RecursionError):
        folder.save(endless, [])
    assert read_json(tmp_path / "result.json") == {"value": 1.0}
    (tmp_path / "steps.csv").unlink()
    (tmp_path / "steps.csv").mkdir()
    with pytest.raises(OutputUnusable, match=r"steps\.csv: cannot be written"):
        folder.save({"value": 2.0}, [])
    assert not list(tmp_path.glob(".part*"))
    folder.close()


def test_json_is_strict() -> None:
    text = to_json({"a": math.nan, "b": np.float64(2.0), "c": np.array([1, 2]), "d": (math.inf, True), "e": Path("x")})
    assert json.loads(text) == {"a": None, "b": 2.0, "c": [1, 2], "d": [None, True], "e": "x"}
    assert plain({"h": -math.inf}, infinity="inf") == {"h": "-inf"}
