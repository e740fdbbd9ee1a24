"""Fields on disk for ParaView and meshio: one HDF5 and one XDMF file per load step, and an index over all of them.

Each step's files are closed when the step ends, so a killed run leaves every finished step readable.
The XDMF text is written here because the library's own puts every field on a grid of its own, which
meshio cannot read and ParaView shows as separate blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

import dolfinx
import h5py
import numpy as np
import ufl

from finite_strain import compat
from finite_strain.model import Model
from linear_bem.errors import OutputUnusable

FIELDS = {
    "displacement": ("Node", "Vector"),
    "contact_pressure": ("Node", "Scalar"),
    "cauchy_stress": ("Cell", "Tensor"),
}
INDEX = "fields.xdmf"


class FieldWriter:
    """Writes displacement [m], contact pressure [Pa] and Cauchy stress [Pa] of a model, step by step (collective)."""

    def __init__(self, model: Model, folder: Path) -> None:
        self.model = model
        self.folder = folder
        mesh = model.mesh
        self._linear = compat.function_space(mesh, 1, (3,))
        self._constant = compat.function_space(mesh, 0, (3, 3), discontinuous=True)
        self._values = {
            "displacement": dolfinx.fem.Function(self._linear, name="displacement"),
            "contact_pressure": dolfinx.fem.Function(model.linear_space, name="contact_pressure"),
            "cauchy_stress": dolfinx.fem.Function(self._constant, name="cauchy_stress"),
        }
        self._stress = [
            (compat.compile_expression(stress, self._constant, model.comm), cells) for stress, cells in self._stresses()
        ]

    def _stresses(self):  # type: ignore[no-untyped-def]
        model = self.model
        gradient = ufl.variable(ufl.grad(model.displacement))
        for bulk in model.bulks:
            psi = model.kinematics.energy_density(gradient, *model.constants(bulk))
            stress = model.kinematics.cauchy_stress(gradient, ufl.diff(psi, gradient))
            yield stress, model.cell_tags.find(bulk.tag)

    def forget_after(self, number: int) -> None:
        """Remove the steps beyond ``number`` that an earlier, different run left in the folder (collective)."""
        if self.model.comm.rank == 0:
            for path in self.folder.glob("step_*.*"):
                if path.stem > _stem(number):
                    path.unlink()
        self.model.comm.barrier()

    def write(self, number: int) -> None:
        """Write step ``number`` (1, 2, ...) and bring the index up to date."""
        model, values = self.model, self._values
        values["displacement"].interpolate(model.displacement)
        pressure = values["contact_pressure"].x.array
        pressure[:] = 0.0
        for contact in model.contacts:
            pressure += model.project(contact, contact.true_pressure(model.nodal))
        for expression, cells in self._stress:
            values["cauchy_stress"].interpolate(expression, cells)
        stem = _stem(number)
        with dolfinx.io.XDMFFile(model.comm, str(self.folder / f"{stem}.xdmf"), "w") as file:
            file.write_mesh(model.mesh)
            for function in values.values():
                file.write_function(function, 0.0)
        failure = None
        if model.comm.rank == 0:
            try:
                _write_text(self.folder / f"{stem}.xdmf", [_grid(self.folder, stem)], temporal=False)
                grids = [_grid(self.folder, _stem(n), n) for n in range(1, number + 1)]
                _write_text(self.folder / INDEX, grids, temporal=True)
            except OSError as error:
                failure = f"fields in {self.folder} cannot be written: {error}"
        failure = model.comm.bcast(failure, root=0)
        if failure:
            raise OutputUnusable(failure)


def _stem(number: int) -> str:
    return f"step_{number:04d}"


def _grid(folder: Path, stem: str, number: int | None = None) -> Xml.Element:
    """Return the XDMF grid of one step, with the sizes that its HDF5 file has; ``number`` is its time in an index."""
    grid = Xml.Element("Grid", Name=stem, GridType="Uniform")
    with h5py.File(folder / f"{stem}.h5", "r") as file:
        cells, points = file["Mesh/mesh/topology"].shape, file["Mesh/mesh/geometry"].shape
        topology = Xml.SubElement(
            grid, "Topology", TopologyType="Tetrahedron", NumberOfElements=str(cells[0]), NodesPerElement="4"
        )
        _item(topology, f"{stem}.h5:/Mesh/mesh/topology", cells, "Int", 8)
        geometry = Xml.SubElement(grid, "Geometry", GeometryType="XYZ")
        _item(geometry, f"{stem}.h5:/Mesh/mesh/geometry", points, "Float", 8)
        if number is not None:
            Xml.SubElement(grid, "Time", Value=str(number))
        for name, (center, kind) in FIELDS.items():
            group = file[f"Function/{name}"]
            dataset = f"Function/{name}/{next(iter(group))}"
            attribute = Xml.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center=center)
            _item(attribute, f"{stem}.h5:/{dataset}", file[dataset].shape, "Float", 8)
    return grid


def _item(parent: Xml.Element, where: str, shape: tuple[int, ...], kind: str, precision: int) -> None:
    dimensions = " ".join(str(n) for n in shape)
    item = Xml.SubElement(
        parent, "DataItem", Dimensions=dimensions, NumberType=kind, Precision=str(precision), Format="HDF"
    )
    item.text = where


def _write_text(path: Path, grids: list[Xml.Element], temporal: bool) -> None:
    root = Xml.Element("Xdmf", Version="3.0")
    parent = Xml.SubElement(root, "Domain")
    if temporal:
        parent = Xml.SubElement(parent, "Grid", Name="load path", GridType="Collection", CollectionType="Temporal")
    parent.extend(grids)
    draft = path.with_suffix(".part")
    Xml.ElementTree(root).write(draft, xml_declaration=True, encoding="utf-8")
    draft.replace(path)


@dataclass(frozen=True)
class SurfaceFields:
    """The whole scene's top surface: points (n, 3) [m], triangles (m, 3), contact pressure (n,) [Pa]."""

    reference: np.ndarray
    points: np.ndarray
    triangles: np.ndarray
    pressure: np.ndarray


def gather_surface(model: Model) -> SurfaceFields | None:
    """Return the whole scene's deformed top surface on rank 0, completed by symmetry; None elsewhere (collective)."""
    nodes = model.space.tabulate_dof_coordinates()
    triangles = _straight_triangles(model.top_dofs(), nodes)
    pressure = np.zeros(len(nodes))
    for contact in model.contacts:
        pressure += contact.nodal_pressure(model.nodal)
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
    return _completed(model, SurfaceFields(points, deformed, inverse.reshape(-1, 3), p))


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


def _completed(model: Model, part: SurfaceFields) -> SurfaceFields:
    """Mirror the simulated part at its symmetry planes and turn it into the scene's frame."""
    reduction = model.reduction
    pieces = [(1.0, 1.0)]
    for axis in reduction.planes:
        pieces += [tuple(-s if k == axis else s for k, s in enumerate(signs)) for signs in pieces]  # type: ignore[misc]
    count = len(part.reference)
    turn = np.eye(3)
    c, s = np.cos(reduction.angle), np.sin(reduction.angle)
    turn[:2, :2] = [[c, -s], [s, c]]
    origin = np.array([*reduction.origin, 0.0])
    mirrors = [np.array([*signs, 1.0]) for signs in pieces]
    return SurfaceFields(
        np.concatenate([(part.reference * m) @ turn.T + origin for m in mirrors]),
        np.concatenate([(part.points * m) @ turn.T + origin for m in mirrors]),
        np.concatenate([part.triangles + k * count for k in range(len(mirrors))]),
        np.tile(part.pressure, len(mirrors)),
    )
