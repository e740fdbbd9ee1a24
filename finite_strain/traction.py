"""The force on a ball by contact traction, freed from the pinning of the contact by the mesh.

The integral of the traction is the derivative of the discrete potential by the ball's position on a mesh
that stays behind. Its neighbours' field puts the contact a little off the ball's axis: at the offset X, the
first moment of the pressure over the undeformed surface divided by the force. On a mesh that is
mirror-symmetric about the axis the discrete potential is even in X, with a curvature k that an elastic
layer, which is the same everywhere, does not have: the mesh pins the contact. The traction integral is
therefore T - k X, off by a few per cent on affordable meshes.

How tractions A, offset M and the domain integral's force B change when the ball alone is moved follows from
one linear solve. The force itself changes with the distance of the neighbours, by B, and the rest of A is
the pinning of a contact that moves by M: A = B - k M. So k = (B - A) / M, and k X is added back. B and M
matter when the ball is deep: at an approach of the radius, leaving them out costs 5 to 10 % of T.

For k to be the mesh's own the contact must be a plain penalty, so this is done before the first
augmentation, where multipliers are zero.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from finite_strain.contact import Contact
from finite_strain.domain import ModelBall
from finite_strain.forces import ForceMeter
from finite_strain.model import Model
from finite_strain.newton import NewtonSolver

_STEP = 1e-5
"""By how much of the contact radius a ball is moved to and fro to see what changes: so little that no point of the
surface gains or loses contact, whose jump the linear solve does not know."""


class TractionRoute:
    """Evaluates the freed traction forces on the model's balls."""

    def __init__(self, model: Model, meter: ForceMeter, solver: NewtonSolver) -> None:
        self.model, self.meter, self.solver = model, meter, solver

    def per_squared_force(self, contact_radii: list[float]) -> np.ndarray:
        """Return T / Q^2 (balls, 2) [1/N]; the contact radii [m] place the domain integral's ramp.

        The model must be in equilibrium with multipliers of zero, and is so again afterwards (collective).
        """
        balls = self.model.reduction.balls
        answer = np.zeros((len(balls), 2))
        for number, (contact, ball) in enumerate(zip(self.model.contacts, balls, strict=True)):
            normal, force, offset = self._state(contact, ball)
            free = [axis for axis in (0, 1) if axis not in ball.fixed_axes]
            if normal > 0.0 and free:
                force[free] += self.pinning(number, free, contact_radii) @ offset[free]
                answer[number, free] = force[free] / normal**2
        return answer

    def pinning(self, number: int, axes: list[int], contact_radii: list[float]) -> np.ndarray:
        """Return k (axes, axes) [N/m] of one ball, whole."""
        traction, offset, domain = self.rates(number, axes, contact_radii)
        return (domain - traction) @ np.linalg.inv(offset)

    def rates(self, number: int, axes: list[int], contact_radii: list[float]) -> tuple[np.ndarray, ...]:
        """Return by how much traction force, contact offset and domain force change as one whole ball is moved.

        Three matrices (axes, axes) [N/m], [-], [N/m]; the ball's mirror images move with it.
        """
        model = self.model
        contact, ball = model.contacts[number], model.reduction.balls[number]
        step = _STEP * contact_radii[number]
        present, reference = model.fields.copy(), contact.reference
        rows: list[np.ndarray] = []
        for column, axis in enumerate(axes):
            response = self._response(contact, axis, refactor=column == 0)
            direction = np.eye(3)[axis]
            change = np.zeros((3, 2))
            for sign in (1.0, -1.0):
                self._displace(response, -sign * step)
                contact.reference = reference - sign * step * direction
                _, force, offset = self._state(contact, ball)
                offset += sign * step * direction[:2]  # about the undisplaced axis
                change += sign * np.array([force, offset, self.meter.domain_force(number, ball, contact_radii)])
                contact.reference = reference
                model.fields.restore(present)
            response.destroy()
            rows.append(change[:, axes] / (2.0 * step))
        traction, offset, domain = np.array(rows).transpose(1, 2, 0)
        return traction, offset, domain

    def _response(self, contact: Contact, axis: int, refactor: bool) -> PETSc.Vec:
        """Return minus the change of the fields per length that the ball moves along an axis [-]."""
        column, response = self.solver.new_vector(), self.solver.new_vector()
        self.model.shift_derivative(contact, axis, column)
        self.solver.solve_linear(column, response, refactor=refactor)
        column.destroy()
        return response

    def _displace(self, response: PETSc.Vec, length: float) -> None:
        moved = self.solver.new_vector()
        self.model.get_state(moved)
        moved.axpy(length, response)
        self.model.set_state(moved)
        moved.destroy()

    def _state(self, contact: Contact, ball: ModelBall) -> tuple[float, np.ndarray, np.ndarray]:
        """Return normal force [N] and in-plane force (2,) [N] of a whole ball by traction, and its contact's offset.

        The offset (2,) is in m; along axes that a symmetry fixes both are meaningless, of the cut ball.
        """
        model = self.model
        local = np.concatenate([contact.force(model.nodal), contact.pressure_moment(model.nodal)])
        x, y, normal, total, *moment = model.comm.allreduce(local, op=MPI.SUM)
        if not total > 0.0:
            return 0.0, np.zeros(2), np.zeros(2)
        return ball.copies * normal, ball.copies * np.array([x, y]), np.array(moment) / total
