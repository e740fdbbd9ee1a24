r"""How balls are arranged in the plane: distances, clusters, coordination, hexatic order and structure factor.

Each function takes positions (balls, 2) [m] and the lengths of a periodic cell [m], or None.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Voronoi
from scipy.special import j0

from linear_bem.arrays import Array, Indices
from linear_bem.touching import nearest_distances
from runs.evolution.drift import Moment
from runs.evolution.hard_balls import HardBalls
from runs.evolution.pair_list import images

SIGMA = "sliding_path_over_friction"
"""Column of sigma in tables."""
WAVES = 48
"""Rings of wave numbers, from 0 to two over the smallest touching distance, times 2 pi."""
FLAT = 1e-3
"""Width over length below which balls are in one line."""
EDGE = 1e-6
"""An edge between two Voronoi cells up to this length, over the distance of their balls, counts as a corner."""


def cluster_sizes(balls: HardBalls, x: Array) -> Indices:
    """Return the numbers of balls of the clusters, largest first; see `HardBalls.groups`."""
    return np.array(sorted((len(group) for group in balls.groups(x)), reverse=True))


def hexatic_order(x: Array, cell: Array | None) -> NDArray[np.complex128]:
    r"""Return psi_6 of every ball: the mean of exp(6 i theta) over the directions theta to its neighbours.

    Neighbours are those whose cells of Voronoi's diagram share an edge longer than `EDGE`, so that four balls on one
    circle, as at a vacancy of a lattice, have no diagonal; for balls in one line without a cell, psi_6 = 0.
    |psi_6| = 1 in a triangular lattice; the size of the mean over all balls is less than the mean size where grains
    point differently.
    [Halperin, Nelson 1978, doi 10.1103/PhysRevLett.41.121]
    """
    count = len(x)
    if cell is None and (count < 4 or np.linalg.svd(x - x.mean(axis=0), compute_uv=False)[1] < FLAT * np.ptp(x)):
        return np.zeros(count, dtype=complex)
    # the eight cells around are enough: a ball more than a cell's length away along an axis has a nearer image
    diagram = Voronoi(x if cell is None else images(x, cell))
    points, pairs, ends = diagram.points, diagram.ridge_points, np.array(diagram.ridge_vertices)
    apart = np.hypot(*(points[pairs[:, 1]] - points[pairs[:, 0]]).T)
    edges = np.hypot(*(diagram.vertices[ends[:, 1]] - diagram.vertices[ends[:, 0]]).T)
    pairs = pairs[(ends[:, 0] < 0) | (edges > EDGE * apart)]  # an outer edge has no end
    owner, neighbours = np.concatenate([pairs, pairs[:, ::-1]]).T
    between = points[neighbours] - points[owner]
    turned = (np.exp(6j * np.arctan2(between[:, 1], between[:, 0])))[owner < count]
    own = owner[owner < count]
    total = np.bincount(own, turned.real, count) + 1j * np.bincount(own, turned.imag, count)
    return np.asarray(total / np.maximum(np.bincount(own, minlength=count), 1))


def structure_factor(x: Array, cell: Array | None, largest: float) -> tuple[Array, Array]:
    r"""Return wave numbers k [1/m] up to ``largest`` and S(k) averaged over directions; rings without waves left out.

    S(k) = |sum_j exp(i k x_j)|^2 / n over the wave vectors of the cell; without a cell the average over all directions,
    1 + (2/n) sum_{i<j} J0(k r_ij), Debye's formula in the plane. [Hansen, McDonald, Theory of Simple Liquids, 2013,
    section 4.1]
    """
    edges = np.linspace(0.0, largest, WAVES + 1)
    if cell is None:
        first, second = np.triu_indices(len(x), 1)
        apart = np.hypot(*(x[second] - x[first]).T)
        middle = 0.5 * (edges[1:] + edges[:-1])
        return middle, np.array([1.0 + 2.0 / len(x) * float(np.sum(j0(k * apart))) for k in middle])
    one = 2.0 * np.pi / cell
    most = np.floor(largest / one).astype(int)
    along, across = np.arange(0, most[0] + 1), np.arange(-most[1], most[1] + 1)
    waves = np.exp(1j * one[0] * np.outer(along, x[:, 0])) @ np.exp(1j * one[1] * np.outer(across, x[:, 1])).T
    size = np.hypot(one[0] * along[:, None], one[1] * across[None, :])
    power = np.abs(waves) ** 2 / len(x)
    ring = np.digitize(size.ravel(), edges) - 1
    used = (ring < WAVES) & (size.ravel() > 0.0)
    # a wave vector and its opposite are one wave; along y, both are in the list
    weight = np.where(along[:, None] > 0, 1.0, 0.5) + np.zeros(size.shape)
    number, total, mean = (
        np.bincount(ring[used], (weight * values).ravel()[used], WAVES) for values in (1.0, power, size)
    )
    there = number > 0.0
    return mean[there] / number[there], total[there] / number[there]


def row(moment: Moment, balls: HardBalls) -> dict[str, Any]:
    """Return the arrangement at one moment in numbers, lengths [m]; the largest S(k) in a cell alone.

    Without one S(k) is largest at k = 0, whatever the arrangement.
    """
    x, cell = moment.positions, balls.cell
    nearest, sizes, order = nearest_distances(x, cell), cluster_sizes(balls, x), hexatic_order(x, cell)
    peak = {}
    if cell is not None:
        waves, power = structure_factor(x, cell, 4.0 * np.pi / balls.smallest)
        largest = int(np.argmax(power))
        peak = {"structure_peak": float(power[largest]), "structure_peak_wave_number": float(waves[largest])}
    return {
        SIGMA: moment.sigma,
        "nearest_distance_mean": float(np.mean(nearest)),
        "nearest_distance_least": float(np.min(nearest)),
        "clusters": len(sizes),
        "cluster_largest": int(sizes[0]),
        # the cluster that a ball picked at random is in
        "cluster_mean": float(np.sum(sizes**2.0) / np.sum(sizes)),
        "coordination": 2.0 * len(moment.contacts) / len(x),
        "hexatic_local": float(np.mean(np.abs(order))),
        "hexatic_global": float(np.abs(np.mean(order))),
        **peak,
        "largest_force_over_largest_load": float(
            np.max(np.hypot(*moment.state.tangential.T)) / np.max(moment.state.normal)
        ),
    }


def waves_of(moments: Sequence[Moment], balls: HardBalls) -> list[dict[str, Any]]:
    """Return the structure factor at each of ``moments``, one row per wave number [1/m]."""
    return [
        {SIGMA: moment.sigma, "wave_number": k, "structure_factor": s}
        for moment in moments
        for k, s in zip(
            *(v.tolist() for v in structure_factor(moment.positions, balls.cell, 4.0 * np.pi / balls.smallest)),
            strict=True,
        )
    ]
