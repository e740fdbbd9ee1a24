"""What stands between load steps: within its stated error of the truth, and not far wider than it must be."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from runs.comparison.interpolant import COLUMNS, Interpolant, interpolants, table, where_off
from runs.display.numbers import Scale
from runs.studies.strengthening.matrix import APPROACHES

CURVES: dict[str, Callable[[float], float]] = {
    "in proportion to D": lambda d: 1.0 + 0.32 * d + 1.1 * d**2 + 3.0 * d**4,
    "like its root": lambda d: 1.0 - 0.12 * math.sqrt(d) + 0.05 * d,
    "with a pole ahead": lambda d: 1.0 + 0.3 * d / (0.8 - d),
}


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("approaches", [np.arange(1, 7) * 0.32 / 6, np.array(APPROACHES)])
def test_exact_steps_give_a_curve_within_its_error(name: str, approaches: np.ndarray) -> None:
    curve = CURVES[name]
    between = Interpolant(approaches, np.array([curve(d) for d in approaches]), np.zeros(len(approaches)))
    for d in np.linspace(approaches[0], approaches[-1], 101):
        value, error = between(d)
        assert abs(value - curve(d)) <= error + 1e-12
        assert error < 0.02 * d  # that many steps draw such curves well


def test_at_a_step_value_and_error_are_the_steps_own() -> None:
    between = Interpolant(np.array([0.1, 0.2, 0.3]), np.array([1.1, 1.3, 1.4]), np.array([0.01, 0.02, 0.03]))
    assert between(0.2) == pytest.approx((1.3, 0.02))
    assert between(0.1) == pytest.approx((1.1, 0.01))


def test_outside_the_steps_there_is_no_value() -> None:
    between = Interpolant(np.array([0.1, 0.2]), np.array([1.1, 1.3]), np.zeros(2))
    with pytest.raises(ValueError, match=r"approach: must lie between 0.1 and 0.2, got 0.25"):
        between(0.25)


def test_a_comparison_without_a_ratio_has_no_curve() -> None:
    rows = [{"ball": 0, "approach": 0.1 * n, "normal_force": 0.1 * n, "strengthening_at_force": None} for n in (1, 2)]
    assert interpolants(rows, 0) == {}
    assert table(rows, 0) == []


def test_a_table_runs_from_the_first_step_to_the_last() -> None:
    rows = [
        {"ball": 0, "approach": d, "normal_force": d**1.5, **{name: 1.0 + d for name in COLUMNS if name[0] == "s"}}
        for d in (0.1, 0.2, 0.3, 0.4)
    ]
    found = table(rows, 0)
    assert {row["ball"] for row in found} == {0}
    assert [found[0]["approach"], found[-1]["approach"]] == pytest.approx([0.1, 0.4])
    assert found[20]["normal_force"] == pytest.approx(0.25**1.5, abs=1e-12)


@pytest.mark.parametrize(
    ("slope", "error", "said"),
    [
        (0.5, 0.0, "S_Q from D = 0.10000 \u00b1 0.00010 R on"),
        (-0.5, 0.005, "S_Q from D = 0.100 \u00b1 0.010 R on"),
        (0.1, 0.0, "S_Q nowhere up to D = 0.2 R"), (0.2, 0.02, "S_Q perhaps nowhere up to D = 0.2 R"),
        (2.0, 0.001, "S_Q already at the first load step (D = 0.05 R)"),
    ],
)  # fmt: skip
def test_a_comparison_says_from_which_approach_small_strain_is_wrong(slope: float, error: float, said: str) -> None:
    rows = [
        {"ball": 0, "approach": d, "normal_force": d, "strengthening_at_force": 1.0 + slope * d,
         "strengthening_at_force_error": error}
        for d in (0.05, 0.1, 0.15, 0.2)
    ]  # fmt: skip
    assert where_off(rows, 0, Scale(1.0, 1.0)) == f"S differs from 1 by 5 % or more: {said}."
    assert where_off(rows, 1, Scale(1.0, 1.0)) == ""
