"""One measurement: assembly of a pressed pair's tangent and solution of its linear system, twice if it is small."""

from __future__ import annotations

import ctypes
import dataclasses
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from linear_bem import Elements, Problem
from runs.process.machine import own_memory
from runs.studies.framework.pair import pair

if TYPE_CHECKING:
    from mpi4py import MPI

    from finite_strain.discretisation.checkpoint import Snapshot
    from finite_strain.one_discretisation import ModelRun

FORMS = {"displacement": 0.3, "mixed": 0.4999}
"""Poisson's ratio used with each element form."""
SOLVERS = {"MUMPS": {"direct_up_to": "1e12"}, "multigrid": {"direct_up_to": "0", "ksp_rtol": "1e-8"}}
"""PETSc options by solver, without their prefix."""
MOST_BY_FACTORS, TWICE_UP_TO = 100_000, 250_000
"""Largest number of unknowns of systems solved by factors, and of systems solved twice."""
BYTES = {"displacement": 1.05e4, "mixed": 1.9e4}
"""Memory [bytes per unknown], summed over the ranks, without which a measurement by multigrid is not started."""
DEPTH = 0.1
FINENESSES = np.arange(1.0, 16.1, 0.25).tolist()
PATH = (0.2, 0.6, 1.0)
"""Fractions of the depth at which equilibrium is solved before measuring."""


def pair_of(form: str) -> Problem:
    """Return the pair at the approach `DEPTH`, with elements of a form."""
    balls = pair(DEPTH, poisson=FORMS[form], substrate=None, shape="paraboloid")
    return dataclasses.replace(balls, elements=Elements(form))


def pressed(form: str, comm: MPI.Comm) -> Snapshot:
    """Return the pair in equilibrium at the approach `DEPTH` on the coarsest mesh, on every rank (collective)."""
    run = _run(form, 0.0, comm)
    for _ in run.path.steps(PATH):
        pass
    state = run.snapshot(PATH[-1])
    run.close()
    return state


def measure(form: str, target: int, state: Snapshot, comm: MPI.Comm) -> Iterator[dict[str, Any]]:
    """Yield, by solver, processor time of the slowest rank [s] and memory of all ranks, at ``state`` (collective)."""
    from finite_strain.geometry.estimates import penalties  # noqa: PLC0415  (imports DOLFINx, like all below)

    forget_peak()
    before = own_memory("VmRSS")
    run = _run(form, target, comm)
    near = run.predicted_by(state)
    run.model.fields.restore(near.values)
    run.model.contact.set_approaches(np.array(near.approaches))
    contact = run.model.contact
    contact.set_penalties(penalties(run.path.problem, contact.balls, contact.approaches))
    run.solver.close()
    for name in SOLVERS:
        if name != "MUMPS" or run.model.unknowns <= MOST_BY_FACTORS:
            yield {"form": form, "solver": name, "target": target, **_solved_by(name, run, before)}
    run.model.close()


def _run(form: str, target: float, comm: MPI.Comm) -> ModelRun:
    """Return the pair on a mesh of about ``target`` unknowns (collective)."""
    from finite_strain.observer import Silence  # noqa: PLC0415
    from finite_strain.one_discretisation import ModelRun, mesh_box  # noqa: PLC0415
    from finite_strain.planning.records import Discretisation  # noqa: PLC0415
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415

    plan = plan_run(pair_of(form), 0.02, "finite_strain")
    levels = [Discretisation(3, fineness) for fineness in FINENESSES]
    level = min(levels, key=lambda level: abs(plan.unknowns(level) - target))
    box = plan.box(level)
    with TemporaryDirectory() as folder:
        meshed = mesh_box(box, Path(comm.bcast(folder, root=0)) / "mesh.msh", comm)
        comm.barrier()
    return ModelRun(plan, meshed, box, level, Silence(), "scaling")


def _solved_by(name: str, run: ModelRun, before: float) -> dict[str, Any]:
    from petsc4py import PETSc  # noqa: PLC0415

    from finite_strain.equilibrium.newton import NewtonSolver  # noqa: PLC0415

    model, options = run.model, PETSc.Options("thirdbody_")
    comm = model.comm
    forget_peak()
    for key, value in SOLVERS[name].items():
        options[key] = value
    solver = NewtonSolver(model, run.path.control)
    ksp, b, x = solver.linear.ksp, model.matrix.createVecRight(), model.matrix.createVecRight()
    model.border(np.ones(len(model.contact.balls)), b)
    spent, iterations, failed = [], 0, 0
    # the second reuses the symbolic analysis, like all but the first of a load path
    for _ in range(2 if model.unknowns <= TWICE_UP_TO else 1):
        assembled = _seconds(model.tangent, comm)
        ksp.setOperators(model.matrix)
        with solver.options():
            spent.append((assembled, _seconds(lambda: ksp.solve(b, x), comm)))
        iterations, failed = ksp.getIterationNumber(), failed + (ksp.getConvergedReason() < 0)
    used = comm.allreduce(own_memory("VmHWM") - before)
    for vector in (b, x):
        vector.destroy()
    solver.close()
    for key in SOLVERS[name]:
        options.delValue(key)
    return {
        "unknowns": model.unknowns,
        "ranks": comm.size,
        "assembly_seconds": spent[-1][0],
        "first_seconds": spent[0][1],
        "solve_seconds": spent[1][1] if len(spent) > 1 else np.nan,
        "krylov_iterations": iterations if name == "multigrid" else 0,
        "fallbacks": failed,
        "kilobytes_per_unknown": used / model.unknowns / 1e3,
        "load": os.getloadavg()[0],
    }


def _seconds(work: Callable[[], Any], comm: MPI.Comm) -> float:
    comm.barrier()
    began = time.process_time()
    work()
    return max(comm.allgather(time.process_time() - began))


def forget_peak() -> None:
    """Return freed memory to the system and reset this process's peak memory (Linux)."""
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
