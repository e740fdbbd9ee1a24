"""The studies: the numbers behind the paper's figures, finished parts that are kept, names that are none."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from runs import studies
from runs.studies.collective import answer as collective
from runs.studies.experiments import answer as experiments
from runs.studies.figures import answer as figures
from runs.studies.figures import map_lengths, modulus
from runs.studies.figures import part as parts
from runs.studies.framework.page import render
from runs.studies.peers import answer as peers
from tests.launch import thirdbody

REFERENCE = 1e-5
"""Relative error of the independent reference values, and of the T that the study asks for."""
THEORY = 0.02
"""Of the point-load law's T/T0 near touching balls at the paper's load, over the half-space's T0."""
PARTS = (
    "figure_8_bulge", "figure_9_pressure", "figure_10_thickness", "figure_11_modulus", "figure_12_distance",
    "map_lengths", "map_materials",
)  # fmt: skip


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study") / "figures"
    done = thirdbody("study", "figures", "--quick", "--out", folder)
    assert done.returncode == 0, done.stderr
    assert "# Figures 8 to 12" in done.stdout
    assert done.stdout == (folder / "figures.md").read_text(encoding="utf-8")
    return folder


def numbers(out: Path, part: str) -> Any:
    return json.loads((out / f"{part}.json").read_text(encoding="utf-8"))["numbers"]


def table(path: Path) -> dict[str, np.ndarray]:
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key] or "nan") for row in rows]) for key in rows[0]}


@pytest.mark.slow
def test_every_figure_is_drawn_twice_with_its_numbers_behind_it(out: Path) -> None:
    for part in PARTS:
        assert (out / f"{part}.png").stat().st_size > 20_000
        assert "<svg" in (out / f"{part}.svg").read_text(encoding="utf-8")[:1000]
        assert list(out.glob(f"{part}_*.csv")), part


def test_the_bulge_has_its_reference_depth_and_leaves_the_axis_in_thin_layers(out: Path) -> None:
    found = numbers(out, "figure_8_bulge")
    assert found["w_at_reference"] == pytest.approx(-5.801183e-2, rel=1e-6)
    assert found["x_at_reference"] == pytest.approx(1.675357, rel=1e-6)
    side = table(out / "figure_8_bulge_anywhere.csv")
    leaves = found["h_over_a_off_axis_below"]
    assert np.all(side["y_over_a"][side["h_over_a"] < 0.9 * leaves] > 0.1)
    assert np.all(side["y_over_a"][side["h_over_a"] > 1.05 * leaves] < 0.01)
    depth = table(out / "figure_8_bulge_axis.csv")["w_E1_over_a_q"]
    assert np.min(depth) >= found["deepest_w"]


def test_the_pressures_differ_by_an_odd_function_that_presses_the_inner_sides(out: Path) -> None:
    found = table(out / "figure_9_pressure_pressure.csv")
    # roundoff: next to the edge the pressure is the square root of a difference
    assert found["difference"] == pytest.approx(-found["difference"][::-1], abs=1e-7 * np.max(found["p_left"]))
    assert np.all(found["difference"][found["xi"] > 0.0] >= 0.0)
    assert numbers(out, "figure_9_pressure")["mutual"] == pytest.approx(-1.161292e-7, rel=REFERENCE)


def test_force_over_thickness_meets_the_references(out: Path) -> None:
    found = numbers(out, "figure_10_thickness")
    assert found["at_thin"] == pytest.approx(-1.161292e-7, rel=REFERENCE)
    assert found["at_thick"] == pytest.approx(4.098673e-7, rel=REFERENCE)
    assert found["limit_thick"] == pytest.approx(4.362335e-7, rel=REFERENCE)
    assert found["sign_changes"] == pytest.approx([0.171697, 1.697711], rel=REFERENCE)


def test_the_overshoot_belongs_to_a_fixed_approach_and_not_to_a_fixed_force(out: Path) -> None:
    found = numbers(out, "figure_10_thickness")
    force = table(out / "figure_10_thickness_force.csv")["T"]
    limit = found["limit_thick"]
    assert np.max(force) < limit
    assert np.all(np.diff(force[int(np.argmin(force)) :]) > 0.0)
    assert found["overshoot_at_approach"] == pytest.approx(0.0355, abs=2e-4)
    assert found["h_of_maximum_at_approach"] == pytest.approx(9.2, rel=0.01)
    approach = table(out / "figure_10_thickness_approach.csv")
    assert np.max(approach["T"]) > 1.02 * limit


def test_the_attraction_over_modulus_is_largest_beyond_the_modulus_of_the_substrate(out: Path) -> None:
    found = numbers(out, "figure_11_modulus")
    assert 0.1 < found["sign_change_over_E2"] < 1.0 < found["maximum_over_E2"] < 10.0
    curve = table(out / "figure_11_modulus_modulus.csv")
    assert np.max(curve["T"]) <= found["maximum"] * (1.0 + REFERENCE)
    assert np.all(curve["T"][curve["E1_over_E2"] < found["sign_change_over_E2"]] < 0.0)


def test_force_over_distance_ends_in_the_attraction_of_the_bare_substrate(out: Path) -> None:
    found = numbers(out, "figure_12_distance")
    assert found["thin"]["at_contact"] == pytest.approx(-1.161292e-7, rel=REFERENCE)
    assert found["thick"]["at_contact"] == pytest.approx(4.098673e-7, rel=REFERENCE)
    assert len(found["thick"]["sign_changes"]) == 2
    assert len(found["thin"]["sign_changes"]) == 1
    assert found["far"]["T_L_squared_over_substrate"] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("part", ["map_lengths", "map_materials"])
