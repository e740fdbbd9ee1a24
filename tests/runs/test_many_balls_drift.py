"""Many balls: a lattice in a periodic cell, rolling resistance, contacts as one problem, structure, and resuming."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from linear_bem import Ball, Layer, Load, Problem
from linear_bem.errors import UnsupportedProblem
from runs.commands.plan import plan_scene
from runs.evolution import evolving, motion, outcome, showing, structure
from runs.evolution.drift import Drift, Moment
from runs.evolution.evolving import evolve_scene
from runs.evolution.forces import Forces, State
from runs.evolution.hard_balls import HardBalls
from runs.evolution.loads import DENSE, effective_approaches
from runs.evolution.pair_forces import PairForces, PairLaw
from runs.evolution.pair_list import CUT, CutLaw, PairList
from runs.evolution.providers import Provider
from runs.models import choose
from runs.process import signals
from runs.scene.scene_file import InvalidScene, read_scene
from runs.session.session import Options
from tests.launch import ROOT, python
from tests.runs.foam_balls import RADIUS, line, of, scene, spread
from tests.test_architecture import LOADED

Array = NDArray[np.float64]

ROUNDOFF = 1e-9
INTERIOR = 1e-7
"""Of the interior-point method, relative to the largest velocity."""
TOLERANCE = 1e-6 * RADIUS
CLOSE = 1e-6
"""Share of the law left out where the sums themselves are looked at."""


def lattice(columns: int, rows: int, spacing: float) -> Array:
    return spacing * np.array([(i, j) for i in range(columns) for j in range(rows)], dtype=float)


def triangular(columns: int, rows: int, spacing: float) -> tuple[Array, Array]:
    """Return positions and cell of a triangular lattice; ``rows`` even."""
    x = [(i + 0.5 * (j % 2), 0.5 * np.sqrt(3.0) * j) for i in range(columns) for j in range(rows)]
    return spacing * np.array(x), spacing * np.array([columns, 0.5 * np.sqrt(3.0) * rows])


def in_cell(pair: PairForces, count: int, cell: Array, cut: float = CUT) -> PairForces:
    places = [tuple(p) for p in lattice(count, 1, 4.0 * pair.problem.balls[0].radius)]
    balls = tuple(Ball(place, pair.problem.balls[0].radius) for place in places)
    problem = Problem(pair.problem.layer, balls, Load("approach", pair.problem.load.values[:1] * count))
    return PairForces(problem, [pair.singles[0]] * count, pair.law, 0.0, cell, cut)


@pytest.fixture(scope="module")
def thin(tmp_path_factory: pytest.TempPathFactory) -> PairForces:
    """Point loads on a layer as thin as the balls' radius, on which touching balls separate; R = 1, E = 1."""
    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 1.16), balls, Load("approach", (0.1, 0.1)))
    given = of("point_load", problem, tmp_path_factory.mktemp("thin")).forces
    assert isinstance(given, PairForces)
    return given


@pytest.fixture(scope="module")
def thick(tmp_path_factory: pytest.TempPathFactory) -> PairForces:
    """The same on a layer of two radii, on which balls attract up to 2.35 R and separate farther away."""
    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 2.0), balls, Load("approach", (0.1, 0.1)))
    given = of("point_load", problem, tmp_path_factory.mktemp("thick")).forces
    assert isinstance(given, PairForces)
    return given


