"""Equilibrium at a fixed load: PETSc's Newton solver with a line search that watches the potential.

In the mixed form equilibrium is a saddle point, not a minimum, and the search watches the merit of `merit.py`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from petsc4py import PETSc

from finite_strain.lagged_factors import NEAR
from finite_strain.linear_solver import LinearSolver, choose_for, given_options, install, slowest
from finite_strain.merit import Merit
from finite_strain.model import Model
from finite_strain.solver_choice import PREFIX
from linear_bem.errors import InvalidProblem, NotConverged

_OPTIONS = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "bt",
    "snes_linesearch_order": "2",
    "snes_linesearch_minlambda": "1e-3",
}
"""Defaults of the prefix ``thirdbody_``; the user's PETSc options with that prefix win."""


NOT_TAKEN = ("snes_atol", "snes_rtol", "snes_stol")
"""Options of PETSc's that would end Newton's method early."""
MOST_ITERATIONS = 25
"""Newton iterations in one solve; ``-thirdbody_snes_max_it N`` sets another number."""


def _reasons() -> dict[int, str]:
    names = PETSc.SNES.ConvergedReason
    return {value: name for name, value in vars(names).items() if isinstance(value, int) and not name.startswith("_")}


def _blame_options(error: PETSc.Error) -> None:
    """Raise `InvalidProblem` for an error of PETSc's where the user gave options, which are the likely cause."""
    given = " ".join(f"-{PREFIX}{key} {value}" for key, value in given_options().items())
    if given:
        said, cause = "", error
        while (
            not said and cause is not None
        ):  # an error in a call back from PETSc is the cause of one with a mere number
            lines = [line.partition("] ")[2] for line in str(cause).splitlines()]
            said = next((line for line in reversed(lines) if line and "() at " not in line), "")
            cause = cause.__cause__ or cause.__context__
        said = said or str(error).splitlines()[0]
        raise InvalidProblem(f"PETSC_OPTIONS: PETSc does not know what to do with {given}: {said}") from error


@dataclass(frozen=True)
class Equilibrium:
    """What one Newton solve took: iterations and final residual norm [N]."""

    iterations: int
    residual: float


@dataclass
class Effort:
    """What linear systems and assembly took since it was last asked for, on this rank; wall times [s].

    ``residuals`` are the norms [N] that the last Newton solve passed through; ``fallbacks`` counts the systems that the
    Krylov method left to factors, and the Newton solves that therefore ended with them.
    """

    seconds_assembly: float = 0.0
    seconds_solve: float = 0.0
    linear_iterations: int = 0
    fallbacks: int = 0
    residuals: list[float] = field(default_factory=list)


