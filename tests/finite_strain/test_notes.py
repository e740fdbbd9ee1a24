"""The notes of a result, each where it holds and not elsewhere."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import pytest

from finite_strain.accuracy.answer import judge
from finite_strain.accuracy.notes import result_notes
from finite_strain.planning.records import Record, Row
from finite_strain.planning.run_plan import plan_run
from linear_bem import Elastic
from linear_bem.depth import LARGE_STRAIN
from linear_bem.result import FAINT
from tests.finite_strain.scenes import CUBIC, at_small_strain, pair

SOFT = Elastic(0.91, 0.3)
"""A base with a contact modulus of 1 Pa."""


def one_ball(**known: Any) -> Any:
    """Return the state of a ball, its normal force 1 N unless it is ``known``."""
    return SimpleNamespace(**{"normal_force": 1.0, "errors": {}, **known})


@pytest.mark.parametrize(
    ("film", "volume_ratio", "noted"),
    [(0.14, 0.3, False), (0.14, 0.09, False), (0.14, 0.06, True), (0.62, 0.09, True), (None, 0.09, True)],
)
def test_a_state_with_nearly_inverted_elements_is_named(film: float | None, volume_ratio: float, noted: bool) -> None:
    plan = plan_run(pair(1.0), 0.1, "finite_strain")
    ball = one_ball(tangential_force=(1.0, 0.0), tangential_force_error=0.01, approach=1.0)
    step = SimpleNamespace(
        balls=(ball, ball), smallest_volume_ratio=volume_ratio, smallest_seen_area=1.0, surface_crossing=0.0,
        distorted_at={"volume_ratio": [1.0, 0.0]}, linear_failure="", film=film, fraction=1.0, error_terms={},
    )  # fmt: skip
    rows = [Row(SimpleNamespace(fraction=1.0), SimpleNamespace())]  # type: ignore[arg-type]
    record = Record(CUBIC, steps=[step], rows=rows)  # type: ignore[list-item]
    judge(plan, record)
    notes = result_notes(plan, record, "", 1.0)
    assert [note for note in notes if "not resolved 1 m from a ball's axis" in note and "J falls to" in note] == (
        notes if noted else []
    )
    left = f", while {film} of the thickness is left under a ball"
    assert all(note.endswith("there" if film is None else left) for note in notes)


@pytest.mark.parametrize(
    ("seen_area", "crossing", "noted"),
    [
        (0.1, 0.0, ""),
        (-0.1, 0.0, "overhangs 1.5 m from a ball's axis"),
        (-0.1, 0.01, "pass through each other by 0.02 m"),
    ],
)
def test_a_surface_that_may_touch_itself_is_noted(seen_area: float, crossing: float, noted: str) -> None:
    plan = plan_run(pair(1.0), 0.1, "finite_strain")
    ball = one_ball(tangential_force=(1.0, 0.0), tangential_force_error=0.01, approach=1.0)
    step = SimpleNamespace(
        balls=(ball, ball), smallest_volume_ratio=0.9, smallest_seen_area=seen_area, surface_crossing=crossing,
        distorted_at={"seen_area": [1.5, 0.0]}, linear_failure="",
    )  # fmt: skip
    rows = [Row(SimpleNamespace(fraction=1.0), SimpleNamespace())]  # type: ignore[arg-type]
    record = Record(CUBIC, steps=[step], rows=rows, reached=0.01, scale=1.0)  # type: ignore[list-item]
    said = [note for note in result_notes(plan, record, "", 1.0) if "contact of the surface with itself" in note]
    assert len(said) == bool(noted)
    assert all(noted in note for note in said)


@pytest.mark.parametrize(
    ("approach", "thickness", "base", "noted"),
    [
        (0.28, 1.16, None, ""),
        (0.3, 1.16, None, "of the layer's thickness: strains"),
        (1.0, 1.16, SOFT, ""),  # 0.65 m is the dent by the own force, 0.16 m that by the other ball's
        (1.6, 7.0, None, "of its ball's radius"),
    ],
)
def test_small_strain_is_noted_where_it_does_not_hold(
    approach: float, thickness: float, base: Elastic | None, noted: str
) -> None:
    problem = at_small_strain(pair(approach, thickness=thickness, substrate=base))
    plan = plan_run(problem, 0.1, "small_strain")
    ball = one_ball(tangential_force=(1.0, 0.0), tangential_force_error=0.01, approach=approach, contact_area=1.0)
    step = SimpleNamespace(balls=(ball, ball), linear_failure="")
    rows = [Row(SimpleNamespace(fraction=1.0), None)]  # type: ignore[arg-type]
    record = Record(CUBIC, steps=[step], rows=rows, reached=0.01, scale=1.0)  # type: ignore[list-item]
    said = [note for note in result_notes(plan, record, "", 1.0) if note.startswith(LARGE_STRAIN)]
    assert len(said) == bool(noted)
    assert all(noted in note for note in said)


def test_a_force_near_zero_is_noted_once_for_equal_balls() -> None:
    plan = plan_run(pair(0.1), 0.1, "finite_strain")
    ball = one_ball(tangential_force=(1.0, 0.0), tangential_force_error=0.0082, approach=0.1)
    step = SimpleNamespace(
        balls=(ball, ball), smallest_volume_ratio=1.0, smallest_seen_area=1.0, surface_crossing=0.0, linear_failure=""
    )
    rows = [Row(SimpleNamespace(fraction=1.0), SimpleNamespace())]  # type: ignore[arg-type]
    record = Record(CUBIC, steps=[step], rows=rows, reached=0.01, scale=2.0)  # type: ignore[list-item]
    assert result_notes(plan, record, "", 1.0) == [
        "T is smaller than 2 N, a tenth of the force between the balls on a half-space, to which its accuracy refers; "
        "relative to T itself its error is 0.82 %"
    ]


@pytest.mark.parametrize(("errors", "noted"), [((1.5, 0.55), ":"), ((1.5, 0.45), " on ball 0:"), ((0.45, 0.1), "")])
def test_forces_with_an_error_above_half_the_largest_are_bounded(errors: tuple[float, float], noted: str) -> None:
    plan = plan_run(pair(0.1), 0.1, "finite_strain")
    balls = [
        one_ball(tangential_force=(1.0, 0.0), tangential_force_error=error, approach=0.1, normal_force=1e3)
        for error in errors
    ]
    step = SimpleNamespace(
        balls=balls, smallest_volume_ratio=1.0, smallest_seen_area=1.0, surface_crossing=0.0, linear_failure=""
    )
    rows = [Row(SimpleNamespace(fraction=1.0), SimpleNamespace())]  # type: ignore[arg-type]
    record = Record(CUBIC, steps=[step], rows=rows, reached=0.01, scale=200.0)  # type: ignore[list-item]
    said = [note for note in result_notes(plan, record, "", 1.0) if note.startswith(FAINT)]
    assert len(said) == bool(noted)
    assert all(f"{FAINT}{noted} it is at most 2.5 N, 0.0025 of the normal force" in note for note in said)


def test_the_bound_of_a_ball_without_force_on_the_mesh_has_no_share_of_it() -> None:
    plan = plan_run(pair(0.1), 0.1, "finite_strain")
    balls = [
        one_ball(tangential_force=(pull, 0.0), tangential_force_error=error, approach=0.1, normal_force=force)
        for pull, error, force in ((1.0, 0.1, 1e3), (0.0, 1.5, 0.0))
    ]
    step = SimpleNamespace(
        balls=balls, smallest_volume_ratio=1.0, smallest_seen_area=1.0, surface_crossing=0.0, linear_failure=""
    )
    rows = [Row(SimpleNamespace(fraction=1.0), SimpleNamespace())]  # type: ignore[arg-type]
    record = Record(CUBIC, steps=[step], rows=rows, reached=0.01, scale=1.0)  # type: ignore[list-item]
    (said,) = [note for note in result_notes(plan, record, "", 1.0) if note.startswith(FAINT)]
    assert said.startswith(f"{FAINT} on ball 1: it is at most 1.5 N; at small loads ")


@pytest.mark.parametrize(
    ("errors", "noted"), [((0.4, 0.4), ""), ((1.5, 1.5), "0, 1 .* is 150 %"), ((0.4, 0.6), "1 .* is 60 %")]
)
def test_a_normal_force_with_an_error_above_half_of_it_is_noted(errors: tuple[float, float], noted: str) -> None:
    """Of a law near its limit, T may be small and well known beside a Q that is not known at all."""
    plan = plan_run(pair(0.1), 0.1, "finite_strain")
    balls = [
        one_ball(
            tangential_force=(1.0, 0.0), tangential_force_error=0.01, approach=0.1, normal_force=1.0,
            errors={"normal_force": error},
        )
        for error in errors
    ]  # fmt: skip
    step = SimpleNamespace(
        balls=balls, smallest_volume_ratio=1.0, smallest_seen_area=1.0, surface_crossing=0.0, linear_failure=""
    )
    rows = [Row(SimpleNamespace(fraction=1.0), SimpleNamespace())]  # type: ignore[arg-type]
    record = Record(CUBIC, steps=[step], rows=rows, reached=0.01, scale=1.0)  # type: ignore[list-item]
    said = [note for note in result_notes(plan, record, "", 1.0) if "is not resolved: its error" in note]
    assert len(said) == bool(noted)
    assert all(re.match(f"the normal force of ball {noted}", note) for note in said)
