"""One contract for the finite elements and their stand-in in the tests of `runs`: observer calls and resuming."""

from __future__ import annotations

import re
import shutil
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import get_origin, get_type_hints

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from mpi4py import MPI

import finite_strain
from finite_strain.observer import Started
from finite_strain.planning.records import Answer
from linear_bem.result import Result, Step
from tests.finite_strain.press import ACCURACY, STEPS
from tests.finite_strain.scenes import COARSER, Keeper, Recorder, light_pair
from tests.runs import elements

FRESH = r"(an+)+(s((an+)+d)+)+"
"""Attempts with iterations on the path finder; each later mesh is started, and each step ends what led to it."""
RESUMED = r"s((an+)+d)+(s((an+)+d)+)*"
REPORTED = {"asked", "reached", "met", "terms", "relative_to", "stopped", "budget", "meshes"}
MESH = {"order", "fineness", "extent", "penalty", "unknowns", "seconds", "reached", "normal_forces"}


@pytest.fixture(scope="module", params=[finite_strain, elements], ids=["finite elements", "stand-in"])
def solved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """An uninterrupted run, what it had left after its first step, resumed, and requested again."""

    def run(folder: Path, observer: Recorder) -> Result:
        return request.param.solve(
            light_pair(), accuracy=ACCURACY, comm=MPI.COMM_SELF, folder=folder, observer=observer, steps=STEPS,
            numerics=COARSER,
        )  # fmt: skip

    if request.param is finite_strain:
        result, whole = (request.getfixturevalue(name) for name in ("result", "heard"))
    else:
        whole = Keeper(*(tmp_path_factory.mktemp(name) for name in ("whole", "kept")))
        result = run(whole.folder, whole)
    folder = shutil.copytree(whole.kept / "1", tmp_path_factory.mktemp("broken"), dirs_exist_ok=True)
    resumed, again = Recorder(), Recorder()
    results = result, run(folder, resumed), run(folder, again)
    return SimpleNamespace(results=results, whole=whole, resumed=resumed, again=again)


def test_observers_are_called_in_the_same_order(solved: SimpleNamespace) -> None:
    assert re.fullmatch(FRESH, solved.whole.order)
    assert re.fullmatch(RESUMED, solved.resumed.order)
    assert solved.whole.order.count("d") == len(STEPS)


def test_observers_receive_the_arguments_of_the_protocol(solved: SimpleNamespace) -> None:
    types = get_type_hints(Started)
    assert set(solved.whole.info) == set(types)
    assert all(isinstance(value, get_origin(types[k]) or types[k]) for k, value in solved.whole.info.items())
    assert set(solved.whole.arguments) == {(str, float, int), (int, float)}
    names = [attempt["mesh"] for attempt in solved.whole.attempts]
    assert list(dict.fromkeys(names)) == ["coarse", "coarse, small strain", "main", "main, small strain"]
    for step, surface in zip(solved.whole.steps, solved.whole.surfaces, strict=True):
        assert isinstance(step, Step)
        nodes, corners = surface.points.shape[0], surface.triangles
        assert surface.points.shape == (nodes, 3)
        assert surface.pressure.shape == (nodes,)
        assert corners.shape[1] == 3
        assert 0 <= corners.min() <= corners.max() < nodes


def test_steps_and_accuracy_have_the_same_keys(solved: SimpleNamespace) -> None:
    known = {field.name for field in fields(Answer)} - {"balls"}
    for step in solved.results[0].steps:
        assert set(step.record) == known
        answer = Answer.from_step(step)
        assert answer.to_step() == step
        per_ball = (*answer.error_terms.values(), answer.pair_weight, answer.normal_force_error, answer.approach_error)
        assert {len(values) for values in per_ball} == {len(step.balls)}
    accuracy = solved.results[0].solved.accuracy
    assert set(accuracy) == REPORTED
    assert all(set(mesh) == MESH for mesh in accuracy["meshes"])


def test_a_stopped_run_resumes_to_the_same_answer_and_a_finished_one_calls_no_observer(solved: SimpleNamespace) -> None:
    whole, resumed, again = (np.array([numbers(step) for step in result.steps]) for result in solved.results)
    assert resumed == pytest.approx(whole, rel=1e-6)
    assert np.array_equal(again, resumed)
    assert solved.resumed.info["resumed_steps"] == 1
    assert [step.record["step"] for step in solved.resumed.steps] == [2]
    assert solved.again.order == ""


def numbers(step: Step) -> list[float]:
    """Return a step's numbers for its first ball, with errors."""
    ball = step.balls[0]
    return [ball.approach, ball.normal_force, ball.tangential_force[0], ball.tangential_force_error]
