"""Drift of hard balls: the analytic law, contacts that hold and part, symmetry, and equilibria."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from linear_bem import Ball, Layer, LayeredKernel, Load, Problem, UnsupportedProblem
from runs.evolution import equilibria
from runs.evolution.drawing import chosen_cycles
from runs.evolution.drift import Drift, Moment
from runs.evolution.evolving import balls_of
from runs.evolution.forces import DirectForces, State
from runs.evolution.hard_balls import HardBalls
from runs.evolution.outcome import equilibrium, position_error
from runs.evolution.outcome import rest as rest_of
from runs.evolution.providers import Provider
from runs.evolution.record import Record, events, positions_at
from runs.scene.scene_file import read_scene
from tests.runs.foam_balls import FOAM, RADIUS, line, of, scene, spread
from tests.scenes import thin_pair

Array = NDArray[np.float64]

ROUNDOFF = 1e-10
THEORY = 0.01
"""Of L^3 linear in the path: a pair at a fixed approach loses load, by 0.7 % at 2 R and D = 1e-4 R."""
TOLERANCE = 1e-6 * RADIUS
REST = 1e-6


def path(forces: object, problem: Problem, end: float, start: Array | None = None, rest: float = REST) -> list[Moment]:
    x = np.array([ball.position for ball in problem.balls]) if start is None else start
    return list(Drift(forces, HardBalls.of(problem), TOLERANCE, rest).path(x, end))  # type: ignore[arg-type]


@pytest.mark.parametrize(("model", "thickness"), [("point_load", np.inf), ("point_load", 100.0), ("full", np.inf)])
def test_two_balls_on_a_half_space_meet_as_the_cube_of_their_distance(
    model: str, thickness: float, tables: Path
) -> None:
    problem = scene(line(2, 6.0 * RADIUS), Layer(1e6, 0.3, float(thickness)), 1e-4 * RADIUS)
    forces = DirectForces(problem, 1e-3) if model == "full" else of(model, problem, tables).forces
    moments = path(forces, problem, np.inf, rest=1e-12)
    distance = np.array([np.ptp(m.positions[:, 0]) for m in moments])
    sigma = np.array([m.sigma for m in moments])
    load = float(forces(moments[0].positions).normal[0])
    singular = LayeredKernel.of(problem).singular
    # dL/dsigma = -2 T/Q with T = Q^2 (1 - nu^2)/(pi E L^2)
    expected = distance[0] ** 3 - 6.0 * load * singular * sigma
    assert distance[-1] == pytest.approx(2.0 * RADIUS, rel=ROUNDOFF)
    assert np.max(np.abs(distance**3 - expected)) <= THEORY * distance[0] ** 3
    assert moments[-1].resting
    assert sigma[-1] == pytest.approx((distance[0] ** 3 - distance[-1] ** 3) / (6.0 * load * singular), rel=THEORY)


def test_balls_of_different_size_touch_where_their_spheres_do() -> None:
    balls = (Ball((0.0, 0.0), 0.01, "sphere"), Ball((0.05, 0.0), 0.004, "sphere"))
    problem = Problem(FOAM, balls, Load("approach", (0.001, 0.001)))
    touch = HardBalls.of(problem).smallest
    assert np.hypot(touch, 0.01 - 0.004) == pytest.approx(0.01 + 0.004, rel=1e-14)
    with pytest.raises(UnsupportedProblem, match="flat plate"):
        HardBalls.of(Problem(FOAM, balls, Load("approach", (0.001, 0.002))))


def test_pushes_keep_touching_balls_apart_and_never_pull() -> None:
    problem = scene(line(3, 2.0 * RADIUS))
    balls = HardBalls.of(problem)
    x = np.array([ball.position for ball in problem.balls])
    load = np.array([1.0, 2.0, 1.5])
    contacts = balls.touching(x)
    assert balls.pairs(contacts).tolist() == [[0, 1], [1, 2]]
    inwards = np.array([[0.3, 0.0], [0.1, 0.0], [-0.4, 0.0]])
    velocity, pushes = balls.admissible(x, inwards, load, contacts)
    # sum T = 0: three balls in contact with the outer ones attracted stay where they are
    assert np.abs(velocity) == pytest.approx(0.0, abs=1e-14)
    assert pushes == pytest.approx([0.3, 0.4])
    velocity, pushes = balls.admissible(x, -inwards, load, contacts)
    assert velocity == pytest.approx(-inwards / load[:, None])
    assert np.all(pushes == 0.0)
    # one pair parts while the other is pushed along: the projection in the metric Q shares the push out
    velocity, pushes = balls.admissible(x, np.array([[0.5, 0.0], [0.0, 0.0], [0.3, 0.1]]), load, contacts)
    assert pushes == pytest.approx([1.0 / 3.0, 0.0])
    assert velocity[0, 0] == pytest.approx(velocity[1, 0])
    assert velocity[2, 0] > velocity[1, 0]


def test_a_ball_without_load_is_not_moved_by_its_force_and_gives_way() -> None:
    problem = scene(line(2, 2.0 * RADIUS))
    balls = HardBalls.of(problem)
    x = np.array([ball.position for ball in problem.balls])
    free = np.zeros(0, dtype=np.intp)
    velocity, _ = balls.admissible(x, np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([1.0, 0.0]), free)
    assert np.all(velocity == 0.0)
    velocity, _ = balls.admissible(x, np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([1.0, 0.0]), balls.touching(x))
    assert velocity[:, 0] == pytest.approx([1.0, 1.0], rel=1e-5)


def test_a_touching_pair_that_repels_parts_and_one_that_attracts_stays(tables: Path) -> None:
    rubber = Layer(1e6, 0.48, 0.01)
    radii = {0.008: "part", 0.005: "stay"}
    for radius, what in radii.items():
        balls = (Ball((-radius, 0.0), radius, "sphere"), Ball((radius, 0.0), radius, "sphere"))
        problem = Problem(rubber, balls, Load("approach", (0.0015, 0.0015)))
        moments = path(of("point_load", problem, tables).forces, problem, 1.0)
        distance = [float(np.ptp(m.positions[:, 0])) for m in moments]
        assert len(moments[0].contacts) == 1
        assert rest_of(moments[0])["holding"] == (what == "stay")
        if what == "part":
            assert np.all(np.diff(distance) > 0.0)
            assert distance[-1] > 2.4 * radius
            assert not moments[-1].resting
        else:
            assert len(moments) == 1
            assert moments[0].resting
            assert moments[0].pushes[0] > 0.0


def test_no_ball_overlaps_and_contacts_hold_on_the_whole_path(foam: Provider) -> None:
    problem = scene([(0.021 * i + 0.0003 * j * j, 0.022 * j - 0.0002 * i * j) for i in range(3) for j in range(3)])
    balls = HardBalls.of(problem)
    forces = spread(foam, problem)
    moments = path(forces, problem, 5.0)
    assert min(float(np.min(balls.gaps(m.positions))) for m in moments) >= -1e-11 * RADIUS
    for moment in moments:
        assert np.all(moment.pushes >= 0.0)
        velocity, pushes = balls.admissible(
            moment.positions, moment.state.tangential, moment.state.normal, moment.contacts
        )
        opening = balls.jacobian(moment.positions, moment.contacts) @ velocity.ravel()
        assert np.all(opening >= -ROUNDOFF)
        assert np.abs(opening * pushes) == pytest.approx(0.0, abs=ROUNDOFF)
    assert moments[-1].resting
    assert moments[-1].speed <= REST
    assert len(moments[-1].contacts) == 16  # nine discs have at most 16 contacts in the plane: closest packing


def test_momentum_is_kept_and_equal_loads_keep_the_centroid(foam: Provider) -> None:
    problem = scene([(0.0, 0.0), (0.031, 0.004), (0.011, 0.035), (-0.02, 0.027)])
    for moment in path(spread(foam, problem), problem, 2.0):
        # at every instant sum Q dx = 0: pushes are internal, and so is T
        balls = HardBalls.of(problem)
        velocity, _ = balls.admissible(moment.positions, moment.state.tangential, moment.state.normal, moment.contacts)
        drift = np.abs((velocity * moment.state.normal[:, None]).sum(axis=0))
        assert drift == pytest.approx(0.0, abs=1e-12 * float(np.max(np.abs(moment.state.tangential))))
    pair = scene([(0.0, 0.0), (0.04, 0.03)])
    ends = path(spread(foam, pair), pair, 3.0)
    assert ends[-1].positions.mean(axis=0) == pytest.approx([0.02, 0.015], rel=1e-12)


def test_mirror_scenes_have_mirror_paths(foam: Provider) -> None:
    problem = scene([(0.0, 0.0), (0.031, 0.004), (0.011, 0.035), (-0.02, 0.027)])
    start = np.array([ball.position for ball in problem.balls])
    forces = spread(foam, problem)
    here, there = (path(forces, problem, 1.0, start * [sign, 1.0]) for sign in (1.0, -1.0))
    assert len(here) == len(there)
    for one, other in zip(here, there, strict=True):
        assert other.positions * [-1.0, 1.0] == pytest.approx(one.positions, abs=1e-9 * RADIUS)


def test_a_finer_tolerance_moves_the_end_by_less_than_the_stated_error(foam: Provider) -> None:
    problem = scene([(0.0, 0.0), (0.031, 0.004), (0.011, 0.035), (-0.02, 0.027)])
    balls, forces = HardBalls.of(problem), spread(foam, problem)
    start = np.array([ball.position for ball in problem.balls])
    record = Record()
    for moment in Drift(forces, balls, TOLERANCE, REST).path(start, 0.3):
        record.take(moment, balls, last=moment.sigma >= 0.3)
    stated = position_error(record.moments, forces, balls, start, TOLERANCE, REST)
    finer = list(Drift(forces, balls, 0.5 * TOLERANCE, REST).path(start, 0.3))[-1].positions
    change = float(np.max(np.abs(finer - record.moments[-1].positions)))
    assert 0.0 < change < stated < 1e-3 * RADIUS


def test_the_stated_error_of_positions_is_that_of_the_coarser_path_where_contacts_close() -> None:
    problem, tolerance = scene(line(4, 0.03)), 1e-4 * RADIUS
    balls, x = HardBalls.of(problem), problem.positions

    def attracting(at: Array) -> State:
        away = at[None, :, 0] - at[:, None, 0] + np.eye(4)
        pull = np.sum(np.sign(away) * (0.01 / away) ** 2 - 1e-4 * np.eye(4), axis=1)
        return State(np.stack([pull, np.zeros(4)], axis=1), np.ones(4), np.zeros(4))

    record = Record()
    for moment in Drift(attracting, balls, tolerance, REST).path(x, 1.0):
        record.take(moment, balls, last=moment.resting)
    stated = position_error(record.moments, attracting, balls, x, tolerance, REST)
    coarse, exact = (list(Drift(attracting, balls, k * tolerance, REST).path(x, 1.0)) for k in (10.0, 0.01))
    sigma, place = np.array([moment.sigma for moment in exact]), np.array([moment.positions for moment in exact])
    there = positions_at(np.array([moment.sigma for moment in coarse]), sigma, place)
    true = float(np.max(np.abs(there - [moment.positions for moment in coarse])))
    assert 0.5 * true < stated < 1.1 * true


def test_motion_that_starts_slowly_is_kept_as_it_is() -> None:
    problem = scene([(0.0, 0.0), (0.05, 0.0)])
    balls, at_rest = HardBalls.of(problem), State(np.zeros((2, 2)), np.ones(2), np.zeros(2))
    record, none = Record(), np.array([], dtype=np.intp)

    def place(sigma: float) -> float:
        return float(1e-6 * RADIUS * np.exp(3.0 * sigma))  # grows to 0.3 R

    for sigma in np.linspace(0.0, 4.2, 421):
        x = np.array([[0.0, 0.0], [0.05 + place(sigma), 0.0]])
        record.take(Moment(sigma, x, at_rest, none, none, 1.0, 0.01, 0.0, False), balls, last=sigma == 4.2)
    kept = [moment.sigma for moment in record.moments]
    between = np.interp(2.9, kept, [moment.positions[1, 0] - 0.05 for moment in record.moments])
    assert between == pytest.approx(place(2.9), rel=0.2)
    assert len(kept) < 80


def test_balls_in_contact_within_a_coarse_tolerance_have_not_parted_and_are_one_group(tmp_path: Path) -> None:
    file = tmp_path / "pair.toml"
    drift = "[reciprocation]\namplitude = 1\ncycles = 1\nfriction = 1\ntolerance = 1e-2\n"
    file.write_text(thin_pair() + drift, encoding="utf-8")
    balls, at_rest = balls_of(read_scene(file)), State(np.zeros((2, 2)), np.ones(2), np.zeros(2))
    moments = []
    for sigma, gap in enumerate((1e-9, 0.009, 1e-9, 0.014)):  # over the radius
        x = np.array([[0.0, 0.0], [balls.smallest + gap * balls.radii[0], 0.0]])
        contacts = balls.touching(x, balls.tolerance)
        moments.append(Moment(float(sigma), x, at_rest, contacts, np.zeros(len(contacts)), 1.0, 1.0, 0.0, False))
        assert len(balls.groups(x)) == 2 - len(contacts)
    assert [(event.sigma, event.kind) for event in events(moments, balls)] == [(0.0, "touch"), (3.0, "part")]


def test_edge_balls_pair_first_and_two_groups_merge(foam: Provider) -> None:
    problem = scene(line(4, 0.03))
    balls = HardBalls.of(problem)
    record = Record()
    for moment in path(spread(foam, problem), problem, 5.0):
        record.take(moment, balls, last=moment.resting)
    touches = [event.pair for event in events(record.moments, balls)]
    assert sorted(touches[:2]) == [(0, 1), (2, 3)]
    assert touches[2] == (1, 2)
    assert record.moments[-1].positions[:, 1] == pytest.approx(0.0, abs=ROUNDOFF)
    # pictures show when groups form
    kept = record.to_dict(balls, Path())["path"]
    shown = chosen_cycles([{**moment, "cycle": moment["sigma"]} for moment in kept], 6, balls)
    formed = {event.sigma for event in events(record.moments, balls)}
    assert len(shown) == 6
    assert shown == sorted(shown)
    assert all(min(abs(sigma - at) for at in shown) <= 1e-9 * shown[-1] for sigma in formed)


def test_the_straight_line_is_unstable_and_the_rhomb_stable(foam: Provider) -> None:
    problem = scene(line(4, 0.021))
    balls, forces = HardBalls.of(problem), spread(foam, problem)
    straight = path(forces, problem, 5.0)[-1]
    found = equilibria.find(forces, balls, straight.positions)
    assert found.verdict == "unstable"
    assert found.free == 2
    assert found.growth[0] > 0.0
    shaken = straight.positions + np.array([[0.0, 1e-5], [0.0, -1e-5], [0.0, 1e-5], [0.0, -1e-5]])
    x = equilibria.on_contacts(balls, shaken, straight.state.normal, balls.touching(straight.positions, TOLERANCE))
    moments = path(forces, problem, 20.0, x)
    # the disturbance grows at the rate of the linearised drift
    bend = np.array([abs(m.positions[1, 1] - m.positions[2, 1]) for m in moments])
    early = (bend > 3e-5) & (bend < 3e-4)
    rate = np.polyfit(np.array([m.sigma for m in moments])[early], np.log(bend[early]), 1)[0]
    assert rate == pytest.approx(found.growth[0], rel=0.05)
    rhomb = equilibria.find(forces, balls, moments[-1].positions)
    assert moments[-1].resting
    assert rhomb.verdict == "stable"
    assert rhomb.free == 0
    assert len(rhomb.contacts) == 5
    assert rhomb.positions == pytest.approx(moments[-1].positions, abs=1e-8 * RADIUS)


def test_contacts_with_gaps_up_to_the_tolerance_of_the_path_hold_its_end(foam: Provider) -> None:
    problem = scene(line(4, 0.021))
    balls, forces, coarse = HardBalls.of(problem), spread(foam, problem), 1e-3 * RADIUS
    start = problem.positions + np.array([[0.0, 1e-3], [0.0, -1e-3], [0.0, 1e-3], [0.0, -1e-3]])
    end = list(Drift(forces, balls, coarse, REST).path(start, 50.0))[-1]
    gaps = balls.gaps(end.positions, end.contacts)
    assert equilibria.HELD * balls.smallest < np.max(gaps) <= coarse
    found = equilibrium(forces, balls, end.positions, equilibria.DIFFERENCE, coarse)
    assert found["verdict"] == "stable"
    assert found["free_motions"] == 0
    assert found["distance_from_end"] < coarse


def test_where_a_path_ends_changes_its_last_moment_alone(foam: Provider) -> None:
    problem = scene([(0.0, 0.0), (0.023, 0.001), (0.001, 0.024), (0.025, 0.027)])
    balls, forces, tolerance = HardBalls.of(problem), spread(foam, problem), 1e-3 * RADIUS
    coarse, fine = (Drift(forces, balls, each, REST) for each in (tolerance, 0.01 * tolerance))
    whole = list(coarse.path(problem.positions, 2.0))
    sigma = np.array([moment.sigma for moment in whole])
    for before, share in ((3, 0.9), (5, 0.3), (11, 0.9), (11, 0.95)):  # balls touch, at last all, at their ends
        end = float(sigma[before] + share * (sigma[before + 1] - sigma[before]))
        cut = list(coarse.path(problem.positions, end))
        assert [moment.sigma for moment in cut] == [*sigma[: before + 1], pytest.approx(end, rel=1e-12)]
        true = list(fine.path(problem.positions, end))[-1]
        assert np.max(np.abs(cut[-1].positions - true.positions)) < 2.0 * tolerance


def test_forces_that_fail_beyond_the_end_of_a_path_do_not_matter() -> None:
    balls, start = HardBalls.of(scene(line(2, 0.03))), np.array(line(2, 0.03))

    def failing(x: Array) -> State:
        if np.ptp(x[:, 0]) < 0.023:  # at sigma = 3.5
            raise UnsupportedProblem("too near")
        return State(np.array([[1e-3, 0.0], [-1e-3, 0.0]]), np.ones(2), np.zeros(2))

    for end in (3.0, 3.45):
        moments = list(Drift(failing, balls, TOLERANCE, REST).path(start, end))
        assert np.ptp(moments[-1].positions[:, 0]) == pytest.approx(0.03 - 2e-3 * end, rel=1e-12)
        assert position_error(moments, failing, balls, start, TOLERANCE, REST) < TOLERANCE
    with pytest.raises(UnsupportedProblem, match="too near"):
        list(Drift(failing, balls, TOLERANCE, REST).path(start, 3.6))
