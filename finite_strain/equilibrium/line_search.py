"""Merit function of Newton's line search in the mixed form, where equilibrium is a saddle point of the potential.

The potential L(u, p) is a minimum in u only where the volume conditions c = dL/dp = 0 hold. With p the pressures
at the end of the full Newton step, held fixed along the step, the search reduces the augmented Lagrangian

    L(u, p) + kappa/2 sum_i c_i^2 / m_i,

m the pressures' lumped mass. Its slope along the Newton step (du, dp) is -(du . K du + kappa sum_i (B du)_i^2 / m_i),
with K and B the blocks of the tangent: a descent wherever K is positive on volume-preserving displacements, or kappa
makes it so [Nocedal Wright 2006, sections 17.3 and 18.3, doi 10.1007/978-0-387-40065-5]. A residual norm has no such
property: if a contact's edge moves, or elements are strongly compressed, it has to increase temporarily.
"""

import math

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from finite_strain.discretisation.discrete_model import Model

KAPPA = 20.0
"""Bound of kappa over the shear modulus; below it, kappa is the first Lame constant.

With larger values the merit has a narrow curved valley, which keeps the steps short.
"""


class Merit:
    """The augmented Lagrangian of a mixed model along one Newton step after another."""

    def __init__(self, model: Model, template: PETSc.Vec) -> None:
        self._model = model
        self._trial = template.duplicate()
        self._aim = np.zeros(0)
        """The pressures [m] at the end of the present step, this rank's own."""
        self._weight = model.volume_weights(KAPPA)
        ranges = model.fields.ranges
        self._pressures = slice(ranges[0].stop, ranges[-1].stop)

    def close(self) -> None:
        """Free the vector of trial states (collective)."""
        self._trial.destroy()

    def aim(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Store the pressures at the end of a Newton step from the state x to x - y."""
        self._aim = x.array_r[self._pressures] - y.array_r[self._pressures]

    def __call__(self, x: PETSc.Vec) -> float:
        """Return the merit [J] of the displacement in x, nan where elements are turned inside out (collective)."""
        x.copy(self._trial)
        self._trial.array[self._pressures] = self._aim
        model = self._model
        model.fields.set(self._trial)
        energy = model.energy()
        if not math.isfinite(energy):
            return math.nan
        local = float(self._weight @ model.volume_residual() ** 2) / 2.0
        return energy + float(model.comm.allreduce(local, op=MPI.SUM))
