"""From what two or three meshes answer to what a mesh without end would, and how far off that may be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

FORCE_RATIO_ORDER = 2.5
"""Order of convergence of T / Q^2 in the element size that its extrapolation assumes; 2 to 4 are observed."""
CAUTIOUS_ORDER = 2.0
"""The order that the error of T / Q^2 is estimated with."""
INDENTATION_ORDER = 3.0
"""The same for Q at given approach and D at given force, which feel the contact's edge; 2.7 to 3.2 are observed."""
EDGE_ERROR = 0.4
"""Relative error of Q at given D over the cube of the growth of element sizes at the contact's edge.

Two meshes may agree by chance; how the edge cuts through the elements is off all the same. 240 load steps at small
strain on meshes of growth 0.21, 0.3 and 0.34, whose Q is known, have a root mean square of 0.17 to 0.20, at most 0.66.
"""
FORCE_ERROR, FORCE_ERROR_ORDER, MOST_OF_FORCE, MOST_CANCELLED = 14.0, 6.0, 0.1, 10.0
"""The same for T at given Q over the sixth power: 2 % at a growth of 0.336 (accuracy 0.1), 0.1 % at 0.21 (0.02), but
10 % at most.

It is of T, or of a tenth of the half-space's mutual force where the layer takes more of that away, but of ten times T
at most. 128 load steps at small strain at growth 0.336 (h = 0.2 to 2 R, nu = 0.3 and 0.48, L = 2 and 2.5 R, against
`linear_bem`) are off by at most 0.8 times the error with this; without it 28 were off by more, by up to 5 times.
"""
FILM = 2.0
"""Thicknesses of a layer that count as its contact's radius where that is larger: fields change within a thickness.

One ball on h = 0.05 R, nu = 0.5, with a contact of five thicknesses: Q is 0.9 % off on meshes whose growth is 0.21.
"""
FORCE_EXPONENT = 1.5
"""Q goes like this power of D, nearly: what Q is off by at given D, over it, is what D is off by at given Q."""
_LARGEST_ORDER = 8.0


@dataclass(frozen=True)
class Extrapolated:
    """A value without mesh error, the estimate of its error, and the order of convergence used (nan: none)."""

    value: np.ndarray
    error: np.ndarray
    order: np.ndarray


def gain(order: float | np.ndarray, ratio: float) -> np.ndarray:
    """Return what the difference of two meshes must be multiplied with to remove the finer one's error.

    ``ratio`` is that of their element sizes, coarse over fine.
    """
    return np.asarray(1.0 / (ratio**order - 1.0))


def force_ratio(values: list[np.ndarray], sizes: list[float]) -> Extrapolated:
    """Return T / Q^2 (balls, 2) from its values on two or three meshes, finest first, with their element sizes.

    Two meshes: the usual order extrapolates, the cautious one estimates the error. Three: where the
    differences shrink in one direction, the order they show is used if it is lower; where they do not, the
    finest value is left as it is, and no difference to a coarser mesh counts as chance.
    """
    fine, change = values[0], values[0] - values[1]
    ratio = sizes[1] / sizes[0]
    order = np.full(fine.shape, FORCE_RATIO_ORDER)
    error = gain(CAUTIOUS_ORDER, ratio) * np.abs(change)
    if len(values) == 2:
        return Extrapolated(fine + gain(order, ratio) * change, error, order)
    before = values[1] - values[2]
    observed = np.vectorize(lambda a, b: observed_order(a, b, sizes))(change, before)
    steady = np.isfinite(observed) & (observed >= 1.0)
    order = np.where(steady, np.minimum(observed, FORCE_RATIO_ORDER), np.nan)
    shift = np.where(steady, gain(np.where(steady, order, 1.0), ratio) * change, 0.0)
    whole = gain(CAUTIOUS_ORDER, sizes[2] / sizes[0]) * np.abs(fine - values[2])
    return Extrapolated(fine + shift, np.maximum(np.maximum(error, whole), np.abs(shift)), order)


def observed_order(change: float, before: float, sizes: list[float]) -> float:
    """Return the order of convergence that two successive differences on three meshes show; nan where none.

    ``change`` is between the finest two, ``before`` between the coarser two.
    """
    if change == 0.0 or before / change <= 1.0:
        return math.nan
    fine, middle, coarse = sizes

    def excess(order: float) -> float:
        return (coarse**order - middle**order) / (middle**order - fine**order) - before / change

    low, high = 0.01, _LARGEST_ORDER
    if excess(low) > 0.0:
        return low
    for _ in range(60):
        middle_order = 0.5 * (low + high)
        low, high = (middle_order, high) if excess(middle_order) < 0.0 else (low, middle_order)
    return high


def indentation(fine: np.ndarray, coarse: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Return forces or approaches extrapolated from two meshes, and their errors; none changes its sign."""
    change = gain(INDENTATION_ORDER, ratio) * (fine - coarse)
    return np.where(fine * (fine + change) > 0.0, fine + change, fine), np.abs(change)
