"""How strongly the elements are compressed: the smallest ratio of deformed to undeformed volume."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from finite_strain import compat
from finite_strain.recovery import GAUSS_POINTS

_CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
_POINTS = np.concatenate([_CORNERS, GAUSS_POINTS])


def smallest_volume_ratio(space: Any, nodal: np.ndarray, comm: MPI.Comm) -> float:
    """Return the smallest det(I + grad u) at corners and Gauss points of all cells (collective).

    ``space`` is the quadratic vector space of the displacements ``nodal`` (local nodes, 3) [m].
    """
    mesh = space.mesh
    owned = mesh.topology.index_map(3).size_local
    corners = mesh.geometry.x[compat.geometry_dofs(mesh)[:owned]]
    to_reference = np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
    by_reference = np.einsum("qaj,cai->cqij", _derivatives(), nodal[compat.cell_dofs(space)[:owned]])
    gradient = np.einsum("cqij,cjk->cqik", by_reference, to_reference)
    ratios = np.linalg.det(np.eye(3) + gradient)
    return float(comm.allreduce(float(ratios.min(initial=np.inf)), op=MPI.MIN))


def _derivatives() -> np.ndarray:
    """Return the derivatives (points, 10, 3) of the quadratic functions: central differences are exact for them."""
    columns = []
    for axis in np.eye(3):
        ahead, behind = (compat.tabulate_lagrange(2, _POINTS + sign * 0.5 * axis) for sign in (1.0, -1.0))
        columns.append(ahead - behind)
    return np.stack(columns, axis=2)
