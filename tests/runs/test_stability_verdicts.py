"""Verdicts of the stability study: right answers are called right, wrong ones wrong, refusals refused with a reason."""

from __future__ import annotations

import math
from typing import Any

import pytest

from linear_bem.result import FAINT, UNRESOLVED
from runs.studies.stability.agreement import at_force, compared
from runs.studies.stability.judging import BALANCE, FORCES, energy_balance, last_good, meshed_forces, verdict, work
from runs.studies.stability.matrix import END, NO_LOAD, SAME_FORCE
from tests.runs.saved_paths import ball, found, path

POWER_LAW = 1e-12


def test_work_along_a_power_law_is_exact() -> None:
    steps = path(1.5, 0.01, 0.03, 0.1)
    assert work(steps) == pytest.approx(0.1**2.5 / 2.5, rel=POWER_LAW)
    assert energy_balance(steps) == pytest.approx(0.0, abs=POWER_LAW)
    assert energy_balance(path(1.5, 0.01, 0.03, 0.1, stored=1.1)) == pytest.approx(1.0 - 1.0 / 1.1)
    assert math.isnan(energy_balance(path(1.5, 0.05, 0.1)))  # two steps tell no curve


def test_a_ball_that_only_rests_does_no_work() -> None:
    steps = path(1.5, 0.01, 0.03, 0.1)
    beside = [{**step, "balls": [*step["balls"], ball(0.0, 1e-3)]} for step in steps]
    assert energy_balance(beside) == pytest.approx(0.0, abs=POWER_LAW)
    later = [
        {**step, "balls": [*step["balls"], ball(depth, 1e-3)]}
        for step, depth in zip(steps, (0.0, 0.0, 0.1), strict=True)
    ]
    assert math.isnan(energy_balance(later))  # it moves, but the step from which it moves is unknown


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({"stored": 1.0 + 2.0 * BALANCE}, "energy against work"),
        ({"force_balance": 2.0 * FORCES}, "forces against base"),
        ({"smallest_volume_ratio": -0.1}, "folded over"),
    ],
)
def test_a_path_out_of_balance_or_folded_over_is_called_wrong(record: dict[str, Any], words: str) -> None:
    right = found(a={"steps": path(1.5, 0.01, 0.03, 0.1, smallest_volume_ratio=0.7)})
    assert verdict(right, "a", {"check": None})[0] == "right"
    wrong = found(a={"steps": path(1.5, 0.01, 0.03, 0.1, **record)})
    ended, why = verdict(wrong, "a", {"check": None})
    assert ended == "WRONG"
    assert words in why


def test_a_state_that_the_result_calls_unresolved_owes_equilibrium_alone() -> None:
    def judged(**record: Any) -> tuple[str, str]:
        steps = path(1.5, 0.01, 0.03, 0.1, **record)
        notes = {"notes": [f"{UNRESOLVED} 0.9 m from a ball's axis"]}
        return verdict(found(a={"steps": steps, "solved": notes}), "a", {"check": None})

    ended, why = judged(stored=1.0 + 2.0 * BALANCE)
    assert ended == "state reported as unresolved"
    assert "0.9 m from a ball's axis; energy against work: 3.8 %; forces against base" in why
    assert judged(smallest_volume_ratio=-0.1)[0] == "WRONG"
    assert judged(force_balance=2.0 * FORCES)[0] == "WRONG"


def test_a_case_is_held_against_another_with_both_error_bars_or_a_tolerance() -> None:
    def pair(other: float, **check: Any) -> tuple[str, str]:
        records = found(
            a={"steps": [{"balls": [ball(0.1, 0.1, pull=-1e-3)], "record": {}}]},
            b={"steps": [{"balls": [ball(0.1, 0.1, pull=other)], "record": {}}]},
        )
        given = {"words": "the twin", "other": "b", "within": 0.0, "factor": 1.0, "at": END, **check}
        return verdict(records, "a", {"check": given})

    assert pair(-1.01e-3)[0] == "right"  # 1 % apart, two error bars of 1 % each
    assert pair(-1.05e-3)[0] == "WRONG"
    assert pair(-1.01e-3, within=0.02)[0] == "right"
    assert pair(-1.01e-3, within=0.001)[0] == "WRONG"
    assert pair(-1e-6, factor=1e3, within=1e-6)[0] == "right"
    assert pair(-1.09e-3, within=0.1)[0] == "right"
    ended, why = pair(-1.09e-3, within=0.11)  # so large a tolerance claims nothing
    assert ended == "not checked"
    assert "tolerance 11 %, which is no check" in why
    assert pair(-1.2e-3, within=0.11)[0] == "WRONG"
    alone = found(a={"steps": [{"balls": [ball(0.1, 0.1)], "record": {}}]})
    check = {"words": "the twin", "other": "b", "within": 0.0, "factor": 1.0, "at": END}
    assert compared(alone, "a", check) is None
    assert "has no answer" in verdict(alone, "a", {"check": check})[1]


