"""Prescribed forces: met exactly, at the right approach, at little more cost than prescribed approaches."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import finite_strain
from finite_strain.geometry.estimates import alone, radius_seen
from finite_strain.geometry.load_control import LARGEST_APPROACH, prescribed
from finite_strain.geometry.symmetry import reduce_scene
from finite_strain.planning.forecast import forecast
from finite_strain.planning.run_plan import plan_run
from linear_bem import Ball, Elastic, FiniteStrain, InvalidProblem, Layer, Load, Problem, UnsupportedProblem
from linear_bem.closed_forms import indentation_of_layer
from linear_bem.indenter import Cone, HeightFunction, Indenter
from tests.finite_strain.scenes import (
    COARSER,
    UNEQUAL,
    Rig,
    coarse_plan,
    coarse_rig,
    on_layer,
    pair,
    relatively,
    single,
)

if TYPE_CHECKING:
    from pathlib import Path

FORCE = 1e-8
"""Relative error of a prescribed force after Newton's method."""
PENALTY = 2e-4
"""Relative error of an approach: a tenth of the penetration, as the penalty depends on the first estimate."""
DEARER = 1.3
"""Largest number of tangents of a path by forces, over that of the same path by approaches."""
PATH = [0.3, 0.6, 1.0]


def pressed(
    problem: Problem, folder: Path, path: list[float] | None = None, meshed_for: Problem | None = None
) -> tuple[Rig, int]:
    """Return a rig at full load on the mesh of some load, and the number of tangents of its path."""
    plan = coarse_plan(meshed_for or problem)
    rig = coarse_rig(replace(plan, problem=problem), folder)
    records = rig.press(path or PATH)
    assert rig.path.augment(records[-1])
    return rig, sum(record.tangents for record in records)


@pytest.mark.parametrize("poisson", [0.3, 0.4999], ids=["displacement form", "mixed form"])
def test_a_prescribed_force_is_met_at_the_right_approach(
    poisson: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    problem = pair(0.1, poisson=poisson)
    by_approach, tangents = pressed(problem, tmp_path_factory.mktemp("approach"), [f ** (2 / 3) for f in PATH])
    (force,) = by_approach.normal_forces()
    by_force, more = pressed(
        problem.with_load("force", (force, force)), tmp_path_factory.mktemp("force"), None, problem
    )
    assert by_force.normal_forces() == relatively([force], FORCE)
    assert by_force.model.contact.approaches == relatively([0.1], PENALTY)
    assert np.abs(by_force.model.nodal - by_approach.model.nodal).max() < 0.01 * 0.1
    assert more <= DEARER * tangents


def test_every_step_of_a_path_meets_its_fraction_of_the_force(tmp_path: Path) -> None:
    problem = pair(Load("force", (0.05, 0.05)), poisson=0.3)
    rig = coarse_rig(coarse_plan(problem), tmp_path)
    for record in rig.path.steps(PATH):
        rig.settle()
        assert rig.normal_forces() == relatively([record.fraction * 0.05], FORCE)
        # and with multipliers, too
        assert rig.path.augment(record)
        assert rig.normal_forces() == relatively([record.fraction * 0.05], FORCE)


def test_unequal_forces_find_an_approach_each(tmp_path_factory: pytest.TempPathFactory) -> None:
    by_approach, _ = pressed(UNEQUAL, tmp_path_factory.mktemp("approach"))
    forces = by_approach.normal_forces()
    by_force, _ = pressed(UNEQUAL.with_load("force", forces), tmp_path_factory.mktemp("force"), None, UNEQUAL)
    assert by_force.normal_forces() == relatively(forces, FORCE)
    assert by_force.model.contact.approaches == relatively([0.1, 0.08], PENALTY)


def test_one_total_force_on_unequal_balls_is_shared_at_a_common_approach(tmp_path: Path) -> None:
    balls = (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 0.7, "sphere"))
    rig, _ = pressed(on_layer(balls, Load("total_force", (0.1,)), poisson=0.3), tmp_path)
    forces, approaches = rig.normal_forces(), rig.model.contact.approaches
    assert forces.sum() == relatively(0.1, FORCE)
    assert forces[0] > forces[1] > 0.0
    assert approaches[0] == approaches[1]


