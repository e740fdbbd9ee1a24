"""Values keyed by position: brought to one rank, and back to whatever ranks hold those positions."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from linear_bem.errors import OutputUnusable


def gather_rows(rows: np.ndarray, comm: MPI.Comm) -> np.ndarray | None:
    """Return the rows of all ranks, one under the other, on rank 0 (None elsewhere)."""
    parts = comm.gather(np.ascontiguousarray(rows), root=0)
    return None if parts is None else np.concatenate(parts)


def match_rows(points: np.ndarray, known: np.ndarray, tolerance: float) -> np.ndarray:
    """Return for each of ``points`` (n, 3) the row of ``known`` (m, 3) at the same position."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    distance, row = cKDTree(known).query(points)
    if np.max(distance) > tolerance:
        raise OutputUnusable(
            f"checkpoint: no saved value within {tolerance:g} m of a node of this mesh "
            f"(nearest {np.max(distance):g} m); it belongs to another mesh"
        )
    return row
