r"""What ending the model at a finite distance changes: images in its sides, and a rigid bottom under the substrate.

Sides that slide in their plane mirror the balls without end, and the bottom of the meshed substrate does
not move. Far from the contacts strains are small whatever they are below the balls, so both effects follow
from the linear response of a layered stack to point loads Q_j at the balls' axes. With the surface
displacement K(r) under a unit load on the model's stack and K_oo(r) on the unbounded one, the model exceeds
the unbounded scene by

    approach of ball i:  E_i = sum_j Q_j [K - K_oo](r_ij) + sum_images Q_k K(r_ik)
    force on ball i:     F_i = -Q_i sum_j Q_j [K - K_oo]'(r_ij) e_ij - Q_i sum_images Q_k K'(r_ik) e_ik,

e_ij pointing from i to j. K is the inverse Hankel transform of the response G(t), t = k h, that satisfies
equilibrium in layer and substrate, found here wave number by wave number from the general plane solution
[Burmister 1945, doi 10.1063/1.1707558]; `G = 1` is the half-space of the layer's material:

    K(r) = (1 - nu^2) / (pi E) [1/r + int_0^inf (G(k h) - 1) J0(k r) dk].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import erfc, j0, j1

from linear_bem.problem import Elastic, Layer, Problem

REMAINS = 1.0 / 3.0
"""Part of the first-order force between distant balls that stays in the error bar when it has been taken off."""
SHIFT_REMAINS = 0.1
"""The same for the approach: what distance adds to it is nearly one rigid shift, which nothing but Q(D) feels."""
_DECAYED = 24.0
"""exp(-2 t) beyond this t is roundoff."""
_REACH = 12.0
"""Distance over the stack's height beyond which the surface of a stack on a rigid base is at rest."""
_IMAGES, _MOST = 6.0, 6
"""Distance over the stack's height within which images are summed, and the most periods of them: K has decayed."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


def _waves(z: np.ndarray, nu: float, sign: int) -> np.ndarray:
    """Return W, U, normal and shear stress (n, 4, 2) of the waves (A + B z) exp(sign z); stresses over 2 mu k.

    Depth z and displacements are in units of 1/k; z is measured from where the wave is largest.
    """
    one, decay = np.ones_like(z), np.exp(sign * z)
    rows = [
        (one, z),
        (sign * one, 3.0 - 4.0 * nu + sign * z),
        (sign * one, 1.0 - 2.0 * nu + sign * z),
        (one, z + sign * 2.0 * (1.0 - nu)),
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) * decay[:, None, None]


def response(t: np.ndarray, layer: Elastic, substrate: Elastic | None, depth: float) -> np.ndarray:
    """Return G(t) at wave numbers t = k h > 0 for a substrate of ``depth`` layer thicknesses on a rigid base.

    ``depth`` may be ``inf`` (the unbounded half-space); without a substrate the layer's base is rigid.
    """
    t = np.asarray(t, dtype=float)
    zero, nu = np.zeros_like(t), layer.poisson
    top = np.concatenate([_waves(zero, nu, -1), _waves(-t, nu, 1)], axis=2)
    base = np.concatenate([_waves(t, nu, -1), _waves(zero, nu, 1)], axis=2)
    size = 4 if substrate is None else (6 if math.isinf(depth) else 8)
    matrix, load = np.zeros((len(t), size, size)), np.zeros((len(t), size, 1))
    matrix[:, :2, :4] = top[:, 2:]
    load[:, 0] = -1.0
    if substrate is None:
        matrix[:, 2:, :4] = base[:, :2]
    else:
        ratio = substrate.shear_modulus / layer.shear_modulus
        stiffer = np.array([1.0, 1.0, ratio, ratio])[:, None]
        thick = depth * t
        matrix[:, 2:6, :4] = base
        matrix[:, 2:6, 4:6] = -stiffer * _waves(zero, substrate.poisson, -1)
        if size == 8:
            matrix[:, 2:6, 6:] = -stiffer * _waves(-thick, substrate.poisson, 1)
            matrix[:, 6:, 4:6] = _waves(thick, substrate.poisson, -1)[:, :2]
            matrix[:, 6:, 6:] = _waves(zero, substrate.poisson, 1)[:, :2]
    waves = np.linalg.solve(matrix, load)[..., 0]
    return (top[:, 0] * waves[:, :4]).sum(axis=1) / (2.0 * (1.0 - nu))


def _rule(end: float, finest: float, coarsest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights of Gauss rules on panels of [0, end] that grow from ``finest`` to ``coarsest``."""
    edges = [0.0]
    while edges[-1] < end:
        edges.append(edges[-1] + min(max(finest, 0.2 * edges[-1]), coarsest))
    half = 0.5 * np.diff(edges)[:, None]
    return (np.array(edges[:-1])[:, None] + half * (1.0 + _NODES)).ravel(), (half * _WEIGHTS).ravel()


