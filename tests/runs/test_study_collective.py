"""The study of many balls: its starts, its verdicts, its growth law, and its page."""

from __future__ import annotations

import csv
import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from linear_bem.errors import OutputUnusable
from runs import studies
from runs.evolution.hard_balls import HardBalls
from runs.process.files import write_csv
from runs.session.session import Session
from runs.studies.collective import answer, boundary, cases
from runs.studies.collective.cases import Case
from runs.studies.framework.saved_cases import Found, StudyFolder

FORCE = "largest_force_over_largest_load"
SOLVED = ("converged", "iterations", "seconds")
CASES = [Case(2.0, 0.3, 101, 1), Case(0.8, 0.3, 101, 1)]


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "cases", lambda quick: [*CASES, Case(6.0, 0.3, 101, 1)])
        patch.setattr(cases, "MODEL", "point_load")
        patch.setattr(cases, "GATHERING", 0.03)
        patch.setattr(cases, "PARTING", 0.4)
        cases.pair_law.cache_clear()
        folder.joinpath("out", "cases").mkdir(parents=True)
        for case in CASES:
            cases.evolve(case, folder / "out" / "cases")
        studies.run_study("collective", studies.Options(quick=True, out=folder / "out", tables=True))
        assert cases.pair_law.cache_info().misses == len(CASES)
        cases.pair_law.cache_clear()  # of another model
    return folder / "out"


def test_starts_are_random_without_overlap_and_the_same_again() -> None:
    case = Case(1.0, 0.5, 120, 7)
    x = cases.random_start(case.count, case.length, case.seed)
    balls = HardBalls(np.ones(case.count), np.array([case.length] * 2))
    assert len(balls.near(x, -1e-9)) == 0
    assert case.count * np.pi / case.length**2 == pytest.approx(0.5)
    cases.random_start.cache_clear()
    assert np.array_equal(x, cases.random_start(case.count, case.length, case.seed))
    assert not np.allclose(x, cases.random_start(case.count, case.length, 8))


def test_the_page_holds_what_ran_and_names_what_did_not(out: Path) -> None:
    text = (out / "answer.md").read_text(encoding="utf-8")
    assert "Missing or interrupted: 1 of 3 runs:** h6-phi0.3-n101-seed1" in text
    assert "T changes sign" in text
    with open(out / "collective.csv", encoding="utf-8", newline="") as file:
        rows = {float(row["h/R"]): row for row in csv.DictReader(file)}
    assert set(rows) == {2.0, 0.8}
    assert float(rows[2.0]["coordination"]) > 0.0 == float(rows[0.8]["coordination"])
    assert float(rows[0.8]["nearest_distance"]) > float(rows[2.0]["nearest_distance"])
    for name in ("map.svg", "ends.png", "growth.svg"):
        assert (out / name).stat().st_size > 5_000, name


def finished(rows: list[dict[str, float]], **row: float) -> answer.Finished:
    return answer.Finished(CASES[0], {"cluster_mean": 1.0, "hexatic_start": 0.4, "hexatic_end": 0.4, **row}, rows)


def test_verdicts_turn_with_clusters_and_order() -> None:
    assert finished([]).outcome == "stays"
    assert finished([], cluster_mean=4.0).outcome == "gathers"
    assert finished([], cluster_mean=3.9).outcome == "small groups"
    assert finished([], hexatic_end=0.56).outcome == "orders"


def test_a_power_law_is_found_with_its_error() -> None:
    path = np.geomspace(0.1, 100.0, 30)
    noise = np.exp(0.05 * np.random.default_rng(0).normal(size=len(path)))
    size = np.maximum(6.0 * path**0.4, 1.0) * noise
    law = answer.growth(finished([{"cycle": p, "cluster_mean": s} for p, s in zip(path, size, strict=True)]))
    assert law is not None
    assert law.exponent == pytest.approx(0.4, abs=4.0 * law.error)
    assert 0.0 < law.error < 0.05
    assert answer.growth(finished([{"cycle": p, "cluster_mean": 1.0} for p in path])) is None
    joined = [{"cycle": p, "cluster_mean": s} for p, s in zip(path, np.geomspace(2.0, 60.0, 30), strict=True)]
    assert answer.growth(finished(joined)) is None


