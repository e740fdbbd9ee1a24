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
        nearest = model.contact.nearest
        self._cells = np.unique(model.contact.cells[nearest[model.contact.cells] >= 0]).astype(np.int32)
        self._balls = nearest[self._cells]
        dofs = compat.cell_dofs(model.space)[self._cells]
        self._is_top = on_top(model.space, model.facet_tags)[dofs]
        nodes = lattice_of(dofs.shape[1]).points
        self._values = compat.compile_expression(model.contact.penetration(), nodes, model.comm)
        self._pressure = MeanPressure(model, model.linear_space)
        points = model.linear_space.tabulate_dof_coordinates()
        axes = np.array([ball.position for ball in model.contact.balls])
        self._nearest = np.linalg.norm(points[:, None, :2] - axes[None], axis=-1).argmin(axis=1)

    def __call__(self) -> np.ndarray:
        """Return the largest pressure per deformed area [Pa] and penetration [m], shape (balls, 2) (collective)."""
        values = compat.evaluate(self._values, self.model.mesh, self._cells, (1,))
        answer = np.zeros((len(self.model.contact.balls), 2))
        np.maximum.at(answer[:, 1], self._balls, np.where(self._is_top, values[:, :, 0], 0.0).max(axis=1))
        np.maximum.at(answer[:, 0], self._nearest, self._pressure())
        self.model.comm.Allreduce(MPI.IN_PLACE, answer, op=MPI.MAX)  # in lower case it compares whole arrays
        return answer
