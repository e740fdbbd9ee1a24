from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshes.box import Box, Zone


@dataclass(frozen=True)
class Written:
    """A mesh file as meshio reads it: points, tetrahedra and triangles with the name of their physical group."""

    box: Box
    points: np.ndarray
    tetrahedra: dict[str, np.ndarray]
    triangles: dict[str, np.ndarray]
    reported: int

    @property
    def cells(self) -> np.ndarray:
        return np.concatenate(list(self.tetrahedra.values()))

    def volumes(self, name: str) -> np.ndarray:
        a, b, c, d = self.points[self.tetrahedra[name]].transpose(1, 0, 2)
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0

    def area(self, name: str) -> float:
        a, b, c = self.points[self.triangles[name]].transpose(1, 0, 2)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)

    def mean_edges(self, cells: np.ndarray) -> np.ndarray:
        corners = self.points[cells]
        edges = [np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i, j in combinations(range(4), 2)]
        return np.mean(edges, axis=0)


def zone(x: float, y: float, mirror: float, finest: float = 0.1, growth: float = 0.3) -> Zone:
    return Zone((x, y), finest, growth, radius=0.4, outer_growth=0.3, mirror=mirror)


BOXES = {
    "one ball": Box((-3.0, 3.0), (-3.0, 3.0), 1.0, 0.0, (zone(0.0, 0.0, 0.8),), 1.0),
    "a quarter of a pair": Box((0.0, 4.0), (0.0, 3.0), 1.2, 0.0, (zone(1.0, 0.0, 0.9),), 1.0),
    "unequal pair on a substrate": Box(
        (-4.0, 4.0), (0.0, 3.0), 0.7, 2.0, (zone(-1.0, 0.0, 0.9), zone(1.0, 0.0, 0.8, 0.07, 0.25)), 1.5
    ),
    "balls off each other's lines": Box(
        (-3.5, 3.5),
        (-3.0, 3.5),
        1.0,
        0.0,
        (zone(-1.0, -0.6, 0.8), zone(1.1, -0.2, 0.7, 0.08), zone(0.3, 1.4, 0.6)),
        1.0,
    ),
}


def named_cells(mesh: Any, kind: str) -> dict[str, np.ndarray]:
    """Return the cells of a kind by the name of their physical group."""
    names = {int(tag): name for name, (tag, _) in mesh.field_data.items()}
    cells: dict[str, list[np.ndarray]] = {}
    for block, tags in zip(mesh.cells, mesh.cell_data["gmsh:physical"], strict=True):
        if block.type == kind:
            (tag,) = set(tags.tolist())
            cells.setdefault(names[tag], []).append(block.data)
    return {name: np.concatenate(parts) for name, parts in cells.items()}


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Written]:
    """Mesh a box of `BOXES` once and return what its file holds."""
    pytest.importorskip("gmsh")
    import meshio  # noqa: PLC0415

    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    folder: Path = tmp_path_factory.mktemp("meshes")
    known: dict[str, Written] = {}

    def build(name: str) -> Written:
        if name not in known:
            path = folder / f"{len(known)}.msh"
            reported = write_layer_mesh(BOXES[name], path)
            mesh = meshio.read(path)
            known[name] = Written(
                BOXES[name], mesh.points, named_cells(mesh, "tetra"), named_cells(mesh, "triangle"), reported
            )
        return known[name]

    return build
