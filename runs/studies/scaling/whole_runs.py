"""A whole run by multigrid on a fine mesh: a pair and its small-strain companion, two load steps."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from runs.models import Run
from runs.process.machine import own_memory
from runs.session.progress import print_status
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.scaling.measuring import forget_peak, pair_of

if TYPE_CHECKING:
    from mpi4py import MPI

STEPS = (0.5, 1.0)
FINENESSES = np.arange(1.0, 8.05, 0.1).round(1).tolist()
BYTES = 1.9e4
"""Memory [bytes per requested unknown], summed over the ranks: both models keep matrix and multigrid levels."""
ACCURACY = 0.02
"""Accuracy of the domain size and of linear_bem; the mesh is given."""
KEPT = ("unknowns", "fraction", "iterations", "tangents", "linear_iterations", "linear_fallbacks", "seconds")
"""Entries of a load step's record that are in the rows."""


def run(target: int, comm: MPI.Comm) -> list[dict[str, Any]]:
    """Return a row per load step on a mesh of about ``target`` unknowns, order 3 (collective).

    Two coarse meshes come first: the path finder, which gives initial guesses to the next, and one for the error.
    """
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415

    problem = pair_of("displacement")
    plan = plan_run(problem, ACCURACY, "finite_strain", steps=STEPS)
    fine = min((Level(3, f) for f in FINENESSES), key=lambda at: abs(plan.unknowns(at.discretisation()) - target))
    case = LevelCase("", problem, "finite_strain", ACCURACY, steps=STEPS, levels=(Level(2), Level(3), fine))
    forget_peak()
    begun = time.process_time()
    result = case.solve(Run(comm=comm, steps=STEPS))
    spent = comm.allreduce(time.process_time() - begun)
    peak = comm.allreduce(own_memory("VmHWM"))
    whole = {"target": target, "ranks": comm.size, "processor_seconds": spent, "gigabytes": peak / 1e9}
    seen = [
        {
            **{key: step.record[key] for key in KEPT if key in step.record},
            **whole,
            "normal_force": step.balls[0].normal_force,
            "tangential_force": step.balls[0].tangential_force[0],
            "error": step.balls[0].tangential_force_error,
        }
        for step in result.steps[-len(STEPS) :]
    ]
    if comm.rank == 0:
        for row in seen:
            print_status(", ".join(f"{key} {value}" for key, value in row.items()))
    return seen
