"""Tetrahedral meshes of a `Box`, mirror-symmetric about each ball's axis in the contact zones.

A mesh that is not symmetric about a ball's axis gives the ball a spurious in-plane force. So gmsh
meshes one quadrant of the prism about each ball, with its outer faces as periodic masters of the
other quadrants' faces; the other quadrants are then replaced by mirror images of the first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import gmsh
import numpy as np

from linear_bem.errors import ThirdBodyError, UnsupportedProblem
from meshes.box import TAGS, Box, Zone

Quadrant = tuple[int, int]


@contextmanager
def gmsh_session() -> Iterator[None]:
    """Run gmsh for the length of a with block: silent, one thread, Ctrl-C left to Python."""
    gmsh.initialize([], False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("General.NumThreads", 1)
    try:
        yield
    finally:
        gmsh.finalize()


def write_layer_mesh(box: Box, path: Path) -> int:
    """Mesh the box, write it with its physical groups (`TAGS`) to a .msh file; return the number of tetrahedra."""
    # gmsh's geometric tolerances are absolute, so it meshes in units of the problem and the points are scaled back
    unit = max(zone.radius for zone in box.zones)
    with gmsh_session():
        try:
            points, tetrahedra, volume = _mesh(box.in_units_of(unit))
        except Exception as error:  # gmsh raises the base class itself
            if isinstance(error, ThirdBodyError):
                raise
            raise UnsupportedProblem(
                f"gmsh makes no mesh of this scene ({error}): a layer {box.thickness:.3g} m thick, contacts down to "
                f"{min(zone.radius for zone in box.zones):.3g} m, a box {box.x[1] - box.x[0]:.3g} m wide; lengths that "
                "differ by more than a thousand times are better left to linear_bem"
            ) from error
    points *= unit
    with gmsh_session():
        _write(box, points, tetrahedra, volume, path)
    return len(tetrahedra)


def _quadrants(box: Box, zone: Zone) -> list[Quadrant]:
    """Return the quadrants about the zone's axis that lie in the box (symmetry planes cut some off)."""
    tolerance = 1e-9 * (box.x[1] - box.x[0] + box.y[1] - box.y[0])
    x, y = zone.position
    signs_x = [s for s in (1, -1) if box.x[0] - tolerance < x + s * zone.mirror < box.x[1] + tolerance]
    signs_y = [s for s in (1, -1) if box.y[0] - tolerance < y + s * zone.mirror < box.y[1] + tolerance]
    return [(sx, sy) for sx in signs_x for sy in signs_y]


def _slabs(box: Box) -> list[tuple[float, float, str]]:
    slabs = [(-box.thickness, 0.0, "layer")]
    if box.substrate > 0.0:
        slabs.append((-box.thickness - box.substrate, -box.thickness, "substrate"))
    return slabs


