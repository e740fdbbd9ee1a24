"""Own meshes on several ranks: that of a scene's run, as a file or from DOLFINx, and one on the first rank alone."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

import finite_strain
from finite_strain.compat import read_mesh
from finite_strain.geometry.load_control import prescribed
from finite_strain.own_mesh import OwnMesh
from linear_bem import Ball, FiniteStrain, Layer, Load, Problem
from tests.finite_strain.scenes import COARSER
from tests.finite_strain.test_own_mesh import SMALL, SOLVERS, SPARSE, block

layer = Layer(young=1.0, poisson=0.3, thickness=1.16)
balls = tuple(Ball((x, 0.0), 1.0, "sphere") for x in (-1.0, 1.0))
problem = Problem(layer, balls, Load("approach", (0.1, 0.1)), finite_strain=FiniteStrain())
comm = MPI.COMM_WORLD
folder = Path(comm.bcast(mkdtemp() if comm.rank == 0 else "", root=0))
given: dict[str, Any] = {"accuracy": 0.3, "numerics": COARSER}
answers = {"scene": finite_strain.solve(problem, folder=folder, **given)}

answers["file"] = finite_strain.solve(problem, mesh=folder / "mesh_1.msh", **given)


def fitted(source: Any) -> Any:
    """Return what a run on a mesh starts from: the part of the scene, and the mesh's measures and digest."""
    return OwnMesh(source, comm).fit(problem, prescribed(problem).expected())


# the same start gives the same answer; DOLFINx's meshes are solved on below
alike = comm.allgather(fitted(folder / "mesh_1.msh") == fitted(read_mesh(folder / "mesh_1.msh", comm)))


def all_on_the_first(comm: Any, ranks: int, dimension: int, cells: Any, *_: Any) -> Any:
    """Return the rank of each cell."""
    corners = cells[0] if isinstance(cells, list) else cells.array
    return dolfinx.cpp.graph.AdjacencyList_int32(np.zeros((len(corners) // 8, 1), dtype=np.int32))


options = {"ghost_mode": dolfinx.mesh.GhostMode.none, "partitioner": all_on_the_first}
meshed = block(**SPARSE, comm=comm, **options)
cells = comm.allgather(meshed[0].topology.index_map(3).size_local)
for name, solver in SOLVERS.items():
    answers[name] = finite_strain.solve(SMALL, mesh=meshed, model="small_strain", accuracy=0.3, solver_options=solver)

if comm.rank == 0:
    print(json.dumps({"cells": cells, "alike": alike, **{name: answer.to_dict() for name, answer in answers.items()}}))
