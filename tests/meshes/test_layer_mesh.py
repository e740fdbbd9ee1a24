"""What a mesh file holds: all of the box, its named parts, sizes as asked for, and mirror images about the balls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from linear_bem import Ball, Elastic, Layer, Load, Problem
from meshes.box import TAGS, Box, Zone
from tests.meshes.conftest import BOXES, Written, named_cells

ROUNDOFF = 1e-12
"""Of sums over some thousand cells of order one."""
NAMES = list(BOXES)


@pytest.mark.parametrize("name", NAMES)
def test_tetrahedra_fill_layer_and_substrate_exactly(written: Callable[[str], Written], name: str) -> None:
    mesh = written(name)
    box = mesh.box
    base = (box.x[1] - box.x[0]) * (box.y[1] - box.y[0])
    depths = {"layer": box.thickness, "substrate": box.substrate}
    assert set(mesh.tetrahedra) == {part for part, depth in depths.items() if depth > 0.0}
    for part in mesh.tetrahedra:
        volumes = mesh.volumes(part)
        assert volumes.min() > 0.0
        assert volumes.sum() == pytest.approx(base * depths[part], rel=ROUNDOFF)
        heights = mesh.points[mesh.tetrahedra[part]][..., 2]
        low, high = (-box.thickness, 0.0) if part == "layer" else (-box.thickness - box.substrate, -box.thickness)
        assert heights.min() == pytest.approx(low, abs=ROUNDOFF)
        assert heights.max() == pytest.approx(high, abs=ROUNDOFF)
    assert len(mesh.cells) == mesh.reported


@pytest.mark.parametrize("name", NAMES)
def test_all_six_faces_are_tagged_and_complete(written: Callable[[str], Written], name: str) -> None:
    mesh = written(name)
    box = mesh.box
    dx, dy, dz = box.x[1] - box.x[0], box.y[1] - box.y[0], box.thickness + box.substrate
    faces = {
        "top": (2, 0.0, dx * dy),
        "bottom": (2, -dz, dx * dy),
        "x_low": (0, box.x[0], dy * dz),
        "x_high": (0, box.x[1], dy * dz),
        "y_low": (1, box.y[0], dx * dz),
        "y_high": (1, box.y[1], dx * dz),
    }
    assert set(mesh.triangles) == set(faces)
    for face, (axis, value, area) in faces.items():
        assert np.abs(mesh.points[mesh.triangles[face]][..., axis] - value).max() < ROUNDOFF
        assert mesh.area(face) == pytest.approx(area, rel=ROUNDOFF)


def test_physical_groups_carry_the_numbers_that_the_models_use(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    pytest.importorskip("gmsh")
    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    write_layer_mesh(BOXES["unequal pair on a substrate"], tmp_path / "box.msh")
    mesh = meshio.read(tmp_path / "box.msh")
    assert {name: int(tag) for name, (tag, _) in mesh.field_data.items()} == TAGS
    assert set(named_cells(mesh, "tetra")) | set(named_cells(mesh, "triangle")) == set(TAGS)


def mirrored_share(mesh: Written, chosen: Zone, axis: int) -> float:
    """Return the share of the tetrahedra about a zone's axis whose mirror image is a tetrahedron too."""
    offset = mesh.points[:, :2] - np.array(chosen.position)
    centroids = offset[mesh.cells].mean(axis=1)
    inside = np.all(np.abs(centroids) < chosen.mirror, axis=1)
    images = mesh.points.copy()
    images[:, axis] = 2.0 * chosen.position[axis] - images[:, axis]
    distance, partner = cKDTree(mesh.points).query(images)
    cells = mesh.cells[inside]
    matched = np.all(distance[cells] < 1e-4 * chosen.finest, axis=1)
    known = {tuple(cell) for cell in np.sort(cells, axis=1).tolist()}
    found = [tuple(cell) in known for cell in np.sort(partner[cells], axis=1).tolist()]
    return float(np.mean(matched & np.array(found)))


@pytest.mark.parametrize("axis", [0, 1], ids=["x", "y"])
@pytest.mark.parametrize(
    ("name", "number", "cut"),
    [
        ("one ball", 0, ()),
        ("a quarter of a pair", 0, (1,)),
        ("unequal pair on a substrate", 0, (1,)),
        ("unequal pair on a substrate", 1, (1,)),
        ("balls off each other's lines", 0, ()),
        ("balls off each other's lines", 1, ()),
        ("balls off each other's lines", 2, ()),
    ],
)
def test_the_mesh_about_each_ball_is_its_own_mirror_image(
    written: Callable[[str], Written], name: str, number: int, cut: tuple[int, ...], axis: int
) -> None:
    mesh = written(name)
    share = mirrored_share(mesh, mesh.box.zones[number], axis)
    # across a plane at which the box is cut, the other half is not there
    assert share == (0.0 if axis in cut else 1.0)


def test_without_mirroring_the_mesh_is_not_symmetric(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    pytest.importorskip("gmsh")
    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    box = BOXES["one ball"]
    plain = replace(box, zones=(replace(box.zones[0], mirror=0.0),))
    count = write_layer_mesh(plain, tmp_path / "plain.msh")
    mesh = meshio.read(tmp_path / "plain.msh")
    read = Written(plain, mesh.points, named_cells(mesh, "tetra"), named_cells(mesh, "triangle"), count)
    assert mirrored_share(read, box.zones[0], 0) < 0.5


@pytest.mark.parametrize("name", NAMES)
def test_element_size_follows_the_field(written: Callable[[str], Written], name: str) -> None:
    mesh = written(name)
    cells = mesh.tetrahedra["layer"]
    centroids = mesh.points[cells].mean(axis=1)
    asked = mesh.box.element_size(centroids)
    ratio = mesh.mean_edges(cells) / asked
    # where the field grows by 0.3 per length, an edge and the size asked for at its middle differ by some ten per cent
    assert np.median(ratio) == pytest.approx(1.0, abs=0.2)
    assert np.quantile(ratio, 0.98) < 1.6
    for zone in mesh.box.zones:
        near = np.linalg.norm(centroids - np.array([*zone.position, 0.0]), axis=1) < 2.0 * zone.finest
        assert mesh.mean_edges(cells[near]).mean() < 2.0 * zone.finest


def default_box() -> Box:
    """Return the main mesh's box of the paper's thin pair at the default accuracy."""
    from finite_strain.planning import plan_run  # noqa: PLC0415

    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 1.16), balls, Load("force", (2.66666e-3,) * 2), Elastic(1e3, 0.3))
    return plan_run(problem, 0.02, "finite_strain").boxes[1]


@pytest.mark.parametrize("name", [*NAMES, "default"])
def test_the_number_of_tetrahedra_is_foreseen_within_the_stated_error(
    written: Callable[[str], Written], name: str, tmp_path: Path
) -> None:
    if name == "default":
        from meshes.layer import write_layer_mesh  # noqa: PLC0415

        box = default_box()
        count = write_layer_mesh(box, tmp_path / "default.msh")
    else:
        box, count = BOXES[name], written(name).reported
    # theory: 40 % is what `Box.estimated_tetrahedra` states
    assert box.estimated_tetrahedra() == pytest.approx(count, rel=0.4)
