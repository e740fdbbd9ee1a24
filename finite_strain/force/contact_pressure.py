"""The contact pressure as means over the test functions of a space on the top, and its extremes.

Its values at points oscillate inside the elements, as equilibrium determines only its integrals with the displacement's
test functions. Over such a function's integral they are nodal forces over nodal areas: on hexahedra, whose nodes are
those of Gauss-Lobatto's rule, with the weights of that rule, which are positive and accurate to the order of the
element. On triangles of higher order they are not positive; hat functions of the vertices serve there.
"""

from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model, assembled
from finite_strain.discretisation.nodal_values import lattice_of, on_top
from finite_strain.discretisation.regions import constant


class MeanPressure:
    """Means of the contact pressure per deformed area over the test functions of a scalar Lagrange space."""

    def __init__(self, model: Model, space: Any) -> None:
        self.contact, self.space, self._means = model.contact, space, dolfinx.fem.Function(space)
        self._asked = constant(model.mesh, 0.0)
        pressure = model.contact.pressure()
        if model.is_finite:
            F = ufl.Identity(3) + ufl.grad(model.displacement)
            normal = ufl.cross(F[:, 0], F[:, 1])
            pressure = pressure / ufl.sqrt(ufl.dot(normal, normal))
        value = ufl.conditional(ufl.gt(self._asked, 0), pressure, 1)
        self._form = compat.compile_form(value * ufl.TestFunction(space) * model.contact.measure, model.comm)
        self._work = compat.ghosted_vector(self._form, space)

    def __call__(self, balls: np.ndarray) -> np.ndarray:
        """Return the means [Pa] at local nodes, ghosts included, of the pressure of balls with weights (balls,).

        They are zero where no facet may touch a ball (collective).
        """
        self.contact.choose(balls)
        parts = []
        for asked in (1.0, 0.0):
            self._asked.value = asked
            parts.append(assembled(self._work, self._form))
        moment, weight = parts
        means = self._means.x
        means.array[: len(moment)] = np.divide(moment, weight, out=np.zeros_like(moment), where=weight > 0.0)
        means.scatter_forward()
        return np.array(means.array)


class Extremes:
    """Evaluates the largest contact pressure, of the means over hat functions of vertices, and penetration per ball."""

    def __init__(self, model: Model) -> None:
        self.model = model
        dofs = compat.cell_dofs(model.space)[model.contact.touchable]
        self._is_top = on_top(model.space, model.facet_tags)[dofs]
        nodes = lattice_of(dofs.shape[1]).points
        self._values = compat.compile_expression(model.contact.penetration(), nodes, model.comm)
        self._pressure = MeanPressure(model, model.linear_space)

    def __call__(self) -> np.ndarray:
        """Return the largest pressure per deformed area [Pa] and penetration [m], shape (balls, 2) (collective)."""
        contact = self.model.contact
        answer = np.zeros((len(contact.balls), 2))
        for largest, chosen in zip(answer, np.eye(len(answer)), strict=True):
            pressures = self._pressure(chosen)
            depths = compat.evaluate(self._values, self.model.mesh, contact.touchable, (1,))[:, :, 0]
            largest[:] = pressures.max(initial=0.0), depths.max(initial=0.0, where=self._is_top)
        self.model.comm.Allreduce(MPI.IN_PLACE, answer, op=MPI.MAX)  # in lower case it compares whole arrays
        return answer
