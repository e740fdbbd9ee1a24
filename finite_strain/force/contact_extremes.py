"""Largest contact pressure and penetration under each ball.

The pressure is a mean over the hat function of a vertex: at points it oscillates (`MeanPressure`).
"""

import numpy as np
from mpi4py import MPI

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.mean_pressure import MeanPressure
from finite_strain.discretisation.nodal_values import lattice_of, on_top


class Extremes:
    """Evaluates a model's extremes; compiles its expression once."""

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
