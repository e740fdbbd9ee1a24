"""Forces by pairs on many balls: waves in a lattice, images in a periodic cell, the law's cut, the loads' solution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, Problem
from linear_bem.coupled_point_loads import effective_approaches
from runs.evolution.drift import Drift
from runs.evolution.hard_balls import HardBalls
from runs.evolution.pair_forces import PairForces
from runs.evolution.pair_list import DENSE
from runs.evolution.providers import provider
from runs.models import MODELS
from runs.studies.collective.lattice_waves import around, growth_rates
from tests.runs.lattices import in_cell, lattice, triangular

ROUNDOFF = 1e-9
CLOSE, MESH = 1e-6, 3e-6
"""Accuracy of sums by a law of which half of that is left out, and of the mesh over the force of a neighbour."""


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
    assert np.max(np.abs(still.tangential)) <= MESH * push
    assert np.max(np.abs(still.tangential.sum(axis=0))) <= ROUNDOFF * push
    balls = HardBalls(np.ones(len(x)), cell)
    for number in (1, 3):
        wave = 2.0 * np.pi * number / cell[0]
        r = around(np.array([spacing, 0.0]), np.array([0.0, spacing]), 50.0)
        rates = growth_rates(pair, r, np.array([[wave, 0.0]]))[0]
        for axis, rate in enumerate(np.diag(rates)):
            shape = np.sin(wave * x[:, 0])
            moved = x.copy()
            moved[:, axis] += 1e-5 * shape
            path = list(Drift(forces, balls, 1e-10, 1e-15).path(moved, 0.4 / abs(rate)))
            size = [float(shape @ (m.positions - x)[:, axis]) for m in (path[0], path[-1])]
            measured = np.log(size[1] / size[0]) / path[-1].sigma
            # corrections of the law are cut, a wave of 1e-5 R is not quite linear
            assert measured == pytest.approx(rate, rel=0.002)


@pytest.mark.parametrize(
    ("thickness", "poisson", "spacing", "columns", "rows"), [(8.0, 0.3, 3.0, 20, 24), (5.0, 0.45, 3.5, 6, 10)]
)
def test_slow_waves_grow_as_the_law_without_a_cut_says(
    thickness: float, poisson: float, spacing: float, columns: int, rows: int
) -> None:
    balls = tuple(Ball((x, 0.0), 1.0) for x in (-1.5, 1.5))
    two = Problem(Layer(1.0, poisson, thickness), balls, Load("approach", (0.1, 0.1)))
    pair = provider(MODELS["point_load"], two, None, "pairs", Path("none")).forces
    assert isinstance(pair, PairForces)
    x, cell = triangular(columns, rows, spacing)
    forces = in_cell(pair, len(x), cell)
    r = around(np.array([spacing, 0.0]), 0.5 * spacing * np.array([1.0, np.sqrt(3.0)]), 15.0 * thickness)
    for numbers in ((1, 0), (0, 1), (2, 1)):
        wave = 2.0 * np.pi * np.array(numbers) / cell
        shape = np.sin(x @ wave)
        measured = np.empty((2, 2))
        for axis in (0, 1):
            step = np.zeros_like(x)
            step[:, axis] = 1e-5 * shape
            states = forces(x + step), forces(x - step)
            there, back = (state.tangential / state.normal[:, None] for state in states)
            measured[:, axis] = shape @ (there - back) / 2e-5 / (shape @ shape)
        expected = np.sort(np.linalg.eigvals(growth_rates(pair, r, wave[None])[0]).real)
        assert np.sort(np.linalg.eigvals(measured).real) == pytest.approx(
            expected, abs=1e-5 * np.max(np.abs(expected)), rel=1e-4
        )


def test_a_cell_stands_for_its_images_and_its_edge_for_nothing(thin: PairForces) -> None:
    side, rng = 9.0, np.random.default_rng(3)
    x = np.array([(1.5, 1.5), (4.4, 2.0), (7.2, 1.2), (2.0, 5.1), (5.5, 5.6), (1.2, 7.9), (7.0, 7.5)])
    x += rng.uniform(-0.2, 0.2, x.shape)
    cell = np.array([side, side])
    forces = in_cell(thin, len(x), cell, 0.5 * CLOSE)
    assert forces.reach > side  # a ball acts on another, and on itself, through several images
    here = forces(x)
    copies = np.array([(0, 0), *[(i, j) for i in range(-4, 5) for j in range(-4, 5) if (i, j) != (0, 0)]])
    many = (x[None] + side * copies[:, None]).reshape(-1, 2)
    problem = in_cell(thin, len(many), cell).problem
    wide = PairForces(problem, [thin.singles[0]] * len(many), thin.law, cut=0.5 * CLOSE)(many)
    assert here.normal == pytest.approx(wide.normal[: len(x)], rel=10.0 * CLOSE)
    size = float(np.max(np.abs(here.tangential)))
    assert here.tangential == pytest.approx(wide.tangential[: len(x)], abs=10.0 * CLOSE * size)
    assert here.tangential.sum(axis=0) == pytest.approx(0.0, abs=ROUNDOFF * size)
    moved = forces(x + np.array([4.3, -7.7]) + side * np.array([[1.0, 0.0]] * 3 + [[0.0, -2.0]] * 4))
    assert moved.tangential == pytest.approx(here.tangential, abs=CLOSE * size)
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
    monkeypatch.setattr("runs.evolution.pair_forces.DENSE", 0)
    assert forces(x).normal == pytest.approx(by_elimination.normal, rel=1e-11)


def test_balls_without_influence_keep_their_approaches() -> None:
    given = np.array([1.0, 2.0])
    none = effective_approaches(np.zeros((2, 2)), lambda d: (d, np.ones(2)), given, 0.5 * given)
    assert none == pytest.approx(given)
