"""The plan of a run, without DOLFINx."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise

import pytest

import finite_strain
from finite_strain import Numerics
from finite_strain.geometry.extent import choose_extent
from finite_strain.geometry.load_control import prescribed
from finite_strain.planning.cost import FORCE_SECONDS, START_SECONDS, speedup
from finite_strain.planning.forecast import LEAST, SCATTER, chances, first_error, forecast, likely
from finite_strain.planning.refinement import PATH_FINDER, Budget
from finite_strain.planning.run_plan import plan_run
from linear_bem import Ball, Elastic, Load, Punch
from tests.finite_strain.scenes import (
    CUBIC,
    QUADRATIC,
    STIFF_SUBSTRATE,
    balls_at,
    on_layer,
    pair,
    relatively,
)
from tests.launch import python

KEYS = {
    "forms",
    "linear_solver",
    "symmetries",
    "unknowns",
    "meshes",
    "accuracy",
    "memory_bytes",
    "memory_bytes_at_most",
    "processor_memory_bytes",
    "seconds",
    "processor_seconds",
    "seconds_of_meshes",
    "processor_seconds_of_meshes",
    "domain",
    "load_steps",
}
"""What the command ``plan`` prints."""
LARGEST_STEP = Numerics().largest_step


@pytest.mark.parametrize("kind", ["approach", "force", "total_force"])
@pytest.mark.parametrize("deepest", [0.001, 0.0125, 0.05, 0.3, 0.8])
def test_load_fractions_increase_to_one_in_steps_that_newton_can_follow(kind: str, deepest: float) -> None:
    load = prescribed(pair(0.1).with_load(kind, (0.1,) if kind == "total_force" else (0.1, 0.1)))
    fractions = load.fractions(deepest, (1.0,), LARGEST_STEP)
    assert fractions[-1] == 1.0
    assert all(0.0 < a < b for a, b in pairwise(fractions))
    power = 1.0 if kind == "approach" else 2.0 / 3.0
    approaches = [0.0] + [deepest * f**power for f in fractions]
    steps = [b - a for a, b in pairwise(approaches)]
    assert max(steps) <= LARGEST_STEP * (1.0 + 1e-12)
    assert max(steps) == pytest.approx(min(steps))
    assert len(steps) == max(math.ceil(deepest / LARGEST_STEP), 1)


def test_the_order_of_the_balls_does_not_change_the_load_path() -> None:
    balls = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((7.0, 0.0), 10.0, "paraboloid"))
    for load in (Load("approach", (0.2, 0.2)), Load("force", (0.17, 1.4)), Load("total_force", (1.0,))):
        paths = []
        for turn in (1, -1):
            values = load.values[::turn]
            problem = on_layer(balls[::turn], Load(load.kind, values), 2.0, poisson=0.45)
            plan = plan_run(problem, 0.1, "finite_strain")
            paths.append((plan.path, plan.unknowns(CUBIC)))
        assert paths[0][0] == paths[1][0]
        assert paths[0][1] == pytest.approx(paths[1][1])
        deepest = max(e.approach / b.radius for b, e in zip(balls, prescribed(problem).expected()[::-1], strict=True))
        power = 1.0 if load.kind == "approach" else 2.0 / 3.0
        assert paths[0][0][0] ** power * deepest <= LARGEST_STEP  # the smaller ball's own first step


def test_requested_steps_are_answered_on_a_path_that_newton_can_follow() -> None:
    problem = pair(0.2)
    usual = plan_run(problem, 0.02, "finite_strain")
    assert usual.goals == (1.0,)
    # one load alone does not show the error: more of them are compared
    assert usual.loads == (0.7, 0.85, 1.0)
    assert usual.path == prescribed(problem).fractions(0.2, usual.loads, LARGEST_STEP)
    asked = plan_run(problem, 0.02, "finite_strain", steps=(0.3, 0.77, 1.0))
    assert asked.goals == asked.loads == (0.3, 0.77, 1.0)
    # two loads a roundoff apart would be one to the load path: the asked one stays
    near = plan_run(problem, 0.02, "finite_strain", steps=(0.7000000000000001, 1.0))
    assert near.loads == (0.7000000000000001, 0.85, 1.0)
    # light loads say nothing about full load
    light = plan_run(problem, 0.02, "finite_strain", steps=(0.01, 0.1, 1.0))
    assert light.loads == (0.01, 0.1, 0.7, 0.85, 1.0)
    forces = plan_run(problem.with_load("force", (0.1, 0.1)), 0.02, "finite_strain")
    assert forces.nearby == light.nearby**1.5
    assert asked.path == prescribed(problem).fractions(0.2, asked.goals, LARGEST_STEP)
    assert set(asked.goals) <= set(asked.path)
    assert list(asked.path) == sorted(asked.path)
    every = plan_run(problem, 0.02, "finite_strain", steps=None)
    assert every.goals == prescribed(problem).answered_fractions()
    assert every.path == every.goals  # close enough to follow


def test_higher_orders_finer_meshes_and_wider_domains_have_more_unknowns() -> None:
    plan = plan_run(pair(0.1, substrate=STIFF_SUBSTRATE), 0.02, "finite_strain")
    levels = [QUADRATIC, CUBIC, replace(CUBIC, fineness=2.0), replace(CUBIC, fineness=3.0)]
    unknowns = [plan.unknowns(level) for level in levels]
    assert all(a < b for a, b in pairwise(unknowns))
    assert plan.unknowns(replace(CUBIC, extent=2.0)) > unknowns[1]
    boxes = [plan.box(level) for level in levels]
    # finer meshes fill the same box, and a domain twice as wide is twice as wide beyond the balls
    assert all(
        (box.x, box.y, box.substrate, box.zones) == (boxes[0].x, boxes[0].y, boxes[0].substrate, boxes[0].zones)
        for box in boxes
    )
    wide = plan.box(replace(CUBIC, extent=2.0))
    assert wide.substrate == pytest.approx(2.0 * boxes[0].substrate)
    assert wide.x[1] - 1.0 == pytest.approx(2.0 * (boxes[0].x[1] - 1.0))


@pytest.mark.parametrize(
    ("share", "meshes", "others"), [(4.0, 2, []), (2.2, 2, [3]), (1.2, 2, [3]), (0.8, 3, [2, 4]), (0.4, 3, [2, 4])]
)
def test_another_number_of_meshes_is_named_where_the_expected_error_is_near_what_was_asked(
    share: float, meshes: int, others: list[int]
) -> None:
    plan = plan_run(pair(0.1), 0.02, "finite_strain")
    said = forecast(replace(plan, accuracy=share * first_error(plan)))
    assert len(said["seconds_of_meshes"]) == meshes
    assert [other["meshes"] for other in said.get("perhaps", [])] == others
    for other in said.get("perhaps", []):
        assert LEAST <= other["chance"] <= 0.5
        for key in ("seconds", "processor_seconds", "memory_bytes", "processor_memory_bytes"):
            assert (other[key] > said[key]) == (other["meshes"] > meshes)


def test_chances_of_numbers_of_meshes_are_those_of_the_scatter() -> None:
    plan = plan_run(pair(0.1), 0.02, "finite_strain")
    even = replace(plan, accuracy=first_error(plan))
    assert chances(even)[1] == (CUBIC, pytest.approx(0.5))
    assert sum(chance for _, chance in chances(even)) == pytest.approx(1.0)
    # one standard deviation below: 0.84 need another mesh
    finer = replace(plan, accuracy=first_error(plan) * math.exp(-SCATTER))
    assert chances(finer)[1][1] == pytest.approx(0.1587, abs=1e-4)
    few = replace(finer, budget=Budget(unknowns=1.01 * plan.unknowns(CUBIC)))
    assert chances(few)[1:] == ((CUBIC, 1.0),)
    assert likely(chances(few)) == (PATH_FINDER, CUBIC)


def test_a_holder_that_moves_three_balls_costs_one_unknown_approach() -> None:
    balls = balls_at((0.0, 0.0), (2.5, 0.3), (0.4, 2.8))
    plans = [
        plan_run(on_layer(balls, load), 0.3, "finite_strain")
        for load in (Load("total_force", (0.15,)), Load("force", (0.05,) * 3))
    ]
    held, free = (forecast(plan)["processor_seconds"] - START_SECONDS for plan in plans)
    assert held / free == relatively((1.0 + FORCE_SECONDS) / (1.0 + 3.0 * FORCE_SECONDS), 1e-9)


EXTENT_SCENES = {
    "approach": pair(0.1),
    "force": pair(Load("force", (0.01, 0.01))),
    "stiff substrate": pair(0.1, substrate=STIFF_SUBSTRATE),
    "as soft": pair(Load("force", (0.01, 0.01)), substrate=Elastic(1.0, 0.48)),
    "thick": pair(Load("force", (0.01, 0.01)), thickness=6.0),
    "one ball": on_layer(balls_at((0.0, 0.0)), Load("approach", (0.1,))),
}


@pytest.mark.parametrize("name", EXTENT_SCENES)
def test_the_box_grows_with_the_requested_accuracy(name: str) -> None:
    problem = EXTENT_SCENES[name]
    expected = prescribed(problem).expected()
    extents = [choose_extent(problem, expected, accuracy) for accuracy in (0.3, 0.1, 0.02, 0.005, 0.001)]
    for coarse, fine in pairwise(extents):
        assert coarse.margin <= fine.margin
        assert coarse.depth <= fine.depth
    assert all((extent.depth > 0.0) == (problem.substrate is not None) for extent in extents)
    if name in ("force", "as soft", "thick"):
        assert extents[0].margin < extents[-1].margin
    for extent in extents:  # wide enough for the contacts and the layer in any case
        assert extent.margin >= max(1.2 * problem.layer.thickness, *(3.0 * each.contact_radius for each in expected))


def test_the_box_is_cut_at_mirror_planes() -> None:
    for substrate in (None, STIFF_SUBSTRATE):
        box = plan_run(pair(0.1, substrate=substrate), 0.02, "finite_strain").box(CUBIC)
        assert (box.x[0], box.y[0]) == (0.0, 0.0)
        assert box.x[1] - 1.0 == pytest.approx(box.y[1])
        assert (box.substrate > 0.0) == (substrate is not None)
        (zone,) = box.zones
        assert zone.position == (1.0, 0.0)


def test_blocks_of_neighbouring_balls_do_not_overlap() -> None:
    balls = balls_at((0.0, 0.0), (2.2, 0.0), (0.0, 3.0))
    zones = plan_run(on_layer(balls, Load("approach", (0.1,) * 3)), 0.02, "finite_strain").box(CUBIC).zones
    assert len(zones) == 3
    for i, a in enumerate(zones):
        for b in zones[i + 1 :]:
            apart = max(abs(a.position[k] - b.position[k]) for k in (0, 1))
            assert a.half_width + b.half_width <= apart * (1.0 + 1e-12)


def test_the_plan_is_complete_and_holds_plain_numbers() -> None:
    answer = finite_strain.plan(pair(0.2), 0.1, steps=(0.5, 1.0))
    assert set(answer) == KEYS
    assert json.loads(json.dumps(answer)) == answer
    assert len(answer["symmetries"]) == 2
    assert answer["unknowns"] > 1000
    assert answer["load_steps"] == 2
    assert answer["accuracy"] == {"asked": 0.1, "unknowns_at_most": 120e3, "seconds_at_most": None}
    assert len(answer["meshes"]) >= 3
    assert answer["domain"]["layer"] == 1.16
    assert 1e8 < answer["memory_bytes"] < answer["memory_bytes_at_most"] < 1e11
    assert 1.0 < answer["seconds"] < 1e5


BLOCKED = """
import sys
for name in ("dolfinx", "ufl", "basix", "petsc4py", "mpi4py", "gmsh", "h5py"):
    sys.modules[name] = None
