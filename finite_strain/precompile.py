"""Compile the forms of common scenes into the cache, so that their first run does not wait for the compiler.

    mpirun -n 2 python -m finite_strain.precompile

Forms do not depend on parameter values. These are for prescribed approaches of spheres on a neo-Hookean layer with nu
below 0.49: for models in which a facet may touch one ball (between mirror planes) or two, with elements of each order,
without output of fields.
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

RADII = ((1.0, 1.0), (1.0, 1.2))
"""Radii of two balls: equal, with a mirror plane between them, or different."""


def precompile(comm: MPI.Comm) -> None:
    """Compile the forms; every rank compiles its share independently."""
    layer, substrate = Layer(young=1.0, poisson=0.48, thickness=1.16), Elastic(young=1e3, poisson=0.3)
    jobs = [(order, radii) for order in range(HIGHEST, PATH_FINDER.order - 1, -1) for radii in RADII]
    with tempfile.TemporaryDirectory() as folder:
        for order, radii in jobs[comm.rank :: comm.size]:
            balls = tuple(Ball((x, 0.0), radius) for x, radius in zip((-1.2, 1.2), radii, strict=True))
            load = Load("approach", (0.1, 0.1))
            plan = plan_run(Problem(layer, balls, load, substrate, finite_strain=FiniteStrain()), 0.02, "finite_strain")
            level = replace(PATH_FINDER, order=order, fineness=0.5)
            run = MeshRun(plan, level, Path(folder) / "mesh.msh", MPI.COMM_SELF, Silence(), "")
            for part in filter(None, (run.own, run.small)):
                _ = part.model.actions
            run.close()


if __name__ == "__main__":
    precompile(MPI.COMM_WORLD)
