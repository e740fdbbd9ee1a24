"""T of many balls from a table of pairs: the model's own, close for more balls, and kept through a kill."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from linear_bem import Ball, Elastic, Layer, Load, Problem, Result, solve, solve_point_load
from linear_bem.errors import OutputUnusable, UnsupportedProblem
from linear_bem.problem import FiniteStrain
from linear_bem.result import BallResult, Solved
from runs.evolution import pair_table
from runs.evolution.forces import DirectForces
from runs.evolution.pair_forces import PairForces, SingleBall
from runs.evolution.providers import Provider, point_loads, provider
from runs.models import MODELS, Run
from runs.process.files import write_text
from runs.process.json_values import to_json
from runs.process.locks import take
from tests.runs.foam_balls import FOAM, RADIUS, line, of, scene, spread


def test_pairs_of_the_table_are_the_models_own_and_more_balls_are_close(
    tables: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # as few distances as a finite-strain table has
    monkeypatch.setattr(pair_table, "MANY", pair_table.FEW)
    problem = scene(line(3, 0.023))
    given = of("linear_bem", problem, tables)
    assert given.table is not None
    for distance in (0.02, 0.0237, 0.041):
        pair = scene([(0.0, 0.0), (0.0, distance)])
        true = solve(pair, accuracy=3e-4).balls[0]
        state = spread(given, pair)(np.array([[0.0, 0.0], [0.0, distance]]))
        # the table's accuracy, and interpolation between ten distances
        assert state.tangential[0] == pytest.approx([0.0, true.tangential_force[1]], rel=2e-3, abs=1e-9)
        assert state.normal[0] == pytest.approx(true.normal_force, rel=1e-3)
    rows = given.table["additivity"]
    assert {row["arrangement"] for row in rows} == {"three in a line", "four in a square"}
    assert all(row["coupled"] < 0.03 < row["bare_sum"] for row in rows)
    x = np.array([ball.position for ball in problem.balls])
    state = given.forces(x)
    full = DirectForces(problem, 1e-2)(x)
    assert np.max(np.abs(state.tangential - full.tangential)) <= np.max(state.error) + np.max(full.error)
    assert state.tangential.sum(axis=0) == pytest.approx([0.0, 0.0], abs=1e-13)


def test_point_loads_are_the_models_own(foam: Provider) -> None:
    problem = scene([(0.0, 0.0), (0.031, 0.004), (0.011, 0.035)])
    x = np.array([ball.position for ball in problem.balls])
    state = spread(foam, problem)(x)
    balls = solve_point_load(problem.at(x)).balls
    # both interpolate the single ball's law; this one is the nearer to it
    assert state.normal == pytest.approx([ball.normal_force for ball in balls], rel=0.015)
    assert state.tangential == pytest.approx(np.array([ball.tangential_force for ball in balls]), rel=0.03, abs=1e-3)
    pair = foam.forces
    assert isinstance(pair, PairForces)
    for depth in (0.0095, 0.0115):
        alone = Problem(FOAM, (Ball((0.0, 0.0), RADIUS, "sphere"),), Load("approach", (depth,)))
        true = solve(alone, accuracy=1e-3).balls[0].normal_force
        assert pair.singles[0].force(np.array([depth])) == pytest.approx(true, rel=5e-4)


def test_a_table_goes_on_where_it_was_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pair_table, "MANY", (1.0, 1.5, 3.0, 6.0))
    problem = Problem(
        Layer(1.0, 0.48, 6.0),
        (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid")),
        Load("approach", (0.05,) * 2),
    )
    problem = Problem(problem.layer, problem.balls, problem.load, Elastic(1e3, 0.3))
    calls: list[int] = []

    def dies_after(count: int) -> pair_table.Solve:
        def run(one: Problem, workspace: Path | None, steps: Sequence[float]) -> object:
            if len(calls) >= count:
                raise KeyboardInterrupt
            calls.append(one.size)
            return MODELS["linear_bem"].solve(one, Run(1e-2, steps=steps))

        return run  # type: ignore[return-value]

    table = pair_table.PairTable(problem, "linear_bem", dies_after(3), tmp_path, {})
    with pytest.raises(KeyboardInterrupt):
        table.complete()
    calls.clear()
    again = pair_table.PairTable(problem, "linear_bem", dies_after(99), tmp_path, {})
    assert again.missing == 4  # the single ball and two pairs are there
    again.complete()
    assert calls == [2, 2, 3, 4]
    whole = pair_table.PairTable(problem, "linear_bem", dies_after(999), tmp_path / "other", {})
    said: list[str] = []
    whole.complete(said.append)
    assert ["left" in line for line in said] == [False, *[True] * 5, False]  # one ball has no pairs
    x = np.array([[-1.1, 0.0], [1.1, 0.3]])
    assert again.forces()(x).tangential == pytest.approx(whole.forces()(x).tangential, rel=1e-14)
    assert len(list(tmp_path.glob("*.json"))) == 1


PULLS = {2.0: -2e-4, 2.5: -1e-6, 3.0: 1e-4, 4.0: 5e-5}
"""T at four distances, in units of E and R; it nearly vanishes at one of them."""


def written_table(folder: Path) -> pair_table.PairTable:
    """Return a table of two balls with the forces `PULLS`, without any run."""
    balls = (Ball((0.0, 0.0), 1.0), Ball((3.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 2.0), balls, Load("approach", (0.1,) * 2))

    def solve(*_: object) -> Result:
        raise NotImplementedError

    table = pair_table.PairTable(problem, "none", solve, folder, {})
    pairs = [pair_table.PairState(at, 0.05, pull, 1e-5, 0.0) for at, pull in PULLS.items()]
    depths = (0.02, 0.05, 0.09, 0.105)
    single = pair_table.SingleStates(depths, tuple(2.0 * d**1.5 for d in depths), 0.0)
    adding = pair_table.Additivity("three in a line", 1e-4, 1e-6, 0.01, 0.1, 0.0)
    table.states = pair_table.States(single, pairs, [adding])
    return table


def test_a_table_that_another_run_makes_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pair_table, "MANY", tuple(at / 2.0 for at in PULLS))
    monkeypatch.setattr(pair_table, "ARRANGEMENTS", {"three in a line": pair_table.ARRANGEMENTS["three in a line"]})
    made, waiting = written_table(tmp_path), written_table(tmp_path)
    waiting.states = pair_table.States()
    said: list[str] = []

    def other_run_ends(text: str) -> None:
        said.append(text)
        write_text(made.path, to_json(made.data))
        lock.close()

    with open(tmp_path / f".{made.path.stem}.lock", "w", encoding="utf-8") as lock:
        assert take(lock)
        waiting.complete(other_run_ends)  # without a run of its own
    assert ["another run makes it now" in text for text in said] == [True]
    assert to_json(waiting.data) == to_json(made.data)


def test_a_folder_of_tables_that_cannot_be_written_is_refused_before_the_first_run(tmp_path: Path) -> None:
    table = written_table(tmp_path / "file" / "tables")
    table.states = pair_table.States()
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OutputUnusable, match="name another --tables"):
        table.complete()


def test_the_error_of_t_includes_that_of_the_pairs(tmp_path: Path) -> None:
    table = written_table(tmp_path)
    for distance, pull in PULLS.items():
        state = table.forces()(np.array([[0.0, 0.0], [0.0, distance]]))
        assert state.tangential[0, 1] == pytest.approx(pull, rel=2e-3)
        assert state.error == pytest.approx(1e-5 + 0.01 * abs(pull), rel=2e-3)
    # the errors of both neighbours may have any signs
    corners = tuple(Ball(at, 1.0) for at in ((-1.25, 0.0), (1.25, 0.0), (0.0, 1.25 * np.sqrt(3.0))))
    table.problem = Problem(table.problem.layer, corners, Load("approach", (0.1,) * 3))
    state = table.forces()(table.problem.positions)
    both = 2e-5 * (state.normal / 0.05) ** 2
    assert state.error == pytest.approx(both + 0.01 * np.hypot(*state.tangential.T), rel=1e-6)


UNLIKE = (Ball((0.0, 0.0), 20.0), Ball((80.0, 0.0), 1.0), Ball((82.3, 0.0), 1.0))


@pytest.mark.parametrize(
    "problem",
    [
        Problem(Layer(1.0, 0.3, 50.0), UNLIKE, Load("approach", (0.1,) * 3)),
        Problem(Layer(1.0, 0.3, 1.0), UNLIKE[1:], Load("approach", (0.15, 0.12)), Elastic(0.05, 0.3)),
        Problem(Layer(1.0, 0.3, 1.0), UNLIKE[1:], Load("approach", (0.15, 0.15))),  # where a term changes its sign
    ],
)
def test_the_error_of_point_loads_is_that_of_the_model_for_unlike_balls_too(problem: Problem) -> None:
    own, depths = solve_point_load(problem).balls, np.max(problem.load.values) * np.array(pair_table.DEPTHS)

    def alone(ball: Ball) -> tuple[list[float], float]:
        loads = (Load("approach", (depth,)) for depth in depths)
        found = [solve_point_load(dataclasses.replace(problem, balls=(ball,), load=load)).balls[0] for load in loads]
        areas = [other.contact_area or 0.0 for other in own if other.radius == ball.radius]
        return [single.normal_force for single in found], max(areas)

    stated = point_loads(problem, None, alone)(problem.positions).error[0]
    assert stated == pytest.approx(max(ball.tangential_force_error for ball in own), rel=0.1)


def test_errors_of_t_are_lengths_whatever_the_axes(tmp_path: Path) -> None:
    table = written_table(tmp_path)
    for name, places in pair_table.ARRANGEMENTS.items():
        corners = np.array(places) * table.touch
        balls = tuple(Ball((x, y), 1.0) for x, y in corners)
        table.problem = Problem(table.problem.layer, balls, Load("approach", (0.1,) * len(balls)))
        state = table.forces()(corners)
        # a model with forces of twice the size: half of the largest is missing
        full = [
            BallResult(ball.position, 1.0, 0.1, q, (2.0 * t[0], 2.0 * t[1]), 0.0, None, None)
            for ball, q, t in zip(balls, state.normal, state.tangential, strict=True)
        ]
        table.solve = lambda *_, balls=tuple(full): Result("none", balls, Solved(True, 1, 1, 0.0))
        assert table._additivity(name).coupled == pytest.approx(0.5, rel=1e-9)
        forces = PairForces(table.problem, [table.single()] * len(balls), table.law(), cut=0.5)
        turned = corners @ np.array([[0.6, 0.8], [-0.8, 0.6]])
        assert forces.cut_error(turned) == pytest.approx(forces.cut_error(corners), rel=1e-6)


def test_a_single_balls_law_is_a_power_law_outside_its_states() -> None:
    depths = np.geomspace(0.1, 1.0, 6)
    ball = SingleBall(list(depths), list(4.0 / 3.0 * depths**1.5))
    at_any = np.array([-0.1, 0.0, 1e-3, 0.37, 2.0])
    assert ball.force(at_any) == pytest.approx(4.0 / 3.0 * np.maximum(at_any, 0.0) ** 1.5, rel=1e-10)
    assert ball.approach(ball.force(at_any))[2:] == pytest.approx(at_any[2:], rel=1e-10)


def test_a_budget_too_small_for_the_last_run_is_refused_before_the_first(tmp_path: Path) -> None:
    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 2.0), balls, Load("approach", (0.3,) * 2), finite_strain=FiniteStrain())
    finite = MODELS["finite_strain"]
    assert finite.plan is not None
    budget = {"unknowns": 1.1 * finite.plan(problem, 0.1, {}, (1.0,))["unknowns"]}
    finite.plan(problem, 0.1, budget, (1.0,))  # enough for a pair

    def solve(one: Problem, run: Run) -> Result:
        raise AssertionError(f"solved before all runs of the table were planned: {one.size} balls")

    model = dataclasses.replace(finite, solve=solve)
    with pytest.raises(UnsupportedProblem, match=r"accuracy\.unknowns"):  # a row of three balls takes more
        provider(model, problem, 0.1, "pairs", tmp_path, budget=budget)
    assert not list(tmp_path.iterdir())
