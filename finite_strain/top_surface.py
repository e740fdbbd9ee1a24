"""The whole scene's top surface on rank 0: small data, for pictures and sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finite_strain import compat
from finite_strain.model import Model
from finite_strain.recovery import on_nodes
from finite_strain.scene_frame import SceneFrame


@dataclass(frozen=True)
class SurfaceFields:
    """The whole scene's top surface: points (n, 3) [m], triangles (m, 3), contact pressure (n,) [Pa]."""

    reference: np.ndarray
    points: np.ndarray
    triangles: np.ndarray
    pressure: np.ndarray


def contact_pressure(model: Model) -> np.ndarray:
    """Return the contact pressure [Pa] per deformed area at this rank's nodes, ghosts included (collective).

    Projected to the corners of the top's facets, lumped: never negative, and the same on any number of ranks.
    """
    corners = np.zeros(len(model.linear_space.tabulate_dof_coordinates()))
    for contact in model.contacts:
        corners += model.project(contact, contact.true_pressure(model.nodal))
    vertex_dofs, node_dofs = compat.cell_dofs(model.linear_space), compat.cell_dofs(model.space)
    return on_nodes(corners, vertex_dofs, node_dofs, len(model.nodal))


def gather_surface(model: Model) -> SurfaceFields | None:
    """Return the whole scene's deformed top surface on rank 0, completed by symmetry; None elsewhere (collective)."""
    nodes = model.space.tabulate_dof_coordinates()
    triangles = _straight_triangles(model.top_dofs(), nodes)
    pressure = contact_pressure(model)
    parts = model.comm.gather((nodes[triangles], model.nodal[triangles], pressure[triangles]), root=0)
    if parts is None:
        return None
    reference, moved, pressures = (np.concatenate([part[k] for part in parts]) for k in range(3))
    size = float(np.ptp(reference))
    _, first, inverse = np.unique(
        np.round(reference.reshape(-1, 3) / (1e-9 * size)), axis=0, return_index=True, return_inverse=True
    )
    points = reference.reshape(-1, 3)[first]
    u, p = moved.reshape(-1, 3)[first], pressures.ravel()[first]
    deformed = points + u if model.contacts[0].indenter.deformed else points + u * np.array([0.0, 0.0, 1.0])
    return _completed(SceneFrame.of(model.reduction), SurfaceFields(points, deformed, inverse.reshape(-1, 3), p))


def _straight_triangles(dofs: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Split quadratic facets (n, 6), corners first, into four straight triangles each (4 n, 3)."""
    corners, mids = dofs[:, :3], dofs[:, 3:]
    edges = nodes[corners][:, [[1, 2], [0, 2], [0, 1]]].mean(axis=2)
    distance = np.linalg.norm(nodes[mids][:, None, :, :] - edges[:, :, None, :], axis=-1)
    opposite = np.take_along_axis(mids, np.argmin(distance, axis=2), axis=1)  # of edge k: the node opposite corner k
    a, b, c = corners.T
    at_a, at_b, at_c = opposite.T
    parts = [(a, at_c, at_b), (at_c, b, at_a), (at_b, at_a, c), (at_a, at_b, at_c)]
    return np.concatenate([np.column_stack(part) for part in parts])


def _completed(frame: SceneFrame, part: SurfaceFields) -> SurfaceFields:
    """Mirror the simulated part at its symmetry planes and turn it into the scene's frame."""
    count, signs = len(part.reference), frame.mirror_signs()
    return SurfaceFields(
        np.concatenate([frame.points(part.reference * s) for s in signs]),
        np.concatenate([frame.points(part.points * s) for s in signs]),
        np.concatenate([part.triangles + k * count for k in range(len(signs))]),
        np.tile(part.pressure, len(signs)),
    )