def test_an_answer_that_does_not_know_its_error_is_neither_right_nor_a_reference() -> None:
    steps = [{"balls": [ball(0.1, 0.1, error=None)], "record": {}}]  # as nan is saved
    both = found(a={"steps": [{"balls": [ball(0.1, 0.1)], "record": {}}]}, b={"steps": steps})
    check = {"words": "the twin", "other": "b", "within": 0.0, "factor": 1.0, "at": END}
    assert compared(both, "a", check) is None
    ended, why = verdict(both, "b", {"check": None})
    assert (ended, why) == ("T not resolved", "the error of T is an unknown part of T")


def test_an_answer_whose_error_is_a_large_part_of_it_claims_nothing_whatever_else_holds() -> None:
    def ended(error: float) -> tuple[str, str]:
        steps = path(1.5, 0.01, 0.03, 0.1)
        steps[-1]["balls"] = [ball(0.1, 0.1**1.5, error=error)]
        return verdict(found(a={"steps": steps}), "a", {"check": None})

    assert ended(0.99e-4)[0] == "right"
    state, why = ended(1.1e-4)
    assert state == "T not resolved"
    assert why.startswith("the error of T is 11 % of T; energy against work")


def test_a_result_that_says_that_the_force_is_below_its_error_refuses_it_by_name_and_owes_every_check() -> None:
    def ended(stored: float) -> str:
        steps = path(1.5, 0.01, 0.03, 0.1, stored=stored)
        steps[-1]["balls"] = [ball(0.1, 0.1**1.5, error=2e-3)]
        record = {"steps": steps, "solved": {"notes": [f"{FAINT}: it is at most 0.003 N"]}}
        return verdict(found(a=record), "a", {"check": None})[0]

    assert ended(1.0) == "T reported as unresolved"
    assert ended(1.0 + 2.0 * BALANCE) == "WRONG"


def test_the_sum_of_unlike_forces_is_judged_as_it_was_on_the_mesh() -> None:
    def ended(imbalance: float) -> tuple[str, str]:
        steps = path(1.5, 0.01, 0.03, 0.1, imbalance=imbalance, imbalance_error=1e-4)
        steps[-1]["balls"] = [ball(0.1, 0.1**1.5), ball(0.1, 0.2 * 0.1**1.5, pull=1e-3)]  # opposite by construction
        return verdict(found(a={"steps": steps[-1:]}), "a", {"check": None})

    state, why = ended(0.9e-4)
    assert state == "right"
    assert "third law: T of all balls adds up to 4.5 %, tolerance 5 %" in why
    assert ended(1.1e-4)[0] == "WRONG"


def test_balance_of_forces_alone_claims_nothing_about_the_force() -> None:
    two = path(1.5, 0.05, 0.1)
    assert verdict(found(a={"steps": two}), "a", {"check": None})[0] == "not checked"


def test_finite_strain_is_held_against_its_limit_of_no_load_even_where_its_path_stopped_later() -> None:
    check = {"words": "the limit", "other": "b", "within": 0.0, "factor": 1.0, "at": NO_LOAD}
    depths = (0.01, 0.02, 0.04, 0.08)

    def at(limit: float, departure: float) -> list[dict[str, Any]]:
        return [
            {"balls": [ball(d, d, pull=-(limit + departure * d**0.5) * 1e-3)], "record": {"fraction": d}}
            for d in depths
        ]

    stopped = {"state": "not converged", "steps": at(1.0, 0.0)}
    worst, allowed = compared(found(a={"steps": at(1.0, 0.7)[:3]}, b=stopped), "a", check) or (math.nan, math.nan)
    assert worst == pytest.approx(0.0, abs=POWER_LAW)
    # theory: Lagrange's weights at zero for 1, sqrt 2 and 2; both bars are 1 % of T
    weights = (2.0**0.5 * 2.0 / (0.4142136 * 1.0), 2.0 / (0.4142136 * 0.5857864), 2.0**0.5 / 0.5857864)
    ratios = [1.0 + 0.7 * d**0.5 for d in depths[:3]]
    assert allowed == pytest.approx(sum(w * (0.01 + 0.01 / r) for w, r in zip(weights, ratios, strict=True)), rel=1e-5)
    worst, _ = compared(found(a={"steps": at(1.1, 0.7)}, b=stopped), "a", check) or (math.nan, math.nan)
    assert worst == pytest.approx(0.1)
    one = compared(found(a={"steps": at(1.0, 0.7)[:1]}, b=stopped), "a", check)
    assert one is not None
    assert one[0] == pytest.approx(0.07)  # nothing to extrapolate from
    assert compared(found(a={"steps": at(1.0, 0.0)[1:]}, b=stopped), "a", check) is None  # other steps
    unknown = at(1.0, 0.0)
    unknown[1]["balls"][0]["tangential_force_error"] = None
    assert compared(found(a={"steps": unknown}, b=stopped), "a", check) is None


