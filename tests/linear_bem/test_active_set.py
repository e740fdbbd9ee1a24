"""Contacts on grids that conjugate gradients solve while the contact is held."""

import numpy as np
import pytest
from scipy.optimize import nnls

from linear_bem import Elastic, Layer, LayeredKernel, solve_height_field
from linear_bem.grid.patches import Patch, Patches
from linear_bem.grid.polonsky_keer import solve_bounded


def film(count):
    """A sphere on a film that is 1000 times as stiff as its base: conjugate gradients stall from 128 cells on."""
    x = 1.5 * ((np.arange(count) + 0.5) / count - 0.5)
    return (
        Layer(1e3, 0.3, 0.05),
        Elastic(1.0, 0.3),
        1.0 - np.sqrt(np.maximum(1.0 - x[:, None] ** 2 - x**2, 0.0)),
        1.5 / count,
    )


def test_a_stiff_film_on_which_conjugate_gradients_stall_is_solved():
    coarse, fine = solve_height_field(*film(64), approach=0.3), solve_height_field(*film(160), approach=0.3)
    assert max(fine.gap_in_contact, fine.penetration_outside) < 1e-8
    assert fine.normal_force == pytest.approx(coarse.normal_force, rel=3e-4)
    again = solve_height_field(*film(160), normal_force=fine.normal_force)
    assert again.approach == pytest.approx(0.3, rel=1e-7)
    assert np.array_equal(again.pressure > 0.0, fine.pressure > 0.0)


def test_shorter_steps_spare_most_rough_films_the_active_set():
    """Held contacts need 272 to 352 steps on the finest grid, shortened ones 116 to 144."""
    number = np.hypot(np.fft.fftfreq(64, 1.0 / 64)[:, None], np.fft.fftfreq(64, 1.0 / 64))
    size = np.where((number >= 2.0) & (number <= 8.0), np.maximum(number, 1.0) ** -1.8, 0.0)
    taken = 0
    for seed in range(3):
        heights = np.fft.ifft2(size * np.exp(2j * np.pi * np.random.default_rng(seed).random((64, 64)))).real
        heights *= 1e-2 / np.std(heights)
        film = Layer(300.0, 0.48, 0.07), Elastic(1.0, 0.3)
        taken += solve_height_field(*film, heights, 1.0 / 64, periodic=True, normal_force=0.3).iterations
    assert taken < 600


def test_complete_contact_is_solved_while_it_is_held(monkeypatch):
    """The mean pressure of a periodic surface in complete contact is free: its equations are singular."""
    monkeypatch.setattr("linear_bem.grid.polonsky_keer.HOPELESS", 0)
    angle = 2.0 * np.pi * np.arange(32) / 32
    heights = 1e-3 * (np.cos(angle)[:, None] + np.cos(3.0 * angle))
    layer, base = Layer(1e3, 0.3, 0.05), Elastic(1.0, 0.3)
    contact = solve_height_field(layer, base, heights, 1.0 / 32, periodic=True, normal_force=5.0)
    assert contact.contact_area == pytest.approx(1.0)
    assert contact.gap_in_contact < 1e-8


@pytest.mark.parametrize("patience", [-1, 10**6], ids=["held", "free"])
@pytest.mark.parametrize("force", [None, 0.3], ids=["approach", "force"])
def test_pressures_are_those_of_non_negative_least_squares(patience, force, monkeypatch):
    """At an approach D, p minimises p K p/2 - p (D - f) over p >= 0, cell by cell."""
    monkeypatch.setattr("linear_bem.grid.polonsky_keer.HOPELESS", patience)
    _, base, heights, cell = film(20)
    kernel = LayeredKernel(Layer(30.0, 0.3, 0.05), base)
    patch = Patch(kernel, (0.0, 0.0), cell, 20, 20, (0,))
    groups = [] if force is None else [([0], force * kernel.singular)]
    start, first = np.maximum(0.3 - heights, 0.0), np.array([0.3])
    state = solve_bounded(Patches(kernel, [patch]), [heights[None]], [start], first, groups, 1e-11)
    matrix = np.array([patch.displacement(unit.reshape(20, 20)).ravel() for unit in np.eye(400)])
    root = np.linalg.cholesky(matrix)
    pressure = nnls(root.T, np.linalg.solve(root, state.approaches[0] - heights.ravel()))[0]
    assert 0.1 < np.mean(pressure > 0.0) < 0.5
    assert state.pressures[0].ravel() == pytest.approx(pressure, abs=1e-7 * np.max(pressure))
    if force is not None:
        assert np.sum(pressure) * cell**2 == pytest.approx(force * kernel.singular, rel=1e-8)