def test_the_maps_hold_where_the_full_solver_was_asked(part: str, out: Path) -> None:
    found = numbers(out, part)
    assert found["signs_agree"] == found["checked"] >= 5
    check = table(out / f"{part}_check.csv")
    assert check["law"] == pytest.approx(check["full"], abs=THEORY)


def test_the_law_has_touching_balls_change_sign_where_the_solver_does(out: Path) -> None:
    found = numbers(out, "map_lengths")
    for end in ("lower", "upper"):
        assert found[f"{end}_L_over_h"] == pytest.approx(found[f"full_{end}_at_contact"], rel=0.01)
    seen = found["experiments"]
    assert seen["16 mm"] < 0.0 < seen["10 mm"] < seen["7 mm"]
    assert found["as_seen"] == 3
    assert "the sign agrees with the experiment in 3 of 3." in (out / "figures.md").read_text(encoding="utf-8")


def test_the_words_on_agreement_with_the_paper_follow_the_signs_of_the_forces(out: Path) -> None:
    assert map_lengths.as_seen({"16 mm": 0.252, "10 mm": -0.195, "7 mm": -0.592}) == 0
    parts = [(part, numbers(out, part.stem)) for part in figures.PARTS]
    given: dict[str, Any] = {"command": "", "seconds": 1.0, "versions": "", "python": ""}
    text = render(figures.__file__, parts=parts, **given)
    assert text.count("- Agrees") == 8
    assert "Does not agree" not in text
    turned = {**numbers(out, "figure_11_modulus"), "at_60_MPa": 1e-7}
    assert "- Does not agree: a stiffer layer" in render(figures.__file__, parts=[(modulus.PART, turned)], **given)


def test_finished_parts_are_not_computed_again(
    out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = Path(shutil.copytree(out, tmp_path / "figures"))
    kept = PARTS[:2]
    for part in PARTS[2:]:
        (folder / f"{part}.json").unlink()
    before = {part: (folder / f"{part}.json").stat().st_mtime_ns for part in kept}
    (folder / "figure_9_pressure.svg").unlink()  # as a run that was killed leaves it
    with monkeypatch.context() as two:
        two.setattr(figures, "PARTS", figures.PARTS[:2])
        studies.run_study("figures", studies.Options(quick=True, out=folder))
    assert capsys.readouterr().err.count("taken from") == len(kept)
    assert (folder / "figure_9_pressure.svg").exists()
    assert before == {part: (folder / f"{part}.json").stat().st_mtime_ns for part in kept}
    (folder / f"{kept[0]}.json").unlink()
    shown = thirdbody("study", "figures", "--quick", "--tables", "--out", folder)
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.count("\n## ") == 1
    full = thirdbody("study", "figures", "--out", folder)
    assert full.returncode == 2
    assert "quick is True there and False here" in full.stderr


def test_a_finished_part_is_that_of_the_present_scene(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    one = figures.PARTS[0]
    parts.save(tmp_path, one, True, parts.Findings({}, {}), 0.0)
    assert parts.saved(tmp_path, one, quick=True) is not None
    text = parts.scene().text.replace("force = 2.66666e-3", "force = 0.02")
    assert text != parts.scene().text
    monkeypatch.setattr(parts, "scene", lambda: SimpleNamespace(text=text))
    assert parts.saved(tmp_path, one, quick=True) is None


def test_a_name_that_is_no_study_is_refused_with_the_list() -> None:
    done = thirdbody("study", "figure")
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert 'there is no study "figure"; known: figures' in done.stderr
    assert "benchmarks" in done.stderr


def test_codes_against_hertz_and_the_pair_against_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    from runs.studies.benchmarks import pair, sphere  # noqa: PLC0415

    row = sphere.measure("this project", 128)
    # discretisation: the staircase edge of square cells, a first-order share of the contact's 77 cells
    assert row["pressure_error"] < 0.01
    assert row["load_error"] < sphere.TOLERANCE
    monkeypatch.setitem(sphere.CODES, "absent", ("no_such_code", sphere.by_this_project))
    assert "pip install no_such_code" in sphere.measure("absent", 64)["remark"]
    for found in pair.times_to_accuracy(1):
        assert found["error"] <= found["wanted"]
        assert found["estimate"] <= found["wanted"]
    ballast = np.ones(5 * 10**7)  # 0.37 GiB in this process, not in that of the measurement
    (row,) = pair.growth([4])
    assert row["estimate"] < 1e-3
    assert row["GiB_of_it_before"] <= row["GiB"] < 8e-9 * len(ballast)


def test_every_case_is_named_when_it_begins(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said: list[str] = []

    def begins(*given: Any, **options: Any) -> str:
        said.append(capsys.readouterr().err)
        return "an answer"

    monkeypatch.setattr(collective.cases, "evolve", begins)
    monkeypatch.setattr(experiments.cases, "evolve", begins)
    monkeypatch.setattr(peers, "_solve", begins)
    options = studies.Options(quick=True)
    for study, first in (
        (collective, collective.cases.cases(True)[0].name),
        (experiments, f"{experiments.cases.chosen(True)[0].name}, linear_bem"),
        (peers, next(peers.cases(tmp_path, True))[0].stem),
    ):
        said.clear()
        capsys.readouterr()
        study.STUDY.compute(tmp_path, options)
        assert said[0] == f"{first}\n"
        assert re.match(rf"(an answer\n)?{re.escape(first)}: 0\.0 s\n", said[1]), said[1]
