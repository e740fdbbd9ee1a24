"""A mesh with free sides is a body of its own: its forces are not those of the infinite layer."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import finite_strain
from finite_strain.accuracy.answer import Answers
from finite_strain.planning.records import Record
from finite_strain.planning.run_plan import plan_run
from linear_bem import Layer
from linear_bem.solver import solve
from tests.finite_strain.scenes import CUBIC, ONE_LOAD, QUADRATIC, at_small_strain, pair, relatively, single
from tests.finite_strain.test_own_mesh import COMM, X, block, fitted

PILLAR = (0.0, 0.07, 0.14, 0.22, 0.32, 0.5, 0.75)
"""Lines of a narrow body around a ball at the origin."""


def pillar(x: Any = PILLAR, y: Any = PILLAR) -> tuple[Any, Any, Any]:
    """Return a pillar on a rigid base, from its planes of symmetry on, whose outer sides are curved and free."""
    mesh, cells, facets = block(x=tuple(line - x[0] for line in x), y=y)
    first, second = mesh.geometry.x[:, 0] + x[0], mesh.geometry.x[:, 1].copy()
    mesh.geometry.x[:, 0] = first * (1.0 - 0.2 * (second / y[-1]) ** 2)
    mesh.geometry.x[:, 1] = second * (1.0 - 0.2 * (first / x[-1]) ** 2)
    return mesh, cells, facets


def test_the_pull_of_free_sides_is_the_derivative_of_the_energy_by_the_balls_position() -> None:
    x = (-0.75, -0.4, -0.15, 0.0, 0.06, 0.12, 0.18, 0.24, 0.3, 0.36, 0.5, 0.75)
    problem, energies = at_small_strain(replace(single(0.04, poisson=0.45), layer=Layer(1.0, 0.45, 1.16))), []
    meshed = pillar(x, (0.0, 0.08, 0.18, 0.35, 0.75))
    for place in (0.15, 0.21, 0.18):
        (step,) = finite_strain.solve(
            replace(problem, balls=(replace(problem.balls[0], position=(place, 0.0)),)), model="small_strain",
            accuracy=0.3, mesh=meshed, comm=COMM, numerics=ONE_LOAD,
        ).steps  # fmt: skip
        energies.append(step.record["strain_energy"])
    pull = (energies[0] - energies[1]) / 0.06
    assert step.balls[0].tangential_force[0] == relatively(pull, 0.02)  # discretisation of the energies
    assert abs(step.balls[0].tangential_force[0] - pull) < step.balls[0].tangential_force_error


@pytest.mark.parametrize("model", ["small_strain", "finite_strain"])
def test_a_body_with_free_sides_is_solved_as_it_is_and_not_corrected_as_an_infinite_layer(model: str) -> None:
    problem = replace(single(0.04, poisson=0.45), layer=Layer(1.0, 0.45, 1.16))
    problem = problem if model == "finite_strain" else at_small_strain(problem)
    result = finite_strain.solve(
        problem, model=model, accuracy=0.05, mesh=pillar(), comm=COMM, steps=(0.9, 1.0), numerics=ONE_LOAD
    )
    first, last = result.steps
    # the work of the force is the elastic energy; the trapezoidal rule over this step: 6e-4
    work = (last.record["strain_energy"] - first.record["strain_energy"]) / (0.1 * 0.04)
    mean = 0.5 * (first.balls[0].normal_force + last.balls[0].normal_force)
    assert mean == relatively(work, 5e-3)  # discretisation, and the penalty's energy
    infinite = solve(replace(problem, finite_strain=None), 1e-3).balls[0].normal_force
    assert result.balls[0].normal_force < 0.95 * infinite
    assert result.balls[0].errors["normal_force"] < 0.03 * infinite
    assert 0.03 < result.balls[0].errors["peak_pressure"] / result.balls[0].peak_pressure < 0.3  # of a mean at a vertex
    assert any(note.startswith("the mesh has free sides") for note in result.solved.notes)
    assert not any("flanks" in note for note in result.solved.notes)


def test_free_sides_may_push_a_pair() -> None:
    problem, x = pair(0.1, poisson=0.3), (*(-c for c in X[:0:-1]), *X)
    errors, forces = np.array([0.1, 1.0]), np.array([[1.0, 0.0], [-3.0, 0.0]])
    for slope, is_free in ((0.0, False), (0.03, True)):
        mesh, cells, facets = block(x=x)
        mesh.geometry.x[:, 0] *= 1.0 + slope * mesh.geometry.x[:, 1]
        part = fitted(problem, (mesh, cells, facets))
        plan = plan_run(problem, 0.1, "finite_strain", fit=lambda *_, part=part: part)
        answers = Answers(plan, [Record(QUADRATIC), Record(CUBIC)])
        assert plan.has_free_sides is is_free
        assert part[1].room == pytest.approx((2.4, 2.4) if is_free else (math.inf, math.inf))
        assert plan.is_paired is not is_free
        assert (answers._worst(errors) is None) is is_free  # the sum of T need not be zero
        assert (answers._imbalance(forces, errors)[1] == 1.0) is is_free
        assert (answers.truth(1.0) == "") is is_free
