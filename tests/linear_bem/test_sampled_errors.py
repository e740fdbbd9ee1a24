"""Errors of many balls, from a sample of them that is solved exactly."""

from dataclasses import replace

import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, Problem, sampled_solution, solve, solve_contact
from linear_bem.errors import InvalidProblem, NotConverged
from linear_bem.problem import Periodic
from linear_bem.sampled_solution import sample_error
from linear_bem.smooth.newton import solve_zones
from tests.linear_bem.sampled_scenes import errors, forces, scattered, scene


@pytest.mark.parametrize(
    ("load", "base"), [("approach", "half-space"), ("force", "rigid base"), ("total_force", "elastic base")]
)
def test_a_sampled_solution_meets_a_sharper_one_within_its_stated_error(load, base):
    problem = scene(load, base)
    quick, sharp = solve(problem, 1e-3), solve(problem, 1e-4)
    assert quick.solved.accuracy["reached"] <= quick.solved.accuracy["asked"] == 1e-3  # the names of all models
    assert 16 < len(quick.solved.accuracy["sample"]) < problem.size
    difference = np.max(np.abs(forces(quick) - forces(sharp)), axis=1)
    assert np.all(difference <= errors(quick) + errors(sharp))
    largest = np.max(np.abs(forces(sharp)))
    assert np.max(difference) < 1e-3 * largest
    assert np.max(np.abs(forces(quick).sum(axis=0))) < 1e-3 * largest
    assert [b.normal_force for b in quick.balls] == pytest.approx([b.normal_force for b in sharp.balls], rel=1e-4)
    for name in ("normal_force", "approach"):
        for here, there in zip(quick.balls, sharp.balls, strict=True):
            known = here.errors[name] + there.errors[name] + 1e-9 * abs(getattr(there, name))
            assert abs(getattr(here, name) - getattr(there, name)) <= known
    if load == "total_force":
        assert sum(b.normal_force for b in quick.balls) == pytest.approx(problem.load.values[0], rel=1e-8)


def test_a_sample_without_a_solution_leaves_the_error_unbounded_and_says_so(monkeypatch):
    def lost(contacts, report):
        sample = sample_error(contacts, report)
        return replace(sample, tangential_force=np.full(len(sample.tangential_force), np.inf))

    problem = scene("approach", "half-space", 110)
    lifted = problem.with_load("approach", (*[0.1] * 109, -0.1))
    monkeypatch.setattr(sampled_solution, "sample_error", lost)
    result = solve(lifted, 1e-2)
    assert result.solved.accuracy["reached"] == np.inf
    assert result.balls[0].tangential_force_error == np.inf
    assert result.balls[-1].tangential_force_error == 0.0
    assert "is estimated to inf" in result.solved.notes[0]


@pytest.mark.parametrize(("load", "adds"), [("approach", True), ("force", False)])
def test_what_a_ball_alone_is_off_in_force_is_part_of_the_error_of_its_pull(monkeypatch, load, adds):
    def off(contacts, report):
        sample = sample_error(contacts, report)
        return replace(sample, normal_force=sample.normal_force + 1e-6)

    problem = scene(load, "half-space")
    known = solve(problem, 1e-2)
    monkeypatch.setattr(sampled_solution, "sample_error", off)
    pull = [np.hypot(*b.tangential_force) / b.normal_force for b in known.balls]
    more = errors(solve(problem, 1e-2)) - errors(known)
    assert more == pytest.approx(sampled_solution.UNSAMPLED * 1e-6 * np.array(pull) * adds, rel=0.1, abs=1e-12)


def test_the_sample_has_the_balls_that_are_deepest_for_their_size():
    places, radii = scattered(105, 20.0, low=0.1)
    balls = tuple(Ball((x, y), r) for (x, y), r in zip(places.tolist(), radii.tolist(), strict=True))
    contacts = solve_contact(Problem(Layer(1.0, 0.48, np.inf), balls, Load("total_force", (3.0,))), 1e-3).contacts
    steep = [n.zone.reach / radii[k] for k, n in zip(contacts.touching, contacts.smooth.nodes, strict=True)]
    assert set(np.argsort(steep)[-4:].tolist()) <= set(contacts.sample)


