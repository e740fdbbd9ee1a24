"""Contacts that a grid must take: unequal balls under one holder, contacts that merge, balls that lift."""

import numpy as np
import pytest

from linear_bem import Ball, Elastic, Layer, Load, Problem, solve_contact
from linear_bem.grid_contact import GridContacts


@pytest.mark.parametrize(("radius", "distance"), [(10.0, 7.0), (100.0, 20.0)])
@pytest.mark.parametrize("substrate", [Elastic(1e3, 0.3), None])
def test_unequal_balls_under_one_holder_agree_with_their_common_approach_prescribed(radius, distance, substrate):
    """Cells differ up to tenfold in side; under a prescribed approach there is no force to keep (and polynomials for 10:1)."""
    balls = (Ball((0.0, 0.0), radius), Ball((distance, 0.0), 1.0))
    held = Problem(Layer(1.0, 0.48, 1.16), balls, Load("total_force", (0.5,)), substrate)
    together = solve_contact(held, 1e-3)
    assert isinstance(together.contacts, GridContacts)
    assert together.contacts.iterations < 20
    depth = float(together.contacts.approaches[0])
    apart = solve_contact(held.with_load("approach", (depth, depth)), 1e-4)
    assert np.sum(together.contacts.normal_forces) == pytest.approx(0.5, rel=1e-10)
    assert together.contacts.normal_forces == pytest.approx(apart.contacts.normal_forces, rel=5e-4)
    size = np.max(np.abs(apart.contacts.mutual_force))
    assert together.contacts.mutual_force == pytest.approx(apart.contacts.mutual_force, abs=1e-3 * size)