def growth_rates(pair: PairForces, spacing: float, wave: float, reach: float = 40.0) -> tuple[float, float]:
    r"""Return the growth rates [1/m of path over friction] of a square lattice along and across a wave along x.

    With all loads Q, displacements u_j = U exp(i q x_j) and the pair law's k and c at the lattice's distances, the
    linearised balance of loads gives (1/s + sum k exp(i q r)) dQ = -Q i sum k' n sin(q r) U, s = dF/dd, and

        du/dsigma = Q [sum (c' n n + c/L (1 - n n)) (cos(q r) - 1) + (sum c n sin)(sum k' n sin)/(1/s + sum k exp)] U.
    """
    steps = np.arange(-int(reach / spacing), int(reach / spacing) + 1)
    r = spacing * np.array([(i, j) for i in steps for j in steps if (i, j) != (0, 0)], dtype=float)
    distance = np.hypot(*r.T)
    n = r / distance[:, None]
    (k, c), h = pair.law(distance), 1e-4
    (k_up, c_up), (k_down, c_down) = pair.law(distance + h), pair.law(distance - h)
    k_slope, c_slope = (k_up - k_down) / (2.0 * h), (c_up - c_down) / (2.0 * h)
    single, approach = pair.singles[0], pair.problem.load.values[0]
    load = single.force(np.array([approach]))[0]
    for _ in range(200):  # the load that all balls share
        load = 0.5 * load + 0.5 * single.force(np.array([approach - np.sum(k) * load]))[0]
    slope = single.force_and_slope(np.array([approach - np.sum(k) * load]))[1][0]
    phase = wave * r[:, 0]
    soft = 1.0 / slope + np.sum(k * np.cos(phase))
    rates = []
    for axis in (0, 1):
        square = n[:, axis] ** 2
        stiff = np.sum((c_slope * square + c / distance * (1.0 - square)) * (np.cos(phase) - 1.0))
        turned = np.sum(c * n[:, axis] * np.sin(phase)) * np.sum(k_slope * n[:, axis] * np.sin(phase))
        rates.append(float(load * (stiff + turned / soft)))
    return rates[0], rates[1]


@pytest.mark.parametrize(("name", "spacing"), [("thin", 3.0), ("thick", 2.2), ("thick", 3.0)])
def test_a_lattice_has_no_force_and_a_wave_in_it_grows_as_the_linear_law_says(
    name: str, spacing: float, request: pytest.FixtureRequest
) -> None:
    pair: PairForces = request.getfixturevalue(name)
    count = 8
    x = lattice(count, count, spacing)
    cell = np.array([count * spacing] * 2)
    forces = in_cell(pair, len(x), cell)
    still = forces(x)
    push = still.normal[0] ** 2 * abs(float(pair.law(np.array([spacing]))[1][0]))
    assert np.max(np.abs(still.tangential)) <= ROUNDOFF * push
    balls = HardBalls(np.ones(len(x)), cell)
    for number in (1, 3):
        wave = 2.0 * np.pi * number / cell[0]
        for axis, rate in enumerate(growth_rates(pair, spacing, wave)):
            shape = np.sin(wave * x[:, 0])
            moved = x.copy()
            moved[:, axis] += 1e-5 * shape
            path = list(Drift(forces, balls, 1e-10, 1e-15).path(moved, 0.4 / abs(rate)))
            size = [float(shape @ (m.positions - x)[:, axis]) for m in (path[0], path[-1])]
            measured = np.log(size[1] / size[0]) / path[-1].sigma
            # the law of the forces is cut, a wave of 1e-5 R is not quite linear
            assert measured == pytest.approx(rate, rel=0.02)


def test_a_cell_stands_for_its_images_and_its_edge_for_nothing(thin: PairForces) -> None:
    side, rng = 9.0, np.random.default_rng(3)
    x = np.array([(1.5, 1.5), (4.4, 2.0), (7.2, 1.2), (2.0, 5.1), (5.5, 5.6), (1.2, 7.9), (7.0, 7.5)])
    x += rng.uniform(-0.2, 0.2, x.shape)
    cell = np.array([side, side])
    forces = in_cell(thin, len(x), cell, CLOSE)
    assert forces.reach > side  # a ball acts on another, and on itself, through several images
    here = forces(x)
    copies = np.array([(0, 0), *[(i, j) for i in range(-4, 5) for j in range(-4, 5) if (i, j) != (0, 0)]])
    many = (x[None] + side * copies[:, None]).reshape(-1, 2)
    problem = in_cell(thin, len(many), cell).problem
    wide = PairForces(problem, [thin.singles[0]] * len(many), thin.law, cut=CLOSE)(many)
    assert here.normal == pytest.approx(wide.normal[: len(x)], rel=10.0 * CLOSE)
    size = float(np.max(np.abs(here.tangential)))
    assert here.tangential == pytest.approx(wide.tangential[: len(x)], abs=10.0 * CLOSE * size)
    assert here.tangential.sum(axis=0) == pytest.approx(0.0, abs=ROUNDOFF * size)
    moved = forces(x + np.array([4.3, -7.7]) + side * np.array([[1.0, 0.0]] * 3 + [[0.0, -2.0]] * 4))
    assert moved.tangential == pytest.approx(here.tangential, abs=ROUNDOFF * size)
    balls = HardBalls(np.ones(2), np.array([20.0, 20.0]))
    across = np.array([[0.5, 10.0], [19.0, 10.0]])
    assert balls.gaps(across) == pytest.approx([-0.5])
    assert balls.gaps(balls.parted(across, np.ones(2))) == pytest.approx([0.0], abs=1e-12)


