"""Fields on disk for ParaView, meshio and h5py: one HDF5 and one XDMF file per load step, and an index over all.

Cells are quadratic tetrahedra, so the displacement is written exactly as it was solved for, and the curved facets of
a contact stay curved. Points, vectors and tensors are in the scene's own frame; the part beyond the mirror planes is
not written again (attributes name the planes: ParaView's Reflect filter and `thirdbody render` complete the scene).
Each step's files stand alone and are closed when the step ends, so a killed run leaves every finished step readable.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import ufl

from finite_strain import compat
from finite_strain.catalogue import CATALOGUE, FieldChoice
from finite_strain.kinematics import Finite
from finite_strain.model import Model
from finite_strain.recovery import EDGES, GAUSS_POINTS, NodeAverage
from finite_strain.scene_frame import SceneFrame
from finite_strain.spread_arrays import write_in_turns
from finite_strain.together import on_root
from finite_strain.top_surface import contact_pressure
from finite_strain.xdmf import stem, write_step_and_index

_DRAWN_EDGES = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]
_DRAWN = [0, 1, 2, 3, *(4 + EDGES.tolist().index(edge) for edge in _DRAWN_EDGES)]
"""Nodes of a DOLFINx cell in the order of VTK and XDMF."""
_STRESSES = {"cauchy_stress", "von_mises", "pressure"}
_STRAINS = {"volume_ratio", "principal_stretches"}


class FieldWriter:
    """Writes the chosen fields of a model, step by step (collective). What is not asked for is not compiled."""

    def __init__(self, model: Model, folder: Path, choice: FieldChoice | None = None) -> None:
        self.model = model
        self.folder = folder
        self.choice = choice or FieldChoice()
        self._frame = SceneFrame.of(model.reduction)
        wanted = set(self.choice.names)
        owned = model.mesh.topology.index_map(3).size_local
        tagged = [(bulk, model.cell_tags.find(bulk.tag)) for bulk in model.bulks]
        self._regions = [(bulk, cells[cells < owned].astype(np.int32)) for bulk, cells in tagged]
        self._average = NodeAverage(model.space) if wanted & (_STRESSES | _STRAINS) else None
        self._gradient = self._compiled(ufl.grad(model.displacement)) if wanted & _STRAINS else None
        self._stresses = (
            [self._compiled(self._stress(bulk)) for bulk, _ in self._regions] if wanted & _STRESSES else None
        )

    def _compiled(self, value: Any) -> Any:
        return compat.compile_expression(value, GAUSS_POINTS, self.model.comm)

    def _stress(self, bulk: Any) -> Any:
        model = self.model
        gradient = ufl.variable(ufl.grad(model.displacement))
        psi = model.kinematics.energy_density(gradient, *model.constants(bulk))
        return model.kinematics.cauchy_stress(gradient, ufl.diff(psi, gradient))

    def forget_after(self, number: int) -> None:
        """Remove the steps beyond ``number`` that an earlier, different run left in the folder (collective)."""

        def remove() -> None:
            for path in self.folder.glob("step_*.*"):
                if path.stem > stem(number):
                    path.unlink()

        on_root(self.model.comm, remove)

    def write(self, number: int, fraction: float) -> float:
        """Write step ``number`` (1, 2, ...) if it is asked for, and the index anew; return the seconds taken."""
        began = time.monotonic()
        if self.choice.wants(number, fraction):
            arrays = self._mesh_arrays()
            arrays |= {f"node_fields/{name}": values for name, values in self._node_fields().items()}

            def describe(file: h5py.File) -> None:
                self._describe(file, number, fraction)

            write_in_turns(self.model.comm, self.folder / f"{stem(number)}.h5", arrays, describe)
            on_root(self.model.comm, lambda: write_step_and_index(self.folder, number))
        return time.monotonic() - began

    def _mesh_arrays(self) -> dict[str, np.ndarray]:
        space, mesh = self.model.space, self.model.mesh
        owned_cells, index_map = mesh.topology.index_map(3).size_local, space.dofmap.index_map
        region = np.zeros(owned_cells, dtype=np.int64)
        for bulk, cells in self._regions:
            region[cells] = bulk.tag
        dofs = compat.cell_dofs(space)[:owned_cells][:, _DRAWN]
        numbers = index_map.local_to_global(dofs.ravel().astype(np.int32)).reshape(-1, 10)
        points = space.tabulate_dof_coordinates()[: index_map.size_local]
        return {"points": self._frame.points(points), "cells": numbers, "cell_fields/region": region}

    def _node_fields(self) -> dict[str, np.ndarray]:
        """Return the chosen fields at this rank's own nodes, in the scene's frame."""
        fields = {"displacement": lambda: self._frame.vectors(self.model.nodal)}
        fields |= {"contact_pressure": lambda: contact_pressure(self.model), "gap": self._gap}
        answer = {name: make() for name, make in fields.items() if name in self.choice.names}
        for several in (self._strain_fields, self._stress_fields):
            answer |= {name: values for name, values in several().items() if name in self.choice.names}
        owned = self.model.space.dofmap.index_map.size_local
        return {name: np.ascontiguousarray(answer[name][:owned]) for name in self.choice.names}

    def _gap(self) -> np.ndarray:
        model = self.model
        nodes = model.space.tabulate_dof_coordinates()
        gaps = []
        for contact, ball in zip(model.contacts, model.reduction.balls, strict=True):
            gaps.append(contact.indenter.gap(nodes - np.array([*ball.position, 0.0]), model.nodal, contact.approach)[0])
        return np.min(gaps, axis=0)

    def _strain_fields(self) -> dict[str, np.ndarray]:
        if self._gradient is None or self._average is None:
            return {}
        regions = []
        for _, cells in self._regions:
            gradient = compat.evaluate(self._gradient, self.model.mesh, cells, (3, 3))
            ratio, stretches = _strains(gradient, finite=isinstance(self.model.kinematics, Finite))
            regions.append((cells, np.concatenate([ratio[..., None], stretches], axis=2)))
        values = self._average.of(regions)
        # where elements differ much, the order at their Gauss points is not that of the averages
        stretches = -np.sort(-values[:, 1:], axis=1)
        return {"volume_ratio": values[:, 0], "principal_stretches": stretches}

    def _stress_fields(self) -> dict[str, np.ndarray]:
        if self._stresses is None or self._average is None:
            return {}
        regions = []
        for (_, cells), expression in zip(self._regions, self._stresses, strict=True):
            regions.append((cells, compat.evaluate(expression, self.model.mesh, cells, (9,))))
        stress = self._average.of(regions).reshape(-1, 3, 3)
        stress = 0.5 * (stress + stress.transpose(0, 2, 1))  # symmetric but for roundoff
        pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
        deviator = stress + pressure[:, None, None] * np.eye(3)
        return {
            "cauchy_stress": self._frame.tensors(stress),
            "von_mises": np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))),
            "pressure": pressure,
        }

    def _describe(self, file: h5py.File, number: int, fraction: float) -> None:
        file["points"].attrs.update(unit="m", meaning="undeformed nodes of the simulated part, in the scene's frame")
        file["cells"].attrs.update(
            meaning="quadratic tetrahedra by rows of points: four corners, then the middles of edges 01 12 02 03 13 23"
        )
        file["cell_fields/region"].attrs.update(unit="1", kind="Scalar", meaning="1: layer, 2: substrate")
        file.require_group("node_fields")
        for name in self.choice.names:
            field = CATALOGUE[name]
            file[f"node_fields/{name}"].attrs.update(unit=field.unit, kind=field.kind, meaning=field.meaning)
        frame, reduction = self._frame, self.model.reduction
        balls = [(image, reduction.balls[image.model_ball]) for image in reduction.images]
        axes = np.array([[*np.multiply(image.signs, ball.position), 0.0] for image, ball in balls])
        file.attrs.update(
            step=number,
            fraction=fraction,
            deformed=self.model.contacts[0].indenter.deformed,
            ball_positions=frame.points(axes)[:, :2],
            layer_young=self.model.bulks[0].solid.young,
            ball_radii=[ball.radius for _, ball in balls],
            ball_shapes=[ball.shape for _, ball in balls],
            ball_approaches=[self.model.contacts[image.model_ball].approach for image, _ in balls],
            frame="points are the scene's: frame_turn x + frame_origin of the simulated part's own x",
            frame_turn=frame.turn,
            frame_origin=frame.origin,
            frame_angle=reduction.angle,
            mirror_planes=frame.scene_mirrors,
            mirror_planes_meaning="normals of the planes through frame_origin beyond which the scene mirrors itself",
        )


def _strains(gradient: np.ndarray, finite: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return J and the principal stretches (..., 3), largest first, for displacement gradients (..., 3, 3)."""
    if not finite:
        principal = np.linalg.eigvalsh(0.5 * (gradient + np.swapaxes(gradient, -1, -2)))
        return 1.0 + np.trace(gradient, axis1=-2, axis2=-1), 1.0 + principal[..., ::-1]
    F = np.eye(3) + gradient
    return np.linalg.det(F), np.linalg.svd(F, compute_uv=False)
