"""Studies of many cases: shared out, resumed after a kill with the right answer, a failing case recorded, published."""

from __future__ import annotations

import csv
import dataclasses
import json
import shutil
import signal
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from linear_bem import solve
from linear_bem.errors import InvalidProblem, OutputUnusable
from linear_bem.result import Step
from runs.reporting import page_of
from runs.reporting.folder import read_folder
from runs.studies import Options, read_shard
from runs.studies.framework import runner
from runs.studies.framework import study as studies
from runs.studies.framework.case import Case
from runs.studies.framework.pair import as_seen_by, pair
from runs.studies.framework.saved_cases import Found, StudyFolder
from runs.studies.framework.study import BEGIN, END, OUTDATED, publish
from runs.studies.strengthening.matrix import cases, law_cases
from tests.launch import STAND_IN, thirdbody
from tests.runs.saved_paths import path

Resumed = tuple[subprocess.CompletedProcess[str], subprocess.CompletedProcess[str], Path]
LINEAR = 2e-4
"""Relative error asked of the linear T, twice."""
NAMES = [case.name for case in (*cases(quick=True), *law_cases(quick=True))]


def study(out: Path, *more: str, n: int = 1, env: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    args = ("study", "strengthening", "--quick", "--out", out, *more)
    return thirdbody(*args, ranks=n, env=env, program=STAND_IN)


def records(out: Path) -> dict[str, dict[str, Any]]:
    return {path.stem: json.loads(path.read_text()) for path in (out / "cases").glob("*.json")}


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a study that was killed in its first case."""
    out = tmp_path_factory.mktemp("killed") / "out"
    done = study(out, "--shard", "1/2", env={"ELEMENTS": "kill"})
    assert done.returncode in (-signal.SIGKILL, 128 + signal.SIGKILL)
    return out


@pytest.fixture(scope="module")
def resumed(killed: Path, tmp_path_factory: pytest.TempPathFactory) -> Resumed:
    """What the same command said on two ranks in a copy of that folder, what the other half said, and the copy."""
    out = tmp_path_factory.mktemp("resumed") / "out"
    shutil.copytree(killed, out)
    first = study(out, "--shard", "1/2", n=2)
    assert first.returncode == 0, first.stderr
    assert set(records(out)) == set(NAMES[::2])
    before = {path: path.stat().st_mtime_ns for path in (out / "cases").glob("*.json")}
    second = study(out, "--shard", "2/2")
    assert second.returncode == 0, second.stderr
    assert all(path.stat().st_mtime_ns == time for path, time in before.items())
    return first, second, out


@pytest.mark.mpi
def test_shards_solve_each_case_once_and_the_last_has_the_whole_answer(resumed: Resumed) -> None:
    first, second, out = resumed
    assert f"Not there: {len(NAMES[1::2])} of {len(NAMES)} cases" in first.stdout
    assert f"- {NAMES[1]}: not run yet" in first.stdout
    assert "Not there" not in second.stdout
    assert f"{len(NAMES)} of {len(NAMES)} cases" in second.stdout
    assert {record["state"] for record in records(out).values()} == {"done"}
    assert {name: record["ranks"] for name, record in records(out).items()} == {
        name: 1 + (name in NAMES[::2]) for name in NAMES
    }
    assert second.stdout == (out / "answer.md").read_text(encoding="utf-8")


@pytest.mark.mpi
def test_a_killed_study_goes_on_inside_the_case_it_was_killed_in(killed: Path, resumed: Resumed) -> None:
    (only,) = records(killed).values()
    assert (only["state"], len(only["steps"])) == ("running", 2)
    assert read_folder(killed).state == "stopped"
    assert "killed, or its machine failed" in page_of(read_folder(killed))
    shown = study(killed, "--tables")
    assert f"- {NAMES[0]}: stopped after 2 load step(s)" in shown.stdout
    assert f"0 of {len(NAMES)} cases" in shown.stdout
    first, second, out = resumed
    assert read_folder(out).state == "finished"
    assert first.stderr.count("step 1 ") == len(NAMES[::2]) - 1
    assert second.stderr.count("step 1 ") == len(NAMES[1::2])
    assert all(len(record["steps"]) == 3 for record in records(out).values())
    assert not any(path.is_dir() for path in (out / "cases").iterdir())


@pytest.mark.mpi
def test_the_stand_in_is_strengthened_by_what_it_was_made_with(resumed: Resumed) -> None:
    _, done, out = resumed
    with open(out / "factors.csv", encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    for row in found:  # the stand-in's T is the linear one times 1 + D / R
        for factor in ("S_Q", "S_D"):
            assert float(row[factor]) == pytest.approx(1.0 + float(row["D"]), rel=LINEAR)
    deepest = next(r for r in found if r["case"] == "headline-thin-L2-nu0.48" and float(r["D"]) == 0.03)
    load = [float(deepest["Q"])] * 2
    sphere, paraboloid = (
        solve(dataclasses.replace(pair(0.03, shape=shape), finite_strain=None).with_load("force", load))
        .balls[0]
        .tangential_force[0]
        for shape in ("sphere", "paraboloid")
    )
    assert float(deepest["geometry"]) == pytest.approx(sphere / paraboloid, rel=LINEAR)
    assert float(deepest["T"]) < 0.0  # they separate, whichever way x points
    assert (out / "strengthening.svg").stat().st_size > 5_000
    assert "within its error bar of 1** in 2 case(s)" in done.stdout
    laws = [line for line in done.stdout.splitlines() if line.startswith(("| 1.16 | neo_hookean ", "| 1.16 | gent "))]
    assert len(laws) == 2
    assert all(line.count("| 1.03 ± ") == 2 for line in laws), laws


@pytest.mark.mpi
def test_a_case_that_fails_is_recorded_with_its_reason_and_its_load_path(tmp_path: Path) -> None:
    done = study(tmp_path / "out", "--shard", "1/4", n=2, env={"ELEMENTS": "stop"})
    assert done.returncode == 0, done.stderr
    assert f"Not there: {len(NAMES)} of {len(NAMES)} cases" in done.stdout
    assert f"- {NAMES[0]}: not converged after 2 load step(s): step 2: DIVERGED_LINE_SEARCH" in done.stdout
    assert done.stdout.count(": not converged after 2 load step(s)") == len(NAMES[::4])
    with open(tmp_path / "out/factors.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert sum(row["case"] == NAMES[0] for row in rows) == 2


def test_a_case_that_is_interrupted_on_two_ranks_has_the_time_of_both(tmp_path: Path) -> None:
    case, folder = Case("any", pair(0.1), "finite_strain", 0.1), StudyFolder(tmp_path, "any")
    attempt = runner._Attempt(case, folder, SimpleNamespace(size=2), {"cpu_seconds": 10.0})
    attempt.began = attempt.began[0] - 3.0, attempt.began[1]  # seconds of this rank
    attempt._take(Step.from_dict(path(1.5, 0.1)[0]))
    record = folder.record(case)
    assert record is not None
    assert record["cpu_seconds"] == pytest.approx(16.0, abs=0.5)


def test_all_versions_of_a_library_that_made_the_answers_are_named() -> None:
    made = [{"numpy": "1.24.2", "scipy": "1.10.1"}, {"numpy": "2.4.0", "scipy": "1.10.1"}]
    records = {str(n): {"solved": {"versions": versions}} for n, versions in enumerate(made)}
    assert Found((), records).versions() == {"numpy": "1.24.2 and 2.4.0", "scipy": "1.10.1"}


def test_the_mark_of_a_study_says_how_its_last_run_ended(tmp_path: Path) -> None:
    out, seen = tmp_path / "out", list[str]()

    def compute(folder: Path, options: Options) -> None:
        seen.append(read_folder(folder).state)
        if options.fresh:
            raise OSError("disk")
        with pytest.raises(OSError, match="disk"):
            studies.run(one, Options(out=folder, fresh=True))
        seen.append(read_folder(folder).state)
        raise KeyboardInterrupt

    one = studies.Study("one", compute, lambda folder, quick: "text")
    with pytest.raises(KeyboardInterrupt):
        studies.run(one, Options(out=out))
    # a run that failed shared the folder with one that went on
    assert (seen, read_folder(out).state) == (["running"] * 3, "interrupted")
    with pytest.raises(OSError, match="disk"):
        studies.run(one, Options(out=out, fresh=True))
    studies.run(one, Options(out=out, tables=True))
    assert read_folder(out).state == "failed"


def test_a_folder_of_another_study_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    done = study(tmp_path)
    assert done.returncode == 2
    assert "holds files of no study (notes.txt)" in done.stderr


@pytest.mark.parametrize("text", ["", "3", "0/2", "3/2", "1/0", "a/b", "1/2/3", "-1/2"])
def test_a_shard_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InvalidProblem, match="must be i/n"):
        read_shard(text)


def test_parts_of_a_study_without_cases_and_a_published_quick_one_are_refused() -> None:
    for more, words in (
        (("figures", "--shard", "1/2"), "cannot be split"),
        (("strengthening", "--quick", "--publish"), "full"),
    ):
        done = thirdbody("study", *more)
        assert done.returncode == 2
        assert words in done.stderr


def test_other_numerics_and_another_accuracy_make_another_case() -> None:
    case = cases(quick=True)[0]
    changes = ({"numerics": {"largest_step": 0.5}}, {"accuracy": 0.1})
    keys = {dataclasses.replace(case, **change).key() for change in changes}  # type: ignore[arg-type]
    assert len(keys - {case.key()}) == 2


def test_a_case_that_is_solved_although_its_file_is_there_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = Case("any", as_seen_by("point_load", pair(0.1)), "point_load", 0.1)

    def said() -> str:
        runner.run_cases("any", [case], tmp_path, Options())
        return capsys.readouterr().err

    assert OUTDATED not in said() + said()
    file = StudyFolder(tmp_path, "any").file(case)
    file.write_text(file.read_text(encoding="utf-8").replace(case.key(), "another"), encoding="utf-8")
    assert f"any{OUTDATED}\n" in said()


def test_an_answer_is_published_between_its_marks(tmp_path: Path) -> None:
    page = tmp_path / "README.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    (tmp_path / "out").mkdir()
    (tmp_path / "out/figure.svg").write_text("<svg/>", encoding="utf-8")
    publish("any", "S = 1.2 \\ 3", [tmp_path / "out/figure.svg", tmp_path / "out/absent.svg"], tmp_path)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "S = 1.2 \\ 3" in text
    assert "old" not in text
    assert (tmp_path / "figure.svg").exists()
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(OutputUnusable, match="no place for the answer"):
        publish("any", "text", [], tmp_path)