def test_one_total_force_on_mirrored_balls_is_shared_equally(tmp_path_factory: pytest.TempPathFactory) -> None:
    total, _ = pressed(pair(Load("total_force", (0.1,)), poisson=0.3), tmp_path_factory.mktemp("total"))
    each, _ = pressed(pair(Load("force", (0.05, 0.05)), poisson=0.3), tmp_path_factory.mktemp("each"))
    assert total.normal_forces() == relatively([0.05], FORCE)
    assert total.model.contact.approaches == relatively(each.model.contact.approaches, PENALTY)


def test_the_initial_approaches_are_those_of_single_balls() -> None:
    problem = replace(UNEQUAL, load=Load("force", (0.05, 0.02)))
    control = prescribed(problem).on(reduce_scene(problem))
    alone = [
        indentation_of_layer(problem.layer, None, radius, normal_force=0.5 * force).approach
        for radius, force in ((1.0, 0.05), (0.8, 0.02))
    ]
    assert control.approaches(0.5) == relatively(alone, 0.05)  # the closed form is for a paraboloid
    # half of each ball is simulated
    assert 0.5 * control.full == relatively([0.5 * 0.025, 0.5 * 0.01], 1e-12)
    assert np.array_equal(control.moves, np.eye(2))
    shared = replace(problem, load=Load("total_force", (0.07,)))
    control = prescribed(shared).on(reduce_scene(shared))
    assert control.full == relatively([0.035], 1e-12)
    assert np.array_equal(control.moves, np.ones((2, 1)))
    given = prescribed(UNEQUAL).on(reduce_scene(UNEQUAL))
    assert given.moves.shape == (2, 0)
    assert given.full.shape == (0,)
    assert given.approaches(0.5) == relatively([0.05, 0.04], 1e-12)


def test_a_body_with_steep_flanks_may_be_pressed_far_deeper_than_its_apex_radius() -> None:
    body = HeightFunction(1e-6, lambda x, y: 1e15 * np.maximum(np.sqrt(x**2 + y**2) - 1e-5, 0.0))
    assert radius_seen(body, 1e-3) == relatively(0.5 * 1e-5**2 / 1e-3, 1e-6)


@pytest.mark.parametrize("approach", [0.01, 0.1, 0.3, 0.5, 1.0])
def test_the_section_of_a_wavy_body_ends_at_its_first_rise(approach: float) -> None:
    body = HeightFunction(1.0, lambda x, y: 1.0 - np.cos(x) + 0.5 * y**2)
    assert radius_seen(body, approach) == relatively(np.arccos(1.0 - approach) / (2.0 * approach) ** 0.5, 1e-9)


@pytest.mark.parametrize(
    ("slope", "approach", "overlap"),
    [(20.0, 0.3, False), (20.0, 0.34, True), (45.0, 0.4, False)],  # the flanks of the first meet at 0.3384
)
def test_bodies_that_overlap_at_the_surface_are_refused_at_finite_strain_alone(
    slope: float, approach: float, overlap: bool
) -> None:
    cone = Cone(math.radians(slope), 0.2)
    balls = tuple(Ball((x, 0.3), cone.apex_radius, cone) for x in (-1.0, 1.0))
    problem = Problem(Layer(1.0, 0.48, 2.0), balls, Load("approach", (approach,) * 2), None, FiniteStrain())
    faults = prescribed(problem).faults("finite_strain")
    assert [fault for fault in faults if "0 and 1 do, by" in fault] == (faults if overlap else [])
    assert bool(faults) == overlap
    assert prescribed(replace(problem, finite_strain=None)).faults("small_strain") == []


