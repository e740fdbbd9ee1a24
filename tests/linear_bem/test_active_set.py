"""Contacts on grids that conjugate gradients solve while the contact is held."""

import numpy as np
import pytest

from linear_bem import Elastic, Layer, solve_height_field


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


def test_complete_contact_is_solved_while_it_is_held(monkeypatch):
    """The mean pressure of a periodic surface in complete contact is free: its equations are singular."""
    monkeypatch.setattr("linear_bem.grid.polonsky_keer.HOPELESS", 0)
    angle = 2.0 * np.pi * np.arange(32) / 32
    heights = 1e-3 * (np.cos(angle)[:, None] + np.cos(3.0 * angle))
    layer, base = Layer(1e3, 0.3, 0.05), Elastic(1.0, 0.3)
    contact = solve_height_field(layer, base, heights, 1.0 / 32, periodic=True, normal_force=5.0)
    assert contact.contact_area == pytest.approx(1.0)
    assert contact.gap_in_contact < 1e-8
