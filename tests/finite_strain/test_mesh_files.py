"""Mesh files: their groups by name, cells that DOLFINx cannot read, and what is wrong in them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
import gmsh
from mpi4py import MPI

from finite_strain import TAGS, compat
from finite_strain.own_mesh import OwnMesh
from linear_bem import InvalidProblem
from meshes.layer import gmsh_session

COMM = MPI.COMM_SELF


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        ((), "has no physical groups of volumes; add groups with the names layer"),
        ((((3, "layer"), 1),), "has no physical groups of faces; add groups with the names top and bottom"),
        ((((3, "layer"), 1), ((3, "rest"), 1)), r"volumes \[1\] are in two physical groups; put each into one"),
        ((((3, "layer"), 1), ((2, "top"), 6), ((2, "bottom"), 11)), "faces of the group bottom belong to no volume"),
        ((((3, "layer"), 1), ((2, "top"), 6), ((2, "none"), 6)), r"faces \[6\] are in two physical groups"),
        (None, "write it by gmsh.write"),
    ],
)
def test_what_is_wrong_in_a_mesh_file_is_said_with_its_name(groups: Any, words: str, tmp_path: Path) -> None:
    file = tmp_path / "block.msh"
    if groups is None:
        file.write_text("no mesh\n", encoding="utf-8")
    else:
        with gmsh_session():
            gmsh.model.occ.addBox(0.0, 0.0, -1.0, 1.0, 1.0, 1.0)
            gmsh.model.occ.addBox(0.0, 0.0, -2.0, 1.0, 1.0, 0.5)  # in no group
            gmsh.model.occ.synchronize()
            for (dimension, name), entity in groups:
                gmsh.model.setPhysicalName(dimension, gmsh.model.addPhysicalGroup(dimension, [entity]), name)
            gmsh.model.mesh.generate(3)
            gmsh.write(str(file))
    with pytest.raises(InvalidProblem, match=f"mesh: .*{file}.*{words}"):
        compat.read_mesh(file, COMM)


@pytest.mark.parametrize(
    ("options", "cells"),
    [
        ({"Mesh.RecombineAll": 0}, "Prism 6"),
        ({"Mesh.RecombineAll": 1, "Mesh.ElementOrder": 3}, "Hexahedron 64"),
        ({"Mesh.RecombineAll": 1, "Mesh.ElementOrder": 2, "Mesh.SecondOrderIncomplete": 1}, "Hexahedron 20"),
        (None, "Hexahedron 8 and Prism 6"),
    ],
)
def test_cells_that_dolfinx_cannot_read_are_named(options: dict[str, int] | None, cells: str, tmp_path: Path) -> None:
    path = tmp_path / "own.msh"
    with gmsh_session():
        occ, model = gmsh.model.occ, gmsh.model
        faces = [(2, occ.addRectangle(x, 0.0, 0.0, 1.0, 1.0)) for x in (0.0, 1.0)]
        faces = occ.fragment(faces[:1], faces[1:])[0]
        occ.extrude(faces, 0.0, 0.0, -1.0, [1], [1.0], recombine=True)
        occ.synchronize()
        model.addPhysicalGroup(3, [tag for _, tag in model.getEntities(3)], TAGS["layer"])
        model.addPhysicalGroup(2, [tag for _, tag in faces], TAGS["top"])
        if options is None:
            model.mesh.setRecombine(2, faces[0][1])
        for name, value in (options or {}).items():
            gmsh.option.setNumber(name, value)
        model.mesh.generate(3)
        gmsh.write(str(path))
    with pytest.raises(InvalidProblem, match=rf"mesh: .*own\.msh: cells must be .* got {cells}; .* recombine"):
        OwnMesh(path, COMM)


def test_cells_curved_by_more_than_order_2_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.msh"
    with gmsh_session():
        gmsh.model.occ.addBox(0.0, 0.0, -1.0, 2.0, 2.0, 1.0)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], TAGS["layer"])
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], TAGS["top"])
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(3)
        gmsh.write(str(path))
    with pytest.raises(InvalidProblem, match="a tetrahedron must have 4 or 10 nodes, got 20"):
        OwnMesh(path, COMM)


@pytest.mark.parametrize("written", [str.lower, str.title])
def test_groups_of_a_file_are_known_by_name(written: Callable[[str], str], tmp_path: Path) -> None:
    path = tmp_path / "own.msh"
    with gmsh_session():
        parts = [(3, gmsh.model.occ.addBox(x, 0.0, -1.0, 1.0, 2.0, 1.0)) for x in (0.0, 1.0)]
        gmsh.model.occ.fragment(parts[:1], parts[1:])
        gmsh.model.occ.synchronize()
        gmsh.model.setPhysicalName(3, gmsh.model.addPhysicalGroup(3, [1, 2]), written("layer"))
        groups = defaultdict(list)
        for _, tag in gmsh.model.getEntities(2):
            x, _, z = gmsh.model.occ.getCenterOfMass(2, tag)
            if abs(z + 0.5) > 0.4:
                name = "top" if z > -0.5 else "bottom"
                groups[written(name) if x < 1.0 else name].append(tag)
        for name, tags in groups.items():  # none has its number in `TAGS`
            gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, tags), name)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    mesh, cells, facets = compat.read_mesh(path, COMM)
    assert set(cells.values) == {TAGS["layer"]}
    points = mesh.geometry.x
    for name, z in (("top", 0.0), ("bottom", -1.0)):
        space = compat.function_space(mesh, 1)
        faces = dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda x, z=z: np.isclose(x[2], z))
        assert np.array_equal(np.sort(facets.find(TAGS[name])), np.sort(faces))
        dofs = dolfinx.fem.locate_dofs_topological(space, 2, facets.find(TAGS[name]))
        assert np.allclose(space.tabulate_dof_coordinates()[dofs, 2], z)
    assert np.ptp(points[:, 2]) == pytest.approx(1.0)
