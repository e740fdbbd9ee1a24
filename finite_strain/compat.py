"""Every difference between the supported DOLFINx versions (0.5, 0.9, 0.11), and nothing else.

Pass arguments by position only where keyword names changed between versions.
"""

import ctypes
import fcntl
import logging
import math
import os
import re
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import lru_cache
from importlib import import_module, machinery
from importlib.util import spec_from_file_location
from pathlib import Path
from typing import Any

import dolfinx
import dolfinx.fem.petsc
import dolfinx.jit
import gmsh
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction

from finite_strain.mpi import on_root
from linear_bem.errors import InvalidProblem, MissingDependency, OutputUnusable
from meshes.groups import number_groups
from meshes.layer import gmsh_session

VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])
_OLD = VERSION < (0, 6)
_COMPILER_SECONDS, _NOTED_AFTER = 600, 2.0
"""How long the compiler waits for a form that another run compiles, and how long it works without a message [s]."""
_COMPILING = "compiling finite elements for this kind of scene, once: it may take minutes, and later runs reuse them"
_FLAGS = [
    "-O2", "-g0", "-ftree-vectorize", "-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros",
    "-fassociative-math",
]  # fmt: skip
_WIDE_FLAGS = ["-mavx2", "-mfma"]
"""Compiler flags of forms, and those where every rank's processor has these instructions: sums over quadrature points
are vectorised, and NaN and infinity keep their meaning. With -O2 alone matrices of order 4 take 1.5 times as long,
vectors and scalars 2.3 times. The names of compiled forms in the cache depend on the flags."""

if VERSION < (0, 5):
    raise MissingDependency(f"finite_strain needs DOLFINx 0.5 or newer, found {dolfinx.__version__}")
if np.issubdtype(PETSc.ScalarType, np.complexfloating):
    raise MissingDependency(
        "finite_strain needs a real build of PETSc, found a complex one: install python3-dolfinx-real"
    )

with suppress(ValueError):  # not in the main thread
    # Python's own handler again: under PETSc's a closed pipe ends the process, instead of a BrokenPipeError
    signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))

# distutils logs the compiler's command lines while a form is compiled for the first time
logging.getLogger().addFilter(lambda record: record.levelno > logging.INFO)


def is_used(option: str) -> bool:
    """Return whether PETSc has read an option of its database, named without a dash."""
    options = PETSc.Options()
    if hasattr(options, "used"):
        return bool(options.used(option))
    used = ctypes.c_int()
    ctypes.CDLL(PETSc.__file__).PetscOptionsUsed(None, option.encode(), ctypes.byref(used))
    return bool(used.value)


def function_space(mesh: Any, degree: int, shape: tuple[int, ...] = (), discontinuous: bool = False) -> Any:
    """Return a Lagrange space of the degree with the value shape."""
    if _OLD:
        _name_spacing(mesh.ufl_domain())
        family, cell = ("DG" if discontinuous else "CG"), mesh.ufl_cell()
        scalar = ufl.FiniteElement(family, cell, degree)
        kinds = {1: lambda: ufl.VectorElement(scalar, dim=shape[0]), 2: lambda: ufl.TensorElement(scalar, shape=shape)}
        element = kinds[len(shape)]() if shape else scalar
        with _compiler_cache(mesh.comm) as options:  # the old version compiles spaces too
            return dolfinx.fem.FunctionSpace(mesh, element, **options)
    import basix.ufl  # noqa: PLC0415  (absent from the old version)

    element = basix.ufl.element(
        "Lagrange", mesh.basix_cell().name, degree, shape=shape or None, discontinuous=discontinuous
    )
    return dolfinx.fem.functionspace(mesh, element)


def _name_spacing(domain: Any) -> None:
    """Name the spacing of a mesh's nodes, as the old version's compiler does in every form that it compiles.

    Names of forms in the cache contain it: they must not depend on whether an earlier form was compiled or found there.
    """
    vector = domain.ufl_coordinate_element()
    scalar = vector.sub_elements()[0]
    if scalar.variant() is None:
        named = ufl.FiniteElement(
            scalar.family(), scalar.cell(), scalar.degree(), scalar.quadrature_scheme(), variant="equispaced"
        )
        domain._ufl_coordinate_element = ufl.VectorElement(named, dim=vector.num_sub_elements())


def compile_form(form: Any, comm: MPI.Comm) -> Any:
    """Return the compiled form (collective over comm), through the project's own cache."""
    with _compiler_cache(comm) as options:
        return dolfinx.fem.form(form, **options)


