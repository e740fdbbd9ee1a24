"""Factors of the tangent that serve several Newton iterations, where the tangent hardly changes.

Far from equilibrium every iteration factorises. Near it, where little but the contact's edge still moves, the factors
made last precondition a few iterations of a Krylov method, which cost a fraction of new ones; where these do not do,
new factors are made. What Newton's method converges to, and how far, does not depend on it. The small moves of the
balls by which `traction.py` compares the routes need hardly any factors of their own.

Measured on 40 000 unknowns in mixed form (thin pair, 1 % of T at D = 0.1 R, 2 ranks): 5 to 9 Krylov iterations where
the residual is below `NEAR`, and 2/3 of the processor time.
"""

from __future__ import annotations

from mpi4py import MPI
from petsc4py import PETSc

NEAR = 1e7
"""Residual norm over the tolerance below which factors made before may do.

That is a hundredth of the normal force on a load path. On 12 000 unknowns 1e6, 1e7 and 3e7 took 44, 43 and 46 s of
processor time, and new factors always 52 s.
"""
RELATIVE = 1e-6
"""Residual over the right-hand side at which the Krylov method stops."""
MOST_ITERATIONS = 20
"""Krylov iterations that cost about what new factors do."""


class LaggedFactors:
    """Factors for PETSc's Newton solver, which sees them as the Krylov method ``outer``.

    ``near`` says that factors made before may do; it is set before each system. ``made`` counts factorisations.
    """

    def __init__(self, comm: MPI.Comm, prefix: str) -> None:
        self.ksp = PETSc.KSP().create(comm)
        """Solves with new factors wherever the operators changed; takes the options of the prefix."""
        self.ksp.setOptionsPrefix(prefix)
        self.ksp.setFromOptions()
        self._corrector = PETSc.KSP().create(comm)
        self._corrector.setType(PETSc.KSP.Type.FGMRES)
        self._corrector.setTolerances(rtol=RELATIVE, max_it=MOST_ITERATIONS)
        self._corrector.setPC(self.ksp.getPC())
        self.outer = PETSc.KSP().createPython(self, comm)
        self.outer.setOptionsPrefix(f"{prefix}lagged_")
        self.outer.getPC().setType(PETSc.PC.Type.NONE)
        self.near = False
        self.made = 0

    def solve(self, outer: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve with the operators of the KSP that asks, and tell it the outcome (PETSc calls this)."""
        operators, solver, iterations = outer.getOperators(), self.ksp, 0
        if self.near and self.made:
            solver = self._corrector
            solver.setOperators(*operators)
            solver.getPC().setReusePreconditioner(True)
            solver.solve(b, x)
            solver.getPC().setReusePreconditioner(False)
            iterations = solver.getIterationNumber()
        if solver is self.ksp or solver.getConvergedReason() <= 0:
            solver = self.ksp
            solver.setOperators(*operators)
            solver.solve(b, x)
            iterations += solver.getIterationNumber()
            self.made += 1
        outer.setConvergedReason(solver.getConvergedReason())
        outer.setIterationNumber(iterations)

    def close(self) -> None:
        """Free the factors (collective)."""
        for ksp in (self.outer, self._corrector, self.ksp):
            ksp.destroy()
