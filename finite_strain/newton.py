"""Equilibrium at a fixed load: PETSc's Newton solver with a line search that watches the potential.

In the mixed form equilibrium is a saddle point, not a minimum, and the search watches the residual.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from petsc4py import PETSc

from finite_strain.model import Model
from linear_bem.errors import NotConverged

_OPTIONS = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "bt",
    "snes_linesearch_order": 2,
    "snes_linesearch_minlambda": 1e-3,
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 80,
    "mat_mumps_icntl_20": 0,
}
"""Defaults of the prefix ``thirdbody_``; the user's PETSc options with that prefix win."""

_MIXED_OPTIONS = {"snes_linesearch_type": "l2"}
"""What differs in the mixed form."""
_written: dict[str, str] = {}
"""Options of ours in PETSc's database, which a solver of the other form may replace; a user's own stay."""


def _reasons() -> dict[int, str]:
    names = PETSc.SNES.ConvergedReason
    return {value: name for name, value in vars(names).items() if isinstance(value, int) and not name.startswith("_")}


@dataclass(frozen=True)
class Equilibrium:
    """What one Newton solve took: iterations and final residual norm [N]."""

    iterations: int
    residual: float


class NewtonSolver:
    """Newton's method on a `Model`, keeping its state unless it converges."""

    def __init__(self, model: Model, monitor: Callable[[int, float], None] | None = None) -> None:
        self.model = model
        self._x = model.matrix.createVecRight()
        self._b = self._x.duplicate()
        self._start = self._x.duplicate()
        self._reasons = _reasons()
        options = PETSc.Options("thirdbody_")
        for key, value in (_OPTIONS | (_MIXED_OPTIONS if model.is_mixed else {})).items():
            if not options.hasName(key) or options.getString(key) == _written.get(key):
                options[key] = value
                _written[key] = options.getString(key)
        self.snes = PETSc.SNES().create(model.comm)
        self.snes.setOptionsPrefix("thirdbody_")
        self.snes.setFunction(self._function, self._b)
        self.snes.setJacobian(self._jacobian, model.matrix)
        if not model.is_mixed:
            self.snes.setObjective(self._objective)
        self.snes.setConvergenceTest(self._converged)
        if monitor is not None:
            self.snes.setMonitor(lambda _, iteration, norm: monitor(iteration, norm))
        self.snes.setFromOptions()
        self.tolerance = 0.0
        self.max_iterations = 25

    def close(self) -> None:
        """Free the solver, with the matrix's factors (collective)."""
        for item in (self.snes, self._x, self._b, self._start):
            item.destroy()

    def solve(self, tolerance: float) -> Equilibrium:
        """Bring the model into equilibrium from its present state.

        ``tolerance`` bounds the residual norm [N]. Raises `NotConverged`, with the state as it
        was before, when Newton's method fails.
        """
        self.tolerance = tolerance
        self.model.get_state(self._x)
        self._x.copy(self._start)
        iterations = 0
        options = PETSc.Options("thirdbody_")
        usual = options.getString("snes_linesearch_type")
        for search in (usual, "basic"):
            self.snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=self.max_iterations)
            if search == "basic":
                # at the end the potential's decrease drowns in its own roundoff and the search stalls:
                # a full step is then safe, and the residual decides
                options["snes_linesearch_type"] = "basic"
                self.snes.setFromOptions()
            self.snes.solve(None, self._x)
            if search == "basic":
                options["snes_linesearch_type"] = usual
                self.snes.setFromOptions()
            iterations += self.snes.getIterationNumber()
            reason, norm = self.snes.getConvergedReason(), self.snes.getFunctionNorm()
            if reason > 0:
                self.model.set_state(self._x)
                return Equilibrium(iterations, norm)
            if reason != PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH or not norm < 1e3 * tolerance:
                break
        self._start.copy(self._x)
        self.model.set_state(self._x)
        name = self._reasons.get(reason, str(reason))
        raise NotConverged(f"Newton's method stopped with {name} after {iterations} iterations, residual {norm:.3g} N")

    def solve_linear(self, b: PETSc.Vec, x: PETSc.Vec, refactor: bool = True) -> None:
        """Solve with the tangent of the present state: x = K^-1 b; without ``refactor``, with the one used last."""
        ksp = self.snes.getKSP()
        if refactor:
            self.model.tangent()
            ksp.setOperators(self.model.matrix)
        ksp.solve(b, x)

    def new_vector(self) -> PETSc.Vec:
        """Return an uninitialised vector of the model's size."""
        return self._x.duplicate()

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, b: PETSc.Vec) -> None:
        self.model.set_state(x)
        self.model.residual(b)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        self.model.set_state(x)
        self.model.tangent()

    def _objective(self, snes: PETSc.SNES, x: PETSc.Vec) -> float:
        self.model.set_state(x)
        energy = self.model.energy()
        return energy if math.isfinite(energy) else math.nan

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        reason = PETSc.SNES.ConvergedReason
        residual = norms[2]
        if not math.isfinite(residual):
            return reason.DIVERGED_FNORM_NAN
        if residual <= self.tolerance:
            return reason.CONVERGED_FNORM_ABS
        return reason.DIVERGED_MAX_IT if iteration >= self.max_iterations else reason.CONVERGED_ITERATING
