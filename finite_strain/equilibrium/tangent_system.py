"""Newton's linear system: the tangent at the present state, preconditioned by the solver of an earlier state.

At order 3 (4), assembling and factoring a tangent takes the time of 40 (90) products and back substitutions. Products
therefore use the action of the potential's second derivative, with the factors of an earlier state as preconditioner.

A load that prescribes forces makes approaches unknowns. With the tangent K, the residual's derivative B by the unknown
approaches and their own stiffness C the system is [[K, B], [B^T, C]], preconditioned by block elimination: one solve
with K for each column of B, and one for the right-hand side.
"""

import numpy as np
from petsc4py import PETSc

from finite_strain.discretisation.discrete_model import Model


class TangentSystem:
    """Operator and preconditioner of Newton's systems, as contexts of PETSc's matrix and preconditioner of type python.

    ``moves`` (balls, unknowns) maps the unknown approaches, the last entries of the last rank's vectors, to the balls.
    ``ksp`` solves with the model's matrix (``solves`` counts its iterations), ``outer`` with this system, to a residual
    norm ``wanted`` [N] or in ``most`` iterations.
    """

    def __init__(self, model: Model, moves: np.ndarray, ksp: PETSc.KSP, outer: PETSc.KSP, most: int) -> None:
        self.model, self.moves, self.ksp, self.most = model, moves, ksp, most
        self.count, self.solves, self.wanted, self._is_old, self._failed = moves.shape[1], 0, 0.0, False, False
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
        outer.setType("fgmres")
        outer.setGMRESRestart(most)
        outer.setConvergenceTest(self._converged)
        outer.getPC().setType("python")
        outer.getPC().setPythonContext(self)

    def close(self) -> None:
        """Free the vectors and the operator (collective)."""
        for item in (self.matrix, self._inner, self._image, *self._columns, *self._responses):
            item.destroy()

    def approaches(self, x: PETSc.Vec) -> np.ndarray:
        """Return the unknown approaches (unknowns,) [m] in a vector, on every rank (collective)."""
        if not self.count:
            return np.zeros(0)
        return np.asarray(self.model.comm.bcast(np.array(x.array_r[self._own :]), root=self.model.comm.size - 1))

    def store(self, x: PETSc.Vec, values: np.ndarray) -> None:
        """Store values (unknowns,) in the last entries of a vector."""
        if self._last:
            x.array[self._own :] = values

    def linearise(self, is_old: bool) -> None:
        """Linearise at the model's present state; ``is_old``: the matrix is that of an earlier state (collective).

        If no ball that an unknown moves is in contact in a trial state, the stiffness of the previous state is used.
        """
        self._is_old = is_old
        for number, column in enumerate(self._columns):
            self._stiffness[number, number] = self.model.border(self.moves[:, number], column)
            self._solve(column, self._responses[number])
        coupled = self._stiffness - self._along(self._responses)
        lifted = np.flatnonzero(np.diag(coupled) == 0.0)
        self._stiffness[lifted, lifted] = coupled[lifted, lifted] = np.diag(self._schur)[lifted]
        self._schur = coupled

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Apply the operator."""
        d = self.approaches(x)
        self._inner.array[:] = x.array_r[: self._own]
        if self._is_old:
            self.model.action(self._inner, self._image)
        else:
            self.model.matrix.mult(self._inner, self._image)
        self._add(d, self._columns, y)
        self.store(y, self._along([self._inner])[:, 0] + self._stiffness @ d)

    def apply(self, _: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Apply the preconditioner: exact if the matrix is that of the present state and its solver direct."""
        self._inner.array[:] = x.array_r[: self._own]
        self._solve(self._inner, self._image)
        d = np.linalg.solve(self._schur, self.approaches(x) - self._along([self._image])[:, 0])
        self._add(-d, self._responses, y)
        self.store(y, d)

    def _solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        self.ksp.solve(b, x)
        self._failed |= self.ksp.getConvergedReason() < 0
        self.solves += self.ksp.getIterationNumber()

    def _along(self, vectors: list[PETSc.Vec]) -> np.ndarray:
        """Return the products of the border's columns with vectors (unknowns, vectors)."""
        return np.array([c.dot(v) for c in self._columns for v in vectors]).reshape(self.count, len(vectors))

    def _add(self, factors: np.ndarray, vectors: list[PETSc.Vec], y: PETSc.Vec) -> None:
        """Store the image plus a linear combination of vectors in y."""
        for factor, vector in zip(factors, vectors, strict=True):
            self._image.axpy(factor, vector)
        y.array[: self._own] = self._image.array_r

    def _converged(self, ksp: PETSc.KSP, iteration: int, norm: float) -> int:
        reason = PETSc.KSP.ConvergedReason
        self._failed &= iteration > 0
        if self._failed or not np.isfinite(norm):
            return int(reason.DIVERGED_NANORINF)
        if norm <= self.wanted:
            return int(reason.CONVERGED_RTOL)
        if iteration < self.most:
            return int(reason.CONVERGED_ITERATING)
        return int(reason.CONVERGED_ITS if self._is_old else reason.DIVERGED_MAX_IT)
