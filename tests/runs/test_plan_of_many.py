"""What `plan` says of many balls: it solves some of them, and advises about the one with the largest T."""

import dataclasses
import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from linear_bem import Ball, Elastic, Layer, Load, Periodic, Problem, solve, solve_contact
from linear_bem.result import Result
from linear_bem.sampled_solution import SAMPLE
from runs import look_ahead
from runs.commands import plan
from runs.display.numbers import leading_ball
from runs.models import MODELS, Run
from runs.scene.scene_file import read_scene

COUNT = 14
PLACES = [(2.2 * k + 0.08 * (k % 3), 0.4 * (k % 2)) for k in range(COUNT)]
ROW = Problem(Layer(1.0, 0.48, 2.0), tuple(Ball(p, 1.0) for p in PLACES), Load("approach", (0.1,) * COUNT))


@pytest.mark.parametrize("kind", ["approach", "total_force"])
def test_advice_is_about_the_leading_ball_and_its_nearest_ones(kind: str) -> None:
    problem = ROW if kind == "approach" else ROW.with_load(kind, (0.05 * COUNT,))
    ahead = solve(problem, look_ahead.ROUGH)
    part, near = look_ahead.closest(problem, ahead)
    sizes = [math.hypot(*ball.tangential_force) for ball in ahead.balls]
    leading = int(np.argmax(sizes))
    assert part.size == len(near.balls) == look_ahead.ABOUT
    assert part.balls[0] == problem.balls[leading]
    apart = sorted(math.dist(ball.position, PLACES[leading]) for ball in problem.balls)
    assert math.dist(part.balls[-1].position, PLACES[leading]) == pytest.approx(apart[look_ahead.ABOUT - 1])
    # the same load on the same balls: what is farther changes T little
    assert math.hypot(*near.balls[0].tangential_force) == pytest.approx(sizes[leading], rel=0.15)
    assert near.balls[0].normal_force == pytest.approx(ahead.balls[leading].normal_force, rel=0.05)


def test_few_balls_and_cells_are_judged_whole() -> None:
    few = dataclasses.replace(ROW, balls=ROW.balls[:3], load=Load("approach", (0.1,) * 3))
    ahead = solve(few, look_ahead.ROUGH)
    assert look_ahead.closest(few, ahead) == (few, ahead)
    cell = dataclasses.replace(ROW, periodic=Periodic((40.0, 10.0)))
    assert look_ahead.closest(cell, ahead) == (cell, ahead)


TEXT = """
[layer]
thickness = 2.0
young = 1.0
poisson = 0.48
[balls]
radius = 1.0
positions = {places}
[load]
{load}
"""