class NewtonSolver:
    """Newton's method on a `Model`, keeping its state unless it converges."""

    def __init__(self, model: Model, monitor: Callable[[int, float], None] | None = None) -> None:
        self.model = model
        self._x = model.matrix.createVecRight()
        self._b = self._x.duplicate()
        self._start = self._x.duplicate()
        self._reasons = _reasons()
        given = given_options()
        refused = [name for name in NOT_TAKEN if name in given]
        if refused:
            raise InvalidProblem(
                f"PETSC_OPTIONS: -{PREFIX}{refused[0]} is not taken: Newton's method ends where the residual is 1e-9 "
                f"of the normal force, got {given[refused[0]]}; leave it out"
            )
        self.choice = choose_for(model)
        self._options = {**_OPTIONS, **self.choice.options}
        self.effort = Effort()
        self.snes = PETSc.SNES().create(model.comm)
        self.snes.setOptionsPrefix(PREFIX)
        self.linear = LinearSolver(model, self.snes.getKSP(), self.choice)
        self.snes.setFunction(self._function, self._b)
        self.snes.setJacobian(self._jacobian, model.matrix)
        self._merit = Merit(model) if model.is_mixed else None
        self.snes.setObjective(self._objective)
        if self._merit is not None:
            self.snes.setLineSearchPreCheck(self._aim)
        self.snes.setConvergenceTest(self._converged)
        if monitor is not None:
            self.snes.setMonitor(lambda _, iteration, norm: monitor(iteration, norm))
        self._set_from_options({})
        self.tolerance = 0.0
        self.max_iterations = int(given.get("snes_max_it", MOST_ITERATIONS))

    def close(self) -> None:
        """Free the solver, with the matrix's factors (collective)."""
        for item in (self.snes, self._x, self._b, self._start):
            item.destroy()
        if self._merit is not None:
            self._merit.close()
        self.linear.close()

    def solve(self, tolerance: float) -> Equilibrium:
        """Bring the model into equilibrium from its present state.

        ``tolerance`` bounds the residual norm [N]. Raises `NotConverged`, with the state as it
        was before, when Newton's method fails.
        """
        self.tolerance = tolerance
        self.model.get_state(self._x)
        self._x.copy(self._start)
        self.effort.residuals = []
        iterations = 0
        for search in ({}, {"snes_linesearch_type": "basic"}):
            self.snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=self.max_iterations)
            if search:
                # at the end the potential's decrease drowns in its own roundoff and the search stalls:
                # a full step is then safe, and the residual decides
                self._set_from_options(search)
            iterations += self._iterate()
            if search:
                self._set_from_options({})
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
        if refactor:
            with self._assembling():
                self.model.tangent()
            self.linear.renew()
        began = time.perf_counter()
        self.effort.fallbacks += self.linear.solve(b, x)
        self.effort.seconds_solve += time.perf_counter() - began
        self.effort.linear_iterations += self.linear.ksp.getIterationNumber()

    def account(self) -> dict[str, Any]:
        """Return the effort since the last call in a load step's words (collective); times are the slowest rank's."""
        done, self.effort = self.effort, Effort()
        return {
            "linear_solver": self.choice.method,
            "linear_iterations": done.linear_iterations,
            "linear_fallbacks": done.fallbacks,
            "residuals": done.residuals,
            "seconds_assembly": slowest(self.model.comm, done.seconds_assembly),
            "seconds_solve": slowest(self.model.comm, done.seconds_solve),
        }

    def new_vector(self) -> PETSc.Vec:
        """Return an uninitialised vector of the model's size."""
        return self._x.duplicate()

    def _set_from_options(self, changed: dict[str, str]) -> None:
        install(self._options | changed)
        try:
            self.snes.setFromOptions()
        except PETSc.Error as error:
            _blame_options(error)
            raise

    def _iterate(self) -> int:
        """Run Newton's method from ``_x``; return its iterations.

        It goes on with new factors where old ones do not do, and with factors where the Krylov method fails.
        """
        began, assembled = time.perf_counter(), self.effort.seconds_assembly
        effort, iterations, again = self.effort, 0, True
        while again:
            try:
                self.snes.solve(None, self._x)
            except PETSc.Error as error:
                _blame_options(error)
                raise
            iterations += self.snes.getIterationNumber()
            effort.linear_iterations += self.snes.getLinearSolveIterations()
            failed = self.snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE
            lagged = self.linear.lagged
            again = failed and lagged is not None and lagged.outdated() and iterations < self.max_iterations
        if failed and not self.choice.direct:
            effort.fallbacks += 1
            factors = self.linear.factors()
            self.snes.setKSP(factors)
            self.snes.solve(None, self._x)
            self.snes.setKSP(self.linear.ksp)
            factors.destroy()
            iterations += self.snes.getIterationNumber()
        effort.seconds_solve += time.perf_counter() - began - (effort.seconds_assembly - assembled)
        return iterations

    @contextmanager
    def _assembling(self) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.effort.seconds_assembly += time.perf_counter() - began

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, b: PETSc.Vec) -> None:
        with self._assembling():
            self.model.set_state(x)
            self.model.residual(b)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        with self._assembling():
            self.model.set_state(x)
            self.model.tangent()
        if self.linear.lagged is not None:
            self.linear.lagged.update(J, near=snes.getFunctionNorm() < NEAR * self.tolerance)

    def _objective(self, snes: PETSc.SNES, x: PETSc.Vec) -> float:
        with self._assembling():
            self.model.set_state(x)
            energy = self.model.energy() if self._merit is None else self._merit(x)
        return energy if math.isfinite(energy) else math.nan

    def _aim(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        assert self._merit is not None
        self._merit.aim(x, y)

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        reason = PETSc.SNES.ConvergedReason
        residual = norms[2]
        self.effort.residuals.append(float(residual))
        if not math.isfinite(residual):
            return reason.DIVERGED_FNORM_NAN
        if residual <= self.tolerance:
            return reason.CONVERGED_FNORM_ABS
        return reason.DIVERGED_MAX_IT if iteration >= self.max_iterations else reason.CONVERGED_ITERATING
