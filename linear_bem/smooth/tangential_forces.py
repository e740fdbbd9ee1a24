"""The size of T without its cancellation, by sums over the neighbours of every ball: a scale of its errors."""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from linear_bem.arrays import Array
from linear_bem.coupled_point_loads import distances
from linear_bem.far_field.particle_mesh import ParticleMesh
from linear_bem.layer.kernel import LayeredKernel

SUMMED = 1000
"""Number of balls up to which `summed_pulls` sums all pairs."""
LISTED = 2000
"""Number of distances at which `layer_pulls` tabulates dK/dr."""


def half_space_pulls(
    kernel: LayeredKernel, positions: Array, forces: Array, softest: float = 0.0, fading: float = np.inf
) -> Array:
    """Return the sum over neighbours of Q_i Q_j (1 - nu^2)/(pi E (r + softest)^2) [N] for every ball.

    This is T of point loads on a half-space of the layer's material if all had the same sign and direction: the scale
    of T on a layer, where T may pass through zero. Beyond ``fading`` [m] each term is multiplied by fading/r.
    """

    def pull(r: Array) -> Array:
        share = 1.0 if np.isinf(fading) else np.minimum(1.0, fading / r)
        return np.asarray(kernel.singular / (r + softest) ** 2 * share)

    return summed_pulls(positions, forces, pull)


def layer_pulls(kernel: LayeredKernel, positions: Array, forces: Array, reach: float) -> Array:
    """Return the sum over neighbours of Q_i Q_j |dK/dr| [N] for every ball: T without its cancellation.

    As pressures reach ``reach`` [m] from their balls, distances are reduced by it, at most to a half; |dK/dr| is its
    largest value from there on, as it may pass through zero.
    """
    r = np.geomspace(1e-4 * reach, 2.0 * float(np.hypot(*np.ptp(positions, axis=0))) + reach, LISTED)
    shares = np.maximum.accumulate(np.abs(kernel.scaled_slope(r))[::-1])[::-1] * r**2

    def pull(apart: Array) -> Array:
        nearer = np.maximum(apart - reach, 0.5 * apart)
        return np.asarray(kernel.singular / nearer**2 * np.interp(np.log(nearer), np.log(r), shares))

    return summed_pulls(positions, forces, pull)


def summed_pulls(positions: Array, forces: Array, pull: Callable[[Array], Array]) -> Array:
    """Return the sum over neighbours of Q_i Q_j pull(r) [N] for every ball.

    More than `SUMMED` balls are summed within 5 %: near pairs one by one, beyond them pull((r^2 + s^2)^1/2) on a mesh.
    """
    if len(positions) <= SUMMED:
        return np.asarray(forces * (pull(distances(positions)) @ forces))
    low, high = positions.min(axis=0), positions.max(axis=0)
    spacing = float(np.max(high - low)) / np.sqrt(len(positions))
    soft = 1.5 * spacing

    def far(r: Array) -> Array:
        return pull(np.hypot(r, soft))

    mesh = ParticleMesh(low, high, spacing, far)
    points = mesh.at(positions[:, 0], positions[:, 1])
    first, second = cKDTree(positions).query_pairs(4.0 * soft, output_type="ndarray").T
    r = np.hypot(*(positions[first] - positions[second]).T)
    near = pull(r) - far(r)
    total = points.value @ mesh.field(points, forces) - float(far(np.zeros(1))[0]) * forces
    for here, there in ((first, second), (second, first)):
        total += np.bincount(here, near * forces[there], len(forces))
    return np.asarray(forces * np.maximum(total, 0.0))