def test_a_run_with_resistance_has_a_scene_of_its_own() -> None:
    law = cases.PairLaw(np.array([2e-3]), 4e-3, ())
    free, held = Case(6.0, 0.3, 10, 1), Case(6.0, 0.3, 10, 1, 0.2)
    assert held.name == f"{free.name}-rolling0.2"
    assert "[rolling_resistance]\nshare = 0.0008" in cases.scene_text(held, law)
    assert "rolling" not in cases.scene_text(free, law)


def test_a_run_under_other_settings_is_neither_shown_nor_continued_and_fresh_replaces_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    case, law, used = Case(6.0, 0.3, 20, 1), cases.PairLaw(np.array([1.0]), 0.01, ()), []

    class Evolving:
        def __init__(self, session: Session, tables: Path) -> None:
            self.folder = session.folder
            used.append(session.scene.reciprocation.rest)

        def complete(self, *, pictures: bool) -> None:
            row = dict.fromkeys(("cycle", "cluster_mean", "coordination", "nearest_distance_mean", FORCE), 1.0)
            write_csv(self.folder.path / "structure.csv", [row | {"hexatic_local": 0.0}])
            self.folder.save({"solved": dict.fromkeys(SOLVED, 0.0)}, [])  # as of a path that was stopped

    monkeypatch.setattr(cases, "pair_law", lambda *_, finite: law)
    monkeypatch.setattr(cases, "Evolution", Evolving)
    cases.evolve(case, tmp_path)
    law = dataclasses.replace(law, largest=law.largest * (1.0 + 1e-12))
    cases.evolve(case, tmp_path)
    stopped = cases.read(case, tmp_path)
    assert stopped is not None
    assert stopped.row["ended"] == "interrupted"
    with monkeypatch.context() as patch:
        patch.setattr(cases, "FORMAT", cases.FORMAT + 1)
        assert cases.read(case, tmp_path) is None
    monkeypatch.setattr(cases, "REST", 0.05)
    assert cases.read(case, tmp_path) is None
    with pytest.raises(OutputUnusable, match="holds another run"):
        cases.evolve(case, tmp_path)
    cases.evolve(case, tmp_path, fresh=True)
    assert used == pytest.approx([5e-5, 5e-5, 5e-4])
    assert cases.read(case, tmp_path) is not None


def test_layers_gather_where_separation_weakens_towards_contact() -> None:
    far = np.exp(-cases.DISTANCES)
    in_touch, apart = cases.PairLaw(-far, far[0], ()), cases.PairLaw(-far * (cases.DISTANCES - 1.5), far[0], ())
    assert not in_touch.softens
    assert apart.softens
    assert apart.farthest_apart == pytest.approx(2.5)
    path = [{"cycle": 1.0, "cluster_mean": 1.0}]
    done = answer.Finished(Case(1.5, 0.5, 200, 1), {**finished([]).row, "force_over_load": 1e-3, "ended": "at rest",
                           "coordination": 0.0, "steps": 1, "seconds": 1.0}, path)  # fmt: skip
    text = answer.text([done], {1.16: in_touch, 1.5: apart}, [], quick=True)
    assert "than balls farther apart (here h >= 1.5 R)" in text
    assert "where touching balls separate most strongly (h <= 1.16 R)" in text
    assert "On h = 1.5 R they separate, with 0.82 of T/Q at a distance of 2.5 R" in text
    for nowhere in ("nan", "contacts per ball: pairs", "touching balls attract from", "resistance to rolling exceeds"):
        assert nowhere not in text


@pytest.mark.parametrize(("thickness", "fraction", "grows"), [(1.16, 0.5, False), (1.5, 0.3, False), (2.0, 0.5, True)])
def test_a_uniform_lattice_is_unstable_where_layers_gather(
    thickness: float, fraction: float, grows: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cases, "MODEL", "point_load")
    law = cases.pair_law(thickness, cases.APPROACH, finite=False)
    wave = law.wave(fraction)
    assert wave is not None
    assert (wave.rate > 0.05) == grows
    assert (wave.rate < 0.0) != grows
    row = {"force_over_load": 1e-3, "ended": "at rest", "coordination": 0.0, "steps": 1, "seconds": 1.0}
    path = [{"cycle": 1.0, "cluster_mean": 1.0}]
    done = answer.Finished(Case(thickness, fraction, 200, 1), {**finished([]).row, **row}, path)
    text = answer.text([done], {thickness: law}, [], quick=True)
    assert "**Waves in a uniform layer.**" in text
    assert re.search(r"defined above\), is (\S+) to \1 on layers that stay as they are \(if it is negative", text)


