"""Measures of structure: distances, clusters, coordination, hexatic order and structure factor."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import Delaunay

from runs.evolution import drawing, structure
from runs.evolution.drift import Moment
from runs.evolution.forces import State
from runs.evolution.hard_balls import HardBalls
from runs.scene.units import Unit
from tests.runs.foam_balls import line
from tests.runs.lattices import triangular


def test_structure_of_a_lattice_and_of_chance() -> None:
    x, cell = triangular(10, 12, 2.0)
    balls = HardBalls(np.ones(len(x)), cell)
    assert structure.nearest_distances(x, cell) == pytest.approx(2.0)
    assert structure.cluster_sizes(balls, x).tolist() == [len(x)]
    assert 2 * len(balls.touching(x, 1e-9)) == 6 * len(x)
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


def test_the_structure_factor_weighs_all_wave_vectors_alike() -> None:
    rng, largest = np.random.default_rng(2), 4.0
    cell = np.array([7.0, 11.0])
    x = rng.uniform(0.0, 1.0, (13, 2)) * cell
    k, s = structure.structure_factor(x, cell, largest)
    swapped = structure.structure_factor(x[:, ::-1], cell[::-1], largest)
    assert swapped[0] == pytest.approx(k, rel=1e-12)
    assert swapped[1] == pytest.approx(s, rel=1e-10)
    # every wave vector one by one
    numbers = np.array([(m, n) for m in range(-9, 10) for n in range(-9, 10) if m or n])
    waves = 2.0 * np.pi * numbers / cell
    size = np.hypot(*waves.T)
    power = np.abs(np.exp(1j * waves @ x.T).sum(axis=1)) ** 2 / len(x)
    ring = np.floor(size / largest * structure.WAVES).astype(int)
    rings = np.unique(ring[ring < structure.WAVES])
    assert k == pytest.approx([size[ring == r].mean() for r in rings], rel=1e-12)
    assert s == pytest.approx([power[ring == r].mean() for r in rings], rel=1e-10)


def test_the_hexatic_order_does_not_depend_on_the_cells_origin_where_balls_are_missing() -> None:
    x, cell = triangular(10, 12, 2.0)
    x = np.delete(x, [13, 14, 57, 88], axis=0)
    order = structure.hexatic_order(x, cell)
    for shift in np.random.default_rng(5).uniform(0.0, 20.0, (4, 2)):
        assert structure.hexatic_order(x + shift, cell) == pytest.approx(order, abs=1e-9)
    assert np.abs(order).min() < 0.99
    # elsewhere neighbours are Delaunay's
    gas = np.random.default_rng(1).uniform(0.0, 60.0, (400, 2))
    start, neighbours = Delaunay(gas).vertex_neighbor_vertices
    owner = np.repeat(np.arange(len(gas)), np.diff(start))
    away = gas[neighbours] - gas[owner]
    turned = np.exp(6j * np.arctan2(away[:, 1], away[:, 0]))
    mean = np.array([turned[owner == i].mean() for i in range(len(gas))])
    assert structure.hexatic_order(gas, None) == pytest.approx(mean, abs=1e-9)


def test_the_hexatic_order_counts_neighbours_across_wide_voids_of_any_cell() -> None:
    rng = np.random.default_rng(1)
    cluster = triangular(6, 6, 2.1)[0] + rng.uniform(-0.05, 0.05, (36, 2))
    cases = [(cluster, (20.0, 20.0)), (cluster, (14.0, 60.0))]
    cases += [(rng.uniform(0.0, 1.0, (n, 2)) * cell, cell) for n in (1, 2, 5, 12) for cell in ((1.0, 1.0), (6.0, 1.0))]
    for x, lengths in cases:
        cell = np.array(lengths)
        order = structure.hexatic_order(x, cell)
        for shift in np.outer((0.25, 0.55), cell):
            assert structure.hexatic_order(x + shift, cell) == pytest.approx(order, abs=1e-9)
        # the same balls in a cell of three by three, whose images surround them farther
        moves = np.array([(i, j) for i in range(3) for j in range(3)])
        repeated = (x[None] + cell * moves[:, None]).reshape(-1, 2)
        assert structure.hexatic_order(repeated, 3 * cell)[: len(x)] == pytest.approx(order, abs=1e-9)


def test_the_peak_of_the_structure_factor_is_a_number_of_a_cell(tmp_path: Path) -> None:
    x = np.array([[3.0 * i, 3.0 * j] for i in range(8) for j in range(8)])
    state = State(np.ones((64, 2)), np.ones(64), np.zeros(64))
    moment = Moment(0.0, x, state, np.array([], int), np.array([]), 1.0, 0.5, 0.1, False)
    assert "structure_peak" not in structure.row(moment, HardBalls(np.ones(64)))
    path = [
        {"cycle": 0.0, "positions": x, "contacts": []},
        {"cycle": 2.0, "positions": 0.8 * x, "contacts": [[2, 8]]},  # far apart at the start
    ]
    drawn: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "save_figure", lambda figure, *_: drawn.append(figure.axes[0]))
        for part in (x, x[:9]):
            shown = [{**m, "positions": np.array(m["positions"])[: len(part)]} for m in path]
            drawing.draw_distances(tmp_path, {"path": shown}, HardBalls(np.ones(len(part))), Unit("mm", 1e-3))
    many, few = drawn
    assert len(many.lines) == 4  # least, median, largest, and where balls touch
    assert many.lines[1].get_ydata() == pytest.approx([3e3, 2.4e3])
    # seven pairs along a row, one across, one diagonal, one that touches later, and where balls touch
    assert len(few.lines) == 11


def test_unlike_balls_touch_at_unlike_distances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr(drawing, "save_figure", lambda figure, *_: drawn.append(figure.axes[0]))
    x = np.array([[-2.1, 0.0], [0.0, 0.5], [2.1, 0.0]])
    path = [{"cycle": cycle, "positions": x, "contacts": [[0, 2]]} for cycle in (0.0, 1.0)]
    for last, lines in ((2.0, [2.0, 4.0]), (1.95, [math.sqrt(3.9), 2.0, math.sqrt(15.6)])):
        drawing.draw_distances(tmp_path, {"path": path}, HardBalls(np.array([2.0, 0.5, last])), Unit("m", 1.0))
        at = [line.get_ydata()[0] for line in drawn[-1].lines if line.get_linestyle() == ":"]
        assert at == pytest.approx(lines)
        labels = [text.xy[1] for text in drawn[-1].texts if text.get_text() == "touching"]
        assert labels == pytest.approx([lines[0], lines[-1]])  # those of two lines close together would overlap


@pytest.mark.parametrize("path", [[0.0], [0.0, 1.0]])
def test_a_path_at_rest_and_one_along_y_have_whole_pictures(
    path: list[float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(drawing, "save_figure", lambda figure, *_: figures.append(figure))
    x = np.array([[0.0, 5.0 * k] for k in range(5)])
    places = [{"positions": (1.0 + 0.1 * t) * x, "tangential_force": 0.0 * x, "contacts": [], "cycle": t} for t in path]
    balls = HardBalls(np.ones(len(x)))
    drawing.draw_top_views(tmp_path, {"path": places}, balls, (0.0, 1.0), Unit("m", 1.0))
    drawing.draw_distances(tmp_path, {"path": places}, balls, Unit("m", 1.0))
    crowd = [{"positions": triangular(8, 8, 2.5)[0], "contacts": [], "cycle": t} for t in path]
    drawing.draw_distances(tmp_path, {"path": crowd}, HardBalls(np.ones(64)), Unit("m", 1.0))
    views, distances, of_many = figures
    views.draw_without_rendering()
    assert views._suptitle.get_window_extent().x1 <= views.bbox.width
    for (axis,) in (distances.axes, of_many.axes):
        assert axis.get_xlim() == (0.0, 1.0)
        assert (axis.lines[0].get_marker() == "o") == (len(path) == 1)
