"""Arguments of a wrong type are refused, and the message names them, before DOLFINx is imported."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import finite_strain
from finite_strain import Numerics
from finite_strain.planning.refinement import Budget
from finite_strain.planning.run_plan import plan_run
from linear_bem import Ball, FiniteStrain, InvalidProblem, Layer, Load, Problem, UnsupportedProblem

PROBLEM = Problem(Layer(1.0, 0.3, 1.0), (Ball((0.0, 0.0), 1.0),), Load("force", (0.1,)), finite_strain=FiniteStrain())


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"problem": 3}, r"problem: must be a linear_bem\.Problem, got 3"),
        ({"accuracy": "0.1"}, r"accuracy: must be a number between 0 and 1, got '0\.1'"),
        ({"steps": 0.5}, r"steps: must be fractions of the load"),
        ({"steps": np.array(0.5)}, r"steps: must be fractions of the load"),
        ({"steps": "0.5"}, r"steps: must be fractions of the load"),
        ({"steps": ("half",)}, r"steps: must be fractions of the load"),
        ({"seconds": "60"}, r"seconds: must be a number, got '60'"),
        ({"unknowns": [1e4]}, r"unknowns: must be a number"),
        ({"folder": 3}, r"folder: must be the path of a folder"),
        ({"fields": ("gap",)}, r"fields: must be a choice such as FieldChoice.*, got \('gap',\)"),
        ({"observer": print}, r"observer: must be an object with the methods started, attempt, newton, step_done"),
        ({"numerics": {"growth": 2.0}}, r"numerics: must be Numerics such as"),
        ({"solver_options": "lu"}, r"solver_options: must be PETSc options such as"),
        ({"inspect": 1}, r"inspect: must be a function"),
        ({"inspect": lambda functions: None}, r"inspect: must be a function of two arguments"),
        ({"accuracy": 5}, r"tangential_force: must be below 1 \(2 % is 0\.02\), got 5"),
        ({"seconds": "60", "folder": 3}, r"(?s)folder: .*seconds: "),
    ],
)
def test_an_argument_of_another_type_is_refused_by_name(given: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidProblem, match=words):
        finite_strain.solve(**({"problem": PROBLEM} | given))


def test_load_steps_may_be_an_array() -> None:
    given = finite_strain.plan(PROBLEM, 0.1, steps=np.array([0.5, 1.0]))
    assert given == finite_strain.plan(PROBLEM, 0.1, steps=(0.5, 1.0))


def test_numbers_of_numpy_are_written_as_json() -> None:
    given = {"accuracy": np.float32(0.125), "seconds": np.float32(60.0), "unknowns": np.int64(30000)}
    plan = plan_run(PROBLEM, given["accuracy"], "finite_strain", Budget(given["seconds"], given["unknowns"]))
    written = json.dumps(
        [plan.accuracy, plan.budget.seconds, plan.budget.unknowns, finite_strain.plan(PROBLEM, **given)]
    )
    assert json.loads(written)[:3] == [0.125, 60.0, 30000]


def test_a_first_step_with_a_tiny_contact_is_named_where_it_makes_the_mesh_too_large() -> None:
    with pytest.raises(UnsupportedProblem, match=r"load\.steps: .* as at 1e-12 of the load; begin with a larger step"):
        finite_strain.plan(PROBLEM.with_load("approach", (0.1,)), steps=(1e-12, 1.0))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"growth": -1.0}, r"numerics\.growth: must be a number greater than 0 and finite, got -1\.0"),
        ({"growth": 0.0}, r"numerics\.growth: must be a number greater than 0"),
        ({"more_loads": 0.7}, r"numerics\.more_loads: must be a tuple of fractions of the load, below 1, got 0\.7"),
        ({"more_loads": (0.7, 1.5)}, r"numerics\.more_loads: must be a tuple of fractions of the load, below 1, got"),
        ({"more_loads": (0.0,)}, r"numerics\.more_loads: must be a tuple of fractions of the load, below 1, got"),
        ({"contact_degree": 1.5}, r"numerics\.contact_degree: must be a whole number, not negative, got 1\.5"),
        ({"more_loads": ("most",)}, r"numerics\.more_loads: must be a tuple of fractions of the load"),
        ({"largest_step": "0.1"}, r"numerics\.largest_step: must be a number"),
    ],
)
def test_numerics_out_of_range_are_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidProblem, match=words):
        Numerics(**given)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"names": "gap"}, r'output\.fields: must be a list of names, such as \("gap",\), got "gap"'),
        ({"names": np.array(["gap", "pressure"])}, r"output\.fields: must be a list of names, .*, got array\("),
        ({"names": (3,)}, r'output\.fields: must be a list of names, such as \("gap",\), got \(3,\)'),
        ({"names": ("mises",)}, r"output\.fields: unknown mises; known: displacement, "),
        ({"every": 1.5}, r"output\.every: must be 1 or more and whole .*, got 1\.5"),
    ],
)
def test_a_wrong_choice_of_fields_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidProblem, match=words):
        finite_strain.FieldChoice(**given)
