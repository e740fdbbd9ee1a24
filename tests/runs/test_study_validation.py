"""The validation study: our numbers beside those of others, verdicts that keep to both errors, named sources."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import pytest

from runs.models import MODELS, Run
from runs.studies import STUDIES
from runs.studies.framework.case import LINEAR, Case
from runs.studies.framework.saved_cases import Found
from runs.studies.validation import flat_punch, formulas, large_strain, small_strain
from runs.studies.validation.answer import COMPARISONS, cases, present
from runs.studies.validation.comparison import AGREES, CLOSE, DIFFERS, Point
from runs.studies.validation.sources import NOT_OPENED, SOURCES

CHEAP = (
    "hertz-ball", "sphere-D0.05", "sphere-D0.1", "galin-n2", "galin-n4", "hyperboloid-D0.01", "layer-nu0.5-chi0.2",
    "layer-nu0.5-chi0.4", "layer-nu0.3-chi0.2", "punch-r2-nu0.5-D0.0003", "karpitschka-hinf-L2", "karpitschka-h0.5-L2",
    "carbone-h6-Q2.66666e-05", "gao-E0.95-D0.0003", "gao-E1.05-D0.0003", "perriot-ratio2-D0.0003",
)  # fmt: skip
FIT = 1e-3
"""What the polynomials fitted to Lebedev and Ufliand's equation leave open."""


def solved(case: Case) -> dict[str, Any]:
    result = MODELS[LINEAR].solve(case.problem, Run(case.accuracy, steps=case.steps)).to_dict()
    return {"state": "done", "steps": result["steps"] or [{"balls": result["balls"], "record": {}}]}


@pytest.fixture(scope="module")
def found() -> Found:
    chosen = tuple(case for case in cases(quick=True) if case.name in CHEAP)
    assert len(chosen) == len(CHEAP)
    return Found(chosen, {case.name: solved(case) for case in chosen})