def _mesh(box: Box) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, tetrahedra and whether each lies in the layer (1) or the substrate (2)."""
    occ = gmsh.model.occ
    parts = []
    for low, high, _ in _slabs(box):
        parts.append((3, occ.addBox(box.x[0], box.y[0], low, box.x[1] - box.x[0], box.y[1] - box.y[0], high - low)))
        for zone in box.zones:
            if zone.mirror == 0.0:
                continue
            for sx, sy in _quadrants(box, zone):
                x, y = zone.position
                d = zone.mirror
                parts.append((3, occ.addBox(min(x, x + sx * d), min(y, y + sy * d), low, d, d, high - low)))
    if len(parts) > 1:  # gmsh refuses to fragment a single box
        occ.fragment(parts, [])
    occ.synchronize()
    _set_sizes(box)
    for zone in box.zones:
        _make_faces_periodic(box, zone)
    gmsh.model.mesh.generate(3)
    return _mirrored(box)


def _set_sizes(box: Box) -> None:
    field = gmsh.model.mesh.field
    ids = []
    for zone in box.zones:
        (x, y), rc = zone.position, zone.radius
        r = f"sqrt((x-({x!r}))^2+(y-({y!r}))^2+z^2)"
        beyond = f"(({r}-{rc!r})+abs({r}-{rc!r}))/2"
        size = f"{zone.finest!r}+{zone.growth!r}*({r}-{beyond})+{zone.outer_growth!r}*{beyond}"
        if math.isfinite(zone.far_radius):
            far = f"(({r}-{zone.far_radius!r})+abs({r}-{zone.far_radius!r}))/2"
            size += f"+({zone.far_growth - zone.outer_growth!r})*{far}"
        ids.append(field.add("MathEval"))
        field.setString(ids[-1], "F", size)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", ids)
    field.setAsBackgroundMesh(smallest)
    for option, value in {
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeFromCurvature": 0,
        "Mesh.MeshSizeMax": box.coarsest,
        "Mesh.Algorithm": 6,
        "Mesh.Algorithm3D": 1,
        "Mesh.Optimize": 1,
        "Mesh.RandomSeed": 1,
    }.items():
        gmsh.option.setNumber(option, value)


def _face(corner: np.ndarray, opposite: np.ndarray) -> list[int]:
    low, high = np.minimum(corner, opposite), np.maximum(corner, opposite)
    tolerance = 1e-6 * float(np.max(high - low))
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*(low - tolerance), *(high + tolerance), dim=2)]


def _reflection(zone: Zone, signs: Quadrant) -> np.ndarray:
    """Return the affine map (4, 4) from quadrant (+, +) relative to the master's signs to another."""
    affine = np.eye(4)
    for axis in (0, 1):
        affine[axis, axis] = signs[axis]
        affine[axis, 3] = zone.position[axis] * (1 - signs[axis])
    return affine


def _make_faces_periodic(box: Box, zone: Zone) -> None:
    quadrants = _quadrants(box, zone) if zone.mirror > 0.0 else []
    centre = np.array(zone.position)
    for low, high, _ in _slabs(box):
        for axis in (0, 1):
            other = 1 - axis

            def outer(quadrant: Quadrant, axis: int = axis, other: int = other, z: tuple = (low, high)) -> list[int]:
                start, end = np.empty(3), np.empty(3)
                start[axis] = end[axis] = centre[axis] + quadrant[axis] * zone.mirror
                start[other], end[other] = centre[other], centre[other] + quadrant[other] * zone.mirror
                start[2], end[2] = z
                return _face(start, end)

            for quadrant in quadrants[1:]:
                signs = (quadrant[0] * quadrants[0][0], quadrant[1] * quadrants[0][1])
                affine = _reflection(zone, signs)
                gmsh.model.mesh.setPeriodic(2, outer(quadrant), outer(quadrants[0]), affine.ravel().tolist())


def _inside(zone: Zone, quadrant: Quadrant, centroids: np.ndarray) -> np.ndarray:
    offset = (centroids[:, :2] - np.array(zone.position)) * np.array(quadrant)
    return np.all((offset > 0.0) & (offset < zone.mirror), axis=1)