import finite_strain
from tests.finite_strain.scenes import pair
"""


def test_a_plan_needs_no_dolfinx() -> None:
    done = python("-c", BLOCKED + "print(finite_strain.plan(pair(0.1))['unknowns'])")
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == pytest.approx(finite_strain.plan(pair(0.1))["unknowns"], rel=0.3)


def test_a_run_without_dolfinx_names_what_is_missing() -> None:
    code = """
from linear_bem.errors import MissingDependency
try:
    finite_strain.solve(pair(0.1))
except MissingDependency as error:
    print(error)
"""
    done = python("-c", BLOCKED + code)
    assert done.returncode == 0, done.stderr
    for word in ("dolfinx", "petsc4py", "mpi4py", "gmsh", "h5py", "thirdbody doctor"):
        assert word in done.stdout


@pytest.mark.parametrize("approach", [0.02, 0.1])
def test_the_mesh_of_a_punch_follows_its_edge_at_any_load(approach: float) -> None:
    sharp, blunt = Punch(0.5, 0.02), Punch(0.5, 0.15)
    for punch in (sharp, blunt):
        problem = on_layer(balls_at((-1.0, 0.0), (1.0, 0.0), shape=punch), Load("approach", (approach, approach)))
        box = plan_run(problem, 0.1, "finite_strain", steps=(0.1, 1.0)).box(CUBIC)
        radii, heights = box.rings(box.zones[0])[0], box.levels()[0]
        flat, rounding = punch.edge
        assert min(abs(radii - flat)) < 1e-12
        beside = radii[(radii > flat - 2.5 * rounding) & (radii < flat + 2.5 * rounding)]
        assert len(beside) >= 3  # a line on either side of it
        assert -heights[1] < 2.0 * rounding


def test_two_ranks_gain_little_on_a_small_mesh_and_nearly_all_on_a_large_one() -> None:
    measured = {5.6e3: 1.12, 17e3: 1.55, 39e3: 1.96}
    assert [speedup(unknowns, 2) for unknowns in measured] == pytest.approx(list(measured.values()), rel=0.1)
    assert speedup(39e3, 1) == 1.0
    assert speedup(39e3, 4) == pytest.approx(speedup(39e3, 2) ** 2)
