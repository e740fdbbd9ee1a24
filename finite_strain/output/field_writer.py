"""Fields on disk for ParaView, meshio and h5py: one HDF5 and one XDMF file per load step, and an index over all.

Each element of order p is written as p^3 linear cells between its own nodes, which every reader supports; the
nodal displacements are those of the solution. Points, vectors and tensors are in the scene's frame; the part beyond
the mirror planes is not written (attributes name the planes: ParaView's Reflect filter and `thirdbody render`
complete the scene). All finished steps of a killed run are readable. If DOLFINx was built with ADIOS2, each step also
has a VTX folder.
"""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import dolfinx
import h5py
import numpy as np
import ufl

from finite_strain import compat
from finite_strain.contact.contact_energy import gap
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.nodal_values import CellNodes
from finite_strain.mechanics.materials import cauchy_stress
from finite_strain.mpi import on_root
from finite_strain.output.field_catalogue import CATALOGUE, FieldChoice, outline
from finite_strain.output.step_files import stem, write_gathered, write_step_and_index
from finite_strain.output.top_surface import TopSurface
from linear_bem.errors import OutputUnusable

_STRESSES = {"cauchy_stress", "von_mises", "pressure"}
_OUTLINES = "points of bodies that are no balls, from the apex, by direction and outwards; nan of balls"
_STRAINS = {"volume_ratio", "principal_stretches"}


