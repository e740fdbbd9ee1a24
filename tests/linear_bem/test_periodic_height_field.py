"""Surfaces that repeat in both directions, against Westergaard's wave, Hertz and uniform pressure."""

import numpy as np
import pytest

from linear_bem import (
    Ball,
    InvalidProblem,
    Layer,
    Load,
    Problem,
    contact_area_curve,
    solve,
    solve_height_field,
)
from tests.linear_bem.test_height_field import HALF_SPACE, MODULUS, paraboloid


def wave(count, amplitude=0.02, across=8):
    x = (np.arange(count) + 0.5) / count
    return amplitude * (1.0 - np.cos(2.0 * np.pi * x))[:, None] * np.ones(across), 1.0 / count


@pytest.mark.parametrize("load", [0.1, 0.2, 0.5, 0.9])
@pytest.mark.parametrize("count", [64, 128, 256])
def test_the_area_error_covers_straight_edges_along_the_grid(load, count):
    """Both edges of Westergaard's strip are out of place by the same part of a cell over their whole length."""
    heights, cell = wave(count, amplitude=0.01, across=16)
    area, exact = heights.size * cell**2, 2.0 / np.pi * np.arcsin(np.sqrt(load))
    force = load * np.pi * MODULUS * 0.01 * area
    contact = solve_height_field(HALF_SPACE, None, heights, cell, normal_force=force, periodic=True)
    assert abs(contact.contact_area / area - exact) <= contact.contact_area_error / area < 1.5 / count
    turned = solve_height_field(HALF_SPACE, None, heights.T, cell, normal_force=force, periodic=True)
    assert turned.contact_area_error == pytest.approx(contact.contact_area_error)


@pytest.mark.parametrize("load", [0.05, 0.3, 0.8])
def test_a_periodic_wave_is_westergaards(load):
    """p = 2 p* cos(pi x) sqrt(m/p* - sin(pi x)^2), p* = pi E* amplitude/wave length [Westergaard 1939]."""
    heights, cell = wave(512)
    full = np.pi * MODULUS * 0.02
    area = heights.size * cell**2
    contact = solve_height_field(HALF_SPACE, None, heights, cell, normal_force=load * full * area, periodic=True)
    fraction = 2.0 / np.pi * np.arcsin(np.sqrt(load))
    # the edge of a strip lies along the cells: its position is known to a cell
    assert contact.contact_area / area == pytest.approx(fraction, abs=1.5 / 512)
    assert abs(contact.contact_area / area - fraction) <= contact.contact_area_error / area
    x = (np.arange(512) + 0.5) / 512
    inside = np.maximum(load - np.sin(np.pi * x) ** 2, 0.0)
    exact = 2.0 * full * np.abs(np.cos(np.pi * x)) * np.sqrt(inside)
    smooth = np.abs(inside) > 0.1 * load
    assert contact.pressure[smooth, 3] == pytest.approx(exact[smooth], rel=5e-3)
    gap = solve_height_field(HALF_SPACE, None, heights, cell, mean_gap=contact.mean_gap, periodic=True)
    assert gap.normal_force == pytest.approx(contact.normal_force, rel=1e-4)


def test_full_contact_is_the_wave_itself():
    """p = mean + p* cos, in two directions sqrt(2) p* [Johnson, Greenwood and Higginson 1985]."""
    heights, cell = wave(64, across=64)
    both = heights + heights.T
    area, part = 1.0, np.pi * MODULUS * 0.02
    contact = solve_height_field(HALF_SPACE, None, both, cell, normal_force=2.5 * part * area, periodic=True)
    x = np.cos(2.0 * np.pi * (np.arange(64) + 0.5) / 64)
    assert contact.pressure == pytest.approx(part * (2.5 + x[:, None] + x), rel=1e-6)
    assert contact.contact_area == pytest.approx(area)
    assert contact.mean_gap == pytest.approx(0.0, abs=1e-9)


def test_a_rigid_base_holds_the_mean_of_a_periodic_wave():
    heights, cell = wave(32, across=32)
    area, nu = (32 * cell) ** 2, 0.3
    full = solve_height_field(Layer(1.0, nu, 0.5), None, heights, cell, normal_force=0.2 * area, periodic=True)
    assert full.mean_gap == pytest.approx(0.0, abs=1e-9)
    oedometric = (1 + nu) * (1 - 2 * nu) / (1 - nu)
    assert full.approach == pytest.approx(np.mean(heights) + 0.2 * 0.5 * oedometric, rel=1e-7)


