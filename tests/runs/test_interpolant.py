"""What stands between load steps: within its stated error of the truth, and not far wider than it must be."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from runs.comparison.interpolant import COLUMNS, Interpolant, interpolants, leaves_one, table
from runs.display.numbers import Scale
from runs.scene.units import Units
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


def test_under_forces_the_error_of_the_approach_counts_as_one_of_the_force_at_an_approach() -> None:
    rows = [
        {"ball": 0, "approach": d, "approach_error": 0.01 * d, "normal_force": d**1.5, "normal_force_error": 0.0}
        for d in np.linspace(0.1, 0.5, 6)
    ]
    curve = interpolants(rows, 0)["normal_force"]
    for d in np.linspace(0.1, 0.5, 41):
        value, error = curve(d)
        assert 0.014 * value < error < 0.018 * value


STEPS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)


@pytest.mark.parametrize(
    ("ratios", "error", "said"),
    [
        ([1 + 0.5 * d for d in STEPS], 0.0, "at D = 0.10000 \u00b1 0.00010 R"),
        ([1 - 0.5 * d for d in STEPS], 0.005, "at D = 0.100 \u00b1 0.010 R"),
        ([1.0, 1.04, 1.08, 1.08, 1.03, 1.0], 0.0, "at D = 0.1105 \u00b1 0.0014 R (it returns at D = 0.2321 R)"),
        ([1 + 0.1 * d for d in STEPS], 0.0, "nowhere up to D = 0.3 R"),
        ([1 + 0.1 * d for d in STEPS], 0.03, "perhaps up to D = 0.3 R"),
        ([1 + 0.1 * d for d in STEPS], math.nan, "perhaps up to D = 0.3 R"),
        ([1 + 2.0 * d for d in STEPS], 0.001, "before the first load step, D = 0.05 R"),
        ([1.06] * 6, 0.05, "perhaps before the first load step, D = 0.05 R"),
        ([1 + 0.18 * d for d in STEPS], 0.01, "perhaps at D = 0.2778 R"),
        ([1.048 + 0.1 * (d - 0.05) for d in STEPS], 0.01, "perhaps at D = 0.06854 R"),
    ],
)
def test_a_comparison_says_at_which_approach_small_strain_becomes_wrong(
    ratios: list[float], error: float, said: str
) -> None:
    rows = [
        {"ball": 0, "approach": d, "normal_force": d, "strengthening_at_force": s,
         "strengthening_at_force_error": error}
        for d, s in zip(STEPS, ratios, strict=True)
    ]  # fmt: skip
    found = leaves_one(rows, 0, Scale(1.0, 1.0), " on ball 0")
    assert found == f"S on ball 0 leaves 1 \u00b1 0.05: S_Q {said}."
    assert leaves_one(rows, 1, Scale(1.0, 1.0)) == ""
    in_mm = Scale(0.01, 1e6, Units.written({"layer": {"thickness": "2 mm"}}))
    assert "mm" in leaves_one(rows, 0, in_mm)
