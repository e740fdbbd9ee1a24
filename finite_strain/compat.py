"""Every difference between the supported DOLFINx versions (0.5, 0.9, 0.11), and nothing else.

Pass arguments by position only where keyword names changed between versions.
"""

import ctypes
import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
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

from finite_strain.form_cache import compiler_options
from finite_strain.mpi import on_root
from linear_bem.errors import InvalidProblem, MissingDependency
from meshes.groups import number_groups
from meshes.layer import gmsh_session

VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])
_OLD = VERSION < (0, 6)

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
        with _compiler(mesh.comm) as options:  # the old version compiles spaces too
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


@contextmanager
def _compiler(comm: MPI.Comm) -> Iterator[dict[str, Any]]:
    with compiler_options(comm) as options:
        yield {"jit_params" if _OLD else "jit_options": options}


def compile_form(form: Any, comm: MPI.Comm) -> Any:
    """Return the compiled form (collective over comm), through the project's own cache."""
    with _compiler(comm) as options:
        return dolfinx.fem.form(form, **options)


def compile_forms(forms: list[Any], comm: MPI.Comm) -> list[Any]:
    """Return compiled forms (collective over comm); every rank first compiles a share of them into the cache."""
    if comm.size > 1:
        with _compiler(comm) as options:
            scalar = {"scalar_type": "double" if _OLD else np.float64}
            for form in forms[comm.rank :: comm.size]:
                with suppress(Exception):  # a form that does not compile raises below, on all ranks
                    dolfinx.jit.ffcx_jit(MPI.COMM_SELF, form, scalar, *options.values())
            comm.barrier()
    return [compile_form(form, comm) for form in forms]


def vector_of(function: Any) -> PETSc.Vec:
    """Return the PETSc vector that shares a function's memory."""
    return function.vector if _OLD else function.x.petsc_vec


def compile_expression(value: Any, points: np.ndarray, comm: MPI.Comm) -> Any:
    """Return the compiled expression at reference points (n, 3) of a cell (collective over comm).

    UFL's variables, needed for derivatives, are removed: UFL numbers them consecutively, and names in the cache would
    depend on what was compiled before.
    """
    value = map_expr_dag(_WithoutVariables(), apply_derivatives(apply_algebra_lowering(value)))
    with _compiler(comm) as options:
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
