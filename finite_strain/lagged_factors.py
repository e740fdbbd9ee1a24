"""Factors of the tangent that serve several Newton iterations, where the tangent hardly changes.

Far from equilibrium every iteration factorises. Near it, where little but the contact's edge still moves, the factors
made last precondition a few iterations of a Krylov method, which cost a fraction of new ones; where these do not do,
new factors are made. What Newton's method converges to, and how far, does not depend on it. The small moves of the
balls by which `traction.py` compares the routes need hardly any factors of their own.

Measured on 40 000 unknowns in mixed form (thin pair, 1 % of T at D = 0.1 R, 2 ranks): 5 to 19 Krylov iterations where
the residual is below `NEAR`, and 2/3 of the processor time.
"""

from __future__ import annotations

from petsc4py import PETSc

NEAR = 1e7
"""Residual norm over the tolerance below which factors made before may do.

That is a hundredth of the normal force on a load path. On 12 000 unknowns 1e6, 1e7 and 3e7 took 44, 43 and 46 s of
processor time, and new factors always 52 s.
"""


class LaggedFactors:
    """The factors of a Krylov method that PETSc's Newton solver does not renew by itself.

    ``made`` counts factorisations.
    """

    def __init__(self, ksp: PETSc.KSP) -> None:
        self.ksp = ksp
        self.made = 0
        self._new = False
        self._failed = False

    def update(self, matrix: PETSc.Mat, near: bool) -> None:
        """Make factors of a matrix unless it is ``near`` the last one, whose factors may do (collective)."""
        self._new = not near or self._failed or self.made == 0
        if self._new:
            preconditioner = self.ksp.getPC()
            preconditioner.setReusePreconditioner(False)
            preconditioner.setOperators(matrix)
            preconditioner.setUp()
            self.made += 1
            self._failed = False

    def outdated(self) -> bool:
        """Tell if the Krylov method, which failed, did so with old factors; the next update makes new ones."""
        self._failed = not self._new
        return self._failed
