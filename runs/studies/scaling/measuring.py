"""One measurement: a pair of balls in equilibrium, its tangent assembled and its linear system solved twice."""

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

from linear_bem import Elements
from runs.studies.framework.pair import pair

if TYPE_CHECKING:
    from mpi4py import MPI

    from finite_strain.one_discretisation import ModelRun

FORMS = {"displacement": 0.3, "mixed": 0.4999}
"""Poisson's ratio used with each element form."""
SOLVERS = {"MUMPS": "1e12", "multigrid": "0"}
"""Largest number of unknowns that is solved directly."""
DEPTH = 0.1
FINENESSES = np.arange(1.0, 4.1, 0.25).tolist()
PATH = (0.2, 0.6, 1.0)
"""Fractions of the depth at which equilibrium is solved before measuring."""


def measure(form: str, target: int, comm: MPI.Comm) -> Iterator[dict[str, Any]]:
    """Yield, per solver, times of the slowest rank [s of processor time] and memory of all ranks (collective).

    Both solve the same system: the tangent at the equilibrium for approach `DEPTH`.
    """
    from finite_strain.observer import Silence  # noqa: PLC0415
    from finite_strain.one_discretisation import ModelRun, mesh_box  # noqa: PLC0415  (imports DOLFINx, like all below)
    from finite_strain.planning.records import Discretisation  # noqa: PLC0415
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415

    balls = pair(DEPTH, poisson=FORMS[form], substrate=None, shape="paraboloid")
    plan = plan_run(dataclasses.replace(balls, elements=Elements(form)), 0.02, "finite_strain")
    levels = [Discretisation(3, fineness) for fineness in FINENESSES]
    level = min(levels, key=lambda level: abs(plan.unknowns(level) - target))
    box = plan.box(level)
    _forget_peak()
    before = _status("VmRSS")
    with TemporaryDirectory() as folder:
        meshed = mesh_box(box, Path(comm.bcast(folder, root=0)) / "mesh.msh", comm)
        comm.barrier()
    run = ModelRun(plan, meshed, box, level, Silence(), "scaling")
    for _ in run.path.steps(PATH):
        pass
    run.solver.close()
    for name in SOLVERS:
        yield {"form": form, "solver": name, "target": target, **_solved_by(name, run, before)}
    run.model.close()


def _solved_by(name: str, run: ModelRun, before: float) -> dict[str, Any]:
    from petsc4py import PETSc  # noqa: PLC0415

    from finite_strain.equilibrium.newton import NewtonSolver  # noqa: PLC0415

    model, options = run.model, PETSc.Options("thirdbody_")
    comm = model.comm
    _forget_peak()
    options["direct_up_to"] = SOLVERS[name]
    solver = NewtonSolver(model, run.path.control)
    ksp, b, x = solver.linear.ksp, model.matrix.createVecRight(), model.matrix.createVecRight()
    model.border(np.ones(len(model.contact.balls)), b)
    spent, iterations, failed = [], 0, 0
    for _ in range(2):  # the second reuses the symbolic analysis, like all but the first of a load path
        assembled = _seconds(model.tangent, comm)
        ksp.setOperators(model.matrix)
        spent.append((assembled, _seconds(lambda: ksp.solve(b, x), comm)))
        iterations, failed = ksp.getIterationNumber(), failed + (ksp.getConvergedReason() < 0)
    used = comm.allreduce(_status("VmHWM") - before)
    for vector in (b, x):
        vector.destroy()
    solver.close()
    options.delValue("direct_up_to")
    return {
        "unknowns": model.unknowns,
        "ranks": comm.size,
        "assembly_seconds": spent[1][0],
        "first_seconds": spent[0][1],
        "solve_seconds": spent[1][1],
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


def _forget_peak() -> None:
    """Return freed memory to the system and reset this process's peak memory (Linux)."""
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def _status(key: str) -> float:
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    found = [line.split() for line in lines if line.startswith(f"{key}:")]
    return 1024.0 * float(found[0][1]) if found else float(np.nan)
