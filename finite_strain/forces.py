"""The in-plane forces on the balls by a domain integral.

The domain integral is Eshelby's: with Sigma_kJ = psi delta_kJ - u_i,k P_iJ and a weight q that is 1
under one ball's contact and 0 under its neighbours', F_k = -int Sigma_kJ q,J dV (plus surface terms
that vanish where q is constant under the contacts). It is the domain form of the J-integral [Shih
Moran Nakamura 1986, doi 10.1007/BF00034019] and needs no resolved contact traction.
"""

from __future__ import annotations

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from finite_strain import compat
from finite_strain.domain import ModelBall
from finite_strain.model import Model
from meshes.box import Box


class ForceMeter:
    """Evaluates the forces on the model's balls; compiles its forms once."""

    def __init__(self, model: Model, box: Box) -> None:
        self.model = model
        self.box = box
        mesh = model.mesh
        scalar = model.linear_space
        self._weight = dolfinx.fem.Function(scalar)
        self._axis = dolfinx.fem.Constant(mesh, np.zeros(3))
        grad_q = ufl.grad(self._weight)

        def density(psi, gradient):  # type: ignore[no-untyped-def]
            stress = ufl.diff(psi, gradient)
            eshelby_row = psi * self._axis - ufl.dot(stress.T, ufl.dot(gradient, self._axis))
            return -ufl.inner(eshelby_row, grad_q)

        self._integral = compat.compile_form(model.volume_integral(density), model.comm)
        self._points = scalar.tabulate_dof_coordinates()

    def domain(self, contact_radii: list[float]) -> np.ndarray:
        """Return the in-plane force (balls, 2) [N] on whole balls by domain integral; radii [m] place the ramp."""
        balls = self.model.reduction.balls
        return np.array([self.domain_force(number, ball, contact_radii) for number, ball in enumerate(balls)])

    def domain_force(self, number: int, ball: ModelBall, contact_radii: list[float]) -> tuple[float, float]:
        """Return the in-plane force (2,) [N] on one whole ball by domain integral."""
        self._weight.x.array[:] = self._ramp(number, contact_radii)
        vertex_weight = self._weight.x.array
        force = [0.0, 0.0]
        for axis in (0, 1):
            if axis in ball.fixed_axes:
                continue
            direction = np.zeros(3)
            direction[axis] = 1.0
            self._axis.value[:] = direction
            local = dolfinx.fem.assemble_scalar(self._integral)
            for other, contact in enumerate(self.model.contacts):
                local += contact.configurational_terms(self.model.nodal, vertex_weight, own=other == number)[axis]
            force[axis] = ball.copies * float(self.model.comm.allreduce(local, op=MPI.SUM))
        return force[0], force[1]

    def _ramp(self, number: int, contact_radii: list[float]) -> np.ndarray:
        """Return q at this rank's vertices: 1 under the ball, falling to 0 at the edge of its mirrored prism.

        Both the ramp and the mesh under it are mirror-symmetric about the ball's axis, so the ball's own
        field, which is larger than T by orders of magnitude, cancels to roundoff.
        """
        ball, zone = self.model.reduction.balls[number], self.box.zones[number]
        distance = np.linalg.norm(self._points[:, :2] - np.array(ball.position), axis=1)
        start = min(1.1 * contact_radii[number], 0.8 * zone.mirror)
        return np.clip((zone.mirror - distance) / (zone.mirror - start), 0.0, 1.0)