def test_forces_left_out_are_as_small_as_stated(thin: PairForces) -> None:
    x = 2.4 * lattice(12, 12, 1.0) + np.random.default_rng(1).uniform(-0.15, 0.15, (144, 2))
    balls = HardBalls(np.ones(len(x)))
    assert len(balls.near(x, -1e-3)) == 0
    forces = PairForces(in_cell(thin, len(x), np.ones(2)).problem, [thin.singles[0]] * len(x), thin.law)
    # all pairs, by the law itself
    between = x[None] - x[:, None]
    distance = np.hypot(*between.T).T
    np.fill_diagonal(distance, np.inf)
    k, c = thin.law(distance)
    state = forces(x)
    load = state.normal
    for _ in range(100):
        load = 0.5 * load + 0.5 * thin.singles[0].force(0.1 - k @ load)
    np.fill_diagonal(distance, 1.0)
    full = np.einsum("ij,ijk->ik", c * np.outer(load, load) / distance, between)
    error = float(np.max(np.abs(state.tangential - full)) / np.max(np.hypot(*full.T)))
    assert 1e-7 < error < 1.2 * forces.cut_error(x) < 2e-3


def test_loads_of_many_balls_are_those_of_elimination(monkeypatch: pytest.MonkeyPatch, thin: PairForces) -> None:
    x = 2.3 * lattice(6, 6, 1.0)
    forces = PairForces(in_cell(thin, len(x), np.ones(2)).problem, [thin.singles[0]] * len(x), thin.law)
    by_elimination = forces(x)
    assert len(x) <= DENSE
    monkeypatch.setattr("runs.evolution.loads.DENSE", 0)
    assert forces(x).normal == pytest.approx(by_elimination.normal, rel=1e-11)
    from scipy.sparse import csr_matrix  # noqa: PLC0415

    none = effective_approaches(csr_matrix((2, 2)), lambda d: (d, np.ones(2)), np.array([1.0, 2.0]))
    assert none == pytest.approx([1.0, 2.0])


# the path of nine balls of foam_balls by the algorithm before this one, which stopped at every new contact
BEFORE = {
    0.05: [[1.013251, 1.933261], [1.218352, 21.93221], [2.241943, 41.905999], [21.012874, 1.81054],
           [21.217975, 21.809488], [22.241567, 41.783278], [41.01249, 1.686606], [41.217591, 21.685555],
           [42.241183, 41.659344]],
    0.2: [[1.384731, 1.770141], [-0.684505, 21.66281], [3.322578, 41.25728], [21.383159, 2.020875],
          [19.313924, 21.913544], [23.321006, 41.508015], [41.381777, 2.255989], [39.312542, 22.148658],
          [43.319624, 41.743129]],
    100.0: [[4.030295, 4.712475], [-5.727975, 22.170315], [4.511822, 39.350145], [24.028363, 4.434466],
            [14.270092, 21.892305], [24.509889, 39.072135], [44.026431, 4.156456], [34.26816, 21.614296],
            [44.507957, 38.794126]],
}  # fmt: skip


def test_nine_balls_take_the_path_that_stops_at_every_contact(foam: Provider) -> None:
    places = [(0.021 * i + 0.0003 * j * j, 0.022 * j - 0.0002 * i * j) for i in range(3) for j in range(3)]
    problem = scene(places)
    forces, balls = spread(foam, problem), HardBalls.of(problem)
    for end, expected in BEFORE.items():
        last = list(Drift(forces, balls, TOLERANCE, 1e-6).path(np.array(places), end))[-1]
        # a few steps of the tolerance, and seven printed digits
        assert last.positions == pytest.approx(1e-3 * np.array(expected), abs=5.0 * TOLERANCE)


