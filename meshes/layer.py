"""Hexahedral meshes of a `Box`: quadrilaterals in the plane, swept through layer and substrate."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import gmsh
import numpy as np

from linear_bem.errors import ThirdBodyError, UnsupportedProblem
from meshes.box import SIDES, TAGS, Box
from meshes.plane import halved, open_edges, plane_mesh

HEXAHEDRON, QUADRILATERAL = 12, 10
"""gmsh's element types: of second order, with 27 and 9 nodes."""
_LEVEL = [0] * 4 + [2] * 4 + [0, 0, 1, 0, 1, 0, 1, 1, 2, 2, 2, 2] + [0, 1, 1, 1, 1, 2, 1]
_PLACE = [*range(4), *range(4), 4, 7, 0, 5, 1, 6, 2, 3, 4, 7, 5, 6, 8, 4, 7, 5, 6, 8, 8]
"""Positions of gmsh's nodes of a hexahedron: level from below, and number in the quadrilateral."""
_FACES = [[0, 3, 2, 1, 9, 13, 11, 8, 20], [4, 5, 6, 7, 16, 18, 19, 17, 25],
          [0, 1, 5, 4, 8, 12, 16, 10, 21], [1, 2, 6, 5, 11, 14, 18, 12, 23],
          [2, 3, 7, 6, 13, 15, 19, 14, 24], [3, 0, 4, 7, 9, 10, 17, 15, 22]]  # fmt: skip
"""Nodes of a hexahedron's faces: corners, middles of sides, centre."""


@contextmanager
def gmsh_session() -> Iterator[None]:
    """Run gmsh inside a with block: no output, one thread, Ctrl-C handled by Python."""
    gmsh.initialize([], False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("General.NumThreads", 1)
    try:
        yield
    finally:
        gmsh.finalize()


def write_layer_mesh(box: Box, path: Path) -> int:
    """Mesh the box, write it with its physical groups (`TAGS`) to a .msh file, and return the number of hexahedra."""
    unit = _unit(box)
    scaled = box.in_units_of(unit)
    plane, quads = _plane(box)
    layer, substrate = scaled.levels()
    levels = np.concatenate([layer, substrate[1:]])
    heights = halved(levels)
    points = np.concatenate([np.column_stack([plane, np.full(len(plane), z)]) for z in heights])
    column = np.stack([quads + 2 * len(plane), quads + len(plane), quads], axis=1)  # from below
    cells = np.concatenate([column[:, _LEVEL, _PLACE] + 2 * k * len(plane) for k in range(len(levels) - 1)])
    _check(scaled, points, cells)
    in_layer = np.arange(len(cells)) < (len(layer) - 1) * len(quads)
    with gmsh_session():
        _write(scaled, unit, points, cells, in_layer, path)
    return len(cells)


@lru_cache(maxsize=32)
def counted(box: Box) -> tuple[int, int]:
    """Mesh the box in the plane; return the numbers of quadrilaterals and of edges along its sides."""
    quads = _plane(box)[1]
    return len(quads), len(open_edges(quads[:, :4]))


def _unit(box: Box) -> float:
    """Return the unit of length [m] for meshing: gmsh's geometric tolerances are absolute."""
    return max(zone.half_width for zone in box.zones)


def _plane(box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Return the mesh of a box in the plane, see `plane_mesh`, in units of `_unit`."""
    with gmsh_session():
        try:
            return plane_mesh(box.in_units_of(_unit(box)))
        except Exception as error:  # gmsh raises the base class itself
            if isinstance(error, ThirdBodyError):
                raise
            raise UnsupportedProblem(
                f"gmsh cannot mesh this scene ({error}): a layer {box.thickness:.3g} m thick, contacts down to "
                f"{min(zone.contact_radius for zone in box.zones):.3g} m, a box {box.x[1] - box.x[0]:.3g} m wide; "
                "lengths that differ by more than a thousand times are better left to linear_bem"
            ) from error


def _check(box: Box, points: np.ndarray, cells: np.ndarray) -> None:
    """Raise `ThirdBodyError` unless every hexahedron is convex at its corners and all together fill the box."""
    corners = points[cells]
    base = corners[:, :4, :2]
    after, before = np.roll(base, -1, axis=1) - base, np.roll(base, 1, axis=1) - base
    heights = corners[:, 4, 2] - corners[:, 0, 2]
    jacobians = (after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]) * heights[:, None]
    if jacobians.min() <= 0.0:
        raise ThirdBodyError(f"mesh: {np.sum(jacobians.min(axis=1) <= 0.0)} hexahedra are folded")
    filled = 0.25 * jacobians.sum()  # the mean of a bilinear map's corners is its area
    expected = (box.x[1] - box.x[0]) * (box.y[1] - box.y[0]) * (box.thickness + box.substrate)
    if abs(filled - expected) > 1e-9 * expected:
        raise ThirdBodyError(f"mesh: hexahedra fill {filled / expected:.12g} of the box")


def _write(box: Box, unit: float, points: np.ndarray, cells: np.ndarray, in_layer: np.ndarray, path: Path) -> None:
    """Write discrete entities: two volumes, six faces, each with its physical group."""
    model = gmsh.model
    faces = _outer_faces(cells)
    planes = {"top": (2, 0.0), "bottom": (2, -box.thickness - box.substrate)}
    planes |= {name: (axis, (box.x, box.y)[axis][end]) for name, (axis, end) in SIDES.items()}
    groups = {name: faces[np.all(points[faces][..., axis] == end, axis=1)] for name, (axis, end) in planes.items()}
    if len(faces) != sum(len(group) for group in groups.values()):
        raise ThirdBodyError("mesh: blocks and filler do not match (inner faces are left open)")
    parts = {"layer": cells[in_layer], "substrate": cells[~in_layer]}
    for dimension, kind, named in ((3, HEXAHEDRON, parts), (2, QUADRILATERAL, groups)):
        for name, chosen in named.items():
            if len(chosen) == 0:
                continue
            model.addDiscreteEntity(dimension, TAGS[name])
            if name == "layer":
                model.mesh.addNodes(3, TAGS[name], np.arange(1, len(points) + 1), (unit * points).ravel())
            model.mesh.addElementsByType(TAGS[name], kind, [], (chosen + 1).ravel())
            model.addPhysicalGroup(dimension, [TAGS[name]], TAGS[name])
            model.setPhysicalName(dimension, TAGS[name], name)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(path))


def _outer_faces(cells: np.ndarray) -> np.ndarray:
    """Return the faces (n, 9) that belong to one hexahedron only, counter-clockwise seen from outside."""
    faces = np.concatenate([cells[:, side] for side in _FACES])
    _, start, count = np.unique(np.sort(faces[:, :4], axis=1), axis=0, return_index=True, return_counts=True)
    return faces[np.sort(start[count == 1])]
