"""Hyperelastic layer under rigid balls, with contact in the deformed configuration, on DOLFINx and PETSc.

Importing this package is light and needs no DOLFINx; `solve` does.
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from finite_strain.arguments import check_arguments
from finite_strain.numerics import DEFAULT, Numerics
from finite_strain.observer import Observer, Silence
from finite_strain.output.field_catalogue import FieldChoice
from finite_strain.planning.refinement import Budget
from linear_bem.errors import MissingDependency
from linear_bem.problem import Problem
from linear_bem.result import Result, Step
from meshes.box import TAGS

NEEDED = ("dolfinx", "petsc4py", "mpi4py", "gmsh", "h5py")
"""Packages that `solve` imports; Debian has them for its own /usr/bin/python3."""
FORMAT = 23
"""Format version of a run; it is raised when runs of older versions must not be resumed or shown as current."""
DEFAULT_ACCURACY = 0.02
"""Default relative accuracy of the tangential force."""
Inspect = Callable[[Step, dict[str, Any]], None]
"""Receives a step with results and its DOLFINx functions by name."""


def solve(
    problem: Problem,
    *,
    model: str = "finite_strain",
    accuracy: float = DEFAULT_ACCURACY,
    comm: Any = None,
    folder: Path | str | None = None,
    observer: Observer | None = None,
    fields: FieldChoice | None = None,
    seconds: float | None = None,
    unknowns: float | None = None,
    steps: Sequence[float] | None = (1.0,),
    numerics: Numerics = DEFAULT,
    solver_options: Mapping[str, str] | None = None,
    inspect: Inspect | None = None,
    mesh: Any = None,
) -> Result:
    """Press the balls in step by step and return the state of each after every step (collective over ``comm``).

    Raises `InvalidProblem`, `MissingDependency`, `UnsupportedProblem`, `NotConverged`, `OutputUnusable`, on all ranks
    together. The first run with another law, body or set of ball sizes compiles its finite elements, which may take
    minutes; the log "finite_strain" says so at level INFO.

    Parameters
    ----------
    problem
        Layer, balls and load. With the effect ``finite_strain`` the layer is hyperelastic and contact is in the
        deformed configuration; without it the same code uses linear elasticity and linearised contact.
    model
        The expected model, "finite_strain" or "small_strain"; a problem of the other model is refused.
    accuracy
        Relative accuracy of T at full load: meshes are refined until the error estimate meets it, or until the
        next mesh would exceed the budget. ``solved.accuracy`` states the accuracy reached and why refinement ended.
    comm
        MPI communicator; by default all ranks of the run.
    folder
        Folder for mesh, fields and checkpoint. An interrupted run of the same problem resumes from there, except if
        its law or body is a function, which cannot be compared.
    observer
        Follows the progress of the run; see `Observer`. Called on all ranks.
    fields
        Which fields are written into the folder and on which steps; by default all on every step.
    seconds, unknowns
        The budget: wall time of the run, and unknowns of its finest mesh; by default no bound on the time, and
        120 000 unknowns.
    steps
        Rising fractions of the load with output, the last one 1 (full load); by default full load alone. None stands
        for six equal steps of the approach.
    numerics
        Numerical parameters that studies vary.
    solver_options
        PETSc's options of the Newton and linear solvers without a prefix, such as ``{"pc_type": "lu"}``; they override
        the built-in choice and options with the prefix ``thirdbody_`` in ``PETSC_OPTIONS``.
    inspect
        Function called on all ranks after every step on each discretisation from the second on (the first only serves
        the error estimate), except steps that a resumed run already has. Arguments: the `Step`, and the DOLFINx
        functions by name: "displacement" [m] and, for mixed regions, "layer_pressure", "substrate_pressure" [Pa],
        positive in tension. They are defined on the simulated part, in its own frame, and change with the next step:
        copy what you keep. They are the uncorrected solution on the mesh; the small-strain problem corrects only the
        results of the balls: T, contact area, peak pressure, and Q (or D, if forces are prescribed: the deepest point
        of the displacement may therefore lie 1 % of D above or below -D).
    mesh
        A user's mesh in metres in the scene's frame, of hexahedra or tetrahedra: a .msh file, or DOLFINx's mesh, cell
        tags and facet tags. Tags are those of `TAGS`, in a file also by name: "layer", "substrate" if there is one, and
        the flat "top" z = 0 and "bottom". The mesh holds the whole scene, or its part x >= 0 or y >= 0 (or both) if it
        ends there and the scene is its own mirror image. Sides in the planes of its bounding box slide in these planes,
        as parts of an infinite layer; others are free, and the answer is that of this body, without a correction by
        small strain. The mesh is never refined: elements of order 2, 3 and, if needed, 4 give the error of T.

    """
    check_arguments(
        problem=problem, accuracy=accuracy, folder=folder, observer=observer, fields=fields, seconds=seconds,
        unknowns=unknowns, steps=steps, numerics=numerics, solver_options=solver_options, inspect=inspect,
    )  # fmt: skip
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise MissingDependency(
            f"{model} needs {', '.join(missing)}: not importable by {sys.executable} "
            f"(Python {sys.version.split()[0]}); "
            "`thirdbody doctor` states which Python has them and how to install them"
        )
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # one thread per rank: more threads would compete with ranks for cores
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain.equilibrium.linear_solver import with_options  # noqa: PLC0415  (imports DOLFINx)
    from finite_strain.mechanics.own_energy import check_own_energy  # noqa: PLC0415
    from finite_strain.mpi import on_all, working_folder  # noqa: PLC0415
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415
    from finite_strain.refinement_loop import Refinement  # noqa: PLC0415

    comm = MPI.COMM_WORLD if comm is None else comm
    own = None
    if mesh is not None:
        from finite_strain.own_mesh import OwnMesh  # noqa: PLC0415  (only for own meshes)

        own = OwnMesh(mesh, comm)
    fit = None if own is None else own.fit
    on_all(comm, lambda: check_own_energy(problem))
    plan = on_all(comm, lambda: plan_run(problem, accuracy, model, Budget(seconds, unknowns), steps, numerics, fit))
    with with_options(solver_options or {}), working_folder(None if folder is None else Path(folder), comm) as where:
        meshed = None if own is None else own.meshed
        return Refinement(plan, where, comm, observer or Silence(), fields, folder is not None, inspect, meshed).run()


def plan(
    problem: Problem,
    accuracy: float = DEFAULT_ACCURACY,
    model: str = "finite_strain",
    *,
    seconds: float | None = None,
    unknowns: float | None = None,
    steps: Sequence[float] | None = (1.0,),
) -> dict[str, Any]:
    """Return the plan of a `solve` and its cost, without DOLFINx; arguments as for `solve`.

    Times [s] are those of the machine on which `finite_strain.planning.cost` was measured; commands scale them.
    """
    check_arguments(problem=problem, accuracy=accuracy, seconds=seconds, unknowns=unknowns, steps=steps)
    from finite_strain.planning.forecast import forecast  # noqa: PLC0415
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415

    return forecast(plan_run(problem, accuracy, model, Budget(seconds, unknowns), steps))


__all__ = ["DEFAULT_ACCURACY", "FORMAT", "NEEDED", "TAGS", "FieldChoice", "Numerics", "Observer", "plan", "solve"]