@lru_cache(maxsize=1)
def _oscillating_rule() -> tuple[np.ndarray, np.ndarray]:
    """Return u_j and weights of int f(u) J(u) du for f smooth in log u, with a smooth end that loses nothing."""
    edges = np.concatenate([[0.0], 2.0 ** np.arange(-30.0, 2.0), np.arange(4.0, 141.0, 3.0)])
    half = 0.5 * np.diff(edges)[:, None]
    u = (edges[:-1, None] + half * (1.0 + _NODES)).ravel()
    return u, (half * _WEIGHTS).ravel() * 0.5 * erfc((u - 80.0) / 9.0)


@lru_cache(maxsize=16)
def _response_table(stack: Stack) -> CubicSpline:
    """Return G - 1 of a stack as a spline in ln t."""
    depth = stack.depth / stack.layer.thickness
    t = np.geomspace(1e-9 / (1.0 + depth), _DECAYED, 1500)
    resolved = np.maximum(t, 1e-3 / (1.0 + depth))  # below, waves of either sign are one to roundoff, and G is nothing
    return CubicSpline(np.log(t), response(resolved, stack.layer, stack.substrate, depth) - 1.0)


@dataclass(frozen=True)
class Stack:
    """Layer and substrate of a meshed ``depth`` [m] (0: none) on a rigid base."""

    layer: Layer
    substrate: Elastic | None
    depth: float

    @property
    def compliance(self) -> float:
        """(1 - nu^2) / (pi E) of the layer [1/Pa]."""
        return 1.0 / (math.pi * self.layer.contact_modulus)

    @property
    def height(self) -> float:
        """Height of layer and substrate together [m]."""
        return self.layer.thickness + (0.0 if self.substrate is None else self.depth)

    @property
    def reach(self) -> float:
        """Distance [m] beyond which a load is not felt."""
        return _REACH * self.height

    def kernel(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return K [m/N] and K' [1/N] of the stack at distances r > 0 [m]; zero beyond its reach."""
        h = self.layer.thickness
        rho = np.asarray(r, dtype=float) / h
        u, w = _oscillating_rule()
        excess = _response_table(self)(np.log(np.minimum(u / rho[:, None], _DECAYED)))
        excess = np.where(u < _DECAYED * rho[:, None], excess, 0.0)
        near = rho * h <= self.reach
        value, slope = 1.0 + excess @ (w * j0(u)), -1.0 - excess @ (w * u * j1(u))
        return self.compliance / h * near * value / rho, self.compliance / h**2 * near * slope / rho**2

    def mutual(self, positions: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the linear in-plane forces (n, 2) [N] between point loads (n,) [N] on the unbounded stack."""
        offsets = positions[None, :] - positions[:, None]
        distances = np.linalg.norm(offsets, axis=-1)
        apart = distances > 0.0
        slope = np.zeros_like(distances)
        if apart.any():
            slope[apart] = self.kernel(distances[apart])[1] - self.beyond(distances[apart])[1]
        return np.asarray(forces[:, None] * np.einsum("ijk,j->ik", _towards(offsets, distances, slope), forces))

    def beyond(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return K - K_oo [m/N] and its slope [1/N] at r >= 0 [m]: what the rigid bottom takes away."""
        rho = np.asarray(r, dtype=float) / self.layer.thickness
        if self.substrate is None:
            return np.zeros_like(rho), np.zeros_like(rho)
        h, depth = self.layer.thickness, self.depth / self.layer.thickness
        end = _DECAYED / (1.0 + depth)
        t, w = _rule(end, 1e-4 * end, min(0.05 * end, 0.5 * math.pi / float(rho.max(initial=1.0))))
        lost = w * (response(t, self.layer, self.substrate, depth) - response(t, self.layer, self.substrate, math.inf))
        phase = np.outer(rho, t)
        return self.compliance / h * (j0(phase) @ lost), -self.compliance / h**2 * (j1(phase) @ (t * lost))


class FarField:
    """First-order effect of the model's end on every ball of a scene.

    ``depth`` [m] is that of the meshed substrate (0: none), ``positions`` (n, 2) [m] are all balls';
    ``sides`` the x and y intervals [m] of the whole scene, what a symmetry plane cuts off included.
    """

    def __init__(
        self, problem: Problem, depth: float, positions: np.ndarray, sides: tuple[tuple[float, float], ...]
    ) -> None:
        stack = Stack(problem.layer, problem.substrate, depth)
        offsets = positions[None, :] - positions[:, None]
        distances = np.linalg.norm(offsets, axis=-1)
        value, slope = (part.reshape(distances.shape) for part in stack.beyond(distances.ravel()))
        images = _images(positions, sides, _IMAGES * stack.height)
        apart = images[None] - positions[:, None, None]
        far = np.linalg.norm(apart, axis=-1)
        more, steeper = _tabulated(stack, far)
        # what the bottom takes away and what images add are kept apart: their errors do not cancel as they do
        self._value = np.stack([value, more.sum(axis=2)])
        self._slope = np.stack([_towards(offsets, distances, slope), _towards(apart, far, steeper).sum(axis=2)])

    def approaches(self, forces: np.ndarray) -> np.ndarray:
        """Return by how much [m] the model's approaches (n,) exceed the unbounded scene's at normal forces (n,) [N]."""
        return np.asarray((self._value @ forces).sum(axis=0))

    def tangential_forces(self, forces: np.ndarray) -> np.ndarray:
        """Return by how much [N] the model's in-plane forces (n, 2) exceed the unbounded scene's."""
        return np.asarray(self._pulls(forces).sum(axis=0))

    def sizes(self, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sizes of both (n,), [m] and [N], with bottom and sides added up whatever their signs."""
        moved, pulls = np.abs(self._value @ forces).sum(axis=0), self._pulls(forces)
        return moved, np.linalg.norm(pulls, axis=-1).sum(axis=0)

    def _pulls(self, forces: np.ndarray) -> np.ndarray:
        return np.asarray(forces[:, None] * np.einsum("pijk,j->pik", self._slope, forces))


def _towards(offsets: np.ndarray, distances: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Return -K' e for offsets (..., 2) and their lengths; zero where the length is."""
    share = np.divide(-slope, distances, out=np.zeros_like(slope), where=distances > 0.0)
    return np.asarray(share[..., None] * offsets)


def _images(positions: np.ndarray, sides: tuple[tuple[float, float], ...], reach: float) -> np.ndarray:
    """Return the images (n, m, 2) of each ball in the sides, at least as far as a reach [m] or `_MOST` periods."""
    along = []
    for axis, (low, high) in enumerate(sides):
        x, period = positions[:, axis], 2.0 * (high - low)
        count = min(max(1, math.ceil(reach / period)), _MOST)
        shifted = [x, *(x + s * m * period for m in range(1, count + 1) for s in (-1, 1))]
        along.append(np.array(shifted + [2.0 * high - x + m * period for m in range(-count - 1, count + 1)]))
    pairs = [(a, b) for a in along[0] for b in along[1]]
    return np.stack([np.stack(pair, axis=-1) for pair in pairs[1:]], axis=1)  # the first is the ball itself


def _tabulated(stack: Stack, distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return K and K' at many distances [m] by splines in the logarithm of the distance."""
    near = distances <= stack.reach
    if not near.any():
        return np.zeros_like(distances), np.zeros_like(distances)
    low = 0.2 * stack.layer.thickness
    table = _table(stack, low)(np.log(np.clip(distances, low, stack.reach)))
    return table[..., 0] / distances * near, table[..., 1] / distances**2 * near


@lru_cache(maxsize=16)
def _table(stack: Stack, low: float) -> CubicSpline:
    """Return K r and K' r^2, smooth over decades, as splines in ln r."""
    r = np.geomspace(low, stack.reach, 160)
    value, slope = stack.kernel(r)
    return CubicSpline(np.log(r), np.column_stack([value * r, slope * r**2]))
