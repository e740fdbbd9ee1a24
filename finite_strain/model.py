"""The discrete layer: a quadratic displacement on a mesh, bulk energy by forms, contact by parts.

The total potential is the sum of the bulk's strain energy and every ball's contact potential; its
first and second derivatives are residual and tangent. A nearly incompressible region adds a linear
pressure, in which the potential is stationary too. Nothing here knows how they are driven.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from finite_strain import compat
from finite_strain.bulk import Bulk, elastic_constants, make_bulks, nothing_where_idle
from finite_strain.contact import Contact, Surface
from finite_strain.domain import Reduction
from finite_strain.fields import Fields
from finite_strain.indenter import Indenter, LinearisedProfile, ParaboloidInSpace, SphereInSpace
from finite_strain.kinematics import Finite, Kinematics
from finite_strain.volumetric import Volumetric
from linear_bem.problem import Problem
from meshes.box import TAGS

_PLANES = {"x_low": 0, "x_high": 0, "y_low": 1, "y_high": 1}


def indenter_for(shape: str, radius: float, kinematics: Kinematics) -> Indenter:
    """Return the gap function that belongs to a ball's shape and the kinematics."""
    if not isinstance(kinematics, Finite):
        return LinearisedProfile(radius, shape)
    return SphereInSpace(radius) if shape == "sphere" else ParaboloidInSpace(radius)


