"""Newton's linear systems in PETSc: data that a solver needs besides options, and direct factors if it fails.

Multigrid gets its levels or, if the user chose an algebraic one, the rigid-body near-nullspace. The mixed form is split
into displacement and pressure, and the pressure's Schur complement is approximated by its mass matrix over the
stiffness, -(1/mu + 1/lambda) int p q.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.regions import nothing_where_idle
from finite_strain.equilibrium.order_levels import set_levels
from finite_strain.equilibrium.solver_options import DISPLACEMENT, FACTORS, PREFIX, Choice, along, choose, factor_bytes
from finite_strain.mechanics.volumetric import Mixed
from linear_bem.counts import grouped
from linear_bem.errors import InvalidProblem, NotConverged
from linear_bem.memory import SHARE, free_memory


def given_options() -> dict[str, str]:
    """Return the options of our prefix in PETSc's database: the user's own, while no solver works."""
    return dict(PETSc.Options(PREFIX).getAll())


def unused_options() -> list[str]:
    """Return the names of the user's options that no solver has read so far."""
    return [key for key in given_options() if not compat.is_used(f"{PREFIX}{key}")]


@contextmanager
def with_options(options: Mapping[str, str]) -> Iterator[None]:
    """Add options of our prefix to those in PETSc's database inside a with block."""
    database, before = PETSc.Options(PREFIX), given_options()
    changed = [key for key, value in options.items() if before.get(key) != value]  # set again they would be unread
    for key in changed:
        database[key] = options[key]
    try:
        yield
    finally:
        for key in changed:
            database.delValue(key)
            if key in before:
                database[key] = before[key]


def choose_for(model: Model) -> Choice:
    """Return the solver for a model's systems, by its size and form and the user's options."""
    PETSc.Options(PREFIX).hasName("direct_up_to")  # used here only: PETSc would report an unused option
    return choose(model.unknowns, model.is_mixed, given_options(), model.order)


class LinearSolver:
    """The Krylov method or factors of one model's tangent, for Newton's solver or for separate use."""

    def __init__(self, model: Model, ksp: PETSc.KSP, choice: Choice) -> None:
        self.model, self.ksp, self.choice = model, ksp, choice
        self._owned: list[Any] = []
        if choice.direct:
            return
        motions = self._rigid_motions()
        self._owned.append(motions)
        if not model.is_mixed:
            model.matrix.setNearNullSpace(motions)
            self._set_levels(ksp.getPC())
        elif choice.options["pc_type"] == "fieldsplit":
            self._split(motions)

    def close(self) -> None:
        """Free all objects of the solver (collective), including those in the Krylov method of Newton's solver."""
        for item in (self.ksp, *self._owned):
            item.destroy()

    def factors(self) -> PETSc.KSP:
        """Return new factors of MUMPS, to be destroyed by the caller (collective).

        Raises `NotConverged` if they would need more than the free memory of some rank's machine.
        """
        comm, needed = self.model.comm, factor_bytes(self.model.unknowns)
        node = comm.Split_type(MPI.COMM_TYPE_SHARED)
        free = comm.allreduce(free_memory() / node.size, op=MPI.MIN) * comm.size
        node.Free()
        if needed > SHARE * free:
            raise NotConverged(
                f"the Krylov method did not converge, and factors of {grouped(self.model.unknowns)} unknowns need "
                f"about {needed / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB are free; take more machines or "
                "a coarser mesh"
            )
        ksp = PETSc.KSP().create(self.model.comm)
        ksp.setType("preonly")
        ksp.setOperators(self.model.matrix)
        factors = ksp.getPC()
        factors.setType(FACTORS["pc_type"])
        factors.setFactorSolverType(FACTORS["pc_factor_mat_solver_type"])
        factors.setFactorSetUpSolverType()
        factors.getFactorMatrix().setMumpsIcntl(14, int(FACTORS["mat_mumps_icntl_14"]))
        return ksp

    def _set_levels(self, preconditioner: PETSc.PC, prefix: str = "") -> None:
        if self.choice.options[f"{prefix}pc_type"] == "mg":
            set_levels(preconditioner, self.model, along(self.model.unknowns, self.model.order, self.model.is_mixed))

    def _rigid_motions(self) -> PETSc.NullSpace:
        points = np.ascontiguousarray(self.model.fields.points[0][: self.model.fields.owned[0]])
        coordinates = PETSc.Vec().createWithArray(points.ravel(), bsize=3, comm=self.model.comm)
        motions = PETSc.NullSpace().createRigidBody(coordinates)
        coordinates.destroy()
        return motions

    def _split(self, motions: PETSc.NullSpace) -> None:
        model, first = self.model, self.model.matrix.getOwnershipRange()[0]
        ranges = model.fields.ranges
        count = ranges[-1].stop - ranges[1].start
        rows = PETSc.IS().createStride(ranges[0].stop, first, 1, model.comm)
        rows.setBlockSize(3)
        rows.compose("nearnullspace", motions)
        others = PETSc.IS().createStride(count, first + ranges[1].start, 1, model.comm)
        mass = self._mass_over_stiffness()
        preconditioner = self.ksp.getPC()
        preconditioner.setType("fieldsplit")
        preconditioner.setFieldSplitIS(("displacement", rows), ("pressure", others))
        self._set_levels(preconditioner.getFieldSplitSubKSP()[0].getPC(), DISPLACEMENT)
        # in this order: as a Schur complement it has no solvers before its set-up, as another type takes no mass matrix
        preconditioner.setFieldSplitType(PETSc.PC.CompositeType.SCHUR)
        preconditioner.setFieldSplitSchurPreType(PETSc.PC.SchurPreType.USER, mass)
        self._owned += [rows, others, mass]

    def _mass_over_stiffness(self) -> PETSc.Mat:
        """Return -(1/mu + 1/lambda) times the pressures' mass matrix, in their own unknowns; identity where idle."""
        model = self.model
        energy = nothing_where_idle(model.bulks, model.inside)
        for bulk in model.bulks:
            if isinstance(bulk.volumetric, Mixed):
                density = -(1 / bulk.shear + bulk.volumetric.compliance) / 2 * bulk.volumetric.pressure**2
                energy += density * model.inside(bulk.tag, metadata={"quadrature_degree": 2 * model.order - 2})
        forms: list[list[Any]] = []
        pressures = model.fields.pressures
        for number, pressure in enumerate(pressures):
            space = pressure.function_space
            slope = ufl.derivative(energy, pressure, ufl.TestFunction(space))
            block = ufl.derivative(slope, pressure, ufl.TrialFunction(space))
            row = [None] * len(pressures)
            row[number] = compat.compile_form(block, model.comm)
            forms.append(row)
        matrix = compat.create_block_matrix(forms)
        compat.assemble_block_matrix(matrix, forms, model.bcs)
        matrix.assemble()
        return matrix


def blame_options(error: PETSc.Error) -> None:
    """Raise `InvalidProblem` for a PETSc error if the user gave options, which are the likely cause."""
    given = " ".join(f"-{PREFIX}{key} {value}" for key, value in given_options().items())
    if given:
        said, cause = "", error
        while not said and cause is not None:  # an error in a callback from PETSc causes one that has only a number
            lines = [line.partition("] ")[2] for line in str(cause).splitlines()]
            said = next((line for line in reversed(lines) if line and "() at " not in line), "")
            cause = cause.__cause__ or cause.__context__
        said = said or str(error).splitlines()[0]
        raise InvalidProblem(
            f"PETSC_OPTIONS or solver_options: PETSc does not know what to do with {given}: {said}"
        ) from error
