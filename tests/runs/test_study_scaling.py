"""The study of the finite elements' cost: its page from the tables that are there."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from runs import studies
from runs.process.files import write_csv
from runs.studies.scaling import answer, whole_runs


def row(unknowns: int, iterations: int, seconds: float) -> dict[str, object]:
    return {
        "form": "displacement", "solver": "multigrid", "target": unknowns, "unknowns": unknowns, "ranks": 2,
        "assembly_seconds": 1.0, "first_seconds": seconds, "solve_seconds": seconds, "krylov_iterations": iterations,
        "fallbacks": 0, "kilobytes_per_unknown": 8.0, "load": 1.0,
    }  # fmt: skip


def test_the_page_fits_powers_and_has_whole_runs_where_they_are(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    write_csv(out / "ranks_2.csv", [row(10_000, 90, 50.0), row(50_000, 10, 5.0), row(5_000_000, 20, 500.0)])
    options = studies.Options(quick=False, out=out, tables=True)
    studies.run_study("scaling", options)
    text = (out / "answer.md").read_text(encoding="utf-8")
    # doubled over a factor of 100: n^0.15, and 22 iterations at ten million; ten thousand are not fitted
    assert "iterations grow as n^0.15, the time of a first solve as n^1.00" in text
    assert "1e+07 unknowns: 22 iterations" in text
    assert "Whole runs" not in text
    names = [
        *whole_runs.KEPT,
        "target",
        "ranks",
        "processor_seconds",
        "gigabytes",
        "normal_force",
        "tangential_force",
        "error",
    ]
    write_csv(out / "whole_600000.csv", [dict.fromkeys(names, 7.0)])
    studies.run_study("scaling", options)
    assert "Whole runs, two load steps" in (out / "answer.md").read_text(encoding="utf-8")


def test_whole_runs_are_made_once_for_each_number_of_ranks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made = []

    def run(target: int, comm: SimpleNamespace) -> list[dict[str, float]]:
        made.append((target, comm.size))
        return [{"target": target, "ranks": comm.size, "fraction": 1.0, "seconds": 9.0 / comm.size}]

    monkeypatch.setattr(answer, "FORMS", ())
    monkeypatch.setattr(answer, "fits", lambda *_: True)
    monkeypatch.setattr(whole_runs, "run", run)
    of_an_earlier_version = {"target": 500_000, "ranks": 2, "fraction": 1.0, "seconds": 8.0}
    write_csv(tmp_path / "whole_500000.csv", [of_an_earlier_version])
    for size, fresh in ((2, False), (4, False), (2, False), (2, True)):
        monkeypatch.setattr(answer.ranks, "world", lambda size=size: SimpleNamespace(size=size, rank=0))
        answer.compute(tmp_path, studies.Options(fresh=fresh))
    assert made == [(1_050_000, 2), (500_000, 4), (1_050_000, 4), (500_000, 2), (1_050_000, 2)]
    assert sorted((row["target"], row["ranks"], row["seconds"]) for row in answer.read_whole(tmp_path)) == [
        (500_000, 2, 4.5), (500_000, 4, 2.25), (1_050_000, 2, 4.5), (1_050_000, 4, 2.25)
    ]  # fmt: skip


def test_what_does_not_fit_the_memory_is_left_out_with_its_size(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("linear_bem.memory.free_memory", lambda: 1e9)
    alone = SimpleNamespace(rank=0, barrier=lambda: None)
    assert answer.fits(whole_runs.BYTES * 1_000, "a run of 1 000 unknowns", alone)
    assert capsys.readouterr().err == ""
    assert not answer.fits(answer.BYTES["mixed"] * 600_000, "a system of 600 000 unknowns (mixed form)", alone)
    assert "left out: a system of 600 000 unknowns (mixed form)" in capsys.readouterr().err