def _mirrored(box: Box) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    node_tags, coordinates, _ = gmsh.model.mesh.getNodes()
    points = coordinates.reshape(-1, 3)
    index = np.zeros(int(node_tags.max()) + 1, dtype=np.int64)
    index[node_tags.astype(np.int64)] = np.arange(len(node_tags))
    _, nodes = gmsh.model.mesh.getElementsByType(4)
    cells = index[nodes.astype(np.int64)].reshape(-1, 4)
    centroids = points[cells].mean(axis=1)
    keep = np.ones(len(cells), dtype=bool)
    images: list[np.ndarray] = []
    for zone in box.zones:
        quadrants = _quadrants(box, zone) if zone.mirror > 0.0 else []
        for quadrant in quadrants[1:]:
            keep &= ~_inside(zone, quadrant, centroids)
            master = _inside(zone, quadrants[0], centroids)
            signs = (quadrant[0] * quadrants[0][0], quadrant[1] * quadrants[0][1])
            affine = _reflection(zone, signs)
            images.append(points[cells[master]] @ affine[:3, :3].T + affine[:3, 3])
    corners = np.concatenate([points[cells[keep]], *images])
    points, cells = _merge(corners, box)
    volumes = np.einsum(
        "ij,ij->i",
        np.cross(points[cells[:, 1]] - points[cells[:, 0]], points[cells[:, 2]] - points[cells[:, 0]]),
        points[cells[:, 3]] - points[cells[:, 0]],
    )
    flipped = volumes < 0.0
    cells[flipped] = cells[flipped][:, [0, 2, 1, 3]]
    expected = (box.x[1] - box.x[0]) * (box.y[1] - box.y[0]) * (box.thickness + box.substrate)
    if abs(np.abs(volumes).sum() / 6.0 - expected) > 1e-9 * expected:
        raise ThirdBodyError(f"mesh: tetrahedra fill {np.abs(volumes).sum() / 6.0:.12g} m^3 of {expected:.12g} m^3")
    volume = np.where(points[cells].mean(axis=1)[:, 2] > -box.thickness, TAGS["layer"], TAGS["substrate"])
    return points, cells, volume


def _merge(corners: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Merge equal corners (n, 4, 3) of the tetrahedra into numbered points."""
    finest = min(zone.finest for zone in box.zones)
    flat = corners.reshape(-1, 3)
    keys = np.round(flat / (1e-5 * finest)).astype(np.int64)
    order = np.lexsort(keys.T)
    moved = np.any(np.abs(np.diff(keys[order], axis=0)) > 1, axis=1)
    number = np.concatenate([[0], np.cumsum(moved)])
    inverse = np.empty(len(flat), dtype=np.int64)
    inverse[order] = number
    points = np.empty((number[-1] + 1, 3))
    points[inverse] = flat
    return points, inverse.reshape(-1, 4)


def _write(box: Box, points: np.ndarray, cells: np.ndarray, volume: np.ndarray, path: Path) -> None:
    """Write discrete entities: two volumes, six faces, each with its physical group."""
    model = gmsh.model
    faces = _outer_faces(cells)
    groups = _face_groups(box, points[faces])
    if len(faces) != sum(len(g) for g in groups.values()):
        raise ThirdBodyError("mesh: the mirrored quadrants do not match their neighbours (inner faces are left open)")
    first = True
    for name in ("layer", "substrate"):
        chosen = cells[volume == TAGS[name]]
        if len(chosen):
            model.addDiscreteEntity(3, TAGS[name])
            if first:
                model.mesh.addNodes(3, TAGS[name], np.arange(1, len(points) + 1), points.ravel())
                first = False
            model.mesh.addElementsByType(TAGS[name], 4, [], (chosen + 1).ravel())
            model.addPhysicalGroup(3, [TAGS[name]], TAGS[name])
            model.setPhysicalName(3, TAGS[name], name)
    for name, selected in groups.items():
        model.addDiscreteEntity(2, TAGS[name])
        model.mesh.addElementsByType(TAGS[name], 2, [], (faces[selected] + 1).ravel())
        model.addPhysicalGroup(2, [TAGS[name]], TAGS[name])
        model.setPhysicalName(2, TAGS[name], name)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(path))


def _outer_faces(cells: np.ndarray) -> np.ndarray:
    faces = np.concatenate([cells[:, list(c)] for c in itertools.combinations(range(4), 3)])
    _, start, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[start[count == 1]]


def _face_groups(box: Box, corners: np.ndarray) -> dict[str, np.ndarray]:
    planes = {
        "top": (2, 0.0),
        "bottom": (2, -box.thickness - box.substrate),
        "x_low": (0, box.x[0]),
        "x_high": (0, box.x[1]),
        "y_low": (1, box.y[0]),
        "y_high": (1, box.y[1]),
    }
    tolerance = 1e-3 * min(zone.finest for zone in box.zones)
    return {
        name: np.flatnonzero(np.all(np.abs(corners[:, :, axis] - value) < tolerance, axis=1))
        for name, (axis, value) in planes.items()
    }
