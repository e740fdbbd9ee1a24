"""The size field, on any machine: no gmsh here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshes.box import Box, Zone
from tests.meshes.conftest import BOXES

ROUNDOFF = 1e-14


def test_size_grows_by_its_two_rates_and_is_continuous_between_them() -> None:
    zone = Zone((0.0, 0.0), finest=0.1, growth=0.2, radius=1.0, outer_growth=0.5, mirror=0.0)
    sizes = zone.size(np.array([0.0, 0.5, 1.0, 1.0 + 1e-9, 3.0]))
    assert sizes[:3] == pytest.approx([0.1, 0.2, 0.3], abs=ROUNDOFF)
    assert sizes[3] == pytest.approx(0.3, abs=1e-9)
    assert sizes[4] == pytest.approx(0.3 + 0.5 * 2.0, abs=ROUNDOFF)


def test_each_point_gets_the_smallest_size_that_any_ball_or_the_ceiling_asks_for() -> None:
    left = Zone((-1.0, 0.0), 0.1, 0.3, 0.5, 0.3, 0.0)
    right = Zone((1.0, 0.0), 0.05, 0.3, 0.5, 0.3, 0.0)
    box = Box((-9.0, 9.0), (-9.0, 9.0), 1.0, 0.0, (left, right), coarsest=1.5)
    points = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, -1.0], [9.0, 9.0, 0.0]])
    assert box.element_size(points) == pytest.approx([0.1, 0.05, 0.35, 0.35, 1.5], abs=ROUNDOFF)


def test_twice_the_size_needs_an_eighth_of_the_tetrahedra() -> None:
    box = BOXES["one ball"]
    (zone,) = box.zones
    double = replace(zone, finest=2 * zone.finest, growth=2 * zone.growth, outer_growth=2 * zone.outer_growth)
    coarse = replace(box, zones=(double,), coarsest=2 * box.coarsest)
    # discretisation: the integral of the size field is sampled on different nodes
    assert box.estimated_tetrahedra() / coarse.estimated_tetrahedra() == pytest.approx(8.0, rel=0.05)


def test_the_estimate_does_not_depend_on_how_finely_it_is_sampled() -> None:
    for box in BOXES.values():
        # discretisation: a midpoint rule on graded nodes
        assert box.estimated_tetrahedra(60) == pytest.approx(box.estimated_tetrahedra(120), rel=0.05)
