"""Compile the forms of common scenes into the cache, so that no first run waits for the compiler.

    mpirun -n 2 python -m finite_strain.precompile

Forms do not depend on sizes, moduli or loads. These are for spheres on a compressible neo-Hookean layer, in a model
between mirror planes (a facet may touch one ball) and in one without (two), with elements of each order.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

from finite_strain.observer import Silence
from finite_strain.one_discretisation import MeshRun
from finite_strain.planning.refinement import HIGHEST, PATH_FINDER
from finite_strain.planning.run_plan import plan_run
from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem

SCENES = (((-1.0, 0.0), (1.0, 0.0)), ((-1.0, 0.0), (1.0, 0.0), (1.0, 2.5)))
"""Positions of the balls [R]: with two mirror planes, and with none."""


def precompile(comm: MPI.Comm) -> None:
    """Compile the forms; every rank compiles a share of them, by itself."""
    layer, substrate = Layer(young=1.0, poisson=0.48, thickness=1.16), Elastic(young=1e3, poisson=0.3)
    jobs = [(order, positions) for order in range(HIGHEST, PATH_FINDER.order - 1, -1) for positions in SCENES]
    with tempfile.TemporaryDirectory() as folder:
        for order, positions in jobs[comm.rank :: comm.size]:
            load = Load("approach", (0.1,) * len(positions))
            balls = tuple(Ball(position, radius=1.0) for position in positions)
            plan = plan_run(Problem(layer, balls, load, substrate, finite_strain=FiniteStrain()), 0.02, "finite_strain")
            level = replace(PATH_FINDER, order=order, fineness=0.5)
            run = MeshRun(plan, level, Path(folder) / "mesh.msh", MPI.COMM_SELF, Silence(), "")
            for part in filter(None, (run.own, run.small)):
                _ = part.model.actions
            run.close()


if __name__ == "__main__":
    precompile(MPI.COMM_WORLD)
