"""The study of peers: its table is made of whatever has been solved, and its scene is the one that it says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from runs.studies import Options, run_study
from runs.studies.peers.answer import REFERENCE
from runs.studies.peers.scene import LAME, SHEAR, lines, weight_slope


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
