"""Lattices of balls, and the forces of a pair's law on many balls in a periodic cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from linear_bem import Ball, Load, Problem
from runs.evolution.pair_forces import PairForces
from runs.evolution.pair_list import CUT

Array = NDArray[np.float64]


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
