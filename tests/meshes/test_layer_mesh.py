"""Contents of a mesh file: the whole box, its named parts, valid hexahedra, and mirror symmetry about the balls."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from linear_bem.errors import ThirdBodyError
from meshes.box import TAGS, Zone
from tests.meshes.conftest import SCENES, SIDES, Written, box_of, corner_jacobians, write_and_read

ROUNDOFF = 1e-12
"""Of sums over some thousand cells of order one."""
Build = Callable[[str, int], Written]
LARGE = ("three by three", "three by three without the middle", "nine at random")
every_scene = pytest.mark.parametrize(
    ("name", "elements"),
    [(name, elements) for name in SCENES for elements in (1, 2, 3) if elements < 3 or name not in LARGE],
)


@every_scene
def test_sound_hexahedra_fill_layer_and_substrate_exactly(written: Build, name: str, elements: int) -> None:
    mesh = written(name, elements)
    box = mesh.box
    base = (box.x[1] - box.x[0]) * (box.y[1] - box.y[0])
    depths = {"layer": box.thickness, "substrate": box.substrate}
    assert set(mesh.hexahedra) == {part for part, depth in depths.items() if depth > 0.0}
    for part, cells in mesh.hexahedra.items():
        corners = mesh.points[cells]
        jacobians = corner_jacobians(corners)
        assert jacobians.min() > 0.0
        # theory: for vertical columns the determinant is bilinear, so its mean is that of the corners
        assert jacobians.mean(axis=1).sum() == pytest.approx(base * depths[part], rel=ROUNDOFF)
        low, high = (-box.thickness, 0.0) if part == "layer" else (-box.thickness - box.substrate, -box.thickness)
        assert corners[..., 2].min() == pytest.approx(low, abs=ROUNDOFF)
        assert corners[..., 2].max() == pytest.approx(high, abs=ROUNDOFF)
    assert len(mesh.cells) == mesh.reported


@every_scene
def test_every_face_has_two_cells_or_is_on_a_named_side(written: Build, name: str, elements: int) -> None:
    mesh = written(name, elements)
    box = mesh.box
    faces = Counter(map(tuple, np.sort(np.concatenate([mesh.cells[:, side] for side in SIDES]), axis=1).tolist()))
    assert set(faces.values()) == {1, 2}
    dx, dy, dz = box.x[1] - box.x[0], box.y[1] - box.y[0], box.thickness + box.substrate
    sides = {
        "top": (2, 0.0, dx * dy),
        "bottom": (2, -dz, dx * dy),
        "x_low": (0, box.x[0], dy * dz),
        "x_high": (0, box.x[1], dy * dz),
        "y_low": (1, box.y[0], dx * dz),
        "y_high": (1, box.y[1], dx * dz),
    }
    assert set(mesh.quadrilaterals) == set(sides)
    for side, (axis, value, area) in sides.items():
        assert np.abs(mesh.points[mesh.quadrilaterals[side]][..., axis] - value).max() < ROUNDOFF
        assert mesh.area(side) == pytest.approx(area, rel=ROUNDOFF)
    outer = np.concatenate(list(mesh.quadrilaterals.values()))
    assert Counter(map(tuple, np.sort(outer, axis=1).tolist())) == {face: 1 for face, k in faces.items() if k == 1}
    assert set(np.unique(np.concatenate(list(mesh.volumes.values())))) == set(range(len(mesh.points)))


def test_physical_groups_carry_the_numbers_that_the_models_use(written: Build) -> None:
    assert written("touching pair on a substrate, quarter", 1).groups == TAGS


def offsets(mesh: Written, zone: Zone) -> set[tuple[tuple[float, float], ...]]:
    """Return the quadrilaterals on top of a zone's block by their corners' rounded offsets from the ball."""
    corners = mesh.points[mesh.quadrilaterals["top"]][..., :2] - np.array(zone.position)
    inside = np.all(np.abs(corners) < zone.half_width * (1.0 + 1e-9), axis=(1, 2))
    rounded = np.round(corners[inside] / (1e-10 * zone.half_width)).astype(int)
    return {tuple(sorted(map(tuple, quad))) for quad in rounded.tolist()}


@every_scene
def test_a_block_is_its_own_mirror_image_and_blocks_differ_by_scale_only(
    written: Build, name: str, elements: int
) -> None:
    mesh = written(name, elements)
    for zone in mesh.box.zones:
        found = offsets(mesh, zone)
        quadrants = mesh.box.quadrants(zone)
        rings = len(mesh.box.rings(zone)[0]) - 1
        assert len(found) == len(quadrants) * (elements**2 + 2 * elements * rings)
        for flip, whole in (((-1, 1), {s for s, _ in quadrants}), ((1, -1), {s for _, s in quadrants})):
            image = {tuple(sorted((x * flip[0], y * flip[1]) for x, y in quad)) for quad in found}
            # across a plane at which the box is cut, the other half is not there
            assert image == found if len(whole) == 2 else not image & found


@every_scene
def test_shapes_are_sound_inside_blocks_and_between_them(written: Build, name: str, elements: int) -> None:
    mesh = written(name, elements)
    centres = mesh.points[mesh.quadrilaterals["top"]][..., :2].mean(axis=1)
    inside = np.any([mesh.box.beyond(zone, centres) < 0.0 for zone in mesh.box.zones], axis=0)
    angles = mesh.top_angles()
    assert angles[inside].min() > 44.9  # a square's corner halved
    assert angles[inside].max() < 135.0
    # n = 1 leaves little room beside a mirror plane
    assert angles[~inside].min() > (15.0 if elements == 1 else 25.0)
    assert angles[~inside].max() < (172.0 if elements == 1 else 155.0)


@every_scene
def test_the_number_of_hexahedra_is_predicted_within_the_stated_error(written: Build, name: str, elements: int) -> None:
    mesh = written(name, elements)
    assert mesh.box.estimated_hexahedra() == pytest.approx(mesh.reported, rel=0.3)


@every_scene
def test_elements_in_the_plane_are_counted_as_the_file_has_them(written: Build, name: str, elements: int) -> None:
    from meshes.layer import counted  # noqa: PLC0415

    mesh = written(name, elements)
    quads, rim = counted(mesh.box)
    layers, substrate = mesh.box.levels()
    count = len(layers) - 1 + max(len(substrate) - 1, 0)
    assert (quads, quads * count) == (len(mesh.quadrilaterals["top"]), mesh.reported)
    assert rim * count == sum(len(mesh.quadrilaterals[side]) for side in ("x_low", "x_high", "y_low", "y_high"))
    assert len(mesh.points) == (4 * quads + rim + 1) * (2 * count + 1)  # of order 2


@pytest.mark.parametrize(("elements", "most"), [(1, 35), (2, 125), (3, 240)])
def test_the_quarter_of_a_touching_pair_needs_few_elements(written: Build, elements: int, most: int) -> None:
    assert len(written("touching pair on a substrate, quarter", elements).quadrilaterals["top"]) <= most


def test_the_same_box_gives_the_same_file(tmp_path: Path) -> None:
    pytest.importorskip("gmsh")
    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    for number in (0, 1):
        write_layer_mesh(SCENES["triangle"](2), tmp_path / f"{number}.msh")
    assert (tmp_path / "0.msh").read_bytes() == (tmp_path / "1.msh").read_bytes()


@pytest.mark.parametrize("unit", [1e-6, 8e-3, 1e3])
def test_the_mesh_does_not_depend_on_the_unit_of_length(written: Build, tmp_path: Path, unit: float) -> None:
    metres = written("touching pair on a substrate, quarter", 2)
    other = write_and_read(metres.box.in_units_of(1.0 / unit), tmp_path / "other.msh")
    assert np.array_equal(metres.cells, other.cells)
    assert other.points / unit == pytest.approx(metres.points, abs=1e-9)


def test_a_block_beyond_the_box_raises_and_writes_no_mesh(tmp_path: Path) -> None:
    pytest.importorskip("gmsh")
    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    box = box_of([(0.0, 0.0)], 0.4, 2)
    wide = replace(box, zones=(replace(box.zones[0], half_width=4.5),))
    with pytest.raises(ThirdBodyError):
        write_layer_mesh(wide, tmp_path / "wide.msh")
    assert not (tmp_path / "wide.msh").exists()


def test_the_mesh_reads_into_dolfinx_and_carries_linear_fields_exactly(tmp_path: Path) -> None:
    dolfinx = pytest.importorskip("dolfinx")
    import ufl  # noqa: PLC0415
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain import compat  # noqa: PLC0415
    from meshes.layer import write_layer_mesh  # noqa: PLC0415

    box = SCENES["touching pair on a substrate, quarter"](1)
    count = write_layer_mesh(box, tmp_path / "pair.msh")
    mesh, cells, facets = compat.read_mesh(tmp_path / "pair.msh", MPI.COMM_SELF)
    assert mesh.topology.index_map(3).size_local == count
    u = dolfinx.fem.Function(compat.function_space(mesh, 3, (3,)))
    u.interpolate(lambda x: np.stack([x[0], x[0] + x[1], x[2] + 2.0 * x[1]]))
    exact = {"quadrature_degree": 7}
    dx = ufl.Measure("dx", mesh, subdomain_data=cells, metadata=exact)
    ds = ufl.Measure("ds", mesh, subdomain_data=facets, metadata=exact)

    def total(form: object) -> float:
        return dolfinx.fem.assemble_scalar(compat.compile_form(form, MPI.COMM_SELF))

    (wide, broad), deep = (box.x[1], box.y[1]), box.thickness
    assert total(u[0] * dx(TAGS["layer"])) == pytest.approx(wide**2 / 2.0 * broad * deep, rel=1e-10)
    top = wide**2 / 2.0 * broad + wide * broad**2 / 2.0
    assert total(u[1] * ds(TAGS["top"])) == pytest.approx(top, rel=1e-10)
    assert total(ufl.grad(u)[2, 1] * dx(TAGS["layer"])) == pytest.approx(2.0 * wide * broad * deep, rel=1e-10)
    slope = ufl.grad(u) - ufl.as_matrix([[1, 0, 0], [1, 1, 0], [0, 2, 1]])
    assert total(ufl.inner(slope, slope) * dx) == pytest.approx(0.0, abs=1e-18 * wide * broad * deep)


@pytest.mark.parametrize("elements", [1, 2, 3])
def test_the_mesh_line_at_a_contact_edge_is_a_circle_between_corners_too(written: Build, elements: int) -> None:
    """The block's quadrilaterals within the contact radius fill the circle, up to the error of quadratic curves."""
    mesh = written("one ball", elements)
    (zone,) = mesh.box.zones
    nodes = mesh.points[mesh.faces["top"]][..., :2] - np.array(zone.position)
    radii = np.linalg.norm(nodes, axis=-1)
    on = np.abs(radii[:, :8] - zone.contact_radius) < 1e-9 * zone.contact_radius
    outer = radii.max(axis=1) < zone.contact_radius * (1.0 + 1e-9)
    assert outer.sum() >= 8 * elements
    rim = on & outer[:, None]
    assert rim[:, :4].sum() == 16 * elements  # both corners of each of the rim's 8 n sides
    assert rim[:, 4:].sum() == 8 * elements  # and its middle
    area = sum(_area(quad) for quad in nodes[outer])
    assert area == pytest.approx(math.pi * zone.contact_radius**2, rel=2e-3 / elements**3)


def _area(nodes: np.ndarray) -> float:
    """Return the area of a quadrilateral (9, 2) with quadratic sides, by Simpson's rule for int x dy round it."""
    total = 0.0
    for k in range(4):
        (a, m, b) = nodes[k], nodes[4 + k], nodes[(k + 1) % 4]
        for s, w in ((0.5 - math.sqrt(0.15), 5 / 18), (0.5, 4 / 9), (0.5 + math.sqrt(0.15), 5 / 18)):
            x = a[0] * (1 - s) * (1 - 2 * s) + 4 * m[0] * s * (1 - s) + b[0] * s * (2 * s - 1)
            total += w * x * (a[1] * (4 * s - 3) + 4 * m[1] * (1 - 2 * s) + b[1] * (4 * s - 1))
    return total