def compile_forms(forms: list[Any], comm: MPI.Comm) -> list[Any]:
    """Return compiled forms (collective over comm); every rank first compiles a share of them into the cache."""
    if comm.size > 1:
        with _compiler_cache(comm) as options:
            scalar = {"scalar_type": "double" if _OLD else np.float64}
            for form in forms[comm.rank :: comm.size]:
                with suppress(Exception):  # a form that does not compile raises below, on all ranks
                    dolfinx.jit.ffcx_jit(MPI.COMM_SELF, form, scalar, *options.values())
            comm.barrier()
    return [compile_form(form, comm) for form in forms]


@contextmanager
def _compiler_cache(comm: MPI.Comm) -> Iterator[dict[str, Any]]:
    """Yield the compiler's options, as a keyword argument (collective).

    Runs share the cache and may compile at the same time. A source without its ``.cached`` file, for which the compiler
    would wait, was left by a killed run if no other run compiles now, or if it is older than this waiting time.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "thirdbody" / "forms"
    failure = None
    with ExitStack() as stack, warnings.catch_warnings():
        # a hexahedron of order 4 needs more quadrature points than the compiler's warning threshold
        warnings.filterwarnings("ignore", "Number of integration points per cell", UserWarning)
        if comm.rank == 0:
            try:
                cache.mkdir(parents=True, exist_ok=True)
                lock = stack.enter_context((cache / "lock").open("w"))
                oldest = time.time() - _COMPILER_SECONDS
                with suppress(BlockingIOError):
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    oldest = math.inf
                for source in _unfinished(cache, cache.stat().st_mtime_ns):
                    with suppress(FileNotFoundError):  # another run may remove it, too
                        if source.stat().st_mtime < oldest:
                            source.unlink()
                fcntl.flock(lock, fcntl.LOCK_SH)
            except OSError as error:
                failure = f"compiled forms cannot be kept in {cache}: {error}; set XDG_CACHE_HOME to a writable folder"
        failure = comm.bcast(failure, root=0)
        if failure:
            raise OutputUnusable(failure)
        flags = _FLAGS + (_WIDE_FLAGS if comm.allreduce(_has_wide_registers(), op=MPI.LAND) else [])
        options = {"timeout": _COMPILER_SECONDS, "cache_dir": str(cache), "cffi_extra_compile_args": flags}
        stack.callback(vars(machinery).update, FileFinder=machinery.FileFinder)
        vars(machinery).update(FileFinder=FileFinder)
        # forms in the cache take no time
        slow = threading.Timer(_NOTED_AFTER, _announce)
        if comm.rank == 0:
            slow.start()
            stack.callback(slow.cancel)
        yield {"jit_params" if _OLD else "jit_options": options}


class FileFinder(machinery.FileFinder):
    """Finds a compiled form by its name: the compiler makes a finder for each form, which would list the folder.

    Other modules are found as usual. Python registers finders by the names of their classes: it stays ``FileFinder``.
    """

    def find_spec(self, fullname: str, target: Any = None) -> machinery.ModuleSpec | None:
        """Return the module of this name, None if there is none."""
        if not fullname.startswith("libffcx_"):
            return super().find_spec(fullname, target)
        files = (Path(self.path, fullname + suffix) for suffix in machinery.EXTENSION_SUFFIXES)
        return next((spec_from_file_location(fullname, file) for file in files if file.is_file()), None)


@lru_cache(maxsize=1)
def _announce() -> None:
    """Log, once per process, that forms are compiled."""
    logging.getLogger("finite_strain").info(_COMPILING)


@lru_cache(maxsize=1)
def _has_wide_registers() -> bool:
    """Return whether this machine's processor has AVX2 and fused multiply-add; False where it does not say so."""
    with suppress(OSError):
        flags = re.search(r"^flags\s*:(.*)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
        return flags is not None and {"avx2", "fma"} <= set(flags[1].split())
    return False


@lru_cache(maxsize=1)
def _unfinished(cache: Path, changed: int) -> list[Path]:
    """Return the sources without a ``.cached`` file in a folder last ``changed`` at this time [ns].

    There may be thousands of forms: listing them for every form would take a fifth of a small run.
    """
    there = set(os.listdir(cache))
    return [cache / name for name in there if name.endswith(".c") and f"{name}.cached" not in there]


def vector_of(function: Any) -> PETSc.Vec:
    """Return the PETSc vector that shares a function's memory."""
    return function.vector if _OLD else function.x.petsc_vec


def compile_expression(value: Any, points: np.ndarray, comm: MPI.Comm) -> Any:
    """Return the compiled expression at reference points (n, 3) of a cell (collective over comm).

    UFL's variables, needed for derivatives, are removed: UFL numbers them consecutively, and names in the cache would
    depend on what was compiled before.
    """
    value = map_expr_dag(_WithoutVariables(), apply_derivatives(apply_algebra_lowering(value)))
    with _compiler_cache(comm) as options:
        return dolfinx.fem.Expression(value, points, **options)


class _WithoutVariables(MultiFunction):
    expr = MultiFunction.reuse_if_untouched

    def variable(self, o: Any, operand: Any, label: Any) -> Any:
        return operand


def evaluate(expression: Any, mesh: Any, cells: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the values (cells, points, *shape) of a compiled expression."""
    if not len(cells):  # a rank may own none
        return np.zeros((0, len(expression.X()), *shape))
    values = expression.eval(cells) if _OLD else expression.eval(mesh, cells)
    return values.reshape(len(cells), len(expression.X()), *shape)


def cell_dofs(space: Any) -> np.ndarray:
    """Return the (cells, dofs per cell) table of a space's block dofs, ghost cells included."""
    dofmap = space.dofmap.list
    if hasattr(dofmap, "array"):
        return dofmap.array.reshape(-1, space.dofmap.dof_layout.num_dofs)
    return dofmap


def vtx_writer() -> Any:
    """Return DOLFINx's VTX writer; None if DOLFINx was built without ADIOS2, as in Debian 12."""
    return getattr(import_module("dolfinx.io"), "VTXWriter", None)


def read_mesh(path: Path, comm: MPI.Comm) -> tuple[Any, Any, Any]:
    """Return mesh, cell tags and facet tags of a .msh file, whose groups are known by name or number (`TAGS`)."""
    reader = import_module("dolfinx.io.gmshio" if VERSION < (0, 10) else "dolfinx.io.gmsh")

    def open_file() -> None:
        try:
            gmsh.open(str(path))
            number_groups(path)
        except InvalidProblem:
            raise
        except Exception as error:
            said = str(error).removesuffix(" ()")
            raise InvalidProblem(
                f"mesh: gmsh cannot read {path}: {said}; write it by gmsh.write, in the .msh format of "
                "version 4.1 or 2.2"
            ) from error

    with gmsh_session() if comm.rank == 0 else nullcontext():
        on_root(comm, open_file)
        answer = reader.model_to_mesh(gmsh.model if comm.rank == 0 else None, comm, 0, 3)
    return answer[0], answer[1], answer[2]  # DOLFINx 0.10 and later return more


def versions() -> dict[str, str]:
    """Return the versions of the libraries that a finite-element result depends on."""
    petsc, mpi = PETSc.Sys.getVersion(), MPI.Get_library_version().split(",")[0].split("\n")[0]
    known = {"dolfinx": dolfinx.__version__, "petsc": ".".join(map(str, petsc)), "mpi": mpi}
    return {**known, "gmsh": gmsh.__version__}


def geometry_dofs(mesh: Any) -> np.ndarray:
    """Return the (cells, n) table of a mesh's nodes, ghost cells included: of hexahedra n is 8 or, if curved, 27.

    Corners come first, those of a hexahedron with x running first, then y, then z.
    """
    if _OLD:
        nodes = mesh.geometry.cmap.create_dof_layout().num_dofs  # a rank may have no cell
        return mesh.geometry.dofmap.array.reshape(-1, nodes)
    return mesh.geometry.dofmap if VERSION < (0, 11) else mesh.geometry.dofmaps[0]


def constrained_dofs(bc: Any) -> np.ndarray:
    """Return the local dof numbers (unrolled, ghosts included) that a boundary condition constrains."""
    indices = bc.dof_indices() if hasattr(bc, "dof_indices") else bc._cpp_object.dof_indices()
    return np.asarray(indices[0])


def ghosted_vector(linear_form: Any, space: Any) -> PETSc.Vec:
    """Return a new ghosted vector for a linear form on the space."""
    create = dolfinx.fem.petsc.create_vector
    return create(linear_form) if VERSION < (0, 10) else create(space)


def free_dropped_objects(comm: MPI.Comm) -> None:
    """Free PETSc objects that Python has dropped (collective): since PETSc 3.18 they are only queued in parallel."""
    if hasattr(PETSc, "garbage_cleanup"):
        PETSc.garbage_cleanup(comm)


def create_block_matrix(forms: list[list[Any]]) -> PETSc.Mat:
    """Return a matrix for the compiled forms of several fields: each rank's rows of the first field come first."""
    name = "create_matrix_block" if VERSION < (0, 10) else "create_matrix"
    return getattr(dolfinx.fem.petsc, name)(forms)


def assemble_block_matrix(matrix: PETSc.Mat, forms: list[list[Any]], bcs: list[Any]) -> None:
    """Add the forms of several fields to the matrix, with the identity in constrained rows; it is not finalised."""
    name = "assemble_matrix_block" if VERSION < (0, 10) else "assemble_matrix"
    getattr(dolfinx.fem.petsc, name)(matrix, forms, bcs)
