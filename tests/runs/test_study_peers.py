"""The study of peers: its table is made of whatever has been solved, and its scene is the one that it says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from runs.scene.scene_file import read_scene
from runs.studies import Options, run_study
from runs.studies.peers import answer
from runs.studies.peers.answer import REFERENCE
from runs.studies.peers.energies import energy
from runs.studies.peers.scene import LAME, SHEAR, lines, weight_slope
from runs.studies.peers.thirdbody_pair import scene_text
from runs.studies.strengthening.materials import LAW_BY_NAME


def test_answers_that_are_there_make_the_table_and_errors_are_those_against_the_reference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    normal, tangential = REFERENCE[0.1]
    found = {"code": "NGSolve", "version": "6", "approach": 0.1, "discretisation": "order 3", "unknowns": 20,
             "seconds": 3.4, "normal_force": 1.02 * normal, "tangential_force": 0.99 * tangential}  # fmt: skip
    (tmp_path / "ngsolve-3x1-0.1.json").write_text(json.dumps(found), encoding="utf-8")
    run_study("peers", Options(out=tmp_path, tables=True))
    assert "| 0.1 | NGSolve 6 | order 3 | 20 | 3 |" in capsys.readouterr().out
    row = (tmp_path / "peers.csv").read_text(encoding="utf-8").splitlines()[1].split(",")
    assert [float(cell) for cell in row[-2:]] == pytest.approx([0.02, 0.01])


def test_a_case_that_fails_or_has_changed_is_named_below_the_table_and_its_old_answer_is_not_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    normal, tangential = REFERENCE[0.1]
    found = {"code": "NGSolve", "version": "6", "approach": 0.1, "discretisation": "order 2", "unknowns": 20,
             "seconds": 3.4, "normal_force": normal, "tangential_force": tangential}  # fmt: skip
    file, arguments = tmp_path / "ngsolve-2x1-0.1.json", ["ngsolve", "0.1", "2x1"]
    file.write_text(json.dumps(found | {"key": answer._key(arguments)}), encoding="utf-8")
    text = answer.page(tmp_path, quick=True)
    assert "| NGSolve 6 |" in text
    assert "9 of 10 cases have no answer:\n\n- thirdbody-0.1-0.1: not run\n" in text
    file.write_text(json.dumps(found | {"key": "an earlier scene"}), encoding="utf-8")
    assert "- ngsolve-2x1-0.1: not run" in answer.page(tmp_path, quick=True)
    file.write_text(json.dumps(found), encoding="utf-8")
    monkeypatch.setattr(answer, "_solve", lambda _, file: f"{file.stem}: failed: Newton's method")
    answer.compute(tmp_path, Options(quick=True, fresh=True))
    text = answer.page(tmp_path, quick=True)
    assert "10 of 10 cases have no answer" in text
    assert "- ngsolve-2x1-0.1: failed: Newton's method" in text
    assert "| NGSolve 6 |" not in text
    monkeypatch.setattr(answer, "_solve", lambda _, file: str(file.write_text(json.dumps(found | {"key": "later"}))))
    answer.compute(tmp_path, Options(quick=True))
    assert answer.OUTDATED not in capsys.readouterr().err
    answer.compute(tmp_path, Options(quick=True))
    assert f"ngsolve-2x1-0.1{answer.OUTDATED}\n" in capsys.readouterr().err
    assert "- ngsolve-2x1-0.1: not run" in answer.page(tmp_path, quick=True)


def test_the_energies_for_felupe_are_the_papers_in_any_frame() -> None:
    pytest.importorskip("dolfinx")
    from tests.finite_strain.test_laws import GIVEN, LAMBDA, MU, textbook  # noqa: PLC0415

    stretches = np.array([1.3, 0.7, 1.1])
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    for name, law in GIVEN.items():
        psi = energy(law, MU, LAMBDA, np)(turn @ np.diag(stretches**2) @ turn.T)
        assert psi == pytest.approx(textbook(name, stretches), rel=1e-12), name
    assert {type(law) for law, _ in LAW_BY_NAME.values()} == {type(law) for law in GIVEN.values()}


def test_every_law_that_both_codes_solved_is_a_row_with_its_deviation_over_both_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {"thirdbody-0.005": (0.61, 5.0e-3, 0.3e-3), "felupe-3x1": (0.62, 5.8e-3), "felupe-4x1": (0.62, 5.4e-3)}
    for case, (normal, tangential, *error) in said.items():
        found = {"code": case, "normal_force": normal, "tangential_force": tangential}
        found |= {"tangential_force_error": error[0], "normal_force_error": 1e-3} if error else {}
        (tmp_path / f"{case}-0.32-gent-0.48.json").write_text(json.dumps(found), encoding="utf-8")
    run_study("peers", Options(out=tmp_path, tables=True))
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| gent-0.48 |")]
    # 0.4e-3 apart, errors of 0.3e-3 and 0.4e-3
    assert row.split("|")[-4:-1] == [" 0.01613 ", " 0.07407 ", " 0.8 "]


@pytest.mark.slow
def test_ngsolve_of_order_three_reaches_the_deeper_approach(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("ngsolve")
    from runs.studies.peers import ngsolve_pair  # noqa: PLC0415

    ngsolve_pair.main(0.32, "3x1")
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (found["normal_force"], found["tangential_force"]) == pytest.approx(REFERENCE[0.32], rel=5e-3)


def test_the_scene_of_this_project_names_each_law_with_its_numbers(tmp_path: Path) -> None:
    for name, (law, poisson) in LAW_BY_NAME.items():
        (tmp_path / "pair.toml").write_text(scene_text(0.32, "0.02", name), encoding="utf-8")
        problem = read_scene(tmp_path / "pair.toml").problem
        assert problem.finite_strain is not None
        assert (problem.finite_strain.chosen, problem.layer.poisson) == (law, poisson)


def test_the_grid_is_symmetric_about_the_axis_and_so_is_the_weight() -> None:
    x, y, z = lines(0.1, 2)
    inner = x[x <= 2.0]
    assert inner == pytest.approx(2.0 - inner[::-1])
    assert (x[0], y[0], z[-1]) == pytest.approx((0.0, 0.0, 0.0))
    at = np.linspace(0.01, 0.99, 50)
    assert weight_slope(1.0 + at, 0.1) == pytest.approx(-weight_slope(1.0 - at, 0.1))
    # from 0 in the plane of symmetry to 1 under the ball
    middles = np.linspace(0.0, 1.0, 100_001)[:-1] + 0.5e-5
    assert float(np.mean(weight_slope(middles, 0.1))) == pytest.approx(1.0, abs=1e-4)


def test_the_lame_constants_are_those_of_the_stated_solid() -> None:
    from linear_bem import Layer  # noqa: PLC0415

    solid = Layer(1.0, 0.48, 1.16)
    assert pytest.approx((solid.shear_modulus, solid.lame_first)) == (SHEAR, LAME)
