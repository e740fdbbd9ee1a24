"""An own mesh: the mesh of a scene's run, written to a file or handed over by DOLFINx, gives the scene's answer."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import mkdtemp

from mpi4py import MPI

import finite_strain
from finite_strain.compat import read_mesh
from linear_bem import Ball, FiniteStrain, Layer, Load, Problem

layer = Layer(young=1.0, poisson=0.3, thickness=1.16)
balls = tuple(Ball((x, 0.0), 1.0, "sphere") for x in (-1.0, 1.0))
problem = Problem(layer, balls, Load("approach", (0.1, 0.1)), finite_strain=FiniteStrain())
comm = MPI.COMM_WORLD
folder = Path(comm.bcast(mkdtemp() if comm.rank == 0 else "", root=0))
answers = {"scene": finite_strain.solve(problem, tangential_force=0.3, folder=folder)}

answers["file"] = finite_strain.solve(problem, tangential_force=0.3, mesh=folder / "mesh_1.msh")

mesh, cell_tags, facet_tags = read_mesh(folder / "mesh_1.msh", comm)
answers["dolfinx"] = finite_strain.solve(problem, tangential_force=0.3, mesh=(mesh, cell_tags, facet_tags))

if comm.rank == 0:
    print(json.dumps({name: answer.to_dict() for name, answer in answers.items()}))
