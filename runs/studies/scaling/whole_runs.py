"""A whole run by multigrid on a fine mesh: a pair and its small-strain companion, two load steps."""

from __future__ import annotations

import dataclasses
import time
from typing import TYPE_CHECKING, Any

from linear_bem import Elements
from linear_bem.counts import grouped
from runs.models import Run
from runs.session.progress import print_status
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import pair
from runs.studies.scaling.measuring import DEPTH, FINENESSES, FORMS, forget_peak, memory_fault, peak_memory

if TYPE_CHECKING:
    from mpi4py import MPI

STEPS = (0.5, 1.0)
BYTES = 1.85e4
"""Memory on all ranks per unknown asked for: both models keep their matrix and levels."""
ACCURACY = 0.02
"""Of the domain and of linear_bem; the mesh is given."""
KEPT = ("unknowns", "fraction", "iterations", "tangents", "linear_iterations", "linear_fallbacks", "seconds")
"""What the rows have of a load step's record."""


def too_large(target: int) -> str:
    """Return why a run would not fit into the free memory; nothing if it would."""
    return memory_fault(BYTES * target, f"a run of {grouped(target)} unknowns")


def run(target: int, comm: MPI.Comm) -> list[dict[str, Any]]:
    """Return a row per load step on a mesh of about ``target`` unknowns, order 3 (collective).

    Two coarse meshes come before: the path finder, whose states the next ones start from, and one for the error.
    """
    form = next(iter(FORMS))
    problem = dataclasses.replace(
        pair(DEPTH, poisson=FORMS[form], substrate=None, shape="paraboloid"), elements=Elements(form)
    )
    case = LevelCase("", problem, "finite_strain", ACCURACY, steps=STEPS, levels=_levels(problem, target))
    forget_peak()
    begun = time.process_time()
    seen: list[dict[str, Any]] = []
    result = case.solve(Run(comm=comm, steps=STEPS))
    spent = comm.allreduce(time.process_time() - begun)
    memory = peak_memory(comm)
    for step in result.steps[-len(STEPS) :]:
        ball = step.balls[0]
        seen.append(
            {
                **{key: step.record[key] for key in KEPT if key in step.record},
                "target": target,
                "ranks": comm.size,
                "processor_seconds": spent,
                "gigabytes": memory / 1e9,
                "normal_force": ball.normal_force,
                "tangential_force": ball.tangential_force[0],
                "error": ball.tangential_force_error,
            }
        )
        if comm.rank == 0:
            print_status(", ".join(f"{key} {value}" for key, value in seen[-1].items()))
    return seen


def _levels(problem: Any, target: int) -> tuple[Level, ...]:
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415  (imports DOLFINx)

    plan = plan_run(problem, ACCURACY, "finite_strain")
    fine = min((Level(3, f) for f in FINENESSES), key=lambda at: abs(plan.unknowns(at.discretisation()) - target))
    return Level(2), Level(3), fine
