"""The part of laws: every law on both layers, foams under the paper's balls, and a page of both."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from linear_bem.law import LAWS
from runs.display.numbers import with_error
from runs.studies.framework.pair import THICK, THIN
from runs.studies.strengthening import laws
from runs.studies.strengthening.matrix import law_cases


def test_the_matrix_holds_every_law_on_both_layers_to_half_a_radius_and_foams() -> None:
    every = law_cases(quick=False)
    assert len({case.name for case in every}) == len(every)
    compared = {(c.labels["h"], c.labels["law"], max(c.problem.load.values)) for c in every if c.labels["nu"] == 0.48}
    rubbers = {law.name for law in LAWS.values() if law.takes_pressure}
    assert compared == {(h, law, 0.5) for h in (THIN, THICK) for law in rubbers}
    foams = [case for case in every if case.labels["group"] == "foam"]
    assert {case.labels["nu"] for case in foams} == {0.0, 0.3}
    assert {max(case.problem.load.values) for case in foams} == {1.2}
    assert len(law_cases(quick=True)) == 2


def test_the_part_sets_factors_and_foams_side_by_side(tmp_path: Path) -> None:
    every = law_cases(quick=False)

    def rows(case: Any, strength: float) -> list[dict[str, Any]]:
        depth, sign = (
            max(case.problem.load.values),
            -1.0 if case.labels["nu"] == 0.3 and case.labels["h"] == THIN else 1.0,
        )
        return [
            {"D": d, "Q": 2.0 * d, "T": 0.1 * strength * d, "T_error": 1e-3, "T_linear": linear, "S_Q": strength,
             "S_Q_error": 0.01, "S_D": 2.0 * strength, "S_D_error": 0.02}
            for d, linear in ((0.2 * depth, sign), (depth, 1.0))
        ]  # fmt: skip

    stronger = {case.name: 1.0 + 0.1 * number for number, case in enumerate(every)}
    text = laws.part([(case, rows(case, stronger[case.name])) for case in every], tmp_path)
    rubbers = [case for case in every if case.labels["nu"] == 0.48 and case.labels["h"] == THIN]
    ends = " and ".join(
        f"{stronger[case.name]:.4g} ({case.labels['law'].replace('_', ' ')})" for case in (rubbers[0], rubbers[-1])
    )
    assert f"D = 0.5 R on h = {THIN:g} R, nu = 0.48, S_Q lies between {ends}, for {len(rubbers)} laws" in text
    assert f"h = {THIN:g} R, nu = 0.3: T at small strain passes through zero" in text
    foams = [case for case in every if case.labels["group"] == "foam"]
    solid, foam = (stronger[case.name] for case in foams[:2])
    row = next(line for line in text.splitlines() if line.startswith("| hyperfoam 8 | 0.3 | 1.2 "))
    value = foam / solid  # T is 0.1 times the strength times D, with an error of 1e-3
    error = value * math.hypot(1e-3 / (0.12 * foam), 1e-3 / (0.12 * solid))
    assert f"| {with_error(value, error)} |" in row
    assert (tmp_path / "laws.svg").stat().st_size > 5_000