def test_an_incompressible_layer_on_a_rigid_base_keeps_its_mean_height():
    heights, cell = wave(32, across=32)
    layer, mean = Layer(1.0, 0.5, 0.5), float(np.mean(heights))
    contact = solve_height_field(layer, None, heights, cell, approach=0.5 * mean, periodic=True)
    assert contact.mean_gap == pytest.approx(0.5 * mean, rel=1e-8)
    with pytest.raises(InvalidProblem, match="incompressible layer, whose surface keeps its mean height"):
        solve_height_field(layer, None, heights, cell, approach=1.5 * mean, periodic=True)


def test_light_contact_of_a_wave_is_hertz():
    heights, cell = wave(512, 0.01, 512)
    force = 2e-6
    contact = solve_height_field(HALF_SPACE, None, heights + heights.T, cell, normal_force=force, periodic=True)
    radius = 1.0 / (0.01 * (2.0 * np.pi) ** 2)
    exact = np.pi * (0.75 * force * radius / MODULUS) ** (2.0 / 3.0)
    # neighbours at 1 contribute in third order of a = 0.016
    assert abs(contact.contact_area - exact) <= contact.contact_area_error + 0.01 * exact


def test_a_layer_that_is_thin_against_the_period_answers_one_ball_as_it_does_alone():
    """On a rigid base the response fades within some thicknesses; approaches and gaps are those of the layer itself."""
    layer = Layer(1.0, 0.4, 0.05)
    heights, cell = paraboloid(192, 1.2)
    ball = solve(Problem(layer, (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("approach", (0.01,)))).balls[0]
    contact = solve_height_field(layer, None, heights, cell, approach=0.01, periodic=True)
    assert contact.normal_force == pytest.approx(ball.normal_force, rel=3e-3)
    assert abs(contact.contact_area - ball.contact_area) <= contact.contact_area_error + ball.errors["contact_area"]
    again = solve_height_field(layer, None, heights, cell, mean_gap=contact.mean_gap, periodic=True)
    assert again.approach == pytest.approx(0.01, rel=1e-5)
    assert np.mean(again.displacement) == pytest.approx(np.mean(contact.displacement), rel=1e-5)


def test_the_area_of_a_rough_surface_grows_with_the_load_and_less_than_in_proportion():
    rng = np.random.default_rng(1)
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(64) * 64, np.fft.fftfreq(64) * 64))
    shape = np.where((k > 0) & (k < 12), np.maximum(k, 1.0) ** -1.8, 0.0)
    heights = 0.05 * np.fft.ifft2(np.fft.fft2(rng.normal(size=(64, 64))) * shape).real
    forces = np.array([1e-4, 1e-3, 1e-2])
    area, error = contact_area_curve(HALF_SPACE, None, heights, 1.0 / 64, forces, periodic=True).T
    assert np.all(np.diff(area) > 0.0)
    assert np.all(np.diff(area / forces) < 0.0)
    assert np.all(error > 0.0)
    one = solve_height_field(HALF_SPACE, None, heights, 1.0 / 64, normal_force=1e-3, periodic=True)
    assert area[1] == one.contact_area


@pytest.mark.parametrize(("layer", "oedometric"), [(HALF_SPACE, 0.0), (Layer(1.0, 0.3, 0.5), 1.3 * 0.4 / 0.7)])
def test_a_flat_surface_that_repeats_has_a_uniform_pressure(layer, oedometric):
    flat = solve_height_field(layer, None, np.full((8, 8), 0.2), 0.1, normal_force=0.05 * 0.64, periodic=True)
    assert flat.pressure == pytest.approx(np.full((8, 8), 0.05), rel=1e-12)
    assert (flat.contact_area, flat.contact_area_error, flat.mean_gap) == (pytest.approx(0.64), 0.0, 0.0)
    assert flat.approach == pytest.approx(0.2 + 0.05 * 0.5 * oedometric, rel=1e-7)
    if oedometric:
        again = solve_height_field(layer, None, np.zeros((8, 8)), 0.1, approach=flat.approach - 0.2, periodic=True)
        assert again.normal_force == pytest.approx(0.05 * 0.64, rel=1e-7)


def test_a_grid_too_small_to_be_halved_starts_from_its_summit():
    heights = 1e-3 * np.random.default_rng(0).normal(size=(5, 7))
    contact = solve_height_field(Layer(1.0, 0.3, 0.5), None, heights, 0.1, normal_force=1e-4, periodic=True)
    assert contact.penetration_outside < 1e-7


def test_a_mean_gap_of_roundoff_is_refused_and_none_is_negative():
    heights, cell = wave(32, across=32)
    layer = Layer(1.0, 0.3, 0.5)
    assert solve_height_field(layer, None, heights, cell, normal_force=1.0, periodic=True).mean_gap >= 0.0
    with pytest.raises(InvalidProblem, match=r"mean_gap: must be at least .* contact is complete .*; give the force"):
        solve_height_field(layer, None, heights, cell, mean_gap=1e-18, periodic=True)
