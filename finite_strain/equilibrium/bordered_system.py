"""Approaches as unknowns of Newton's method: a bordered system for loads that prescribe forces.

With the tangent K, the residual's derivative B by the unknown approaches and their own stiffness C the system is
[[K, B], [B^T, C]]. One solve with K for each column of B and one for the right-hand side give its solution (block
elimination), so a prescribed force costs what a prescribed approach costs and one more back substitution.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from finite_strain.discretisation.discrete_model import Model


class Border:
    """The bordered operator and its preconditioner, as contexts of PETSc's matrix and preconditioner of type python.

    ``moves`` (balls, unknowns) says how unknowns move balls; ``ksp`` solves with the model's matrix. The unknown
    approaches are the last entries of the last rank's part of a vector.
    """

    def __init__(self, model: Model, moves: np.ndarray, ksp: PETSc.KSP) -> None:
        self.model, self.moves, self.ksp = model, moves, ksp
        self.count = moves.shape[1]
        matrix = model.matrix
        self._inner, self._image = matrix.createVecRight(), matrix.createVecRight()
        self._columns = [matrix.createVecRight() for _ in range(self.count)]
        self._responses = [matrix.createVecRight() for _ in range(self.count)]
        self._stiffness = np.zeros((self.count, self.count))
        self._schur = np.zeros((self.count, self.count))
        self._own = matrix.getLocalSize()[0]
        self._last = model.comm.rank == model.comm.size - 1
        size = self._own + (self.count if self._last else 0)
        self.matrix = PETSc.Mat().createPython(((size, None), (size, None)), self, comm=model.comm)
        self.matrix.setUp()

    def close(self) -> None:
        """Free the vectors and the operator (collective)."""
        for item in (self.matrix, self._inner, self._image, *self._columns, *self._responses):
            item.destroy()

    def approaches(self, x: PETSc.Vec) -> np.ndarray:
        """Return the unknown approaches (unknowns,) [m] in a vector, on every rank (collective)."""
        return np.asarray(self.model.comm.bcast(np.array(x.array_r[self._own :]), root=self.model.comm.size - 1))

    def store(self, x: PETSc.Vec, values: np.ndarray) -> None:
        """Put the last entries (unknowns,) into a vector."""
        if self._last:
            x.array[self._own :] = values

    def update(self) -> None:
        """Assemble the border at the present state, and solve for the response to each unknown (collective).

        Where a trial state has lifted all balls of an unknown off, they come down with the stiffness of before.
        """
        for number, column in enumerate(self._columns):
            self._stiffness[number, number] = self.model.border(self.moves[:, number], column)
            self.ksp.solve(column, self._responses[number])
        coupled = np.array([[column.dot(response) for response in self._responses] for column in self._columns])
        schur = self._stiffness - coupled
        lifted = np.flatnonzero(np.diag(schur) == 0.0)
        self._stiffness[lifted, lifted] = schur[lifted, lifted] = np.diag(self._schur)[lifted]
        self._schur = schur

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Apply the operator."""
        d = self.approaches(x)
        self._inner.array[:] = x.array_r[: self._own]
        self.model.matrix.mult(self._inner, self._image)
        for value, column in zip(d, self._columns, strict=True):
            self._image.axpy(value, column)
        y.array[: self._own] = self._image.array_r
        self.store(y, np.array([column.dot(self._inner) for column in self._columns]) + self._stiffness @ d)

    def apply(self, _: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Apply the preconditioner: the inverse, as far as the solver of the model's matrix is exact."""
        self._inner.array[:] = x.array_r[: self._own]
        self.ksp.solve(self._inner, self._image)
        loads = self.approaches(x) - np.array([column.dot(self._image) for column in self._columns])
        d = np.linalg.solve(self._schur, loads)
        for value, response in zip(d, self._responses, strict=True):
            self._image.axpy(-value, response)
        y.array[: self._own] = self._image.array_r
        self.store(y, d)