class Model:
    """Energy, residual and tangent of the reduced scene on one mesh; collective over ``comm``."""

    def __init__(self, problem: Problem, reduction: Reduction, kinematics: Kinematics, mesh_file: Path, comm: MPI.Comm):
        self.comm = comm
        self.reduction = reduction
        self.kinematics = kinematics
        self.mesh, self.cell_tags, self.facet_tags = compat.read_mesh(mesh_file, comm)
        self.space = compat.function_space(self.mesh, 2, (3,))
        self.displacement = dolfinx.fem.Function(self.space, name="displacement")
        self.linear_space = compat.function_space(self.mesh, 1)
        self._vertex_work = dolfinx.fem.Function(self.linear_space)
        self.bulks = make_bulks(problem, self.mesh, self.cell_tags)
        self.fields = Fields(self.displacement, [bulk.pressure for bulk in self.bulks if bulk.pressure is not None])
        self._length = min(ball.radius for ball in problem.balls)
        self.contacts = self._make_contacts()
        self.bcs = self._make_constraints()
        self._compile()

    def _make_contacts(self) -> list[Contact]:
        top = self.facet_tags.find(TAGS["top"])
        contacts = []
        for ball in self.reduction.balls:
            indenter = indenter_for(ball.shape, ball.radius, self.kinematics)
            surface = Surface.near(self.space, self.linear_space, top, ball.position, indenter.reach)
            vertices = len(self._vertex_work.x.array)
            contacts.append(Contact(surface, indenter, ball.position, ball.radius, vertices))
        return contacts

    def _make_constraints(self) -> list[Any]:
        """Clamp the bottom; let the sides slide without leaving their plane (so they mirror the scene)."""
        zero = PETSc.ScalarType(0.0)
        bottom = dolfinx.fem.locate_dofs_topological(self.space, 2, self.facet_tags.find(TAGS["bottom"]))
        self._bottom = bottom
        bcs = [dolfinx.fem.dirichletbc(np.zeros(3, dtype=PETSc.ScalarType), bottom, self.space)]
        for name, axis in _PLANES.items():
            facets = self.facet_tags.find(TAGS[name])
            component = self.space.sub(axis)
            dofs = dolfinx.fem.locate_dofs_topological(component, 2, facets)
            bcs.append(dolfinx.fem.dirichletbc(zero, dofs, component))
        index_map = self.space.dofmap.index_map
        self.constrained = np.zeros((index_map.size_local + index_map.num_ghosts, 3), dtype=bool)
        for bc in bcs:
            self.constrained.reshape(-1)[compat.constrained_dofs(bc)] = True
        for bulk in self.bulks:
            if bulk.pressure is not None:
                bcs.append(dolfinx.fem.dirichletbc(zero, bulk.idle, bulk.pressure.function_space))
        return bcs

    @property
    def is_mixed(self) -> bool:
        """Whether some region has a pressure unknown: the equilibrium is then a saddle point of the potential."""
        return bool(self.fields.pressures)

    def constants(self, bulk: Bulk) -> tuple[Any, Volumetric]:
        """Return mu and the volumetric energy of a region, as its kinematics takes them."""
        return elastic_constants(bulk, self.mesh, self._length)

    def volume_integral(self, density: Any, degree: int | None = None) -> Any:
        """Return the sum over regions of the integral of ``density``, a function of energy psi and gradient."""
        gradient = ufl.grad(self.displacement)
        measure = ufl.Measure("dx", domain=self.mesh, subdomain_data=self.cell_tags)
        metadata = {"quadrature_degree": self.kinematics.quadrature_degree if degree is None else degree}
        total = 0
        for bulk in self.bulks:
            shear, lame = self.constants(bulk)
            variable = ufl.variable(gradient)
            psi = self.kinematics.energy_density(variable, shear, lame)
            total += density(psi, variable) * measure(bulk.tag, metadata=metadata)
        return total

    def _compile(self) -> None:
        measure = ufl.Measure("dx", domain=self.mesh, subdomain_data=self.cell_tags)
        energy = self.volume_integral(lambda psi, _: psi) + nothing_where_idle(self.bulks, self.mesh, measure)
        fields = self.fields.functions
        residuals = [ufl.derivative(energy, f, ufl.TestFunction(f.function_space)) for f in fields]
        tangents = [[ufl.derivative(r, f, ufl.TrialFunction(f.function_space)) for f in fields] for r in residuals]
        self._energy = compat.compile_form(energy, self.comm)
        self._residual, *self._volume_residuals = (compat.compile_form(r, self.comm) for r in residuals)
        self._tangent = [[compat.compile_form(t, self.comm) for t in row] for row in tangents]
        if self.is_mixed:
            self.matrix = compat.create_block_matrix(self._tangent)
            index_map = self.space.dofmap.index_map
            self._rows = PETSc.IS().createStride(3 * (index_map.size_local + index_map.num_ghosts), 0, 1, MPI.COMM_SELF)
            self._rows.setBlockSize(3)
        else:
            self.matrix = dolfinx.fem.petsc.create_matrix(self._tangent[0][0])
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._work = compat.ghosted_vector(self._residual, self.space)
        spaces = [pressure.function_space for pressure in self.fields.pressures]
        self._volume_work = [compat.ghosted_vector(*pair) for pair in zip(self._volume_residuals, spaces, strict=True)]

    def close(self) -> None:
        """Free the matrix and the work vectors (collective)."""
        for item in (self.matrix, self._work, *self._volume_work):
            item.destroy()
        compat.free_dropped_objects(self.comm)

    @property
    def unknowns(self) -> int:
        """Number of displacement components and pressures on all ranks."""
        return int(self.matrix.getSize()[0])

    @property
    def nodal(self) -> np.ndarray:
        """Nodal displacements (nodes, 3) [m] of this rank, ghosts included; a view."""
        return self.displacement.x.array.reshape(-1, 3)

    def set_state(self, x: PETSc.Vec) -> None:
        """Copy a solver's vector into the fields and refresh their ghosts."""
        self.fields.set(x)

    def get_state(self, x: PETSc.Vec) -> None:
        """Copy the fields into a solver's vector."""
        self.fields.get(x)

    def strain_energy(self) -> float:
        """Return the strain energy [J] of the simulated part."""
        return float(self.comm.allreduce(dolfinx.fem.assemble_scalar(self._energy), op=MPI.SUM))

    def energy(self) -> float:
        """Return the total potential [J] of the simulated part."""
        local = dolfinx.fem.assemble_scalar(self._energy)
        local += sum(contact.energy(self.nodal) for contact in self.contacts)
        return float(self.comm.allreduce(local, op=MPI.SUM))

    def bulk_residual(self) -> np.ndarray:
        """Return the internal forces [N] at this rank's own nodes (nodes, 3): where constrained, the reactions."""
        return self._summed(lambda work: dolfinx.fem.petsc.assemble_vector(work, self._residual))

    def residual(self, b: PETSc.Vec) -> None:
        """Assemble the derivative of the total potential [N] into b; zero in constrained rows."""

        def fill(work: PETSc.Vec) -> None:
            dolfinx.fem.petsc.assemble_vector(work, self._residual)
            with work.localForm() as form:
                for contact in self.contacts:
                    contact.add_residual(self.nodal, form.array.reshape(-1, 3))

        self._store_free(self._summed(fill), b)
        if self.is_mixed:
            b.array[self.fields.ranges[1].start :] = self.volume_residual()

    def volume_residual(self) -> np.ndarray:
        """Return the potential's derivative by the pressures [N], this rank's own; zero where they are idle."""
        return self._by_pressure(self._volume_residuals)

    def volume_weights(self, bound: float) -> np.ndarray:
        """Return kappa over the lumped mass of every pressure [m/N], this rank's own: see `finite_strain.merit`.

        kappa is the first Lame constant, but at most ``bound`` shear moduli.
        """
        forms, factors = [], []
        for bulk in self.bulks:
            if bulk.pressure is not None:
                test = ufl.TestFunction(bulk.pressure.function_space)
                measure = ufl.Measure("dx", domain=self.mesh, subdomain_data=self.cell_tags)
                forms.append(compat.compile_form(test * measure(bulk.tag), self.comm))
                unit = bulk.solid.shear_modulus / self._length
                factors.append(min(bulk.solid.lame_first, bound * bulk.solid.shear_modulus) / unit**2)
        volumes = self._by_pressure(forms)
        owned = self.fields.owned[1:]
        return np.divide(np.repeat(factors, owned), volumes, out=np.zeros_like(volumes), where=volumes > 0.0)

    def _by_pressure(self, forms: list[Any]) -> np.ndarray:
        """Return linear forms of the pressures' test functions, summed over ranks, at this rank's own pressures."""
        parts = []
        idle_dofs = [bulk.idle for bulk in self.bulks if bulk.idle is not None]
        for form, work, idle in zip(forms, self._volume_work, idle_dofs, strict=True):
            values = _summed_into(work, lambda work, form=form: dolfinx.fem.petsc.assemble_vector(work, form))  # type: ignore[misc]
            values[idle[idle < len(values)]] = 0.0
            parts.append(values)
        return np.concatenate(parts)

    def approach_derivative(self, contacts: list[Contact], b: PETSc.Vec) -> None:
        """Assemble the residual's derivative by the common approach of some balls [N/m] into b."""

        def fill(work: PETSc.Vec) -> None:
            with work.localForm() as form:
                for contact in contacts:
                    contact.approach_derivative(self.nodal, form.array.reshape(-1, 3))

        self._store_free(self._summed(fill), b)

    def base_reaction(self) -> float:
        """Return the normal force [N] that the bottom returns to the simulated part."""
        residual = self.bulk_residual()
        held = [dof for dof in self._bottom if dof < len(residual)]
        return float(self.comm.allreduce(float(residual[held, 2].sum()), op=MPI.SUM))

    def tangent(self) -> None:
        """Assemble the second derivative of the total potential into ``matrix``; identity in constrained rows."""
        matrix = self.matrix
        matrix.zeroEntries()
        if self.is_mixed:
            compat.assemble_block_matrix(matrix, self._tangent, self.bcs)
        else:
            dolfinx.fem.petsc.assemble_matrix(matrix, self._tangent[0][0], self.bcs)
        matrix.assemblyBegin(PETSc.Mat.AssemblyType.FLUSH)
        matrix.assemblyEnd(PETSc.Mat.AssemblyType.FLUSH)
        with self._displacement_block() as block:
            for contact in self.contacts:
                contact.add_tangent(self.nodal, block, self.constrained)
        matrix.assemble()

    @contextmanager
    def _displacement_block(self) -> Iterator[PETSc.Mat]:
        """Lend the rows and columns of the displacement for adding values by local nodes."""
        if not self.is_mixed:
            yield self.matrix
            return
        block = self.matrix.getLocalSubMatrix(self._rows, self._rows)
        yield block
        self.matrix.restoreLocalSubMatrix(self._rows, self._rows, block)

    def top_dofs(self) -> np.ndarray:
        """Return the local nodes (n, 6) of the top facets whose cell this rank owns, corners first."""
        top = self.facet_tags.find(TAGS["top"])
        return Surface.near(self.space, self.linear_space, top, (0.0, 0.0), np.inf).dofs

    def project(self, contact: Contact, density: np.ndarray) -> np.ndarray:
        """Return a density (facets, points) of a contact projected to this rank's vertices, zero elsewhere."""
        moments, weights = (self._summed_over_vertices(share) for share in contact.project(density))
        return np.divide(moments, weights, out=np.zeros_like(moments), where=weights > 0.0)

    def _summed_over_vertices(self, share: np.ndarray) -> np.ndarray:
        self._vertex_work.x.array[:] = share
        vector = compat.vector_of(self._vertex_work)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        return self._vertex_work.x.array.copy()

    def _summed(self, fill: Callable[[PETSc.Vec], None]) -> np.ndarray:
        """Return what ``fill`` adds to a displacement-like vector, summed over ranks, at own nodes (nodes, 3)."""
        return _summed_into(self._work, fill).reshape(-1, 3)

    def _store_free(self, values: np.ndarray, b: PETSc.Vec) -> None:
        """Put forces [N] on this rank's own nodes into b, zero where constrained and in the pressures' rows."""
        values[self.constrained[: len(values)]] = 0.0
        b.array[:] = 0.0
        b.array[self.fields.ranges[0]] = values.ravel()


def _summed_into(work: PETSc.Vec, fill: Callable[[PETSc.Vec], None]) -> np.ndarray:
    """Return what ``fill`` adds to a ghosted vector, summed over ranks, at this rank's own entries."""
    with work.localForm() as form:
        form.set(0.0)
    fill(work)
    work.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return work.array_r.copy()
