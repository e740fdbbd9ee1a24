"""The study of the experiments: what a run must show for each report, with cases enough to tell."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from runs import studies
from runs.evolution import evolving, pair_table
from runs.studies.experiments import cases, points, report

NAMES = {"line of four, 25 mm", "line of four, 30 mm", "pair, 16 mm balls", "pair, 10 mm balls", "pair, 7 mm balls"}


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "CASES", tuple(case for case in cases.CASES if case.name in NAMES))
        patch.setattr(cases, "QUICK_ENSEMBLE", 2)
        patch.setattr(cases, "TABLES", folder / "tables")
        patch.setattr(evolving, "TABLES", folder / "tables")
        patch.setattr(pair_table, "MANY", pair_table.FEW)
        studies.run_study("experiments", studies.Options(quick=True, out=folder / "out"))
    return folder / "out"


@pytest.fixture(scope="module")
def documents(out: Path) -> dict[str, Any]:
    found = {}
    for case in cases.CASES:
        stem = case.name.replace(", ", "-").replace(" ", "_")
        file = out / f"{stem}-linear_bem" / "result.json"
        if case.name in NAMES:
            found[case.name] = json.loads(file.read_text(encoding="utf-8"))
    return found


def point(title: str) -> points.Point:
    return next(p for p in points.POINTS if p.title.startswith(title))


@pytest.mark.parametrize(
    ("title", "verdict"),
    [
        ("edge balls carry", None),
        ("a wider line", points.YES),
        ("four balls", points.YES),
        ("16 mm balls separate", points.YES),
        ("they stay there", points.NO),
        ("10 mm and 7 mm", points.YES),
        ("nine balls", None),
    ],
)
def test_the_reports_that_these_runs_bear_on(title: str, verdict: str | None, documents: dict[str, Any]) -> None:
    found = report.findings(point(title), documents)
    assert (found.verdict if found else None) == verdict


def test_a_verdict_turns_with_what_the_runs_show(documents: dict[str, Any]) -> None:
    swapped = {
        **documents,
        "line of four, 25 mm": documents["line of four, 30 mm"],
        "line of four, 30 mm": documents["line of four, 25 mm"],
        "pair, 16 mm balls": documents["pair, 10 mm balls"],
        "pair, 10 mm balls": documents["pair, 16 mm balls"],
    }
    for title in ("a wider line", "16 mm balls separate", "10 mm and 7 mm"):
        found = report.findings(point(title), swapped)
        assert found is not None
        assert found.verdict == points.NO, title


def test_the_answer_names_verdicts_errors_and_missing_tables(out: Path) -> None:
    text = (out / "answer.md").read_text(encoding="utf-8")
    assert "reproduces" in text.splitlines()[0]
    assert text.count("| no table yet |") == len(points.POINTS)
    assert "mpirun -n 2 thirdbody evolve runs/scenes/experiment_pair_16mm_finite_strain.toml" in text
    assert "bare sum of pairs" in text
    assert (out / "experiments.svg").stat().st_size > 10_000
    with open(out / "experiments.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["case"] for row in rows} == NAMES
    assert {row["first_pairs"].split()[0] for row in rows if row["case"].startswith("line")} <= {"0-1", "2-3"}
