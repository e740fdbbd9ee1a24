"""Waves in a lattice of balls that drift: by the linearised law of pairs, a layer stays uniform where none grows."""

from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array
from runs.evolution.pair_forces import PairForces

REACH = 14.0
"""Distance up to which balls act on each other here, over the layer's thickness or the ball's radius."""
DIRECTIONS, LENGTHS = np.pi / 12.0 * np.arange(3), 24
"""Directions of waves in a triangular lattice (from a row to the next line of symmetry), and their number in each."""


@dataclass(frozen=True)
class Wave:
    """The wave that grows fastest: its rate [1/m of sliding path times T/Q] and its length [m]."""

    rate: float
    length: float


def around(first: Array, second: Array, reach: float) -> Array:
    """Return the vectors [m] from a ball of a lattice of two steps [m] to all others within ``reach`` [m]."""
    most = 2 * int(reach / np.hypot(*first)) + 1
    steps = np.arange(-most, most + 1)
    r = np.array([i * first + j * second for i in steps for j in steps if (i, j) != (0, 0)])
    return np.asarray(r[np.hypot(*r.T) < reach])


def growth_rates(pair: PairForces, r: Array, waves: Array) -> Array:
    r"""Return the matrices (waves, 2, 2) of growth rates [1/m of path over friction] of waves in a lattice.

    ``r`` (neighbours, 2) [m] goes from one ball to all others, ``waves`` (waves, 2) are wave vectors [1/m]. With
    all loads Q, displacements u_j = U exp(i q x_j) and the pair law's k and c, the linearised balance of loads gives
    (1/s + sum k exp(i q r)) dQ = -Q i sum k' n sin(q r) U, s = dF/dd, and

        du/dsigma = Q [sum (c' n n + c/L (1 - n n)) (cos(q r) - 1) + (sum c n sin)(sum k' n sin)/(1/s + sum k exp)] U.
    """
    distance = np.hypot(*r.T)
    n, h = r / distance[:, None], 1e-4 * pair.problem.balls[0].radius
    (k, c), up, down = (pair.law(distance + shift) for shift in (0.0, h, -h))
    k_slope, c_slope = ((a - b) / (2.0 * h) for a, b in zip(up, down, strict=True))
    single, approach = pair.singles[0], pair.problem.load.values[0]
    load = single.force(np.array([approach]))[0]
    for _ in range(200):  # the load that all balls share
        load = 0.5 * load + 0.5 * single.force(np.array([approach - np.sum(k) * load]))[0]
    slope = single.force_and_slope(np.array([approach - np.sum(k) * load]))[1][0]
    phase = waves @ r.T
    change, sine = np.cos(phase) - 1.0, np.sin(phase)
    soft = 1.0 / slope + np.cos(phase) @ k
    stiff = np.einsum("wi,i,ia,ib->wab", change, c_slope - c / distance, n, n)
    stiff += np.eye(2) * (change @ (c / distance))[:, None, None]
    turned = (sine @ (c[:, None] * n))[:, :, None] * (sine @ (k_slope[:, None] * n))[:, None, :]
    return np.asarray(load * (stiff + turned / soft[:, None, None]))


def fastest(pair: PairForces, spacing: float) -> Wave:
    """Return the wave that grows fastest in a triangular lattice of this spacing [m] of balls like the first."""
    reach = REACH * max(pair.problem.layer.thickness, pair.problem.balls[0].radius)
    r = around(np.array([spacing, 0.0]), 0.5 * spacing * np.array([1.0, np.sqrt(3.0)]), reach)
    sizes = 4.0 * np.pi / (3.0 * spacing) * np.arange(1, LENGTHS + 1) / LENGTHS
    waves = np.array([size * np.array([np.cos(a), np.sin(a)]) for a in DIRECTIONS for size in sizes])
    rates = np.max(np.linalg.eigvals(growth_rates(pair, r, waves)).real, axis=1)
    at = int(np.argmax(rates))
    return Wave(float(rates[at]), float(2.0 * np.pi / np.hypot(*waves[at])))
