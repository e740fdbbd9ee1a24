"""One contract for the finite elements and their stand-in in the tests of `runs`: observer calls and resuming."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_origin, get_type_hints

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from mpi4py import MPI

import finite_strain
from finite_strain.observer import Started
from finite_strain.planning.records import Answer
from linear_bem.result import Result, Step
from tests.finite_strain.press import StopAfter, Stopped
from tests.finite_strain.scenes import COARSER, light_pair
from tests.runs import elements

STEPS = (0.5, 1.0)
FRESH = r"(an+)+(s((an+)+d)+)+"
"""Attempts with iterations on the path finder; each later mesh is started, and each step ends what led to it."""
RESUMED = r"s((an+)+d)+(s((an+)+d)+)*"
ACCURACY = {"asked", "reached", "met", "terms", "relative_to", "stopped", "budget", "meshes"}
MESH = {"order", "fineness", "extent", "penalty", "unknowns", "seconds", "reached", "normal_forces"}


class Listener(StopAfter):
    """Also records the order of calls: s(tarted), a(ttempt), n(ewton), d(one)."""

    def __init__(self, last: int = 0) -> None:
        super().__init__(last)
        self.order = ""
        self.arguments: list[tuple[type, ...]] = []

    def started(self, info: Any) -> None:
        self.order += "s"
        super().started(info)

    def attempt(self, *given: Any) -> None:
        self.order += "a"
        self.arguments.append(tuple(map(type, given)))
        super().attempt(*given)

    def newton(self, *given: Any) -> None:
        self.order += "n"
        self.arguments.append(tuple(map(type, given)))
        super().newton(*given)

    def step_done(self, step: Step, surface: Any) -> None:
        self.order += "d"
        super().step_done(step, surface)


@pytest.fixture(scope="module", params=[finite_strain, elements], ids=["finite elements", "stand-in"])
def solved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """An uninterrupted run, and one that is stopped after its first step, resumed, and requested again."""

    def run(folder: Path, listener: Listener) -> Result:
        return request.param.solve(
            light_pair(), accuracy=0.3, comm=MPI.COMM_SELF, folder=folder, observer=listener, steps=STEPS,
            numerics=COARSER,
        )  # fmt: skip

    whole, stopped, resumed, again = Listener(), Listener(1), Listener(), Listener()
    result, folder = run(tmp_path_factory.mktemp("whole"), whole), tmp_path_factory.mktemp("broken")
    with pytest.raises(Stopped):
        run(folder, stopped)
    results = result, run(folder, resumed), run(folder, again)
    return SimpleNamespace(results=results, whole=whole, stopped=stopped, resumed=resumed, again=again)


@pytest.mark.slow
def test_observers_are_called_in_the_same_order(solved: SimpleNamespace) -> None:
    assert re.fullmatch(FRESH, solved.whole.order)
    assert re.fullmatch(FRESH, solved.stopped.order)
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
    assert set(accuracy) == ACCURACY
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
