"""An own mesh whose cells are all on the first of two ranks."""

from __future__ import annotations

import json
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

import finite_strain
from tests.finite_strain.scenes import SHAPES, at_small_strain, pair
from tests.finite_strain.test_own_mesh import block


def all_on_the_first(comm: Any, ranks: int, dimension: int, cells: Any, *_: Any) -> Any:
    """Return the rank of each cell."""
    corners = cells[0] if isinstance(cells, list) else cells.array
    return dolfinx.cpp.graph.AdjacencyList_int32(np.zeros((len(corners) // 8, 1), dtype=np.int32))


comm = MPI.COMM_WORLD
options = {"ghost_mode": dolfinx.mesh.GhostMode.none, "partitioner": all_on_the_first}
meshed = block(comm=comm, **options)
problem = at_small_strain(pair(0.1, poisson=0.3, shape=SHAPES["small_strain"]))
cells = comm.allgather(meshed[0].topology.index_map(3).size_local)
for solver in ({}, {"direct_up_to": "0"}):
    asked = {"model": "small_strain", "tangential_force": 0.5, "solver_options": solver}
    ball = finite_strain.solve(problem, mesh=meshed, **asked).balls[0]
    if comm.rank == 0:
        print(json.dumps([cells, ball.normal_force, ball.tangential_force[0]]), flush=True)