def test_a_force_that_presses_through_the_layer_is_planned_as_the_deepest_approach() -> None:
    problem = replace(pair(0.1).with_load("force", (6.0, 6.0)), substrate=Elastic(1e6, 0.3))
    plan = plan_run(problem, 0.1, "finite_strain")
    assert [state.approach for state in plan.expected] == pytest.approx([LARGEST_APPROACH * 1.16] * 2, rel=1e-4)
    assert forecast(plan)["seconds"] > 0.0
    with pytest.raises(InvalidProblem, match=r"^load\.force\[0\]: must press a ball less deep than 2 times"):
        plan_run(replace(problem, substrate=None).with_load("force", (50.0, 50.0)), 0.1, "finite_strain")
    soft = replace(problem, substrate=Elastic(1.0, 0.48)).with_load("force", (1.0, 1.0))  # the base gives most of it
    expected = plan_run(soft, 0.1, "finite_strain").expected
    assert expected == tuple(alone(soft, ball, normal_force=1.0) for ball in soft.balls)


def test_an_approach_beyond_the_layer_is_refused_if_the_layer_takes_most_of_it() -> None:
    soft, stiff = (replace(single(0.25, thickness=0.25), substrate=Elastic(young, 0.4)) for young in (0.1, 1e3))
    assert prescribed(soft).faults("finite_strain") == []
    said = r"below 0\.9 of the layer's thickness, 0\.225 m, got 0\.25 m, of which the layer takes about 0\.24\d m$"
    for deeper in (1.0, 4.0):
        problem = replace(stiff, load=Load("approach", (deeper * 0.25,)))
        (fault,) = prescribed(problem).faults("finite_strain")
        assert deeper > 1.0 or re.search(said, fault)


def test_forces_under_which_contacts_would_meet_are_refused() -> None:
    problem = pair(0.1, thickness=3.0, shape="paraboloid").with_load("force", (4.0, 4.0))
    with pytest.raises(UnsupportedProblem, match=r"^load\.force, balls\.positions: the contacts of balls 0 and 1"):
        plan_run(replace(problem, finite_strain=FiniteStrain()), 0.1, "finite_strain")


class Long(Indenter):
    """A paraboloid whose sections are seven times as long as wide."""

    apex_radius = 2.0

    def height(self, x: Any, y: Any) -> Any:
        return 0.5 * (x**2 / 14.0 + 3.5 * y**2)


def test_forces_on_long_bodies_are_refused_where_their_contacts_meet_along_the_line_between_them() -> None:
    side_by_side, in_a_row = (
        pair(Load("force", (0.06, 0.06)), distance=0.7, shape=Long(), angle=angle) for angle in (0.5 * math.pi, 0.0)
    )
    plan_run(side_by_side, 0.1, "finite_strain")  # round contacts of equal area have a radius of 0.4
    with pytest.raises(UnsupportedProblem, match=r"extend about (.*) and \1 m towards each other, .* distance of 0\.7"):
        plan_run(in_a_row, 0.1, "finite_strain")
    beyond = pair(Load("force", (0.2, 1e-5)), distance=0.9, shape=Long())  # one contact passes the other's axis
    with pytest.raises(UnsupportedProblem, match=r"extend about 1\.58 and 0\.0598 m towards each other"):
        plan_run(beyond, 0.1, "finite_strain")


def test_a_path_of_forces_ends_with_its_key_where_the_layer_ends(tmp_path: Path) -> None:
    problem = pair(0.1).with_load("force", (7.0, 7.0))
    with pytest.raises(
        UnsupportedProblem, match=r"^load\.force: .* 0\.9 of the layer's thickness \(1\.16 m\), got 7 N, of which 93 %"
    ):
        finite_strain.solve(problem, accuracy=0.3, numerics=COARSER, folder=tmp_path)


@pytest.mark.parametrize(("given_by_layer", "ended"), [(0.96, False), (1.0, True)])  # 0.85 of the thickness: 0.986 m
def test_what_the_base_gives_under_all_balls_does_not_end_a_path(given_by_layer: float, ended: bool) -> None:
    problem = pair(Load("force", (0.5, 0.5)), substrate=Elastic(0.91, 0.3))
    force, balls = 0.3, reduce_scene(problem).balls
    own, other = 0.75 * force / 1.16, force / (2.0 * math.pi)
    said = prescribed(problem).ended_by(0.6, [given_by_layer + own + other], balls)
    assert said.startswith("load.force: finite elements take forces") == ended


def test_touching_balls_do_not_overlap_however_deep() -> None:
    for approach in (0.5, 1.0, 1.6):
        assert prescribed(pair(approach, thickness=2.0)).faults("finite_strain") == []
