"""The small-strain problem as control variate: its correction, its weight, and the remaining uncertainty."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from finite_strain.accuracy.pairs import ALIKE, UNLIKE, UNSURE, LinearTruth, paired, unpaired, unsure
from finite_strain.planning.records import ContactState
from tests.finite_strain.scenes import relatively

ROUNDOFF = 1e-13
FAR_FROM_ZERO = np.array([1e-6])
"""A scale [1/N] of T / Q^2 far below those that occur here."""


def state(q: float, d: float, per_squared: tuple[float, float], gap: float = 0.0) -> ContactState:
    """Return a state of one ball with Q, D and T / Q^2."""
    one: Any = np.array([[per_squared[0] * q**2, per_squared[1] * q**2]])
    same = np.array([1.0])
    return ContactState(1.0, np.array([d]), np.array([q]), one, one, same, same, 0.0 * same, same, np.array([gap]))


def linear(q: float, d: float, per_squared: tuple[float, float]) -> LinearTruth:
    one = np.array([1.0])
    return LinearTruth(
        np.array([q]), np.array([d]), q**2 * np.array([per_squared]), 1e-9 * one, one, one, 0.0 * one, 0.0 * one
    )


@pytest.mark.parametrize("forces_given", [False, True], ids=["approach given", "force given"])
def test_if_both_models_agree_the_answer_is_the_linear_one(forces_given: bool) -> None:
    own = small = state(0.9, 0.11, (-0.021, 0.004))
    truth = linear(0.9 if forces_given else 1.0, 0.1 if forces_given else 0.11, (-0.02, 0.003))
    answer = paired(own, small, truth, FAR_FROM_ZERO, forces_given, UNSURE)
    assert answer.weight == [1.0]
    assert answer.normal_force == relatively(truth.normal_force, ROUNDOFF)
    assert answer.approach == relatively(truth.approach, ROUNDOFF)
    assert answer.tangential_force == relatively(truth.tangential_force, ROUNDOFF)
    # the error of both, a fraction of which stays uncertain
    off = np.hypot(*(truth.tangential_force / truth.normal_force**2 - own.per_squared_force)[0])
    share = abs(0.1 / 0.11 - 1.0) if forces_given else abs(1.0 / 0.9 - 1.0)
    assert answer.transfer == relatively([UNSURE * off], ROUNDOFF)
    assert answer.force_transfer == relatively([UNSURE * share], 1e-12)


def test_an_error_shared_by_both_is_removed() -> None:
    # the mesh is 3 % too stiff and has 1e-3 too much T / Q^2; finite strain softens by a tenth
    truth, exact = linear(1.0, 0.1, (-0.02, 0.0)), state(0.9, 0.1, (-0.023, 0.0))
    answer = paired(
        state(0.927, 0.1, (-0.022, 0.0)), state(1.03, 0.1, (-0.019, 0.0)), truth, FAR_FROM_ZERO, False, UNSURE
    )
    assert answer.normal_force == relatively(exact.normal_force, ROUNDOFF)
    assert answer.per_squared_force[0] == pytest.approx([-0.023, 0.0], abs=ROUNDOFF)
    # the transfer error, 3/22 of the correction (difference against ratio), is below the least uncertainty
    assert answer.transfer == relatively([UNSURE * 1e-3], 1e-12)
    assert answer.force_transfer == relatively([UNSURE * (1.0 - 1.0 / 1.03)], 1e-12)


def test_at_given_force_the_approach_is_corrected_and_the_force_kept() -> None:
    own, small, truth = state(1.0, 0.12, (0.02, 0.0)), state(1.0, 0.105, (0.02, 0.0)), linear(1.0, 0.1, (0.02, 0.0))
    answer = paired(own, small, truth, FAR_FROM_ZERO, True, UNSURE)
    assert answer.normal_force == own.normal_force
    assert answer.approach == relatively([0.12 + 0.1 - 0.105], ROUNDOFF)
    assert answer.force_transfer == relatively([(0.105 - 0.1) / 0.105 * UNSURE], 1e-12)


@pytest.mark.parametrize(
    ("unlike", "weight"),
    [(0.0, 1.0), (ALIKE, 1.0), (0.5 * (ALIKE + UNLIKE), 0.5), (UNLIKE, 0.0), (0.9, 0.0), (1.5, 0.0)],
)
def test_the_weight_of_the_pair_falls_as_the_two_forces_differ(unlike: float, weight: float) -> None:
    own, small = state(1.0, 0.1, (1.0 - unlike, 0.0)), state(1.0, 0.1, (1.0, 0.0))
    answer = paired(own, small, linear(1.1, 0.1, (1.2, 0.0)), FAR_FROM_ZERO, False, UNSURE)
    if unlike > 1.0:  # the difference is measured by the larger of the two
        assert answer.weight[0] == 0.0
        return
    assert answer.weight[0] == pytest.approx(weight, abs=ROUNDOFF)
    assert answer.per_squared_force[0, 0] == pytest.approx(1.0 - unlike + weight * 0.2, abs=ROUNDOFF)
    assert answer.normal_force[0] == relatively(1.1**weight, ROUNDOFF)
    # the uncertain part of the correction grows from its minimum to all of it as the problems differ
    left = min(max(unlike / max(1.0 - unlike, 0.5), UNSURE), 1.0)
    assert answer.transfer[0] == pytest.approx(0.2 * left, abs=ROUNDOFF)


def test_what_does_not_carry_over_grows_with_the_slope_of_the_surface_up_to_a_fifth() -> None:
    # measured by `pair_transfer`: slope squared is D / R
    measured = {1e-4: 0.0013, 1e-3: 0.0028, 0.01: 0.0055, 0.03: 0.014, 0.1: 0.079}
    for squared, share in measured.items():
        assert share < unsure(squared**0.5) <= UNSURE
    assert unsure(0.0) == 0.0
    assert unsure(10.0) == UNSURE
    own = small = state(0.9, 0.11, (-0.021, 0.0))
    steep, flat = (
        paired(own, small, linear(1.0, 0.11, (-0.02, 0.0)), FAR_FROM_ZERO, False, unsure(s)) for s in (1, 0.01)
    )
    assert steep.transfer == relatively(flat.transfer * UNSURE / unsure(0.01), 1e-12)
    assert steep.force_transfer == relatively(flat.force_transfer * UNSURE / unsure(0.01), 1e-12)


def test_near_a_zero_of_t_differences_are_relative_to_the_scale() -> None:
    # T of the two has opposite signs, and both are a hundredth of what counts
    own, small = state(1.0, 0.1, (1e-4, 0.0)), state(1.0, 0.1, (-1e-4, 0.0))
    truth = linear(1.0, 0.1, (-3e-4, 0.0))
    near, far = (paired(own, small, truth, np.array([scale]), False, UNSURE) for scale in (1e-2, 1e-6))
    assert near.weight == [1.0]
    assert near.per_squared_force[0, 0] == relatively(1e-4 - 2e-4, 1e-12)
    assert far.weight == [0.0]
    assert far.per_squared_force[0, 0] == 1e-4


def test_contact_area_and_peak_pressure_are_corrected_by_the_same_ratio_with_an_uncertain_part() -> None:
    one = np.array([1.0])
    own = replace(state(0.9, 0.1, (-0.02, 0.0)), contact_area=1.14 * one, peak_pressure=0.48 * one)
    small = replace(state(1.0, 0.1, (-0.02, 0.0)), contact_area=0.95 * one, peak_pressure=0.5 * one)
    truth = replace(linear(1.0, 0.1, (-0.02, 0.0)), contact_area=1.0 * one, peak_pressure=0.51 * one)
    for forces_given in (False, True):
        answer = paired(own, small, truth, FAR_FROM_ZERO, forces_given, 0.1)
        assert answer.contact_area == relatively([1.2], ROUNDOFF)
        assert answer.area_transfer == relatively([0.2 * (1.0 / 0.95 - 1.0)], 1e-12)  # the areas differ by a fifth
        assert answer.peak_pressure == relatively([0.48 * 1.02], ROUNDOFF)
        assert answer.peak_transfer == relatively([0.1 * 0.02], 1e-12)


def test_a_ball_without_force_has_no_correction_and_no_nan() -> None:
    nothing, truth = state(0.0, 0.0, (0.0, 0.0)), linear(0.0, 0.0, (0.0, 0.0))
    for forces_given in (False, True):
        answer = paired(nothing, nothing, truth, np.array([0.0]), forces_given, UNSURE)
        for values in (answer.normal_force, answer.approach, answer.per_squared_force, answer.transfer):
            assert not np.any(values)


def test_without_a_pair_there_is_no_correction() -> None:
    own = state(0.9, 0.1, (-0.02, 0.001))
    answer = unpaired(own)
    assert answer.tangential_force == relatively(own.tangential_force, ROUNDOFF)
    assert answer.normal_force == own.normal_force
    for none in (answer.weight, answer.transfer, answer.force_transfer, answer.area_transfer, answer.peak_transfer):
        assert none == [0.0]
