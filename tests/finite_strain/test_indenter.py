"""Gap functions: values, and derivatives against finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from finite_strain.indenter import Indenter, LinearisedProfile, ParaboloidInSpace, SphereInSpace

INDENTERS: dict[str, Indenter] = {
    "sphere in space": SphereInSpace(1.3),
    "paraboloid in space": ParaboloidInSpace(1.3),
    "linearised sphere": LinearisedProfile(1.3, "sphere"),
    "linearised paraboloid": LinearisedProfile(1.3, "paraboloid"),
}
STEP = 1e-5
DIFFERENCE = 1e-9
"""Of a central difference with that step, of functions and derivatives of order one."""
APPROACH = 0.2
RANDOM = np.random.default_rng(7)
POINTS = np.column_stack([RANDOM.uniform(-0.6, 0.6, (40, 2)), np.zeros(40)])
DISPLACEMENTS = RANDOM.uniform(-0.15, 0.15, (40, 3))


@pytest.mark.parametrize("name", INDENTERS)
def test_gradient_and_hessian_are_the_derivatives_of_the_gap(name: str) -> None:
    indenter = INDENTERS[name]
    _, gradient, hessian = indenter.gap(POINTS, DISPLACEMENTS, APPROACH)
    for axis in range(3):
        step = STEP * np.eye(3)[axis]
        up, down = (indenter.gap(POINTS, DISPLACEMENTS + s * step, APPROACH) for s in (1.0, -1.0))
        assert gradient[:, axis] == pytest.approx((up[0] - down[0]) / (2 * STEP), abs=DIFFERENCE)
        assert hessian[:, :, axis] == pytest.approx((up[1] - down[1]) / (2 * STEP), abs=DIFFERENCE)


@pytest.mark.parametrize("name", INDENTERS)
def test_the_shift_gradient_is_the_derivative_by_moving_the_material_point(name: str) -> None:
    indenter = INDENTERS[name]
    slope = indenter.shift_gradient(POINTS, DISPLACEMENTS, APPROACH)
    assert slope.shape == (40, 2)
    for axis in range(2):
        step = STEP * np.eye(3)[axis]
        up, down = (indenter.gap(POINTS + s * step, DISPLACEMENTS, APPROACH)[0] for s in (1.0, -1.0))
        assert slope[:, axis] == pytest.approx((up - down) / (2 * STEP), abs=DIFFERENCE)


@pytest.mark.parametrize("name", INDENTERS)
def test_an_approach_closes_the_gap_at_the_apex_by_its_own_length(name: str) -> None:
    indenter = INDENTERS[name]
    apex, still = np.zeros((1, 3)), np.zeros((1, 3))
    for approach in (-0.1, 0.0, 0.2):
        assert indenter.gap(apex, still, approach)[0][0] == pytest.approx(-approach, abs=1e-15)
    pushed = np.array([[0.0, 0.0, -0.2]])
    assert indenter.gap(apex, pushed, 0.2)[0][0] == pytest.approx(0.0, abs=1e-15)


def test_points_on_the_ball_have_no_gap() -> None:
    directions = RANDOM.normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    centre = np.array([0.0, 0.0, 1.3 - APPROACH])
    gap, normal, _ = INDENTERS["sphere in space"].gap(np.zeros((30, 3)), centre + 1.3 * directions, APPROACH)
    assert np.abs(gap).max() < 1e-14
    assert np.abs(normal - directions).max() < 1e-14


def test_linearised_and_exact_spheres_share_their_profile() -> None:
    linear, exact = INDENTERS["linearised sphere"], INDENTERS["sphere in space"]
    profile = linear.gap(POINTS, np.zeros((40, 3)), 0.0)[0]
    lifted = np.column_stack([np.zeros((40, 2)), profile])
    assert np.abs(exact.gap(POINTS, lifted, 0.0)[0]).max() < 1e-14


def test_a_linearised_gap_knows_only_the_vertical_displacement() -> None:
    indenter = INDENTERS["linearised paraboloid"]
    sideways = DISPLACEMENTS * np.array([1.0, 1.0, 0.0])
    assert np.array_equal(
        indenter.gap(POINTS, sideways, APPROACH)[0], indenter.gap(POINTS, np.zeros((40, 3)), APPROACH)[0]
    )
    assert not np.any(indenter.gap(POINTS, DISPLACEMENTS, APPROACH)[2])


def test_the_linearised_sphere_stays_finite_beyond_its_own_edge() -> None:
    far = np.array([[5.0, 0.0, 0.0]])
    gap, _, _ = INDENTERS["linearised sphere"].gap(far, np.zeros((1, 3)), 0.1)
    assert np.isfinite(gap).all()
    assert gap[0] > 1.0