def test_the_linear_model_meets_closed_forms_and_the_good_fits(found: Found, tmp_path: Path) -> None:
    text = present(found, tmp_path)
    with open(tmp_path / "validation.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    verdicts: dict[str, set[str]] = {}
    for row in rows:
        verdicts.setdefault(row["source"], set()).add(row["verdict"])
    for exact in ("hertz", "sneddon", "galin", "hyperboloid", "carbone", "gao", "karpitschka"):
        assert verdicts[exact] == {AGREES}, exact
    for fit in ("kontomaris", "lebedev", "garcia", "punch"):
        assert verdicts[fit] <= {AGREES, CLOSE}, fit
    assert DIFFERS in verdicts["dimitriadis"]  # 1 % off at chi = 0.2
    assert "long" not in verdicts
    assert "13 published results compared: 12 agree at all points, 1 at some" in text
    assert "Zhang et al. 2014" in text.split("## Not opened")[1]
    assert (tmp_path / "validation.png").stat().st_size > 20_000


def test_a_verdict_keeps_to_both_errors() -> None:
    def verdict(ours: float, bar: float, error: float) -> str:
        return Point("there", 1.0, ours, bar, 1.0, error).verdict

    assert verdict(1.02, 0.015, 0.006) == AGREES
    assert verdict(1.02, 0.015, 0.004) == DIFFERS
    assert verdict(1.005, 0.001, math.nan) == CLOSE  # no error stated
    assert verdict(1.005, 0.001, 0.0) == DIFFERS  # an exact form has none
    assert verdict(1.02, 0.001, math.nan) == DIFFERS


def test_every_comparison_has_its_source_and_every_source_says_where_it_was_read() -> None:
    assert "validation" in STUDIES
    assert {comparison.key for comparison in COMPARISONS} == set(SOURCES)
    for source in SOURCES.values():
        assert source.states
        assert source.read
    assert all(NOT_OPENED.values())
    names = [case.name for case in cases(quick=False)]
    assert len(names) == len(set(names)) > len(cases(quick=True))
    assert {case.model for case in cases(quick=True)} == {LINEAR}


def test_formulas_of_others_have_their_limits() -> None:
    assert formulas.power_force(0.3, 2.0, 1.0) == pytest.approx(4.0 / 3.0 * math.sqrt(0.5) * 0.3**1.5, rel=1e-12)
    # a blunt cone is a paraboloid
    blunt = formulas.hyperboloid_force(1e-6, 1.0, math.radians(20.0), 1.0)
    assert blunt == pytest.approx(4.0 / 3.0 * 1e-9, rel=1e-2)
    for x in (0.3, 1.2):
        assert formulas.punch_factor(x - 1e-9, 0.5) == pytest.approx(formulas.punch_factor(x + 1e-9, 0.5), rel=3e-3)
    assert formulas.lebedev_factor(math.sqrt(0.4) - 1e-9) == pytest.approx(
        formulas.lebedev_factor(math.sqrt(0.4) + 1e-9), rel=FIT
    )
    assert formulas.gao_weight(1e-6, 0.3) == pytest.approx(1.0, abs=1e-5)
    assert formulas.gao_weight(1e4, 0.3) == pytest.approx(0.0, abs=1e-3)
    assert formulas.perriot_modulus(1e-9, 1.0, 10.0, 1.2) == pytest.approx(1.0, rel=1e-6)
    assert formulas.lin_force(1e-8, 1.0, 1.0, 2.0) == pytest.approx(4.0 / 3.0 * 1e-12, rel=1e-3)


def test_the_slope_of_the_force_is_that_of_a_flat_punch_on_a_half_space() -> None:
    case = flat_punch.punch_case("any", "half-space", small_strain.HALF_SPACE, 0.01)
    radius, slope = flat_punch.stiffness(solved(case)["steps"])
    assert slope == pytest.approx(2.0 * small_strain.HALF_SPACE.contact_modulus * radius, rel=1e-6)


def test_long_et_al_are_compared_within_the_range_they_state() -> None:
    """A fake answer that is the fit itself; the study raises for a depth outside its range."""
    case = large_strain.case_of(1.0)
    steps = [
        {
            "balls": [{"approach": d, "normal_force": large_strain.curve(1.0, [d])[0] * 16.0 / 9.0 * d**1.5}],
            "record": {"normal_force_error": [1e-4]},
        }
        for d in large_strain.DEPTHS[1.0]
    ]
    every = Found((case,), {case.name: {"state": "done", "steps": steps}})
    (comparison,) = (c for c in COMPARISONS if c.key == "long")
    (points,) = comparison.points(every).values()
    assert [point.off for point in points] == pytest.approx([0.0] * len(points), abs=1e-9)
    assert {point.verdict for point in points} == {AGREES}
    for thickness, depths in large_strain.DEPTHS.items():
        if thickness < large_strain.DEEP:
            assert max(depths) / thickness <= min(0.6, 1.0 / thickness) + 1e-12


def test_a_page_is_made_of_whatever_answers_are_there(tmp_path: Path) -> None:
    elements, _ = pressed_elements(1.0)
    text = present(elements, tmp_path)
    assert "1 published results compared" in text  # a response needs no case


def pressed_elements(share: float) -> tuple[Found, str]:
    """Return the coating pressed by elements whose force is ``share`` of linear_bem's, and the name of its twin."""
    (case,) = (case for case in cases(quick=False) if case.name.endswith("-elements"))
    step = {"balls": [{"normal_force": share}], "record": {"normal_force_error": [abs(share - 1.0)]}}
    return Found((case,), {case.name: {"state": "done", "steps": [step]}}), case.name.removesuffix("-elements")


@pytest.mark.parametrize(("share", "verdict"), [(0.97, AGREES), (0.9, DIFFERS), (1.1, DIFFERS)])
def test_elements_that_know_their_difference_from_the_linear_model_may_still_differ(share: float, verdict: str) -> None:
    elements, twin = pressed_elements(share)
    linear = {"state": "done", "steps": [{"balls": [{"normal_force": 1.0}]}] * 3}
    (comparison,) = (c for c in COMPARISONS if c.key == "perriot")
    ((point,),) = comparison.points(Found(elements.cases, {**elements.records, twin: linear})).values()
    assert point.verdict == verdict