@pytest.mark.parametrize("load", ["total_force = 0.7", f"force = {[0.0] * 11 + [0.05] * 3}"])
def test_a_plan_solves_the_balls_about_the_middle_for_all(
    load: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(look_ahead, "FEW", 10)
    file = tmp_path / "row.toml"
    file.write_text(TEXT.format(places=[list(p) for p in PLACES], load=load), encoding="utf-8")
    plan.plan_scene(read_scene(file), None, as_json=True)
    found = json.loads(capsys.readouterr().out)
    forces = [ball["normal_force"] for ball in found["linear_estimate"]]
    assert len(forces) == 10
    assert sum(forces) == pytest.approx(0.5 if load.startswith("total") else 0.15)
    assert any("10 balls about the middle" in note for note in found["notes"])


@pytest.mark.parametrize("shift", [0.0, 100.0], ids=["inside", "outside"])
def test_a_plan_names_the_ball_of_its_expectation_in_a_cell(
    shift: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(look_ahead, "FEW", 10)
    file, cell = tmp_path / "row.toml", np.array([40.0, 10.0])
    places = [[x + shift, y] for x, y in PLACES]
    text = TEXT.format(places=places, load="approach = 0.1") + f"[periodic]\nlengths = {cell.tolist()}\n"
    file.write_text(text, encoding="utf-8")
    plan.plan_scene(read_scene(file), None, advises=False, as_json=True)
    found = json.loads(capsys.readouterr().out)
    leading = found["linear_estimate"][leading_ball(found["linear_estimate"])]
    away = np.array(leading["position"]) - places[found["leading_ball"]]
    assert np.abs(away - cell * np.round(away / cell)) == pytest.approx(0.0, abs=1e-9)
    plan.plan_scene(read_scene(file), None, advises=False, as_json=False)
    assert f"on ball {found['leading_ball']}:" in capsys.readouterr().out


def test_a_drift_in_a_cell_at_finite_strain_is_planned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("gmsh")
    file = tmp_path / "pair.toml"
    drift = "[reciprocation]\namplitude = 8.0\ncycles = 1\nfriction = 0.3\n"
    text = TEXT.format(places=[[-1.5, 0.0], [1.5, 0.0]], load="approach = 0.2") + drift
    file.write_text(text + "[finite_strain]\n[periodic]\nlengths = [12.0, 12.0]\n", encoding="utf-8")
    plan.plan_scene(read_scene(file), None, advises=False, as_json=True)
    found = json.loads(capsys.readouterr().out)
    assert found["models"][0]["model"] == "finite_strain"
    assert found["evolution"]["runs"] > 1


def test_the_work_of_all_load_steps_of_the_linear_model_counts() -> None:
    pair = dataclasses.replace(ROW, balls=ROW.balls[:2], load=Load("approach", (0.1,) * 2))
    both, first, last = (MODELS["linear_bem"].solve(pair, Run(1e-2, steps=s)) for s in ((0.5, 1.0), (0.5,), (1.0,)))
    assert both.solved.iterations == first.solved.iterations + last.solved.iterations


def test_a_note_of_an_earlier_load_step_names_its_part_of_the_load() -> None:
    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    layer = Layer(1.0, 0.48, 1.562171565355676)  # T is 0 at half of the load
    pair = Problem(layer, balls, Load("approach", (0.5, 0.5)), Elastic(1e3, 0.3))
    both, last = (MODELS["linear_bem"].solve(pair, Run(1e-2, steps=s)) for s in ((0.5, 1.0), (1.0,)))
    assert both.solved.notes[0].startswith("at 0.5 of the load: T is close to zero")
    assert both.solved.notes[1:] == last.solved.notes != ()


@pytest.mark.parametrize("cell", ["", "[periodic]\nlengths = [40.0, 10.0]\n"], ids=["free", "cell"])
def test_advice_that_would_take_long_beside_the_run_of_many_balls_is_left_out(
    cell: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made = []

    def counted(problem: Problem, run: Run) -> Result:
        made.append(problem.size)
        return solve(problem, look_ahead.ROUGH)

    monkeypatch.setitem(MODELS, "linear_bem", dataclasses.replace(MODELS["linear_bem"], solve=counted))
    monkeypatch.setattr(plan, "FEW", 0)
    monkeypatch.setattr(plan, "PART", 0.0)
    monkeypatch.setattr(plan, "SHORTEST", 0.0)
    file = tmp_path / "row.toml"
    file.write_text(TEXT.format(places=[list(p) for p in PLACES], load="approach = 0.1") + cell, encoding="utf-8")
    plan.plan_scene(read_scene(file), None, as_json=True)
    found = json.loads(capsys.readouterr().out)
    left = "shape, substrate, poisson, contact size, neighbours, sensitivity of T to the inputs"
    left += f"; to compute it, plan a scene of {'fewer balls' if cell else 'the balls in question alone'}"
    assert any(note.endswith(left) for note in found["notes"])
    assert found["sensitivity"] is None
    assert [item["effect"] for item in found["advice"]] == ["finite_strain", "reciprocation"]
    assert len(made) <= 2


@pytest.mark.parametrize("cell", [False, True])
@pytest.mark.parametrize("count", [60, 110])
def test_a_plan_of_a_hundred_balls_solves_few_of_them_or_samples_few(
    count: int, cell: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def counted(problem: Problem, run: Run) -> Result:
        result = solve_contact(problem, look_ahead.ROUGH, sample=run.sample).result()
        made.append(len(result.solved.accuracy.get("sample", range(problem.size))))  # those that take most of the time
        return result

    monkeypatch.setitem(MODELS, "linear_bem", dataclasses.replace(MODELS["linear_bem"], solve=counted))
    monkeypatch.setattr(plan, "SHORTEST", 0.0)
    places = [[2.3 * (k % 10), 2.3 * (k // 10)] for k in range(count)]
    text = TEXT.format(places=places, load="force = 0.02")
    text += f"[periodic]\nlengths = [23.0, {0.23 * count}]\n" if cell else ""
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8")
    plan.plan_scene(read_scene(file), None, as_json=True)
    assert sum(made) <= 20


def test_the_memory_planned_is_that_of_many_balls_and_of_grids() -> None:
    ahead = solve(ROW, look_ahead.ROUGH)
    # measured: 754 MB with 10 000 balls of degree 4, 357 MB with 1600 of degree 6, 119 MB with two punches on a grid
    sampled = {"sample": [0]}
    for size, unknowns, accuracy, least, most in (
        (10_000, 15 * COUNT, sampled, 6.3e8, 9.0e8),
        (1600, 28 * COUNT, sampled, 2.9e8, 4.3e8),
        (COUNT, 126_464, {}, 1e8, 2.5e8),
    ):
        many = dataclasses.replace(ROW, balls=tuple(Ball((2.2 * k, 0.0), 1.0) for k in range(size)),
                                   load=Load("approach", (0.1,) * size))  # fmt: skip
        solved = dataclasses.replace(ahead.solved, unknowns=unknowns, accuracy=accuracy)
        result = dataclasses.replace(ahead, solved=solved)
        details = plan._model_plan(MODELS["linear_bem"], None, many, result, 1.0)  # type: ignore[arg-type]
        assert least < details["memory_bytes"] < most


def lattice(count: int) -> tuple[Ball, ...]:
    return tuple(Ball((2.2 * (k % 50), 2.2 * (k // 50)), 1.0) for k in range(count))


@pytest.mark.parametrize("count", [2000, 800])
def test_the_time_of_many_balls_grows_with_their_number_beside_the_sample(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = solve(ROW, look_ahead.ROUGH)
    clock, solved = [0.0], []

    def model(problem: Problem, run: Run) -> Result:
        solved.append((problem.size, run.tangential_force, run.sample))
        for line, seconds in (
            ("degree 4, sweep 1: change 1e-5, tolerance 1e-4", 0.01 * problem.size),
            (f"degree 4{SAMPLE}30 contacts are solved exactly", 1.2),
            ("5 of 30 contacts solved exactly", 0.8),
            ("degree 4: results", 0.001 * problem.size),
        ):
            run.report(line)
            clock[0] += seconds
        return dataclasses.replace(known, solved=dataclasses.replace(known.solved, seconds=99.0))

    monkeypatch.setattr(look_ahead.time, "process_time", lambda: clock[0])
    monkeypatch.setitem(MODELS, "linear_bem", dataclasses.replace(MODELS["linear_bem"], solve=model))
    problem = Problem(Layer(1.0, 0.48, 2.0), lattice(count), Load("total_force", (50.0,)))
    *_, seconds = look_ahead.ahead_of(problem, 1e-3)
    runs = [(look_ahead.MANY, 1e-3, look_ahead.SAMPLED), (look_ahead.FEW, 1e-3, None)]
    if count == 2000:
        assert solved == runs[:1]
        assert seconds == pytest.approx(2.0 * look_ahead.LARGER + 0.011 * count)
    else:  # 14 of 120 touch, that is 93 of 800: no sample judges those
        assert solved == runs
        assert seconds == pytest.approx((2.0 / look_ahead.FEW + 0.011) * count)


def test_the_lines_of_progress_say_when_the_sample_begins_and_ends() -> None:
    lines: list[str] = []
    problem = Problem(Layer(1.0, 0.48, 2.0), lattice(105), Load("approach", (0.1,) * 105))
    solve(problem, 1e-2, lines.append)
    degrees = [line for line in lines if line.startswith("degree")]
    begun = [SAMPLE in line for line in degrees].index(True)
    assert "sweep" in degrees[begun - 1]
    assert [SAMPLE in line for line in degrees[begun:]] == [True, True, False]


def test_a_cell_of_many_balls_is_planned_by_a_smaller_one() -> None:
    places = np.array([(2.2 * i + 0.1 * (j % 2), 2.2 * j) for i in range(15) for j in range(20)])
    balls = tuple(Ball((float(x), float(y)), 1.0) for x, y in places)
    cell = Problem(Layer(1.0, 0.48, 2.0), balls, Load("approach", (0.1,) * 300), periodic=Periodic((33.0, 44.0)))
    part, seen = look_ahead.in_the_middle(cell, 120)
    assert part.size == len(seen) == 120
    assert part.periodic is not None
    area = math.prod(part.periodic.lengths) / part.size
    assert area == pytest.approx(33.0 * 44.0 / 300, rel=0.3)
    # offsets of the balls from each other are those of nearest images
    apart = np.array([ball.position for ball in part.balls]) - places[list(seen)]
    shift = apart / (33.0, 44.0)
    assert shift == pytest.approx(np.round(shift), abs=1e-9)
    assert look_ahead.in_the_middle(cell, 299) == (cell, range(300))


def test_advice_on_a_part_of_a_cell_names_the_balls_of_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    few = dataclasses.replace(ROW, balls=ROW.balls[4:7], load=Load("approach", (0.1,) * 3))
    ahead = solve(few, look_ahead.ROUGH)
    monkeypatch.setattr(plan.Adviser, "advise", lambda _: ["some"])
    monkeypatch.setattr(plan.sensitivity, "record", lambda _, ball=None: {"ball": ball})
    scene = SimpleNamespace(drift={}, problem=few, tangential_force=None, effects=("periodic",))
    small = dataclasses.replace(ROW.balls[0], radius=0.5)
    whole = dataclasses.replace(ROW, balls=(small, *ROW.balls[1:]))
    part = dataclasses.replace(few, periodic=Periodic((40.0, 10.0)))
    _, inputs, notes = plan._advice(scene, whole, part, ahead, range(4, 7), 60.0)
    assert inputs == {"ball": 4 + leading_ball([ball.to_dict() for ball in ahead.balls])}
    (note,) = notes  # R of the legend is that of ball 0
    assert note.startswith("in the changes of the scene, R is the radius of ball ")
    assert plan._advice(scene, ROW, part, ahead, range(4, 7), 60.0)[2] == []


def test_advice_on_many_balls_is_about_the_ball_that_leads_among_all(monkeypatch: pytest.MonkeyPatch) -> None:
    few = dataclasses.replace(ROW, balls=ROW.balls[:3], load=Load("approach", (0.1,) * 3))
    ahead = solve(few, look_ahead.ROUGH)
    # without their own neighbours, others may have the largest T
    near = dataclasses.replace(ahead, balls=(ahead.balls[1], *ahead.balls[::2]))
    assert leading_ball([ball.to_dict() for ball in near.balls]) != 0
    asked = []
    monkeypatch.setattr(plan, "closest", lambda *_: (dataclasses.replace(few, balls=few.balls[::-1]), near))
    monkeypatch.setattr(plan.Adviser, "advise", lambda adviser: [adviser.ball])
    monkeypatch.setattr(plan.sensitivity, "record", lambda _, ball=None: asked.append(ball))
    scene = SimpleNamespace(drift={}, problem=few, tangential_force=None, effects=())
    advice, *_ = plan._advice(scene, ROW, few, ahead, range(3), 60.0)
    assert advice == [0]
    assert asked == [0]


def test_the_time_planned_is_that_of_an_idle_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def slowed(problem: Problem, run: Run) -> Result:
        result = solve(problem, look_ahead.ROUGH)
        wall = result.solved.seconds + 30.0  # as if another program had the core
        return dataclasses.replace(result, solved=dataclasses.replace(result.solved, seconds=wall))

    file = tmp_path / "row.toml"
    file.write_text(TEXT.format(places=[list(p) for p in PLACES], load="total_force = 0.7"), encoding="utf-8")
    monkeypatch.setitem(MODELS, "linear_bem", dataclasses.replace(MODELS["linear_bem"], solve=slowed))
    plan.plan_scene(read_scene(file), None, as_json=True)
    planned = json.loads(capsys.readouterr().out)["models"][0]["seconds"]
    assert 0.0 < planned < 30.0
