"""Own meshes on several ranks: that of the run in FOLDER, as a file or from DOLFINx; one with all cells on the first.

mpirun -n 2 python -m tests.finite_strain.own_mesh FOLDER
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

import finite_strain
from finite_strain.compat import read_mesh
from finite_strain.geometry.load_control import prescribed
from finite_strain.own_mesh import OwnMesh
from tests.finite_strain.scenes import ONE_LOAD
from tests.finite_strain.test_own_mesh import OF_SCENE, SMALL, SOLVERS, SPARSE, block

comm, file = MPI.COMM_WORLD, Path(sys.argv[1]) / "mesh_1.msh"
answers = {"file": finite_strain.solve(SMALL, mesh=file, **OF_SCENE)}


def fitted(source: Any) -> Any:
    """Return what a run on a mesh starts from: the part of the scene, and the mesh's measures and digest."""
    return OwnMesh(source, comm).fit(SMALL, prescribed(SMALL).expected())


# the same start gives the same answer; DOLFINx's meshes are solved on below
alike = comm.allgather(fitted(file) == fitted(read_mesh(file, comm)))


def all_on_the_first(comm: Any, ranks: int, dimension: int, cells: Any, *_: Any) -> Any:
    """Return the rank of each cell."""
    corners = cells[0] if isinstance(cells, list) else cells.array
    return dolfinx.cpp.graph.AdjacencyList_int32(np.zeros((len(corners) // 8, 1), dtype=np.int32))


options = {"ghost_mode": dolfinx.mesh.GhostMode.none, "partitioner": all_on_the_first}
meshed = block(**SPARSE, comm=comm, **options)
cells = comm.allgather(meshed[0].topology.index_map(3).size_local)
for name, solver in SOLVERS.items():
    answers[name] = finite_strain.solve(
        SMALL, mesh=meshed, model="small_strain", accuracy=0.3, numerics=ONE_LOAD, solver_options=solver
    )

if comm.rank == 0:
    print(json.dumps({"cells": cells, "alike": alike, **{name: answer.to_dict() for name, answer in answers.items()}}))
