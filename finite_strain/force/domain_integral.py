"""The in-plane forces on the balls by a domain integral.

The domain integral is Eshelby's: with Sigma_kJ = psi delta_kJ - u_i,k P_iJ and a weight q that is 1 under one ball's
contact and 0 under its neighbours', F_k = -int Sigma_kJ q,J dV, and surface terms that vanish where q is constant under
the contacts. It is the domain form of the J-integral [Shih Moran Nakamura 1986, doi 10.1007/BF00034019] and needs no
resolved contact traction. The traction's integral (`Model.forces`) is a second formula: the contact edge tends to
follow mesh lines, so this integral converges more slowly and is not used in the answer.
"""

import numpy as np

from finite_strain.discretisation.discrete_model import Model
from meshes.box import Box, Zone

CLEAR = 1.03
"""Distance from a ball's axis, over its contact radius, outside the contact: q begins to fall on the next mesh line."""


def in_plane_forces(model: Model, box: Box, contact_radii: np.ndarray) -> np.ndarray:
    """Return the in-plane force (balls, 2) [N] on whole balls; radii (balls,) [m] place the ramp of q (collective)."""
    contact, forces = model.contact, np.zeros((len(contact_radii), 2))
    points = model.linear_space.tabulate_dof_coordinates()
    for number, (ball, zone) in enumerate(zip(contact.balls, box.zones, strict=True)):
        model.weight.x.array[:] = ramp(box, zone, contact_radii[number], points)
        contact.choose(np.eye(len(forces))[number])
        for axis in sorted({0, 1} - set(ball.fixed_axes)):
            model.axis.value[:] = np.eye(3)[axis]
            forces[number, axis] = ball.copies * model.readings("eshelby", "configurational")
    return forces


def ramp(box: Box, zone: Zone, contact_radius: float, points: np.ndarray) -> np.ndarray:
    """Return q at points (n, 3) [m]: 1 under a zone's ball, falling to 0 at the edge of its mirror-symmetric block.

    Both q and the mesh under it are mirror-symmetric about the ball's axis, so the ball's own field, which is
    larger than T by orders of magnitude, cancels to roundoff.
    """
    lines = box.rings(zone)[0][:-1]
    outside = lines[lines >= CLEAR * contact_radius]
    start = outside[0] if len(outside) else lines[-1]
    offset = np.abs(points[:, :2] - np.array(zone.position))
    distance, along = np.linalg.norm(offset, axis=1), offset.max(axis=1)
    # the block is square: its outline is farther away along its diagonals
    end = zone.half_width * np.divide(distance, along, out=np.ones_like(along), where=along > 0.0)
    return np.clip((end - distance) / (end - start), 0.0, 1.0)
