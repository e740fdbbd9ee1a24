"""The discrete layer: a displacement of order p, bulk energy and contact energy as forms.

The total potential is the sum of the bulk's strain energy and the contact potential; its first and second derivatives
are residual and tangent. A nearly incompressible region adds a pressure of order p - 1 as an unknown, with respect to
which the potential is stationary, too. Loading is not part of this module.
"""

from functools import cached_property
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from finite_strain import compat
from finite_strain.contact.contact_energy import Contact
from finite_strain.discretisation import regions
from finite_strain.discretisation.readings import Readings
from finite_strain.discretisation.regions import Bulk, constant
from finite_strain.discretisation.unknowns import Fields
from finite_strain.geometry.symmetry import Reduction
from finite_strain.mechanics.materials import energy_density
from linear_bem.problem import Problem
from meshes.box import SIDES, TAGS

Meshed = tuple[Any, Any, Any]
"""Mesh, cell tags, facet tags."""


class Model:
    """Energy, residual and tangent of the reduced scene on one mesh; collective over the mesh's communicator."""

    def __init__(self, problem: Problem, reduction: Reduction, meshed: Meshed, order: int, contact_degree: int) -> None:
        self.mesh, self.cell_tags, self.facet_tags = meshed
        self.comm = self.mesh.comm
        self.inside = ufl.Measure("dx", domain=self.mesh, subdomain_data=self.cell_tags)
        self.reduction, self.order = reduction, order
        self.is_finite = problem.finite_strain is not None
        self.space = compat.function_space(self.mesh, order, (3,))
        self.displacement = dolfinx.fem.Function(self.space, name="displacement")
        self._still = dolfinx.fem.Function(self.space, self.displacement.x)
        self.linear_space = compat.function_space(self.mesh, 1)
        self.weight = dolfinx.fem.Function(self.linear_space)
        self.axis = constant(self.mesh, (0.0, 0.0, 0.0))
        """Weight and direction of the domain integral (`finite_strain.force.domain_integral`)."""
        degree, length = 2 * order + contact_degree, min(ball.radius for ball in problem.balls)
        self.contact = Contact(self.displacement, self.facet_tags, reduction, self.is_finite, degree)
        self.bulks = regions.make_bulks(
            problem, self.mesh, self.cell_tags, order - 1, length, self.contact.turning
        )  # made once: equal parts of a form are compiled once, too
        self.fields = Fields(self.displacement, [bulk.pressure for bulk in self.bulks if bulk.pressure is not None])
        self.bcs = self._make_constraints()
        self._compile()

    def _make_constraints(self) -> list[Any]:
        """Clamp the bottom; let the sides slide without leaving their plane (so they mirror the scene)."""
        zero = PETSc.ScalarType(0.0)
        self._bottom = dolfinx.fem.locate_dofs_topological(self.space, 2, self.facet_tags.find(TAGS["bottom"]))
        bcs = [dolfinx.fem.dirichletbc(np.zeros(3, dtype=PETSc.ScalarType), self._bottom, self.space)]
        self.mirrors = np.zeros((2, 2), dtype=bool)
        """Whether (x, y) there is a flat side (low, high), a plane of symmetry; others are free."""
        for name, (axis, end) in SIDES.items():
            facets = self.facet_tags.find(TAGS[name])
            self.mirrors[axis, end] = self.comm.allreduce(len(facets)) > 0
            component = self.space.sub(axis)
            dofs = dolfinx.fem.locate_dofs_topological(component, 2, facets)
            bcs.append(dolfinx.fem.dirichletbc(zero, dofs, component))
        index_map = self.space.dofmap.index_map
        self.constrained = np.zeros((index_map.size_local + index_map.num_ghosts, 3), dtype=bool)
        for bc in bcs:
            self.constrained.reshape(-1)[compat.constrained_dofs(bc)] = True
        self._held = [self.constrained.reshape(-1)]
        """Whether each dof of each field, ghosts included, is held."""
        for bulk in self.bulks:
            if bulk.pressure is not None:
                bcs.append(dolfinx.fem.dirichletbc(zero, bulk.idle, bulk.pressure.function_space))
                self._held.append(np.isin(np.arange(len(bulk.pressure.x.array)), bulk.idle))
        return bcs

    @property
    def is_mixed(self) -> bool:
        """Whether some region has a pressure unknown: the equilibrium is then a saddle point of the potential."""
        return bool(self.fields.pressures)

    def energy_density(self, bulk: Bulk, gradient: Any) -> Any:
        """Return the strain energy of a region [J/m^3] in its displacement gradient, an expression."""
        return energy_density(bulk.law, gradient, bulk.shear, bulk.volumetric, ufl.grad(self._still))

    def volume_integral(self, density: Any) -> Any:
        """Return the sum over regions of the integral of ``density``, a function of energy psi and gradient."""
        measure = self.inside(metadata={"quadrature_degree": 2 * self.order})
        gradient = ufl.variable(ufl.grad(self.displacement))
        parts = [(bulk, density(self.energy_density(bulk, gradient), gradient)) for bulk in self.bulks]
        if all((bulk.law, bulk.pressure) == (self.bulks[0].law, None) for bulk in self.bulks):
            return parts[0][1] * measure  # regions that differ in their moduli alone share one compiled integral
        return sum(value * measure(bulk.tag) for bulk, value in parts)

    def _compile(self) -> None:
        bulk = self.volume_integral(lambda psi, _: psi) + regions.nothing_where_idle(self.bulks, self.inside)
        fields = self.fields.functions
        self._direction = self.fields.like()
        potential = bulk + self.contact.energy
        residuals = [ufl.derivative(potential, f, ufl.TestFunction(f.function_space)) for f in fields]
        varying, pressed = residuals, []
        if not (self.is_finite or self.is_mixed):  # the bulk's part of the tangent is constant
            u, test, trial = self.displacement, ufl.TestFunction(self.space), ufl.TrialFunction(self.space)
            varying = [ufl.derivative(bulk, u, test)]
            pressed = [ufl.derivative(ufl.derivative(self.contact.energy, u, test), u, trial)]
        tangents = [ufl.derivative(r, f, ufl.TrialFunction(f.function_space)) for r in varying for f in fields]
        pairs = list(zip(fields, self._direction.functions, strict=True))
        self._products = [sum(ufl.derivative(r, f, d) for f, d in pairs) for r in residuals]
        inside = {"strain_energy": lambda psi, _: psi, "eshelby": self._eshelby}
        surface = self.contact.readings() | {"contact_energy": self.contact.energy}
        surface["configurational"] = self.contact.configurational_form(self.weight, self.axis)
        self.readings = Readings(self.contact, self.volume_integral, inside, surface)
        self._by_move = ufl.derivative(surface["normal"], self.displacement, ufl.TestFunction(self.space))
        compiled = iter(compat.compile_forms([*tangents, *residuals, *pressed, *self.readings.forms], self.comm))
        self._tangent = [[next(compiled) for _ in fields] for _ in fields]
        self._residuals = [next(compiled) for _ in fields]
        self._pressed = [next(compiled) for _ in pressed]
        self.readings.compiled = list(compiled)
        create = compat.create_block_matrix if self.is_mixed else dolfinx.fem.petsc.create_matrix
        self.matrix = create(self._tangent if self.is_mixed else self._tangent[0][0])
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._constant: PETSc.Mat | None = None
        spaces = [field.function_space for field in fields]
        self._work = [compat.ghosted_vector(*pair) for pair in zip(self._residuals, spaces, strict=True)]

    @cached_property
    def actions(self) -> list[Any]:
        """The products of the tangent with a direction, compiled on first use (collective)."""
        return compat.compile_forms(self._products, self.comm)

    @cached_property
    def _border(self) -> Any:
        """The residual's derivative with respect to the approach, needed for prescribed forces only (collective)."""
        return compat.compile_form(self._by_move, self.comm)

    def close(self) -> None:
        """Free the matrices and the work vectors (collective)."""
        for item in (self.matrix, self._constant, *self._work):
            if item is not None:
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

    def strain_energy(self) -> float:
        """Return the strain energy [J] of the simulated part (collective)."""
        return self.readings("strain_energy")

    def energy(self) -> float:
        """Return the total potential [J] of the simulated part, nan where an element is inverted (collective)."""
        return self.readings("strain_energy", "contact_energy")

    def forces(self) -> np.ndarray:
        """Return the force (balls, 3) [N] on the model's balls: in-plane, and upwards Q >= 0 (collective).

        Forces are those on whole balls; components along axes fixed by symmetry are 0.
        """
        values = self.readings.per_ball("x", "y", "normal")
        for number, ball in enumerate(self.contact.balls):
            values[number, list(ball.fixed_axes)] = 0.0
        return values

    def part_forces(self) -> np.ndarray:
        """Return the normal force (balls,) [N] on the simulated part of each ball (collective)."""
        copies = np.array([ball.copies for ball in self.contact.balls])
        return np.asarray(self.readings.per_ball("normal")[:, 0] / copies)

    def _eshelby(self, psi: Any, gradient: Any) -> Any:
        """Return -Sigma_kJ q,J along the axis k, with Eshelby's stress Sigma and the weight q."""
        stress = ufl.diff(psi, gradient)
        eshelby_row = psi * self.axis - ufl.dot(stress.T, ufl.dot(gradient, self.axis))
        return -ufl.inner(eshelby_row, ufl.grad(self.weight))

    def residual(self, b: PETSc.Vec) -> None:
        """Assemble the derivative of the total potential [N] into b; zero in constrained rows."""
        b.array[: self.fields.ranges[-1].stop] = self._free(self._residuals)

    def border(self, balls: np.ndarray, b: PETSc.Vec) -> float:
        """Assemble the residual's derivative along a move of the balls (balls,) into b [N/m]; return its stiffness.

        The stiffness is the second derivative of the contact potential along the move [N/m], at fixed displacement.
        """
        self.contact.choose(balls)
        b.array[:] = 0.0
        b.array[self.fields.ranges[0]] = self._free([self._border])
        self.contact.choose(balls**2)
        return self.readings("stiffness")

    def volume_residual(self) -> np.ndarray:
        """Return the potential's derivative by this rank's own pressures [N]; zero for idle pressures."""
        return self._free(self._residuals[1:], 1)

    def volume_weights(self, bound: float) -> np.ndarray:
        """Return `Merit`'s weights [m/N], this rank's own: lambda, at most ``bound`` mu, over lumped masses."""
        forms, factors = [], []
        for bulk in self.bulks:
            if bulk.pressure is not None:
                test = ufl.TestFunction(bulk.pressure.function_space)
                forms.append(compat.compile_form(test * self.inside(bulk.tag), self.comm))
                factors.append(min(bulk.solid.lame_first, bound * bulk.solid.shear_modulus) / bulk.unit**2)
        volumes = self._free(forms, 1)
        owned = self.fields.owned[1:]
        return np.divide(np.repeat(factors, owned), volumes, out=np.zeros_like(volumes), where=volumes > 0.0)

    def _free(self, forms: list[Any], first: int = 0) -> np.ndarray:
        """Return linear forms of the fields from number ``first`` on at this rank's own dofs, zero where held."""
        parts = [assembled(work, form) for work, form in zip(self._work[first:], forms, strict=False)]
        for values, held in zip(parts, self._held[first:], strict=False):
            values[held[: len(values)]] = 0.0
        return np.concatenate(parts)

    def base_reaction(self) -> float:
        """Return the normal reaction [N] of the bottom on the simulated part (collective)."""
        residual = assembled(self._work[0], self._residuals[0]).reshape(-1, 3)
        held = self._bottom[self._bottom < len(residual)]
        return float(self.comm.allreduce(float(residual[held, 2].sum()), op=MPI.SUM))

    def tangent(self, stores: bool = True) -> None:
        """Assemble the second derivative of the total potential into ``matrix``; identity in constrained rows.

        ``stores``: keep a copy of the part that is constant at small strain, which needs as much memory as the matrix.
        """
        matrix, assemble = self.matrix, dolfinx.fem.petsc.assemble_matrix
        if self._constant is not None:
            self._constant.copy(matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        else:
            matrix.zeroEntries()
            if self.is_mixed:
                compat.assemble_block_matrix(matrix, self._tangent, self.bcs)
            else:
                assemble(matrix, self._tangent[0][0], self.bcs)
            matrix.assemble()
            self._constant = matrix.duplicate(copy=True) if self._pressed and stores else None
        for form in self._pressed:
            assemble(matrix, form, self.bcs)
            matrix.assemble()

    def action(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Multiply the second derivative of the total potential with x, zero in constrained rows, into y."""
        self._direction.set(x)
        self._direction.displacement.x.array.reshape(-1, 3)[self.constrained] = 0.0
        y.array[:] = self._free(self.actions)


def assembled(work: PETSc.Vec, form: Any) -> np.ndarray:
    """Return a linear form, summed over ranks, at this rank's own entries; ``work`` is a ghosted vector."""
    with work.localForm() as local:
        local.set(0.0)
    dolfinx.fem.petsc.assemble_vector(work, form)
    work.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return np.array(work.array_r)
