"""Linear systems of balls that interact as point loads: own compliances on the diagonal, K(L_ij) off it."""

from inspect import signature
from typing import Protocol

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from linear_bem.arrays import Array, Mask
from linear_bem.errors import NotConverged
from linear_bem.far_field.pairs_and_mesh import PointInfluence


class Influence(Protocol):
    """K(L_ij) between balls, 0 on the diagonal, as an operator: a matrix, or near pairs and a mesh."""

    def __matmul__(self, loads: Array, /) -> Array:
        """Return the displacement [m] at every ball from the loads [N] on the others."""
        ...


DIRECT = 600
"""Number of balls up to which the matrix is formed and factored."""
FEW = 30
"""The same where products with the influence need a mesh."""
RESIDUAL = 1e-10
"""Relative residual of conjugate gradients."""
_NAMED = "rtol" if "rtol" in signature(cg).parameters else "tol"
"""scipy's keyword of that residual: `rtol` since 1.12, `tol` before 1.14."""


def solve_coupled(
    influence: Influence, compliance: Array, right: Array, free: Mask, residual: float = RESIDUAL
) -> Array:
    """Solve (diag(``compliance``) + K) loads = ``right`` at ``free`` balls and return the loads, 0 at the others.

    Large systems are solved by conjugate gradients to ``residual``, relative to ``right``. The matrix is positive
    definite, because any pressures on separate areas store energy. Raises `NotConverged`.
    """
    count = len(right)
    if isinstance(influence, PointInfluence) and count <= DIRECT and influence.mesh is None:
        influence = influence.near.toarray() - influence.own * np.eye(count)
    elif isinstance(influence, PointInfluence) and count <= FEW:
        influence = np.array([influence @ load for load in np.eye(count)])
    if isinstance(influence, np.ndarray) and count <= DIRECT:
        matrix = influence[np.ix_(free, free)] + np.diag(compliance[free])
        out = np.zeros(count)
        out[free] = np.linalg.solve(matrix, right[free])
        return out
    if np.any(compliance[free] <= 0.0):
        raise NotConverged("point loads: a ball's own compliance is not positive; press the balls less deep")
    # symmetric scaling by the compliances makes the diagonal 1
    scale = np.where(free, 1.0 / np.sqrt(np.where(free, compliance, 1.0)), 0.0)
    operator = LinearOperator((count, count), lambda q: q + scale * (influence @ (scale * q)))
    found, failed = cg(operator, scale * right, atol=0.0, maxiter=1000, **{_NAMED: residual})
    if failed:
        raise NotConverged(
            f"point loads: conjugate gradients did not reach a residual of {residual:g}; press the balls less deep"
        )
    return np.asarray(scale * found)
