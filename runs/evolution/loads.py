r"""Normal forces of balls under given approaches, where each carries less for the dents of the others.

    d_i + sum_j k_ij F_j(d_j) = D_i,     Q_i = F_i(d_i),   F_i = 0 where d_i <= 0,

as `linear_bem.coupled_point_loads` has it, for a sparse influence k: semismooth Newton's method, whose linear systems
conjugate gradients solve where there are many balls. With s = dF/dd the system (1 + k s) delta = -r becomes symmetric
in y = s delta: (1/s + k) y = -r; k is symmetric, and with 1/s on the diagonal it is the compliance of the surface under
the balls, which is positive.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import LinearOperator, cg

from linear_bem.errors import NotConverged

Array = NDArray[np.float64]

DENSE = 100
"""Balls up to which elimination is quicker."""
EXACT = 1e-13
"""Residual over the largest approach."""


def effective_approaches(
    influence: csr_matrix,
    relation: Callable[[Array], tuple[Array, Array]],
    approaches: Array,
    uniform: float = 0.0,
) -> Array:
    """Return d [m] of all balls; ``relation`` gives F [N] and dF/dd [N/m]. Raises `NotConverged`.

    ``influence`` is symmetric, shape (balls, balls) [m/N]; ``uniform`` [m/N] is added to all its entries.
    """
    d, scale = approaches, float(np.max(np.abs(approaches)))
    dense = influence.toarray() + uniform if len(d) <= DENSE else None

    def dents(force: Array) -> Array:
        return np.asarray(influence @ force + uniform * np.sum(force))

    force, slope = relation(d)
    r = d + dents(force) - approaches
    norm = np.inf
    for _ in range(100):
        norm = float(np.max(np.abs(r)))
        if norm <= EXACT * scale:
            return d
        move = np.linalg.solve(np.eye(len(d)) + dense * slope, -r) if dense is not None else _step(dents, slope, r)
        length = 1.0
        while True:
            trial = d + length * move
            force, slope = relation(trial)
            after = trial + dents(force) - approaches
            if np.linalg.norm(after) < (1.0 - 1e-4 * length) * np.linalg.norm(r) or length < 1e-6:
                break
            length *= 0.5
        if length < 1e-6:
            if norm <= 1e-9 * scale:
                return d
            break
        d, r = trial, after
    raise NotConverged(
        f"pair forces: the effective approaches did not converge, residual {norm:.1e} m of approach {scale:.1e} m"
    )


def _step(dents: Callable[[Array], Array], slope: Array, r: Array) -> Array:
    """Return Newton's step by conjugate gradients; balls without contact do not act on others."""
    on = slope > 0.0
    root = np.sqrt(np.where(on, slope, 0.0))

    def system(z: Array) -> Array:
        return np.asarray(z + root * dents(root * z))

    # scaled by the diagonal 1/s, the system has eigenvalues about 1
    z, _ = cg(LinearOperator((len(r), len(r)), system, dtype=float), -root * r, tol=1e-8, atol=0.0, maxiter=500)
    return np.asarray(-r - dents(root * z))
