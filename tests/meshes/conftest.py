from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshes.box import Box, Zone, half_widths

Points = list[tuple[float, float]]
SIDES = ([0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])
"""Corners of a hexahedron's faces."""


def box_of(
    positions: Points,
    contact: float | list[float],
    elements: int,
    planes: tuple[int, ...] = (),
    thickness: float = 1.16,
    substrate: float = 0.0,
) -> Box:
    """Return the box that ends four lengths outside the balls, or at x = 0 and y = 0 for the axes in ``planes``."""
    contacts = contact if isinstance(contact, list) else [contact] * len(positions)
    x, y = (
        (0.0 if axis in planes else min(p[axis] for p in positions) - 4.0, max(p[axis] for p in positions) + 4.0)
        for axis in (0, 1)
    )
    widths = half_widths(positions, contacts, x, y, planes)
    zones = tuple(Zone(*values) for values in zip(positions, contacts, widths, strict=True))
    return Box(x, y, thickness, substrate, zones, elements)


def scattered() -> Points:
    """Return nine positions at random, at least two lengths apart."""
    rng, found = np.random.default_rng(3), []
    while len(found) < 9:
        point = tuple(rng.uniform(-4.0, 4.0, 2).tolist())
        if all(math.dist(point, other) > 2.0 for other in found):
            found.append(point)
    return found


SCENES: dict[str, Callable[[int], Box]] = {
    "one ball": lambda n: box_of([(0.0, 0.0)], 0.4, n),
    "one ball, quarter": lambda n: box_of([(0.0, 0.0)], 0.4, n, (0, 1)),
    "touching pair on a substrate, quarter": lambda n: box_of([(1.0, 0.0)], 0.4, n, (0, 1), substrate=3.0),
    "touching pair on a film, quarter": lambda n: box_of([(1.0, 0.0)], 0.3, n, (0, 1), thickness=0.05),
    "distant pair, quarter": lambda n: box_of([(3.0, 0.0)], 0.4, n, (0, 1)),
    "unlike pair, half": lambda n: box_of([(-2.0, 0.0), (2.0, 0.0)], [0.15, 0.6], n, (1,)),
    "triangle": lambda n: box_of([(-1.0, 0.0), (1.0, 0.0), (0.0, math.sqrt(3.0))], 0.4, n),
    "triangle, half": lambda n: box_of([(1.0, 0.0), (0.0, math.sqrt(3.0))], 0.4, n, (0,)),
    "row of seven, quarter": lambda n: box_of([(2.0 * k, 0.0) for k in range(4)], 0.4, n, (0, 1)),
    "three by three, quarter": lambda n: box_of([(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0)], 0.4, n, (0, 1)),
    "three by three": lambda n: box_of([(2.0 * i, 2.0 * j) for i in range(3) for j in range(3)], 0.4, n),
    "three by three without the middle": lambda n: box_of(
        [(2.0 * i, 2.0 * j) for i in range(3) for j in range(3) if (i, j) != (1, 1)], 0.4, n
    ),
    "diamond, quarter": lambda n: box_of([(1.6, 0.0), (0.0, 1.6)], 0.4, n, (0, 1)),
    "merging pair, quarter": lambda n: box_of([(0.5, 0.0)], 0.7, n, (0, 1)),
    "nine at random": lambda n: box_of(scattered(), 0.4, n),
}


@dataclass(frozen=True)
class Written:
    """A mesh file as meshio reads it: points, and nodes of hexahedra (27) and quadrilaterals (9) by physical group.

    ``hexahedra`` and ``quadrilaterals`` are their corners, which come first.
    """

    box: Box
    points: np.ndarray
    volumes: dict[str, np.ndarray]
    faces: dict[str, np.ndarray]
    groups: dict[str, int]
    reported: int

    @property
    def hexahedra(self) -> dict[str, np.ndarray]:
        return {name: cells[:, :8] for name, cells in self.volumes.items()}

    @property
    def quadrilaterals(self) -> dict[str, np.ndarray]:
        return {name: cells[:, :4] for name, cells in self.faces.items()}

    @property
    def cells(self) -> np.ndarray:
        return np.concatenate(list(self.hexahedra.values()))

    def area(self, name: str) -> float:
        a, b, c, d = self.points[self.quadrilaterals[name]].transpose(1, 0, 2)
        return float(np.linalg.norm(np.cross(c - a, d - b), axis=1).sum() / 2.0)

    def top_angles(self) -> np.ndarray:
        """Return the angles (n, 4) [degrees] of the quadrilaterals on top, less than 180 each."""
        corners = self.points[self.quadrilaterals["top"]][..., :2]
        after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
        cosines = np.sum(after * before, axis=2) / np.linalg.norm(after, axis=2) / np.linalg.norm(before, axis=2)
        return np.degrees(np.arccos(cosines))


def corner_jacobians(corners: np.ndarray) -> np.ndarray:
    """Return the determinants (n, 8) at the corners (n, 8, 3) of hexahedra."""
    neighbours = [(1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)]
    answer = []
    for corner, others in enumerate(neighbours):
        answer.append(np.linalg.det(corners[:, list(others)] - corners[:, [corner]]))
    return np.stack(answer, axis=1)


def _named(mesh: Any, kind: str) -> dict[str, np.ndarray]:
    names = {int(tag): name for name, (tag, _) in mesh.field_data.items()}
    cells: dict[str, list[np.ndarray]] = {}
    for block, tags in zip(mesh.cells, mesh.cell_data["gmsh:physical"], strict=True):
        if block.type == kind:
            (tag,) = set(tags.tolist())
            cells.setdefault(names[tag], []).append(block.data)
    return {name: np.concatenate(parts) for name, parts in cells.items()}


def write_and_read(box: Box, path: Path) -> Written:
    import meshio  # noqa: PLC0415

    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    reported = write_layer_mesh(box, path)
    mesh = meshio.read(path)
    groups = {name: int(tag) for name, (tag, _) in mesh.field_data.items()}
    return Written(box, mesh.points, _named(mesh, "hexahedron27"), _named(mesh, "quad9"), groups, reported)


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Written]:
    """Mesh a scene of `SCENES` once and return what its file holds."""
    pytest.importorskip("gmsh")
    pytest.importorskip("meshio")
    folder: Path = tmp_path_factory.mktemp("meshes")
    known: dict[tuple[str, int], Written] = {}

    def build(name: str, elements: int) -> Written:
        if (name, elements) not in known:
            known[name, elements] = write_and_read(SCENES[name](elements), folder / f"{len(known)}.msh")
        return known[name, elements]

    return build