def test_rest_is_said_of_runs_with_resistance_alone() -> None:
    row = {"path": 53.6, "steps": 472, "seconds": 43.0, "cluster_mean": 14.0, "ended": "at rest"}
    row |= {"force_over_load": 4e-3, "coordination": 3.0}
    path = [{"cycle": 1.0, "cluster_mean": 14.0}]
    held = answer.Finished(Case(6.0, 0.3, 200, 1, 0.2), row, path)
    free = answer.Finished(Case(6.0, 0.3, 200, 1), {**row, "ended": "path spent"}, path)
    assert "**Rest.**" not in answer.text([free], {}, [], quick=True)
    text = answer.text([free, held], {}, [], quick=True)
    assert "None of 1 layers that gather without resistance came to rest" in text
    resting = answer.Finished(Case(6.0, 0.3, 200, 2), row, path)
    assert "1 of 2 layers that gather without resistance came to rest" in answer.text(
        [free, resting, held], {}, [], True
    )
    assert "200 balls on h = 6 R after a path of 53.6 with a mean cluster of 14" in text
    assert "h = 6 R at 0.3. Runs with small groups: none. Runs that order: none. At the end of their path" in text
    assert "have mean clusters of 14 to 14 balls (where contacts run" in text
    assert "nan" not in text


def test_the_force_of_touching_balls_vanishes_where_a_parabola_says() -> None:
    def row(h: float) -> dict[str, float]:
        ratios = {name: 1e-3 * ((h - at) - 0.2 * (h - at) ** 2) for name, at in (("small", 1.65), ("finite", 1.7))}
        return {"h/R": h} | {
            key: value
            for name, ratio in ratios.items()
            for key, value in ((f"{name} strain", ratio), (f"error, {name} strain", 1e-5))
        }

    rows = [row(h) for h in boundary.THICKNESSES]
    assert boundary.vanishing(rows[:2]) == []
    small, finite = boundary.vanishing(rows)
    # the parabola in T/Q is off by 2e-4; its bar holds the error of T, 0.01 R, and more
    found = [[float(number) for number in re.findall(r"\d\.\d+", words)] for words in (small, finite)]
    assert [place for place, _ in found] == pytest.approx([1.65, 1.7], abs=2e-3)
    assert 0.01 <= found[1][1] < 0.02


def test_touching_balls_are_a_row_where_both_models_have_solved_them_and_named_where_not(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cases, "cases", lambda quick: [])
    pair = [{"position": [x, 0.0], "tangential_force": [-2e-3 * x, 0.0]} for x in (-1.0, 1.0)]
    balls = [ball | {"normal_force": 0.5, "tangential_force_error": 1e-4} for ball in pair]
    for case in boundary.cases()[:3]:
        StudyFolder(tmp_path, "collective").save(case, {"state": "done", "steps": [{"balls": balls}]})
    (row,) = boundary.read(Found.of(StudyFolder(tmp_path, "collective"), boundary.cases()))
    assert row["h/R"] == boundary.THICKNESSES[0]
    assert [row[f"{word}{name} strain"] for name in ("small", "finite") for word in ("", "error, ")] == pytest.approx(
        [4e-3, 2e-4] * 2
    )
    assert answer.page(tmp_path, quick=False).count("not run yet") == 3


def test_runs_by_both_models_differ_in_the_model_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    law = cases.PairLaw(np.array([2e-3]), 2e-3, (2.3,))
    small, finite = (Case(1.8, 0.3, 20, 1, 0.0, cases.DEEP, by) for by in (False, True))
    assert cases.scene_text(finite, law).replace("[finite_strain]", "") == cases.scene_text(small, law)
    assert f"approach = {cases.DEEP}" in cases.scene_text(small, law)
    monkeypatch.setattr(cases, "pair_law", lambda *_, finite: dataclasses.replace(law, largest=1.0 + finite))
    row = {"cluster_mean": 2.4, "coordination": 1.0, "ended": "path spent"}
    deep = [answer.Finished(case, row, []) for case in (finite, small, dataclasses.replace(small, seed=2))]
    rows = answer._both(deep)
    assert [r["model"] for r in rows] == ["small strain", "finite strain"]
    assert [r["mean cluster, 0.3"] for r in rows] == ["2.4, 2.4", "2.4"]
    assert {r["T changes sign at (over R)"] for r in rows} == {"2.3"}
