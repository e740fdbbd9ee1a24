"""What will be run, and what is refused: answered without DOLFINx."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import numpy as np
import pytest

import finite_strain
import linear_bem
from finite_strain.domain import Resolution, expected_indentation, reduce_scene
from finite_strain.extent import ALLOWED
from finite_strain.planning import COARSENING, plan_run
from finite_strain.schedule import FIRST, GROWTH, LARGEST_STEP, load_fractions
from linear_bem import Ball, Elastic, Elements, Layer, Load, Problem, UnsupportedProblem
from tests.finite_strain.scenes import STIFF_SUBSTRATE, balls_at, on_layer, pair
from tests.launch import python

KEYS = {
    "forms",
    "linear_solver",
    "symmetries",
    "unknowns",
    "unknowns_companion",
    "meshes",
    "accuracy",
    "memory_bytes",
    "memory_bytes_at_most",
    "seconds",
    "domain",
    "element_sizes",
    "load_steps",
}
"""What the command ``plan`` prints."""


@pytest.mark.parametrize("kind", ["approach", "force", "total_force"])
@pytest.mark.parametrize("deepest", [0.001, 0.0125, 0.05, 0.3, 0.8])
def test_load_fractions_increase_to_one_in_steps_that_newton_can_follow(kind: str, deepest: float) -> None:
    fractions = load_fractions(kind, deepest)
    assert fractions[-1] == 1.0
    assert all(0.0 < a < b for a, b in pairwise(fractions))
    power = 1.0 if kind == "approach" else 2.0 / 3.0
    approaches = [deepest * f**power for f in fractions]
    assert approaches[0] <= FIRST * math.sqrt(GROWTH) * (1.0 + 1e-12)
    for a, b in pairwise(approaches):
        assert b - a <= LARGEST_STEP * (1.0 + 1e-12)
        assert b <= GROWTH * a * (1.0 + 1e-12)


def test_the_order_of_the_balls_does_not_change_the_load_path() -> None:
    balls = (Ball((-1.0, 0.0), 1.0), Ball((7.0, 0.0), 10.0))
    for load in (Load("approach", (0.2, 0.2)), Load("force", (0.17, 1.4)), Load("total_force", (1.0,))):
        paths = []
        for turn in (1, -1):
            values = load.values[::turn]
            problem = Problem(Layer(1.0, 0.45, 2.0), balls[::turn], Load(load.kind, values))
            plan = plan_run(problem, 0.1, "finite_strain")
            paths.append((plan.fractions, plan.unknowns()))
        assert paths[0][0] == paths[1][0]
        assert paths[0][1] == pytest.approx(paths[1][1])
        deepest = max(a / b.radius for b, (a, _, _) in zip(balls, expected_indentation(problem)[::-1], strict=True))
        power = 1.0 if load.kind == "approach" else 2.0 / 3.0
        assert paths[0][0][0] ** power * deepest < 1.3 * FIRST  # the smaller ball's own first step


def test_a_contact_smaller_than_the_mesh_was_made_for_has_coarser_elements_at_its_edge() -> None:
    resolution = Resolution(0.2, 0.2, 0.2)
    assert resolution.at_edge(1.0, 0.5) == resolution.at_edge(0.5, 0.5) == 0.2
    assert resolution.at_edge(0.25, 0.5) == 0.4
    assert resolution.at_edge(0.01, 0.5) == 1.0


def test_a_coarser_resolution_is_coarser_everywhere_by_one_ratio() -> None:
    fine = Resolution(0.25, 0.2, 0.3)
    assert fine.coarser(1.5) == Resolution(pytest.approx(0.375), pytest.approx(0.3), pytest.approx(0.45))


def test_more_accuracy_costs_more_unknowns_within_bounds() -> None:
    problem = pair(0.1)
    unknowns = [finite_strain.plan(problem, accuracy)["unknowns"] for accuracy in (0.5, 0.06, 0.02, 0.005, 1e-4, 1e-6)]
    assert unknowns[0] < unknowns[1] < unknowns[2] < unknowns[3] < unknowns[4]
    assert unknowns[4] == unknowns[5]  # the resolution is clipped: memory is finite


def test_the_companion_mesh_is_coarser_by_the_ratio_that_the_extrapolation_assumes() -> None:
    coarse, fine = plan_run(pair(0.1), 0.02, "finite_strain").boxes
    for a, b in zip(coarse.zones, fine.zones, strict=True):
        assert a.finest / b.finest == pytest.approx(COARSENING)
        assert a.growth / b.growth == pytest.approx(COARSENING)
        assert a.outer_growth / b.outer_growth == pytest.approx(COARSENING)
        assert a.mirror == b.mirror  # the domain integral's ramp ends at the same place on both
    assert (coarse.x, coarse.y, coarse.substrate) == (fine.x, fine.y, fine.substrate)


@pytest.mark.parametrize("substrate", [None, STIFF_SUBSTRATE, Elastic(1.0, 0.48)], ids=["rigid", "stiff", "as soft"])
def test_the_box_reaches_as_far_as_the_accuracy_needs_and_is_cut_at_mirror_planes(substrate: Elastic | None) -> None:
    margins = []
    for accuracy in (0.06, 0.02, 0.005):
        plan = plan_run(pair(0.1, substrate=substrate), accuracy, "finite_strain")
        box = plan.boxes[1]
        assert (box.x[0], box.y[0]) == (0.0, 0.0)
        assert (box.substrate > 0.0) == (substrate is not None)
        margins.append(box.x[1] - 1.0)
        assert margins[-1] == pytest.approx(box.y[1])
        forces = np.full(2, expected_indentation(plan.problem)[0][1])
        linear = linear_bem.solve(plan.problem.with_load("force", forces)).balls[1].tangential_force[0]
        effect = plan.far_field().tangential_forces(forces)[1, 0]
        # the choice's own statement, with point loads for the linear force (5 % off at this load)
        assert abs(effect / linear) <= 1.05 * ALLOWED * accuracy
    assert margins[0] < margins[1] < margins[2]


def test_prisms_of_neighbouring_balls_do_not_overlap() -> None:
    balls = balls_at((0.0, 0.0), (2.2, 0.0), (0.0, 3.0))
    zones = plan_run(on_layer(balls, Load("approach", (0.1,) * 3)), 0.02, "finite_strain").boxes[1].zones
    assert len(zones) == 3
    for i, a in enumerate(zones):
        for b in zones[i + 1 :]:
            apart = max(abs(a.position[k] - b.position[k]) for k in (0, 1))
            assert a.mirror + b.mirror < apart


def test_the_plan_answers_all_that_is_asked_of_it_in_plain_numbers() -> None:
    answer = finite_strain.plan(pair(0.2), 0.02)
    assert set(answer) == KEYS
    assert json.loads(json.dumps(answer)) == answer
    assert len(answer["symmetries"]) == 2
    assert answer["unknowns"] > answer["unknowns_companion"] > 1000
    assert answer["load_steps"] == len(load_fractions("approach", 0.2))
    assert 0.0 < answer["element_sizes"]["finest"] < answer["element_sizes"]["coarsest"]
    assert answer["domain"]["layer"] == 1.16
    assert 1e8 < answer["memory_bytes"] < 1e11
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
    assert int(done.stdout) == finite_strain.plan(pair(0.1))["unknowns"]


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


def test_everything_that_the_model_lacks_is_named_at_once() -> None:
    balls = balls_at((-1.0, 0.0), (1.0, 0.0))
    layer, load = Layer(1.0, 0.495, math.inf), Load("force", (0.01, 0.0))
    problem = Problem(layer, balls, load, Elastic(10.0, 0.5), elements=Elements("displacement"))
    with pytest.raises(UnsupportedProblem) as caught:
        plan_run(problem, 0.02, "small_strain")
    faults = str(caught.value).splitlines()
    assert [fault.split(":")[0] for fault in faults] == [
        "layer.thickness", "elements.form", "load.force",
    ]  # fmt: skip
    assert all("small_strain" in fault for fault in faults)
    assert "0.495" in faults[1]


def test_a_shape_given_as_a_function_is_refused_by_its_key() -> None:
    def cone(x, y):  # type: ignore[no-untyped-def]
        return (x * x + y * y) ** 0.5

    problem = on_layer((Ball((0.0, 0.0), 1.0, cone),), Load("approach", (0.1,)))
    with pytest.raises(UnsupportedProblem, match=r"balls\.shape"):
        reduce_scene(problem)


def test_an_unknown_model_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnsupportedProblem, match="finite_strain and small_strain, got large_strain"):
        plan_run(pair(0.1), 0.02, "large_strain")
