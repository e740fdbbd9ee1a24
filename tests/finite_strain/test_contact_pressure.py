"""The written contact pressure: at every node of the top near the exact one, and as heavy as the balls' loads."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from finite_strain.accuracy.pairs import unpaired
from finite_strain.force.contact_area import contact_areas
from finite_strain.force.contact_pressure import excess
from finite_strain.output.top_surface import TopSurface
from linear_bem import Cone, Ellipsoid, Indenter, Problem, solve, solve_contact
from tests.finite_strain.scenes import (
    CUBIC,
    QUADRATIC,
    Rig,
    at_small_strain,
    coarse_plan,
    coarse_rig,
    pair,
    relatively,
    single,
)

if TYPE_CHECKING:
    from pathlib import Path

    from finite_strain.planning.records import Discretisation

SCENES = {
    "balls": pair(0.1, poisson=0.3, shape="paraboloid"),
    "incompressible": pair(0.1, poisson=0.5, shape="paraboloid"),
    "cone": single(0.1, poisson=0.3, shape=Cone(math.radians(20.0), 0.5)),
}


FINER = replace(CUBIC, fineness=1.5)


def augmented(problem: Problem, folder: Path, level: Discretisation) -> Rig:
    """Return a small-strain model in equilibrium with multipliers, as that of a run."""
    rig = coarse_rig(coarse_plan(problem, "small_strain", extent=None, accuracy=0.05), folder, level)
    *_, last = rig.press()
    assert rig.path.augment(last)
    rig.settle()
    return rig


@pytest.mark.parametrize(
    ("name", "level", "largest", "mean"),
    [("balls", CUBIC, 0.06, 0.02), ("incompressible", QUADRATIC, 0.16, 0.08), ("cone", FINER, 0.07, 0.006)],
)
def test_pressure_at_the_nodes_and_contact_area_are_those_of_the_linear_model(
    name: str, level: Discretisation, largest: float, mean: float, tmp_path: Path
) -> None:
    problem = at_small_strain(SCENES[name])
    model, solution = augmented(problem, tmp_path, level).model, solve_contact(problem)
    surface = TopSurface(model).gathered()
    assert surface is not None
    exact = solution.pressure(*surface.points[:, :2].T)
    off = np.abs(surface.pressure - exact) / exact.max()
    assert np.count_nonzero(exact) > 50
    assert off.max() < largest  # at the edge, where the slope is infinite
    assert math.sqrt(np.mean(off[exact > 0.0] ** 2)) < mean
    assert contact_areas(model)[0] == relatively(solution.contacts.contact_areas[0], 0.02)


@pytest.mark.parametrize(("name", "level"), [("balls", CUBIC), ("balls", QUADRATIC), ("cone", FINER)])
def test_the_error_of_a_peak_without_a_pair_covers_that_of_the_mean_around_its_vertex(
    name: str, level: Discretisation, tmp_path: Path
) -> None:
    problem = at_small_strain(SCENES[name])
    own = augmented(problem, tmp_path, level).run.state(1.0)
    exact, bar = solve(problem, 1e-4).balls[0].peak_pressure, unpaired(own).peak_transfer[0] * own.peak_pressure[0]
    assert 1.0 < bar / (exact - own.peak_pressure[0]) < 7.0


@pytest.mark.parametrize("lowered", [1.0 / 3.0, 5.0 / 6.0], ids=["at a vertex", "in the middle of an element"])
def test_the_excess_covers_a_smooth_peak_wherever_it_lies_in_its_element(lowered: float) -> None:
    for curvature in (0.01, 0.1):  # of the pressure, times the square of the element's width: second moments of hats
        means = 1.0 - curvature * (lowered + 2.0 / 3.0 * np.arange(3.0))
        exact = 1.0 / means[0] - 1.0
        assert exact <= excess(means[:, None])[0] <= 3.0 * exact


@pytest.mark.parametrize(
    "shape",
    ["sphere", "paraboloid", Cone(math.radians(30.0), 0.3), Ellipsoid((0.6, 0.6, 1.2))],
    ids=["sphere", "paraboloid", "cone", "ellipsoid"],
)
def test_pressure_on_the_deformed_surface_carries_the_normal_force(shape: str | Indenter, tmp_path: Path) -> None:
    problem = single(0.25, thickness=1.5, poisson=0.3, shape=shape)
    rig = coarse_rig(coarse_plan(problem), tmp_path, CUBIC)
    *_, last = rig.press()
    assert rig.path.augment(last)
    rig.settle()
    surface = TopSurface(rig.model).gathered()
    assert surface is not None
    a, b, c = surface.points[surface.triangles].transpose(1, 0, 2)
    seen = 0.5 * np.cross(b - a, c - a)[:, 2]
    carried = float(surface.pressure[surface.triangles].mean(axis=1) @ seen)
    assert carried == relatively(rig.normal_forces()[0], 0.03)  # flat triangles, and a kink at the edge
