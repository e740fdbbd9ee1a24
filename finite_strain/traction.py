"""The force on a ball by contact traction, freed from the pinning of the contact by the mesh.

The integral of the traction is the derivative of the discrete potential by the ball's position on a mesh
that stays behind. Its neighbours' field puts the contact a little off the ball's axis: at the offset X, the
first moment of the pressure over the undeformed surface divided by the force. The mesh is mirror-symmetric
about the axis, so the discrete potential is even in the place of the contact on the mesh, with a dependence
on it that an elastic layer, which is the same everywhere, does not have: the mesh pins the contact. On
affordable meshes the traction integral is off by up to a fifth of T for that.

The pinning vanishes where the contact lies on the mesh's mirror axis. So every ball is moved by -X, which is
about a hundredth of the contact radius or less, equilibrium is found again, and the two routes are compared
there. What is left of the offset (the contact does not follow the ball exactly) is taken off by the straight
line through the differences before and after. How the pinning depends on the offset does not matter then;
its slope at X, which jumps with every quadrature point that gains or loses contact, would leave a hundredth
of T or more, where this leaves a few thousandths.

Multipliers would carry the contact's old place into the new equilibrium, so this is done before the first
augmentation, where they are zero.
"""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI

from finite_strain.contact import Contact
from finite_strain.domain import ModelBall
from finite_strain.forces import ForceMeter
from finite_strain.model import Model
from finite_strain.newton import NewtonSolver
from linear_bem.errors import NotConverged

CENTRED, CENTRED_RADII = 0.1, 1e-4
"""Parts of the offset before, and of the contact radius, that a move may leave; a straight line takes them off."""
MOST_MOVES = 3
FARTHEST = 0.2
"""Contact radii beyond which a contact lies on a neighbour's dent rather than under its ball; it stays pinned."""
LONGEST_PART = 0.02
"""Contact radii that a ball is moved by at once; a longer move is divided, and each part predicts the next."""
SMALLEST_PART = 0.1
"""Fraction of the first part below which a move is given up."""


class TractionRoute:
    """Compares the traction forces on the model's balls with the domain integral's."""

    def __init__(self, model: Model, meter: ForceMeter, solver: NewtonSolver) -> None:
        self.model, self.meter, self.solver = model, meter, solver
        self.iterations = 0
        """Newton iterations that the last comparison took."""
        self.pinned = False
        """Whether the last comparison found no equilibrium with the balls moved."""

    def excess(self, contact_radii: list[float]) -> np.ndarray:
        """Return by how much T (balls, 2) [N] by traction exceeds the domain integral's, on whole balls.

        The contact radii [m] place the domain integral's ramp. The model must be in equilibrium with multipliers of
        zero, and is so again afterwards (collective). Where no equilibrium is found with the balls moved, and for a
        ball that then lifts off or whose contact is too far from its axis, the excess is that of the pinned contact,
        which is larger.
        """
        contacts, radii = self.model.contacts, np.array(contact_radii)[:, None]
        present, references = self.model.fields.copy(), [contact.reference for contact in contacts]
        moved = np.zeros((len(contacts), 2))
        first, pinned, _ = self._compare(moved, contact_radii)
        held = (np.abs(first) > FARTHEST * radii).any(axis=1, keepdims=True)
        near = np.maximum(CENTRED * np.abs(first), CENTRED_RADII * radii)
        offset, excess = np.where(held, 0.0, first), pinned
        self.iterations, self.pinned = 0, False
        try:
            for _ in range(MOST_MOVES):
                if np.all(np.abs(offset) <= near):
                    break
                self._move(references, moved, moved - offset, radii)
                moved = moved - offset
                offset, excess, lifted = self._compare(moved, contact_radii)
                held |= lifted[:, None]
                offset = np.where(held, 0.0, offset)
        except NotConverged:
            self.pinned = True
        finally:
            for contact, reference in zip(contacts, references, strict=True):
                contact.reference = reference
            self.model.fields.restore(present)
        # a contact that does not follow its ball is left to what was found: the line would reach too far
        left = np.where(np.abs(offset) <= near, offset, 0.0)
        run = left - first
        slope = np.divide(excess - pinned, run, out=np.zeros_like(run), where=np.abs(run) > near)
        return np.where(held | self.pinned, pinned, excess - slope * left)

    def _move(self, references: list[np.ndarray], start: np.ndarray, end: np.ndarray, radii: np.ndarray) -> None:
        """Take all balls from one displacement (balls, 2) [m] to another, in as many parts as Newton's method needs."""
        fields = self.model.fields
        way = np.divide(np.abs(end - start), radii, out=np.zeros_like(start), where=radii > 0.0)
        part = 1.0 / max(math.ceil(float(way.max()) / LONGEST_PART), 1)
        reached, before, smallest = 0.0, None, SMALLEST_PART * part
        while reached < 1.0 - 1e-9:
            good, aim = fields.copy(), min(reached + part, 1.0)
            shifts = start + aim * (end - start)
            for contact, reference, (x, y) in zip(self.model.contacts, references, shifts, strict=True):
                contact.reference = reference - np.array([x, y, 0.0])
            try:
                if before is not None:
                    fields.restore(tuple(2.0 * new - old for new, old in zip(good, before, strict=True)))
                self.iterations += self.solver.solve(self.solver.tolerance).iterations
                if not math.isfinite(self.model.energy()):
                    raise NotConverged("the equilibrium found has elements turned inside out")
                reached, before = aim, good
            except NotConverged:
                fields.restore(good)
                part, before = 0.5 * part, None
                if part < smallest:
                    raise

    def _compare(self, moved: np.ndarray, contact_radii: list[float]) -> tuple[np.ndarray, ...]:
        """Return the contacts' offsets (balls, 2) [m] from the mesh's mirror axes, the excess there, and who lifts.

        Both are zero for a ball without force, which has lifted (balls,), and along axes that a symmetry fixes.
        """
        balls = self.model.reduction.balls
        offsets, excess = np.zeros((len(balls), 2)), np.zeros((len(balls), 2))
        lifted = np.zeros(len(balls), dtype=bool)
        for number, (contact, ball) in enumerate(zip(self.model.contacts, balls, strict=True)):
            free = [axis for axis in (0, 1) if axis not in ball.fixed_axes]
            normal, force, offset = self._state(contact, ball)
            lifted[number] = not normal > 0.0
            if normal > 0.0 and free:
                domain = np.array(self.meter.domain_force(number, ball, contact_radii))
                offsets[number, free] = (offset + moved[number])[free]
                excess[number, free] = (force - domain)[free]
        # every rank must go the same way, to the last bit
        shared: tuple[np.ndarray, ...] = self.model.comm.bcast((offsets, excess, lifted), root=0)
        return shared

    def _state(self, contact: Contact, ball: ModelBall) -> tuple[float, np.ndarray, np.ndarray]:
        """Return normal force [N] and in-plane force (2,) [N] of a whole ball by traction, and its contact's offset.

        The offset (2,) [m] is from the ball's axis; along axes that a symmetry fixes both are meaningless, of the
        cut ball.
        """
        model = self.model
        local = np.concatenate([contact.force(model.nodal), contact.pressure_moment(model.nodal)])
        x, y, normal, total, *moment = model.comm.allreduce(local, op=MPI.SUM)
        if not total > 0.0:
            return 0.0, np.zeros(2), np.zeros(2)
        return ball.copies * normal, ball.copies * np.array([x, y]), np.array(moment) / total
