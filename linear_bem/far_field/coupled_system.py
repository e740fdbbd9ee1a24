"""Linear systems of balls that interact as point loads: own compliances on the diagonal, K(L_ij) beside it."""

from __future__ import annotations

from inspect import signature

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from linear_bem.arrays import Array, Mask
from linear_bem.errors import NotConverged
from linear_bem.far_field.kernel_split import PointInfluence

DIRECT = 600
"""Number of balls up to which the matrix is formed and factored."""
RESIDUAL = 1e-10
"""Relative residual of conjugate gradients."""
_NAMED = "rtol" if "rtol" in signature(cg).parameters else "tol"
"""That residual's name: scipy 1.12 has the first, 1.14 no longer the second."""


def solve_coupled(influence: PointInfluence, compliance: Array, right: Array, free: Mask) -> Array:
    """Return loads with (diag(``compliance``) + K) loads = ``right`` at ``free`` balls; the loads of others are 0.

    The matrix is positive definite, as a small pressure on separate areas stores energy. Raises `NotConverged`.
    """
    count = len(right)
    if count <= DIRECT and influence.mesh is None:
        matrix = influence.near.toarray()[np.ix_(free, free)] + np.diag(compliance[free])
        out = np.zeros(count)
        out[free] = np.linalg.solve(matrix, right[free])
        return out
    # symmetric scaling by the compliances makes the diagonal 1
    scale = np.where(free, 1.0 / np.sqrt(np.where(free, compliance, 1.0)), 0.0)
    operator = LinearOperator((count, count), lambda q: q + scale * (influence @ (scale * q)))
    found, failed = cg(operator, scale * right, atol=0.0, maxiter=1000, **{_NAMED: RESIDUAL})
    if failed:
        raise NotConverged(f"point loads: conjugate gradients did not reach a residual of {RESIDUAL:g}")
    return np.asarray(scale * found)