def test_a_case_under_given_forces_is_compared_where_the_other_passes_them() -> None:
    # T = Q^2 / 100 on the way, and beyond its end
    steps = [{"balls": [ball(q, q, pull=-(q**2) / 100.0)], "record": {}} for q in (0.01, 0.05, 0.2)]
    for force in (0.03, 0.1, 0.25):
        (there,) = at_force(steps, [ball(1.0, force)])
        assert there["tangential_force"][0] == pytest.approx(-(force**2) / 100.0, rel=POWER_LAW)
    mine = {"steps": [{"balls": [ball(0.1, 0.1, pull=-1e-4)], "record": {}}]}
    check = {"words": "same", "other": "b", "within": 1e-9, "factor": 1.0, "at": SAME_FORCE}
    assert verdict(found(a=mine, b={"steps": steps}), "a", {"check": check})[0] == "right"
    steps[-1]["balls"][0]["tangential_force_error"] = None
    assert compared(found(a=mine, b={"steps": steps}), "a", check) is None


def test_unlike_balls_must_pull_each_other_alike() -> None:
    def two(second: float, error: float = 1e-5) -> str:
        balls = [ball(0.1, 0.1, pull=-1e-3, error=error), ball(0.1, 0.05, pull=second, error=error)]
        return verdict(found(a={"steps": [{"balls": balls, "record": {}}]}), "a", {"check": None})[0]

    assert two(1.01e-3) == "right"
    assert two(1.1e-3) == "WRONG"
    assert two(1.01e-3, error=1.05e-4) == "T not resolved"
    assert two(1.01e-3, error=0.99e-4) == "right"
    assert two(1.5e-3, error=1.05e-4) == "WRONG"


def test_a_stop_is_judged_by_what_it_reached() -> None:
    def stopped(balance: float) -> tuple[str, str]:
        steps = path(1.5, 0.01, 0.03, 0.1, stored=balance)
        return verdict(found(a={"state": "not converged", "reason": "step 4", "steps": steps}), "a", {"check": None})

    ended, why = stopped(1.0)
    assert ended == "not converged"
    assert why.startswith("step 4; what it reached: energy against work")
    assert stopped(1.5)[0] == "WRONG"


def test_the_energy_of_a_mesh_is_held_against_the_work_on_that_mesh() -> None:
    # the answer's Q = D^(3/2) lacks what domain truncation adds to the mesh's, a tenth of it at full load, like Q / D
    answer = path(1.5, *(0.1 * 0.8**n for n in reversed(range(12))))
    answer[-1]["record"]["strain_energy"] = 0.1**2.5 / 2.5 + 0.1 * 0.1**2.5 / 3.0
    meshes = [{"normal_forces": [9.0]}, {"normal_forces": [1.1 * 0.1**1.5]}]
    record = {"steps": answer, "solved": {"accuracy": {"meshes": meshes}}}
    assert energy_balance(answer) > 2.0 * BALANCE
    assert energy_balance(answer, meshed_forces(record)) < 0.1 * BALANCE


def test_a_stop_says_how_far_it_came_even_on_the_mesh_before() -> None:
    reason = "coarse mesh: load step to 0.9: after 8 cut-backs; the last good state is at 0.85 of the full load"
    assert last_good([], "not converged", reason) == 0.85
    assert last_good([], "refused", "too deep") == 0.0
    assert last_good([{"record": {"fraction": 0.3}}], "running", "") == 0.3
    assert last_good([{"record": {}}], "done", "") == 1.0


def test_refusals_need_a_name_and_failures_keep_theirs() -> None:
    assert verdict(found(a={"state": "refused", "reason": "too deep"}), "a", {}) == (
        "refused with a reason",
        "too deep",
    )
    assert verdict(found(a={"state": "refused", "reason": ""}), "a", {})[0] == "WRONG"
    assert verdict(found(a={"state": "not converged", "reason": "step 3"}), "a", {}) == ("not converged", "step 3")
    assert verdict(found(), "a", {})[0] == "not run yet"


def test_a_linear_answer_is_judged_by_its_routes_and_recomputed_residuals() -> None:
    def linear(slope: float, residual: float) -> str:
        routes = {"mutual": [-1e-3, 0.0], "slope": [slope, 0.0]}
        state = ball(0.1, 0.1, error=2.0 * abs(slope + 1e-3)) | {"tangential_force_routes": routes}
        record = {"steps": [{"balls": [state], "record": {}}], "solved": {"certificate": {"load": residual}}}
        return verdict(found(a=record), "a", {"check": None})[0]

    assert linear(-1.00005e-3, 1e-6) == "right"
    assert linear(-1.03e-3, 1e-6) == "WRONG"  # within its error, which has this difference
    assert linear(-1e-3, 1e-2) == "WRONG"
