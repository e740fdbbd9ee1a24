"""How strongly the elements are compressed: the smallest ratio of deformed to undeformed volume."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from finite_strain.recovery import CellNodes


def smallest_volume_ratio(space: Any, nodal: np.ndarray, comm: MPI.Comm) -> float:
    """Return the smallest det(I + grad u) at the nodes of all cells (collective).

    ``space`` is the Lagrange vector space of the displacements ``nodal`` (local nodes, 3) [m].
    """
    ratios = np.linalg.det(np.eye(3) + CellNodes(space).gradient(nodal))
    return float(comm.allreduce(float(ratios.min(initial=np.inf)), op=MPI.MIN))