def test_a_loose_tolerance_takes_many_contacts_in_a_step(foam: Provider) -> None:
    x = np.array(line(4, 0.021)) + np.random.default_rng(5).uniform(-3e-4, 3e-4, (4, 2))
    x = np.concatenate([x + np.array([0.0, 0.021 * j]) for j in range(4)])
    problem = scene([tuple(p) for p in x])
    forces, balls = spread(foam, problem), HardBalls.of(problem)

    def steps(tolerance: float) -> tuple[int, list[Moment]]:
        drift = Drift(forces, balls, tolerance * RADIUS, 1e-4)
        moments = list(drift.path(x, 0.1))
        return drift.steps, moments

    (fine, exact), (coarse, loose) = steps(1e-6), steps(1e-3)
    new = [len(set(b.contacts) - set(a.contacts)) for a, b in pairwise(loose)]
    assert max(new) >= 3
    assert coarse < 0.4 * fine
    assert min(float(np.min(balls.gaps(m.positions))) for m in loose) >= -1e-11 * RADIUS
    assert np.max(np.abs(loose[-1].positions - exact[-1].positions)) < 0.02 * RADIUS


@pytest.mark.parametrize("rolling", [0.0, 0.2])
def test_the_interior_point_method_finds_the_velocity_of_least_squares(
    rolling: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    x, _ = triangular(4, 4, 2.0)
    rng = np.random.default_rng(2)
    force, load = rng.normal(size=x.shape), rng.uniform(0.5, 2.0, len(x))
    balls = HardBalls(np.ones(len(x)), rolling=rolling)
    contacts = balls.touching(x, 1e-9)
    jacobian = balls.jacobian(x, contacts)
    opening = -rng.uniform(0.0, 0.3, len(contacts))
    velocity, pushes = balls.admissible(x, force, load, contacts, opening)
    assert len(contacts) == 33
    slack = jacobian @ velocity.ravel() - opening
    assert np.min(slack) >= -INTERIOR
    assert np.min(pushes) >= 0.0
    assert slack * pushes == pytest.approx(0.0, abs=INTERIOR)
    # the balance of every ball: what the resistance takes is along its motion, and no more than its share
    left = force + (jacobian.T @ pushes).reshape(x.shape) - load[:, None] * velocity
    assert np.all(np.hypot(*left.T) <= rolling * load + INTERIOR)
    power = np.sum(left * velocity, axis=1)
    assert power == pytest.approx(rolling * load * np.hypot(*velocity.T), abs=INTERIOR)
    if rolling == 0.0:
        monkeypatch.setattr(motion, "DENSE", 0)
        assert balls.admissible(x, force, load, contacts, opening)[0] == pytest.approx(velocity, abs=INTERIOR)


def inverse_square(strength: float) -> Forces:
    """Two balls of load 1: T = strength/L^2 [N], positive together."""

    def forces(x: Array) -> State:
        between = x[1] - x[0]
        pull = strength * between / float(np.hypot(*between)) ** 3
        return State(np.array([pull, -pull]), np.ones(2), np.zeros(2))

    return forces


def test_rolling_resistance_brakes_two_balls_as_the_closed_form_says() -> None:
    start = np.array([[-1.5, 0.0], [1.5, 0.0]])
    share, strength = 0.02, -0.5
    balls = HardBalls(np.ones(2), rolling=share)
    moments = list(Drift(inverse_square(strength), balls, 1e-8, 1e-5).path(start, 1e6))
    distance = np.array([np.ptp(m.positions[:, 0]) for m in moments])
    # dL/dsigma = 2 (A/L^2 - s) from L = 3: they part up to L = sqrt(A/s) = 5
    last = np.sqrt(-strength / share)

    def sigma(length: Array) -> Array:
        return np.asarray((last * np.arctanh(length / last) - length) / (2.0 * share))

    assert distance[-1] == pytest.approx(last, rel=1e-3)
    assert np.max(distance) < last
    some = slice(0, -1, max(1, len(moments) // 20))
    expected = sigma(distance[some]) - sigma(np.array([3.0]))
    assert np.array([m.sigma for m in moments])[some] == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_resistance_of_nothing_is_none_and_resistance_above_the_largest_force_stops_all(foam: Provider) -> None:
    problem = scene([(0.0, 0.0), (0.031, 0.004), (0.011, 0.035), (-0.02, 0.027)])
    start, forces = problem.positions, spread(foam, problem)

    def end(share: float) -> Moment:
        balls = HardBalls.of(problem, rolling=share)
        return list(Drift(forces, balls, TOLERANCE, 1e-6).path(start, 0.2))[-1]

    state = forces(start)
    largest = float(np.max(np.hypot(*state.tangential.T) / state.normal))
    assert np.array_equal(end(0.0).positions, list(Drift(forces, HardBalls.of(problem), TOLERANCE, 1e-6).path(
        start, 0.2))[-1].positions)  # fmt: skip
    stopped = end(1.001 * largest)
    assert stopped.resting
    assert stopped.sigma == 0.0
    some = end(0.5 * largest)
    assert some.sigma > 0.0
    moved = [float(np.max(np.abs(end(s * largest).positions - start))) for s in (0.0, 0.5, 0.9)]
    assert moved[0] > moved[1] > moved[2] > 0.0


def test_a_ball_pushes_another_only_with_what_its_own_resistance_leaves() -> None:
    x = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    balls = HardBalls(np.ones(3), rolling=0.6)
    contacts = balls.touching(x)

    def pushed(force: float) -> tuple[Array, Array]:
        return balls.admissible(x, np.array([[force, 0.0], [0.0, 0.0], [0.0, 0.0]]), np.ones(3), contacts)

    velocity, pushes = pushed(1.7)  # three balls resist with 1.8
    assert velocity == pytest.approx(0.0, abs=INTERIOR)
    assert 1.1 - INTERIOR <= pushes[0] <= 1.2 + INTERIOR
    velocity, pushes = pushed(2.1)
    assert velocity[:, 0] == pytest.approx(0.1, abs=INTERIOR)
    assert pushes == pytest.approx([1.4, 0.7], abs=1e-6)


def test_energy_never_grows_with_and_without_resistance(thick: PairForces) -> None:
    x = np.array([(0.0, 0.0), (2.3, 0.4), (0.9, 3.1), (-2.0, 2.7), (3.6, 2.9)])
    problem = in_cell(thick, len(x), np.ones(2)).problem
    forces = PairForces(problem, [thick.singles[0]] * len(x), thick.law)
    balls = HardBalls(np.ones(len(x)))
    depths = np.linspace(0.0, 0.12, 2001)
    work = np.concatenate([[0.0], np.cumsum(np.diff(depths) * 0.5 * np.sum(
        [thick.singles[0].force(depths[:-1]), thick.singles[0].force(depths[1:])], axis=0))])  # fmt: skip

    def energy(moment: Moment) -> float:
        """Return the elastic energy at fixed approaches: of each ball alone, and of what they press each other down."""
        load = moment.state.normal
        which = balls.all
        i, j = balls.pairs(which).T
        k = thick.law(balls.gaps(moment.positions, which) + 2.0)[0]
        dents = np.bincount(i, k * load[j], len(x)) + np.bincount(j, k * load[i], len(x))
        return float(np.sum(np.interp(0.1 - dents, depths, work)) + 0.5 * load @ dents)

    for share in (0.0, 1e-4):
        resisted = HardBalls(balls.radii, rolling=share)
        moments = list(Drift(forces, resisted, 1e-5, 1e-6).path(x, 2e4))
        energies = np.array([energy(m) for m in moments])
        assert len(moments) > 10
        assert np.all(np.diff(energies) <= 1e-9 * energies[0])  # of the sum for the work of one ball
        assert energies[-1] < energies[0] * (1.0 - 1e-6)


def test_structure_of_a_lattice_and_of_chance() -> None:
    x, cell = triangular(10, 12, 2.0)
    balls = HardBalls(np.ones(len(x)), cell)
    assert structure.nearest_distances(x, cell) == pytest.approx(2.0)
    assert structure.cluster_sizes(balls, x).tolist() == [len(x)]
    assert structure.coordination(len(balls.touching(x, 1e-9)), len(x)) == pytest.approx(6.0)
    shaken = x + np.random.default_rng(0).uniform(-1e-6, 1e-6, x.shape)
    order = structure.hexatic_order(shaken, cell)
    assert np.abs(order) == pytest.approx(1.0, abs=1e-5)
    assert np.abs(np.mean(order)) == pytest.approx(1.0, abs=1e-5)
    k, s = structure.structure_factor(x, cell, 6.0)
    # the first reciprocal vectors of the lattice, 4 pi/(sqrt(3) a): all balls in phase, six waves of the ring's
    peak = float(k[np.argmax(s)])
    assert peak == pytest.approx(4.0 * np.pi / (2.0 * np.sqrt(3.0)), rel=0.03)
    assert np.all(s[k < 0.9 * peak] < 1e-9)
    gas = np.random.default_rng(1).uniform(0.0, 60.0, (900, 2))
    k, s = structure.structure_factor(gas, np.array([60.0, 60.0]), 6.0)
    assert np.mean(s[k > 1.0]) == pytest.approx(1.0, abs=0.05)
    assert np.abs(structure.hexatic_order(gas, None)).mean() < 0.6
    # two balls: Debye's sum
    k, s = structure.structure_factor(np.array([[0.0, 0.0], [3.0, 0.0]]), None, 6.0)
    assert s[0] == pytest.approx(2.0, abs=0.05)
    assert np.all(structure.hexatic_order(np.array(line(5, 0.03)), None) == 0.0)


TEXT = """
[layer]
thickness = 2.0
young = 1.0
poisson = 0.48
[balls]
radius = 1.0
positions = [{positions}]
[load]
approach = 0.1
[reciprocation]
amplitude = 300
cycles = {cycles}
friction = 1
tolerance = 1e-3
rest = 1e-5
[periodic]
lengths = [{side}, {side}]
{more}
"""


def written(folder: Path, count: int = 121, cycles: float = 0.3, more: str = "", side: float = 0.0) -> Path:
    columns = round(np.sqrt(count))
    x = lattice(columns, columns, 2.6) + np.random.default_rng(4).uniform(-0.28, 0.28, (columns**2, 2)) + 1.3
    text = TEXT.format(
        positions=", ".join(f"[{a!r}, {b!r}]" for a, b in x.tolist()), cycles=cycles, side=side or 2.6 * columns,
        more=more,
    )  # fmt: skip
    folder.mkdir(exist_ok=True)
    file = folder / "layer.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_shipped_layer_gathers_and_a_larger_resistance_stops_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    monkeypatch.setattr(outcome, "position_error", lambda *given: None)
    shipped = (ROOT / "runs" / "scenes" / "layer_of_36_balls.toml").read_text(encoding="utf-8")
    file = tmp_path / "layer.toml"
    file.write_text(shipped.replace("cycles = 200", "cycles = 0.3"), encoding="utf-8")
    path = evolved(file, tmp_path / "out")["path"]
    assert len(path[-1]["contacts"]) > len(path[0]["contacts"])
    largest = max(np.hypot(*np.array(path[0]["tangential_force"]).T) / np.array(path[0]["normal_force"]))
    assert largest > 1e-3  # the scene's resistance
    file.write_text(shipped.replace("share = 1e-3", f"share = {1.01 * largest}"), encoding="utf-8")
    stopped = evolved(file, tmp_path / "stopped")
    assert stopped["rest"]["at_rest"]
    assert len(stopped["path"]) == 1


def evolved(file: Path, out: Path) -> dict[str, Any]:
    evolve_scene(read_scene(file), "point_load", Options(False, out, False))
    document: dict[str, Any] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return document


def test_a_killed_run_of_many_balls_goes_on_to_the_same_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written(tmp_path)
    monkeypatch.setattr(motion, "DENSE", 5)
    whole = evolved(file, tmp_path / "whole")
    assert "positions" not in whole["path"][0]
    assert whole["path"][-1]["contacts"] > 5  # more than nnls is left with
    left = 12

    def dies() -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(evolving, "SAVED_EVERY", -1.0)
        patch.setattr(showing, "draw", lambda *given: None)
        patch.setattr(signals, "check", dies)
        with pytest.raises(KeyboardInterrupt):
            evolved(file, tmp_path / "killed")
    half = json.loads((tmp_path / "killed" / "result.json").read_text(encoding="utf-8"))
    assert not half["solved"]["converged"]
    monkeypatch.setattr(showing, "draw", lambda *given: None)
    killed = evolved(file, tmp_path / "killed")
    for key in ("path", "events", "balls", "rest", "cut_error"):
        assert killed[key] == whole[key], key
    for name in ("structure.csv", "structure_factor.csv", "steps.csv"):
        assert (tmp_path / "killed" / name).read_text() == (tmp_path / "whole" / name).read_text(), name
    with open(tmp_path / "whole" / "structure.csv", encoding="utf-8", newline="") as table:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(table)]
    assert len(rows) == len(whole["path"])
    assert rows[-1]["coordination"] == pytest.approx(2.0 * whole["path"][-1]["contacts"] / 121)
    assert rows[-1]["cluster_mean"] > rows[0]["cluster_mean"]
    # a moment of many balls takes as much room as its numbers
    sizes = [f.stat().st_size for f in (tmp_path / "whole" / "path").iterdir()]
    assert max(sizes) < 121 * 100
    assert (tmp_path / "whole" / "top_views.png").stat().st_size > 20_000
    assert (tmp_path / "whole" / "structure.svg").stat().st_size > 5_000


def test_a_plan_of_many_balls_says_how_long_they_take(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = read_scene(written(tmp_path))
    plan_scene(scene, None, as_json=True)
    found = json.loads(capsys.readouterr().out)
    pairs = CutLaw(PairLaw(scene.problem), 2.0, 1e-3, 1e-4)
    assert found["reach"] == pytest.approx(pairs.reach)
    listed = PairList(pairs.reach, np.array([28.6, 28.6]))(scene.problem.positions)
    close = np.hypot(*listed.between(scene.problem.positions).T) < pairs.reach
    assert found["pairs"] == pytest.approx(np.sum(close), rel=0.05)
    plan_scene(scene, None, as_json=False)
    assert "of one core" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("count", "change", "says"),
    [
        (4, ("cycles = 0.3", "cycles = 0.3\nforces = \"direct\""), "balls drift by pair forces alone"),
        (4, ("[load]", "[substrate]\nyoung = 1e3\npoisson = 0.3\n[load]"), "add up without limit"),
        (4, ("thickness = 2.0", "thickness = inf"), "add up without limit"),
        (4, ("lengths = [5.2, 5.2]", "lengths = [3.0, 5.2]"), "at least two diameters"),
        (4, ("lengths = [5.2, 5.2]", "lengths = [5.2]"), "must be two lengths"),
        (4, ("[periodic]", "[rolling_resistance]\nshare = -1.0\n[periodic]"), "must not be negative"),
    ],
)  # fmt: skip
def test_faults_of_the_effects_are_named(count: int, change: tuple[str, str], says: str, tmp_path: Path) -> None:
    file = written(tmp_path, count)
    text = file.read_text(encoding="utf-8")
    assert change[0] in text
    file.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(InvalidScene, match=says):
        read_scene(file)


def test_models_of_balls_at_rest_refuse_a_cell_and_resistance(tmp_path: Path) -> None:
    file = written(tmp_path, 4, more="[rolling_resistance]\nshare = 1e-3")
    with pytest.raises(UnsupportedProblem, match=r"\[periodic\].*\[rolling_resistance\].*thirdbody evolve"):
        choose(read_scene(file))
    with pytest.raises(UnsupportedProblem, match="overlap across the cell's edge"):
        evolve_scene(read_scene(written(tmp_path, 9, side=7.0)), "point_load", Options(False, tmp_path / "out", False))


def test_resistance_stops_a_scene_and_a_run_without_it_never_loads_its_solver(tmp_path: Path) -> None:
    free = written(tmp_path / "free", 4, cycles=0.01)
    done = python("-c", LOADED, "evolve", free, "--model", "point_load", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "clarabel" not in set(done.stderr.split("LOADED")[1].split())
    held = evolved(written(tmp_path / "held", 4, more="[rolling_resistance]\nshare = 0.1"), tmp_path / "out_held")
    assert held["rest"]["at_rest"]
    assert len(held["path"]) == 1
    assert held["equilibrium"] is None
