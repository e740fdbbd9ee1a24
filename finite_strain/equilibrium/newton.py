"""Equilibrium at a fixed load: PETSc's Newton solver with a line search on the potential.

In the mixed form equilibrium is a saddle point, not a minimum: the search uses the merit of `line_search.py`.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from finite_strain.discretisation.discrete_model import Model
from finite_strain.equilibrium.line_search import Merit
from finite_strain.equilibrium.linear_solver import LinearSolver, blame_options, choose_for, given_options, with_options
from finite_strain.equilibrium.solver_options import PREFIX
from finite_strain.equilibrium.tangent_system import TangentSystem
from finite_strain.geometry.load_control import LoadControl
from finite_strain.numerics import DEFAULT, Numerics
from linear_bem.errors import InvalidProblem, NotConverged

_OPTIONS = {"snes_type": "newtonls", "snes_linesearch_order": "2", "snes_linesearch_minlambda": "1e-3"}
"""Defaults of the prefix ``thirdbody_``; the user's PETSc options with that prefix take precedence."""
NOT_TAKEN = ("snes_atol", "snes_rtol", "snes_stol")
"""PETSc options that would end Newton's method early."""
LOOSE, TIGHT, BELOW = 3e-2, 1e-3, 0.1
"""Residual tolerance of a linear system: over Newton's residual, at first and near the end; over Newton's tolerance.

[Eisenstat Walker 1996, choice 2, doi 10.1137/0917003]
"""
NEAR_END = 1e-5
"""Residual norm over the force scale below which full steps are taken."""
STALL = 1e-3
"""Residual norm over the force scale below which a full step is tried if the line search has failed."""


@dataclass
class StepRecord:
    """The cost of one load step: Newton iterations, new tangents among them, cut-backs; the last residual norm [N].

    Iterations and tangents include those of attempts that failed, except the iteration whose line search failed.
    ``augmentation_iterations`` counts the iterations with multipliers. ``augmented`` is False if none were requested,
    or if no equilibrium was found with them: the contact is then as soft as its penalty, see `LoadPath.augment`.
    """

    fraction: float
    newton_iterations: int = 0
    tangents: int = 0
    augmentation_iterations: int = 0
    augmented: bool = False
    cuts: int = 0
    residual: float = math.nan


@dataclass
class Effort:
    """Running totals; ``linear_fallbacks`` counts solves that needed factors because the Krylov method failed."""

    tangents: int = 0
    linear_iterations: int = 0
    linear_fallbacks: int = 0