@pytest.mark.parametrize("load", ["approach", "force"])
def test_balls_of_the_sample_solved_together_are_those_solved_one_by_one(monkeypatch, load):
    def one_by_one(kernel, shapes, zones, approaches, groups, tolerance, *, apart):
        assert apart
        if len(zones) > 1:
            raise NotConverged("together")
        return solve_zones(kernel, shapes, zones, approaches, groups, 1e-8)

    contacts = solve_contact(scene(load, "elastic base", 110), 1e-3).contacts
    together = sample_error(contacts)
    monkeypatch.setattr(sampled_solution, "sweep_zones", one_by_one)
    alone = sample_error(contacts)
    largest = np.max(np.abs(contacts.mutual_force))
    assert together.tangential_force == pytest.approx(alone.tangential_force, abs=1e-7 * largest)
    assert together.normal_force == pytest.approx(alone.normal_force, abs=1e-9)
    assert together.settled == pytest.approx(alone.settled, abs=1e-7)


def test_a_sample_of_given_size_judges_fewer_balls():
    problem = scene("approach", count=25)
    found = solve_contact(problem, 1e-3, sample=4).result()
    assert 4 <= len(found.solved.accuracy["sample"]) <= 4 + 5  # at equal steps, and one by each measure
    exact = forces(solve(problem, 1e-5))
    assert np.max(np.abs(forces(found) - exact)) < 1e-3 * np.max(np.hypot(*exact.T))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("count", "size", "load"),
    [(n, size, "approach") for n, size in ((1, 1), (2, 2), (3, 3), (102, 1))] + [(1, 2, "force"), (2, 1, "force")],
)
@pytest.mark.parametrize("cell", [False, True])
def test_the_smallest_samples_judge_one_ball_as_well_as_many(count, size, load, cell):
    rows = int(np.ceil(np.sqrt(count)))
    balls = tuple(Ball((2.5 * (k % rows), 2.5 * (k // rows)), 1.0) for k in range(count))
    periodic = Periodic((2.5 * rows, 2.5 * rows)) if cell else None
    given = Load(load, (0.1,) * count if load == "approach" else (0.05,) * count)
    problem = Problem(Layer(1.0, 0.48, 1.5), balls, given, periodic=periodic)
    judged, known = solve_contact(problem, 1e-2, sample=size).result(), solve(problem, 1e-3)
    assert 1 <= len(judged.solved.accuracy["sample"]) <= size
    difference = np.max(np.abs(forces(judged) - forces(known)), axis=1)
    assert np.all(difference <= errors(judged) + errors(known) + 1e-12)
    for name in ("normal_force", "approach"):
        for here, there in zip(judged.balls, known.balls, strict=True):
            assert abs(getattr(here, name) - getattr(there, name)) <= here.errors[name] + there.errors[name] + 1e-12


def test_a_sample_of_the_only_ball_in_contact_judges_it():
    lifted = Problem(Layer(1.0, 0.48, 1.5), (Ball((0.0, 0.0), 1.0), Ball((2.5, 0.0), 1.0)), Load("force", (0.1, 0.0)))
    result = solve_contact(lifted, 1e-2, sample=1).result()
    assert result.solved.accuracy["sample"] == [0]
    assert np.all(forces(result) == 0.0)


@pytest.mark.parametrize("size", [0, -1, 1.5, True])
def test_a_sample_of_no_balls_is_refused(size):
    with pytest.raises(InvalidProblem, match=f"sample: must be a whole number of balls, 1 or more.* got {size}"):
        solve_contact(scene("approach"), 1e-2, sample=size)


def test_a_sample_of_more_balls_than_there_are_takes_all():
    pair = Problem(Layer(1.0, 0.45, 2.0), (Ball((0.0, 0.0), 1.0), Ball((2.2, 0.0), 1.0)), Load("approach", (0.1, 0.1)))
    assert solve_contact(pair, 1e-2, sample=10**20).result().solved.accuracy["sample"] == [0, 1]
