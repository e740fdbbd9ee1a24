"""The whole scene's top surface on rank 0: small data, for pictures and sections."""

from dataclasses import dataclass

import numpy as np

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.nodal_values import CellNodes, element_of, on_top
from finite_strain.force.contact_pressure import MeanPressure
from finite_strain.geometry.symmetry import Reduction


@dataclass(frozen=True, eq=False)
class SurfaceFields:
    """The whole scene's top surface: points (n, 3) [m], triangles (m, 3), contact pressure (n,) [Pa]."""

    reference: np.ndarray
    points: np.ndarray
    triangles: np.ndarray
    pressure: np.ndarray


class TopSurface:
    """The nodes of a model's top, and the contact pressure there; collective."""

    def __init__(self, model: Model, nodes: CellNodes | None = None) -> None:
        self.model, self.nodes = model, nodes or CellNodes(model.space)
        lattice = self.nodes.lattice
        self._is_top = on_top(model.space, model.facet_tags)
        self._cells, face = np.nonzero(self._is_top[self.nodes.dofs[:, lattice.faces]].all(axis=2))
        pieces = self.nodes.dofs[self._cells[:, None, None], lattice.pieces[face]]
        self._pieces = pieces.reshape(-1, pieces.shape[2])
        order = lattice.order if lattice.faces.shape[1] == (lattice.order + 1) ** 2 else 1
        self._means = MeanPressure(model, compat.function_space(model.mesh, order))
        self._dofs = compat.cell_dofs(self._means.space)[self._cells]
        self._shapes = element_of(self._dofs.shape[1]).tabulate(0, lattice.points)[0, :, :, 0]

    def pressure(self) -> np.ndarray:
        """Return the contact pressure [Pa] per deformed area at this rank's nodes; zero below the top."""
        values = self._means(np.ones(len(self.model.contact.balls)))[self._dofs] @ self._shapes.T
        averaged = self.nodes.averaged([(self._cells.astype(np.int32), values[:, :, None])])[:, 0]
        return np.where(self._is_top, np.maximum(averaged, 0.0), 0.0)

    def gathered(self) -> SurfaceFields | None:
        """Return the whole scene's deformed top on rank 0, completed by symmetry; None elsewhere."""
        model = self.model
        fields = (model.space.tabulate_dof_coordinates(), model.nodal, self.pressure())
        parts = model.comm.gather([field[self._pieces].reshape(-1, *field.shape[1:]) for field in fields], root=0)
        if parts is None:
            return None
        reference, u, pressure = (np.concatenate(field) for field in zip(*parts, strict=True))
        if not model.is_finite:
            u[:, :2] = 0.0
        places = np.round(reference / (1e-9 * np.ptp(reference)))
        _, first, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
        triangles = _triangles(inverse.reshape(-1, self._pieces.shape[1]), pressure[first])
        part = SurfaceFields(reference[first], (reference + u)[first], triangles, pressure[first])
        return _completed(model.reduction, part)


def _triangles(squares: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Split quadrilaterals (n, 4) into triangles (2 n, 3) along the diagonal on which the nodes' values differ less."""
    if squares.shape[1] == 3:  # a face of tetrahedra
        return squares
    ends = values[squares]
    turned = np.abs(ends[:, 0] - ends[:, 2]) > np.abs(ends[:, 1] - ends[:, 3])
    around = np.where(turned[:, None], np.roll(squares, 1, axis=1), squares)
    return around[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)


def _completed(reduction: Reduction, part: SurfaceFields) -> SurfaceFields:
    """Mirror the simulated part at its symmetry planes and turn it into the scene's frame."""
    count, signs = len(part.reference), reduction.mirror_signs()
    places = part.reference[part.triangles]
    (a, b), (c, d) = (places[:, 1] - places[:, 0])[:, :2].T, (places[:, 2] - places[:, 0])[:, :2].T
    up = np.where((a * d > b * c)[:, None], part.triangles, part.triangles[:, ::-1])  # all normals point up
    turns = [up if np.prod(s[:2]) > 0.0 else up[:, ::-1] for s in signs]
    return SurfaceFields(
        np.concatenate([reduction.scene_points(part.reference * s) for s in signs]),
        np.concatenate([reduction.scene_points(part.points * s) for s in signs]),
        np.concatenate([triangles + k * count for k, triangles in enumerate(turns)]),
        np.tile(part.pressure, len(signs)),
    )