class FieldWriter:
    """Writes the chosen fields of a model, step by step (collective). Other fields are not compiled."""

    def __init__(self, model: Model, folder: Path, choice: FieldChoice | None = None) -> None:
        self.model = model
        self.folder = folder
        self.choice = choice or FieldChoice()
        self._nodes = CellNodes(model.space)
        wanted, owned = set(self.choice.names), len(self._nodes.dofs)
        tagged = [(bulk, model.cell_tags.find(bulk.tag)) for bulk in model.bulks]
        self._regions = [(bulk, cells[cells < owned].astype(np.int32)) for bulk, cells in tagged]
        self._top = TopSurface(model, self._nodes) if "contact_pressure" in wanted else None
        self._stresses = [self._stress(bulk) for bulk, _ in self._regions] if wanted & _STRESSES else None

    def _stress(self, bulk: Any) -> Any:
        model = self.model
        gradient = ufl.variable(ufl.grad(model.displacement))
        psi = model.energy_density(bulk, gradient)
        stress = cauchy_stress(bulk.law, gradient, ufl.diff(psi, gradient))
        return compat.compile_expression(stress, self._nodes.lattice.points, model.comm)

    def forget_after(self, number: int) -> None:
        """Remove the steps beyond ``number`` that an earlier run left in the folder, made if missing (collective)."""

        def remove() -> None:
            self.folder.mkdir(exist_ok=True)
            for path in [path for path in self.folder.glob("step_*.*") if path.stem > stem(number)]:
                if path.is_dir():  # of VTX
                    shutil.rmtree(path)
                else:
                    path.unlink()

        on_root(self.model.comm, remove)

    def write(self, number: int, fraction: float) -> None:
        """Write step ``number`` (1, 2, ...) if it is requested, and rewrite the index."""
        if self.choice.wants(number, fraction):
            arrays, fields = self._mesh_arrays(), self._node_fields()
            owned = self.model.space.dofmap.index_map.size_local
            arrays |= {f"node_fields/{name}": values[:owned] for name, values in fields.items()}
            path = self.folder / f"{stem(number)}.h5"
            write_gathered(self.model.comm, path, arrays, lambda file: self._describe(file, number, fraction))
            on_root(self.model.comm, lambda: write_step_and_index(self.folder, number))
            if compat.vtx_writer() is not None:
                self._write_vtx(path.with_suffix(".bp"), number, fields)

    def _write_vtx(self, path: Path, number: int, fields: Mapping[str, np.ndarray]) -> None:
        """Write the fields as functions of order p on the curved elements; a folder is replaced by the complete one."""
        model, draft = self.model, path.with_name("draft.bp")
        shapes = {values.shape[1:] for values in fields.values()}
        spaces = {shape: compat.function_space(model.mesh, model.order, shape) for shape in sorted(shapes)}
        functions = []
        for name, values in fields.items():
            space, rows = spaces[values.shape[1:]], values.reshape(len(values), -1)
            function = dolfinx.fem.Function(space, name=name)
            # a space may number the mesh's nodes differently
            function.x.array.reshape(-1, rows.shape[1])[compat.cell_dofs(space)] = rows[compat.cell_dofs(model.space)]
            function.x.scatter_forward()
            functions.append(function)
        places = model.mesh.geometry.x
        own = places.copy()
        places[:] = model.reduction.scene_points(own)  # the writer uses the functions' mesh
        try:
            with compat.vtx_writer()(model.comm, str(draft), functions) as writer:
                writer.write(float(number))
        except RuntimeError as error:
            raise OutputUnusable(f"{path} cannot be written: {error}") from error
        finally:
            places[:] = own

        def replace() -> None:
            shutil.rmtree(path, ignore_errors=True)
            draft.rename(path)

        on_root(model.comm, replace)

    def _mesh_arrays(self) -> dict[str, np.ndarray]:
        index_map = self.model.space.dofmap.index_map
        pieces = self._nodes.dofs[:, self._nodes.lattice.cells]
        region = np.zeros(pieces.shape[:2], dtype=np.int64)
        for bulk, cells in self._regions:
            region[cells] = bulk.tag
        numbers = index_map.local_to_global(pieces.ravel().astype(np.int32)).reshape(-1, pieces.shape[2])
        nodes = self.model.space.tabulate_dof_coordinates()[: index_map.size_local]
        points = self.model.reduction.scene_points(nodes)
        return {"points": points, "cells": numbers, "cell_fields/region": region.ravel()}

    def _node_fields(self) -> dict[str, np.ndarray]:
        """Return the chosen fields at this rank's nodes, ghosts included, in the scene's frame."""
        answer = {"displacement": self.model.reduction.scene_vectors(self.model.nodal)}
        if self._top is not None:
            answer["contact_pressure"] = self._top.pressure()
        answer |= self._gap() | self._strain_fields() | self._stress_fields()
        return {name: np.ascontiguousarray(answer[name]) for name in self.choice.names}

    def _gap(self) -> dict[str, np.ndarray]:
        if "gap" not in self.choice.names:
            return {}
        model, gaps = self.model, []
        nodes = model.space.tabulate_dof_coordinates()
        # z counts as displacement, because `gap` at small strain is that of points of the surface z = 0
        above, moved = nodes * [1.0, 1.0, 0.0], model.nodal + nodes * [0.0, 0.0, 1.0]
        for ball, approach in zip(model.reduction.balls, model.contact.approaches, strict=True):
            offset = above - [*ball.position, 0.0]
            arguments = ball.shape, ball.radius, offset.T, moved.T, approach
            gaps.append(gap(*arguments, model.is_finite, model.contact.angle))
        least = np.fmin.reduce(gaps)  # nan where a body has no height, beyond its reach
        return {"gap": np.where(np.isnan(least), np.inf, least)}

    def _strain_fields(self) -> dict[str, np.ndarray]:
        if not _STRAINS.intersection(self.choice.names):
            return {}
        gradient = self._nodes.gradient(self.model.nodal)
        ratio, stretches = _strains(gradient, finite=self.model.is_finite)
        strains = np.concatenate([ratio[..., None], stretches], axis=2)
        values = self._nodes.averaged([(cells, strains[cells]) for _, cells in self._regions])
        # averages of sorted values need not be sorted if elements differ strongly
        return {"volume_ratio": values[:, 0], "principal_stretches": -np.sort(-values[:, 1:], axis=1)}

    def _stress_fields(self) -> dict[str, np.ndarray]:
        if self._stresses is None:
            return {}
        regions = zip(self._regions, self._stresses, strict=True)
        values = [(cells, compat.evaluate(stress, self.model.mesh, cells, (9,))) for (_, cells), stress in regions]
        stress = self._nodes.averaged(values).reshape(-1, 3, 3)
        stress = 0.5 * (stress + stress.transpose(0, 2, 1))  # symmetric but for roundoff
        pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
        deviator = stress + pressure[:, None, None] * np.eye(3)
        return {
            "cauchy_stress": self.model.reduction.scene_tensors(stress),
            "von_mises": np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))),
            "pressure": pressure,
        }

    def _describe(self, file: h5py.File, number: int, fraction: float) -> None:
        file["points"].attrs.update(unit="m", meaning="undeformed nodes of the simulated part, in the scene's frame")
        order, reduction = self._nodes.lattice.order, self.model.reduction
        file["cells"].attrs.update(
            order=order, meaning=f"linear cells by rows of points in VTK's order; {order}^3 in a row fill an element"
        )
        file["cell_fields/region"].attrs.update(unit="1", kind="Scalar", meaning="1: layer, 2: substrate")
        outlines = np.array([outline(reduction.balls[image.model_ball]) for image in reduction.images])
        if np.isfinite(outlines).any():
            file["ball_outlines"] = outlines
            file["ball_outlines"].attrs.update(unit="m", meaning=_OUTLINES)
        file.require_group("node_fields")
        for name in self.choice.names:
            field = CATALOGUE[name]
            file[f"node_fields/{name}"].attrs.update(unit=field.unit, kind=field.kind, meaning=field.meaning)
        balls = [(image, reduction.balls[image.model_ball]) for image in reduction.images]
        axes = np.array([[*np.multiply(image.signs, ball.position), 0.0] for image, ball in balls])
        file.attrs.update(
            step=number,
            fraction=fraction,
            deformed=self.model.is_finite,
            ball_positions=reduction.scene_points(axes)[:, :2],
            layer_young=self.model.bulks[0].solid.young,
            ball_radii=[ball.radius for _, ball in balls],
            ball_shapes=[s if isinstance(s := ball.shape, str) else type(s).__name__.lower() for _, ball in balls],
            ball_approaches=[self.model.contact.approaches[image.model_ball] for image, _ in balls],
            frame="points are the scene's: frame_turn x + frame_origin of the simulated part's own x",
            frame_turn=reduction.turn,
            frame_origin=np.array([*reduction.origin, 0.0]),
            mirror_planes=reduction.scene_vectors(reduction.mirrors),
            mirror_planes_meaning="normals of the planes through frame_origin beyond which the scene mirrors itself",
        )


def _strains(gradient: np.ndarray, finite: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return J and the principal stretches (..., 3), largest first, for displacement gradients (..., 3, 3)."""
    if not finite:
        principal = np.linalg.eigvalsh(0.5 * (gradient + np.swapaxes(gradient, -1, -2)))
        return 1.0 + np.trace(gradient, axis1=-2, axis2=-1), 1.0 + principal[..., ::-1]
    F = np.eye(3) + gradient
    return np.linalg.det(F), np.linalg.svd(F, compute_uv=False)
