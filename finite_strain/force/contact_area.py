"""The contact area under each ball, by the points of a fine lattice on every facet that touch it.

The edge of a contact crosses facets. The points of their quadrature are so few that areas would jump by per cents as
the edge passes one, at finite and at small strain at different loads: the pair would not remove these errors.
"""

from functools import cache

import numpy as np
from mpi4py import MPI

from finite_strain import compat
from finite_strain.contact.contact_energy import gap
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.nodal_values import element_of, lattice_of, on_top

POINTS, STRIDE = 1597, 987
"""Points i (1, STRIDE) / POINTS, modulo 1, of a Fibonacci lattice in the unit square. No two have the same coordinate:
where the edge is parallel to a side of the facet, as along the lines of the meshes, it passes one point at a time."""


def contact_areas(model: Model) -> np.ndarray:
    """Return the area (balls,) [m^2] of whole balls, on the deformed surface at finite strain (collective).

    It is where the gap is below the penetration of the multipliers' source, zero without multipliers: under stiff
    penalties the pressure oscillates and vanishes at points of the contact.
    """
    contact, areas = model.contact, np.zeros(len(model.contact.balls))
    dofs = compat.cell_dofs(model.space)[contact.touchable]
    faces = lattice_of(dofs.shape[1]).faces
    held = on_top(model.space, model.facet_tags)[dofs[:, faces]].all(axis=2)
    places, earlier = model.space.tabulate_dof_coordinates(), contact.earlier.x.array.reshape(-1, 3)
    for row, face in np.argwhere(held):
        nodes, cell = dofs[row], contact.touchable[row]
        shapes, *along = _points(len(nodes), face)
        here, now, before = (shapes @ values[nodes] for values in (places, model.nodal, earlier))
        moved = places[nodes] + (model.nodal[nodes] if contact.finite else 0.0)
        sizes = np.linalg.norm(np.cross(*(tangent @ moved for tangent in along)), axis=1) / len(shapes)
        for slot in contact.slots:
            if slot.balls[cell] >= 0:
                x, y, radius, *approaches = (
                    slot.fields[name].x.array[cell] for name in ("x", "y", "radius", "approach", "earlier")
                )
                gaps, reached = (
                    gap(slot.kind, radius, (here - (x, y, 0.0)).T, u.T, approach, contact.finite, contact.angle)
                    for u, approach in zip((now, before), approaches, strict=True)
                )
                overlap = np.maximum(-reached, 0.0) if contact.augmented.value > 0.0 else 0.0
                areas[slot.balls[cell]] += sizes[overlap > gaps].sum()
    copies = np.array([ball.copies for ball in contact.balls])
    return copies * np.asarray(model.comm.allreduce(areas, op=MPI.SUM))


@cache
def _points(nodes: int, face: int) -> tuple[np.ndarray, ...]:
    """Return shape functions (points, nodes) of a cell at points of a face, and their derivatives along both sides.

    The points are those of the unit square, for a triangle with one side shrunk to a corner.
    """
    lattice, numbers = lattice_of(nodes), np.arange(POINTS)[:, None]
    corners = lattice.points[sorted(lattice.faces[face][lattice.faces[face] < lattice.cells.shape[1]])]
    a, b, c, d = corners if len(corners) == 4 else corners[[0, 1, 0, 2]]
    s, t = (numbers + 0.5) / POINTS, (numbers * STRIDE % POINTS + 0.5) / POINTS
    values = element_of(nodes).tabulate(1, a + s * (b - a) + t * (c - a) + s * t * (a - b - c + d))[:, :, :, 0]
    sides = b - a + t * (a - b - c + d), c - a + s * (a - b - c + d)
    return values[0], *(np.einsum("kpn,pk->pn", values[1:], side) for side in sides)
