"""What a plan refuses, by key, without DOLFINx."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

import finite_strain
from finite_strain.planning.refinement import Budget
from finite_strain.planning.run_plan import plan_run
from linear_bem import Ball, Elastic, Elements, InvalidProblem, Layer, Load, Problem, UnsupportedProblem
from tests.finite_strain.scenes import (
    QUADRATIC,
    at_small_strain,
    balls_at,
    on_layer,
    pair,
)


@pytest.mark.parametrize("steps", [(), (0.0, 1.0), (-0.5,), (1.0, 0.5), (0.5, 0.5)])
def test_load_steps_that_do_not_rise_are_refused(steps: tuple[float, ...]) -> None:
    with pytest.raises(InvalidProblem, match=r"load\.steps: must be greater than 0 and rise, got"):
        plan_run(pair(0.1), 0.02, "finite_strain", steps=steps)


@pytest.mark.parametrize("steps", [(0.5,), (0.25, 0.5), (1e-4, 2e-4), (0.5, 1.5), (1.0, float("inf"))])
def test_load_steps_that_do_not_end_at_full_load_are_refused(steps: tuple[float, ...]) -> None:
    with pytest.raises(InvalidProblem, match=r"load\.steps: the last must be 1, the full load, got .*, as \(0\.5, 1"):
        plan_run(pair(0.1), 0.02, "finite_strain", steps=steps)


@pytest.mark.parametrize("accuracy", [0.0, 1e-20, 9e-5, 1.0, -0.1])
def test_an_accuracy_outside_its_range_is_refused(accuracy: float) -> None:
    with pytest.raises(InvalidProblem, match=r"accuracy\.tangential_force"):
        plan_run(pair(0.1), accuracy, "finite_strain")


def test_a_budget_below_the_coarsest_estimate_is_refused() -> None:
    with pytest.raises(UnsupportedProblem, match=r"accuracy\.unknowns.*got 100"):
        plan_run(pair(0.1), 0.02, "finite_strain", Budget(unknowns=100.0))
    with pytest.raises(InvalidProblem, match=r"accuracy\.seconds"):
        Budget(seconds=0.0)
    with pytest.raises(InvalidProblem, match=r"accuracy\.unknowns"):
        Budget(unknowns=-1.0)
    assert Budget().most_unknowns == 120e3
    assert Budget(unknowns=3e4).most_unknowns == 3e4


def test_all_unsupported_effects_are_named_at_once() -> None:
    balls = balls_at((-1.0, 0.0), (1.0, 0.0))
    layer, load = Layer(1.0, 0.49995, math.inf), Load("force", (0.01, 0.0))
    problem = Problem(layer, balls, load, Elastic(10.0, 0.5), elements=Elements("displacement"))
    with pytest.raises(UnsupportedProblem) as caught:
        plan_run(problem, 0.02, "small_strain")
    faults = str(caught.value).splitlines()
    assert [fault.split(":")[0] for fault in faults] == [
        "layer.thickness", "elements.form", "load.force",
    ]  # fmt: skip
    assert all("small_strain" in fault for fault in faults)
    assert "0.49995" in faults[1]


def test_a_function_with_a_pointed_tip_is_refused_by_its_key() -> None:
    def cone(x, y):  # type: ignore[no-untyped-def]
        return (x * x + y * y) ** 0.5

    problem = on_layer((Ball((0.0, 0.0), 1.0, cone),), Load("approach", (0.1,)))
    with pytest.raises(UnsupportedProblem, match=r"balls\.shape: cone must be level .*pointed tip.*slope of 1 next"):
        plan_run(problem, 0.02, "finite_strain")


def test_a_ball_too_deep_for_the_layer_is_refused_by_its_key() -> None:
    plan_run(pair(0.89 * 1.16), 0.02, "finite_strain")
    limit = r"load\.approach: finite_strain takes approaches below 0\.9 of the layer's thickness, 1\.044 m"
    with pytest.raises(UnsupportedProblem, match=limit):
        plan_run(pair(0.9 * 1.16), 0.02, "finite_strain")


def test_an_unknown_model_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnsupportedProblem, match="finite_strain and small_strain, got large_strain"):
        plan_run(pair(0.1), 0.02, "large_strain")


@pytest.mark.parametrize(
    ("problem", "model", "remedy"),
    [
        (pair(0.1), "small_strain", r"got FiniteStrain\(.*; set it to None, or ask for model finite_strain"),
        (at_small_strain(pair(0.1)), "finite_strain", r"got None; set it to FiniteStrain\(\), or ask for model sm"),
    ],
    ids=["effect for small strain", "no effect for finite strain"],
)
def test_a_problem_of_the_other_model_is_refused_by_its_key(problem: Problem, model: str, remedy: str) -> None:
    for asked in (finite_strain.plan, finite_strain.solve):
        with pytest.raises(UnsupportedProblem, match=rf"^finite_strain: model {model} .*{remedy}"):
            asked(problem, model=model)
    other = {"finite_strain": "small_strain", "small_strain": "finite_strain"}[model]
    assert plan_run(problem, 0.1, other).model == other


def test_elements_that_grow_so_fast_that_edges_cross_are_refused(tmp_path: Path) -> None:
    """Gmsh ended the process."""
    from meshes.layer import write_layer_mesh  # noqa: PLC0415  (imports gmsh)

    soft = on_layer(balls_at((0.0, 0.0)), Load("approach", (0.2,)), 1.0, Elastic(0.1, 0.3), poisson=0.3)
    box = plan_run(soft, 0.3, "finite_strain").box(QUADRATIC)
    with pytest.raises(UnsupportedProblem, match=r"^numerics\.growth: .* got 4; give less"):
        write_layer_mesh(replace(box, growth=4.0), tmp_path / "mesh.msh")
    assert write_layer_mesh(box, tmp_path / "mesh.msh") > 0
