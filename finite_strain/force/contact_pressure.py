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

LOWERED = 0.6
"""Largest fraction by which a mean is assumed to lower a peak; at the edge of a punch it is 0.45."""
BETWEEN = 1.25
"""Fraction by which a mean lowers a smooth peak in the middle of a square element, over that by which the mean of the
means lowers it again: the second moments about it are 5/6 and 2/3 of the square of the element's width."""


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
        value = ufl.conditional(ufl.gt(self._asked, 1), self._means, value)
        self._form = compat.compile_form(value * ufl.TestFunction(space) * model.contact.measure, model.comm)
        self._work = compat.ghosted_vector(self._form, space)

    def __call__(self, balls: np.ndarray) -> np.ndarray:
        """Return the means [Pa] at local nodes, ghosts included, of the pressure of balls with weights (balls,).

        They are zero where no facet may touch a ball (collective).
        """
        self.contact.choose(balls)
        return self._mean(1.0)

    def again(self) -> np.ndarray:
        """Return the means of the piecewise polynomial that has the last means at its nodes (collective)."""
        return self._mean(2.0)

    def _mean(self, asked: float) -> np.ndarray:
        parts = []
        for self._asked.value in (asked, 0.0):
            parts.append(assembled(self._work, self._form))
        moment, weight = parts
        means = self._means.x
        means.array[: len(moment)] = np.divide(moment, weight, out=np.zeros_like(moment), where=weight > 0.0)
        means.scatter_forward()
        return np.array(means.array)


class Extremes:
    """Evaluates per ball the largest contact pressure, of the means over hat functions of vertices, and penetration."""

    def __init__(self, model: Model) -> None:
        self.model = model
        dofs = compat.cell_dofs(model.space)[model.contact.touchable]
        self._is_top = on_top(model.space, model.facet_tags)[dofs]
        nodes = lattice_of(dofs.shape[1]).points
        self._values = compat.compile_expression(model.contact.penetration(), nodes, model.comm)
        self._pressure = MeanPressure(model, model.linear_space)

    def __call__(self) -> np.ndarray:
        """Return the largest pressure per deformed area [Pa] and penetration [m], and the pressure's `excess`.

        The array has shape (balls, 3) (collective).
        """
        peaks = np.zeros((3, len(self.model.contact.balls)))
        for ball, chosen in enumerate(np.eye(peaks.shape[1])):
            means = self._pressure(chosen), self._pressure.again(), self._pressure.again()
            peaks[:, ball] = [mean.max(initial=0.0) for mean in means]
        return np.column_stack([self._largest(peaks)[0], self.penetrations(), excess(peaks)])

    def penetrations(self) -> np.ndarray:
        """Return the largest penetration at a node (balls,) [m] (collective)."""
        contact, found = self.model.contact, np.zeros(len(self.model.contact.balls))
        for ball, chosen in enumerate(np.eye(len(found))):
            contact.choose(chosen)
            depths = compat.evaluate(self._values, self.model.mesh, contact.touchable, (1,))[:, :, 0]
            found[ball] = depths.max(initial=0.0, where=self._is_top)
        return self._largest(found)

    def _largest(self, values: np.ndarray) -> np.ndarray:
        """Reduce an array in place to the largest values on any rank."""
        self.model.comm.Allreduce(MPI.IN_PLACE, values, op=MPI.MAX)  # in lower case it compares whole arrays
        return values


def excess(peaks: np.ndarray) -> np.ndarray:
    """Return by how much the largest pressure may exceed its largest mean, over the latter (balls,).

    ``peaks`` (3, balls): the largest mean, mean of the means, and mean of these. Means lower a smooth peak by the same
    fraction each time, and a pointed one by less each time: the first fraction follows by Aitken's extrapolation. It
    is at most `BETWEEN` times as large where no vertex lies at the peak.
    """
    first, second = 1.0 - np.divide(peaks[1:], peaks[:-1], out=np.ones_like(peaks[1:]), where=peaks[:-1] > 0.0)
    pointed = np.divide(first, second, out=np.ones_like(first), where=second > 0.0)
    lowered = np.minimum(BETWEEN * first * np.maximum(pointed, 1.0), LOWERED)
    return lowered / (1.0 - lowered)