class NewtonSolver:
    """Newton's method on a `Model` under a load; the state is restored if it fails."""

    def __init__(
        self, model: Model, control: LoadControl, numerics: Numerics = DEFAULT,
        monitor: Callable[[int, float], None] | None = None,
    ) -> None:  # fmt: skip
        self.model, self.control, self.numerics = model, control, numerics
        given = given_options()
        refused = [name for name in NOT_TAKEN if name in given]
        if refused:
            raise InvalidProblem(
                f"PETSC_OPTIONS or solver_options: -{PREFIX}{refused[0]} is not taken: Newton's method ends where the "
                f"residual suits the accuracy of T (1e-9 to 1e-7 of Q), got {given[refused[0]]}; leave it out"
            )
        self.choice = choose_for(model)
        self._options = {**_OPTIONS, **self.choice.options}
        self.effort = Effort()
        self.residuals: list[float] = []
        """Norms [N] in the last solve."""
        self.snes = PETSc.SNES().create(model.comm)
        self.snes.setOptionsPrefix(PREFIX)
        ksp = PETSc.KSP().create(model.comm)
        ksp.setOptionsPrefix(PREFIX)
        ksp.setOperators(model.matrix)
        self.linear = LinearSolver(model, ksp, self.choice)
        self.snes.getKSP().setOptionsPrefix(f"{PREFIX}outer_")
        self.system = TangentSystem(model, control.moves, ksp, self.snes.getKSP(), numerics.krylov_iterations)
        self._x = self.system.matrix.createVecRight()
        self._b, self._start = self._x.duplicate(), self._x.duplicate()
        self.snes.setFunction(self._function, self._b)
        self.snes.setJacobian(self._jacobian, self.system.matrix)
        self._merit = Merit(model, self._x) if model.is_mixed else None
        self.snes.setObjective(self._objective)
        if self._merit is not None:
            self.snes.setLineSearchPreCheck(self._merit.aim)
        self.snes.setConvergenceTest(self._converged)
        if monitor is not None:
            self.snes.setMonitor(lambda _, iteration, norm: monitor(iteration, norm))
        with self.options():  # PETSc's message about a wrong one comes early
            pass
        self.tolerance = self._goal = 0.0
        self._targets = np.zeros(0)
        self._norm, self._keeps, self._is_old, self._prepared = 0.0, False, False, False
        self._is_limited = "snes_max_it" in given
        self.max_iterations = int(given.get("snes_max_it", numerics.newton_iterations))

    def close(self) -> None:
        """Free the solver, with the matrix's factors (collective)."""
        for item in (self.snes, self._x, self._b, self._start):
            item.destroy()
        for part in (self._merit, self.system, self.linear):
            if part is not None:
                part.close()

    def _take(self, x: PETSc.Vec) -> None:
        """Write the model's state into a vector: its fields and its unknown approaches, if any."""
        self.model.fields.get(x)
        self.system.store(x, np.linalg.lstsq(self.control.moves, self.model.contact.approaches, rcond=None)[0])

    def prepare(self) -> None:
        """Assemble the tangent of the present equilibrium for the first iteration of the next solve (collective)."""
        self._take(self._x)
        with self.options():
            self._renew(self._x)
        self._prepared = True

    def solve(self, tolerance: float, force: float, record: StepRecord, keeps: bool = False) -> None:
        """Bring the model into equilibrium at a record's load fraction, from its present state; add the cost to it.

        ``tolerance`` bounds the residual norm over a scale of ``force`` [N]; ``keeps``: begin with the last solve's
        tangent, which is near enough. If Newton's method fails, restores the state before and raises `NotConverged`.
        """
        self.tolerance, self._targets = tolerance * force, record.fraction * self.control.full
        near_end = max(NEAR_END * force, self.tolerance)
        self._take(self._x)
        self._x.copy(self._start)
        self.residuals = []
        self._norm, self._keeps = 1e-300, self._prepared or keeps
        iterations, tangents = 0, self.effort.tangents - self._prepared  # the prepared one is this solve's
        # near the end the potential's decrease is below its roundoff: full steps are safe, and the residual decides
        exact, failed = self.tolerance, PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH
        for search, self._goal in (("bt", near_end), ("basic", exact), ("bt", exact), ("basic", exact)):
            self.snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=self.max_iterations)
            iterations += self._iterate(search)
            self._prepared = False
            if self.snes.getConvergedReason() == failed and self._is_old:  # the contact has changed since the tangent
                self._keeps = False
                iterations += self._iterate(search)
            reason, norm = self.snes.getConvergedReason(), self.snes.getFunctionNorm()
            if norm <= exact:
                break
            stalled = reason == failed and norm < max(near_end, STALL * force)
            if search == "bt" and not (reason > 0 or stalled):
                break
        record.newton_iterations += iterations
        record.augmentation_iterations += iterations * bool(self.model.contact.augmented.value)
        record.tangents += self.effort.tangents - tangents
        if norm <= exact:
            self._set(self._x)
            record.residual = norm
            return
        self._set(self._start)
        name = next((key for key, value in vars(PETSc.SNES.ConvergedReason).items() if value == reason), str(reason))
        cause = f" (snes_max_it is {self.max_iterations})" if self._is_limited and "MAX_IT" in name else ""
        raise NotConverged(
            f"Newton's method stopped with {name}{cause} after {iterations} iterations, residual {norm:.3g} N"
        )

    def _set(self, x: PETSc.Vec) -> None:
        self.model.fields.set(x)
        if self.system.count:
            self.model.contact.set_approaches(self.control.moves @ self.system.approaches(x))

    @contextmanager
    def options(self, **changed: str) -> Iterator[None]:
        """Take our options, and the user's before ours, inside a with block: PETSc reads some at the first solve.

        Afterwards the database has the user's alone: PETSc 3.22 lists unused options at its end.
        """
        try:
            with with_options({**self._options, **changed, **given_options()}):
                self.snes.setFromOptions()
                self.linear.ksp.setFromOptions()
                yield
        except PETSc.Error as error:
            blame_options(error)
            raise

    def _iterate(self, search: str) -> int:
        """Run Newton's method from ``_x``, with direct factors if the Krylov method fails; return its iterations."""
        solves = self.system.solves
        with self.options(snes_linesearch_type=search):
            self.snes.solve(None, self._x)
            iterations = self.snes.getIterationNumber()
            failed = self.snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE
            if failed and not self.choice.direct:
                self.effort.linear_fallbacks += 1
                factors = self.linear.factors()
                self.system.ksp = factors
                self.snes.solve(None, self._x)
                self.system.ksp = self.linear.ksp
                factors.destroy()
                iterations += self.snes.getIterationNumber()
        self.effort.linear_iterations += self.system.solves - solves
        return iterations

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, b: PETSc.Vec) -> None:
        self._set(x)
        self.model.residual(b)
        if self.system.count:
            self.system.store(b, self.control.moves.T @ self.model.part_forces() - self._targets)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        taken, norm = snes.getKSP().getIterationNumber(), snes.getFunctionNorm()
        share = min(max(min(norm / self._norm, 1.0) ** 2, TIGHT), LOOSE)
        self.system.wanted, self._norm = max(share * norm, BELOW * self.tolerance), norm
        lags = self.choice.direct and taken < self.numerics.lagged_iterations
        self._is_old = self._keeps and (self._prepared or lags)
        if not self._is_old:
            self._renew(x)
        elif not self._prepared:
            self._set(x)
            self.system.linearise(is_old=True)
        self._prepared = False

    def _renew(self, x: PETSc.Vec) -> None:
        self._set(x)
        self.model.tangent(stores=self.choice.direct)
        self.effort.tangents += 1
        self._keeps = True
        self.system.linearise(is_old=False)

    def _objective(self, snes: PETSc.SNES, x: PETSc.Vec) -> float:
        self._set(x)
        energy = self.model.energy() if self._merit is None else self._merit(x)
        energy -= float(self._targets @ self.system.approaches(x))
        return energy if math.isfinite(energy) else math.nan

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        reason = PETSc.SNES.ConvergedReason
        residual = norms[2]
        self.residuals.append(float(residual))
        if not math.isfinite(residual):
            return reason.DIVERGED_FNORM_NAN
        if residual <= self._goal:
            return reason.CONVERGED_FNORM_ABS
        return reason.DIVERGED_MAX_IT if iteration >= self.max_iterations else reason.CONVERGED_ITERATING
