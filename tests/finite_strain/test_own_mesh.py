"""A mesh that users bring: it gives a scene's answer, tetrahedra as well, and what does not fit is refused."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
from dolfinx.mesh import CellType, create_box, locate_entities_boundary, meshtags
from mpi4py import MPI
from scipy.spatial import Delaunay

import finite_strain
from finite_strain import TAGS
from finite_strain.geometry.load_control import prescribed
from finite_strain.own_mesh import OwnMesh
from linear_bem import Elastic, InvalidProblem, Load, Problem
from linear_bem.result import FAINT
from linear_bem.solver import solve
from tests.finite_strain.scenes import COARSER, ONE_LOAD, SHAPES, at_small_strain, pair, relatively, single
from tests.launch import mpirun

COMM = MPI.COMM_SELF
X = (0.0, 0.4, 0.7, 0.87, 1.0, 1.13, 1.3, 1.6, 2.3, 3.4)
Y = (0.0, 0.12, 0.3, 0.7, 1.4, 2.6)
Z = (-1.16, -0.6, -0.2, 0.0)
"""Lines of a quarter of the thin pair, graded towards the contact of the ball at x = 1."""
SPARSE = {"x": (0.0, 0.7, 0.87, 1.0, 1.13, 1.3, 2.3), "y": (0.0, 0.12, 0.3, 1.0), "z": (-1.16, -0.4, 0.0)}
"""Fewer lines of it, for claims that no accuracy matters to."""
SOLVERS = {"factors": {}, "multigrid": {"direct_up_to": "0"}}
CENTRED = (0.0, 0.1, 0.2, 0.35, 0.6, 1.0, 1.6)
"""Lines towards a ball at the origin."""


def tagged(mesh: Any, facets: dict[str, float], skip: int = 0) -> tuple[Any, Any, Any]:
    """Return a mesh with its cells as layer and the facets at each height tagged, all but the first ``skip``."""
    cells = np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32)
    found = {name: locate_entities_boundary(mesh, 2, lambda x, z=z: np.isclose(x[2], z)) for name, z in facets.items()}
    numbers = np.concatenate([[], *([TAGS[name]] * len(each) for name, each in found.items())]).astype(np.int32)
    there = np.concatenate([[], *found.values()]).astype(np.int32)
    order = np.argsort(there)[skip:]
    return (
        mesh,
        meshtags(mesh, 3, cells, np.full_like(cells, TAGS["layer"])),
        meshtags(mesh, 2, there[order], numbers[order]),
    )


def block(
    kind: Any = CellType.hexahedron, x: Any = X, y: Any = Y, z: Any = Z, facets: tuple[str, ...] = ("top", "bottom"),
    skip: int = 0, comm: Any = COMM, **options: Any,
) -> tuple[Any, Any, Any]:  # fmt: skip
    """Return a box between lines, whose top and bottom are tagged."""
    counts = [len(lines) - 1 for lines in (x, y, z)]
    mesh = create_box(comm, [np.zeros(3), np.array(counts, dtype=float)], counts, kind, **options)
    for axis, lines in enumerate((x, y, z)):
        mesh.geometry.x[:, axis] = np.interp(mesh.geometry.x[:, axis], np.arange(len(lines)), lines)
    heights = {"top": z[-1], "bottom": z[0]}
    return tagged(mesh, {name: heights[name] for name in facets}, skip)


SMALL = at_small_strain(pair(0.1, poisson=0.3, shape=SHAPES["small_strain"]))
OF_SCENE: dict[str, Any] = {"model": "small_strain", "accuracy": 0.3, "numerics": COARSER}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """The answer of a scene's run, and its folder with its mesh."""
    folder = tmp_path_factory.mktemp("scene")
    return finite_strain.solve(SMALL, folder=folder, **OF_SCENE), folder


@pytest.fixture(scope="module")
def on_two(scene: tuple[Any, Path]) -> Any:
    done = mpirun(2, "-m", "tests.finite_strain.own_mesh", scene[1], timeout=600.0)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.mpi
def test_the_mesh_of_a_scenes_run_gives_the_scenes_answer_on_two_ranks(on_two: Any, scene: tuple[Any, Path]) -> None:
    of_scene, own = scene[0].balls[0], on_two["file"]["balls"][0]  # at finite strain, on one rank: the tutorial
    assert own["normal_force"] == relatively(of_scene.normal_force, 1e-8)
    assert own["tangential_force"][0] == relatively(of_scene.tangential_force[0], 1e-8)
    assert own["tangential_force_error"] == relatively(of_scene.tangential_force_error, 1e-6)
    assert on_two["alike"] == [True, True]  # read by the user, the mesh is the file's


def on_block(meshed: Any, folder: Path) -> tuple[Any, Any, Any]:
    """Return the answer on a mesh, the mesh that a user's function got, and the fields written."""
    seen: list[Any] = []
    answer = finite_strain.solve(
        SMALL, model="small_strain", accuracy=0.3, mesh=meshed, folder=folder, comm=COMM, numerics=ONE_LOAD,
        inspect=lambda _, functions: seen.append(functions["displacement"].function_space.mesh),
    )  # fmt: skip
    from runs.pictures.written_step import read_step  # noqa: PLC0415

    return answer, seen[0], read_step(folder / "step_0001.h5", 1)


@pytest.fixture(scope="module")
def hexahedra(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any, Any]:
    return on_block(block(), tmp_path_factory.mktemp("hexahedra"))


@pytest.mark.parametrize("kind", [CellType.hexahedron, CellType.tetrahedron])
def test_a_mesh_without_blocks_meets_the_boundary_element_model(
    kind: Any, hexahedra: tuple[Any, Any, Any], tmp_path: Path
) -> None:
    answer, mesh, step = hexahedra if kind == CellType.hexahedron else on_block(block(kind), tmp_path)
    exact, ball = solve(SMALL, 1e-4).balls[0], answer.balls[0]
    # discretisation and truncation; tetrahedra without mirror images about the ball's axis: 6e-3, and 0.10 of T
    assert ball.normal_force == relatively(exact.normal_force, 5e-3 if kind == CellType.hexahedron else 8e-3)
    scale = answer.solved.accuracy["relative_to"]["force"]
    skew = 0.05 if kind == CellType.hexahedron else 0.15
    assert abs(ball.tangential_force[0] - exact.tangential_force[0]) < skew * scale
    assert isinstance(mesh, dolfinx.mesh.Mesh)
    corners = step.points[step.cells]
    top = np.isclose(step.points[:, 2], 0.0)
    triangles = Delaunay(step.points[top, :2])
    places = triangles.points[triangles.simplices]
    areas = 0.5 * np.abs(np.linalg.det(places[:, 1:] - places[:, :1]))
    carried = np.sum(areas * step.fields["contact_pressure"][top][triangles.simplices].mean(axis=1))
    # the pressure linear between nodes; on tetrahedra of the mean of hat functions
    assert carried == relatively(2.0 * ball.normal_force, 0.05)
    if kind == CellType.tetrahedron:
        volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
        assert volumes.min() > 0.0  # of the mirror images, too
        assert volumes.sum() == relatively(4.0 * X[-1] * Y[-1] * 1.16, 1e-9)
    assert np.ptp(step.points[:, 0]) == relatively(2.0 * X[-1], 1e-9)


@pytest.mark.mpi
def test_a_rank_without_cells_does_no_harm(on_two: Any) -> None:
    assert on_two["cells"] == [math.prod(len(lines) - 1 for lines in SPARSE.values()), 0]
    for name, options in SOLVERS.items():
        alone = finite_strain.solve(
            SMALL, mesh=block(**SPARSE), model="small_strain", accuracy=0.3, comm=COMM, numerics=ONE_LOAD,
            solver_options=options,
        ).balls[0]  # fmt: skip
        found = on_two[name]["balls"][0]
        assert found["normal_force"] == relatively(alone.normal_force, 1e-5)
        assert found["tangential_force"][0] == relatively(alone.tangential_force[0], 1e-4)


def bulging() -> tuple[Any, Any, Any]:
    mesh, cells, facets = block()
    x = mesh.geometry.x
    x[np.isclose(x[:, 2], 0.0) & np.isclose(x[:, 0], 1.0), 2] = 1e-3
    return mesh, cells, facets


def hollow() -> tuple[Any, Any, Any]:
    mesh, _, _ = block()
    middles = dolfinx.mesh.compute_midpoints(mesh, 3, np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32))
    kept = np.flatnonzero(np.linalg.norm(middles - [2.1, 0.7, -0.5], axis=1) > 0.3).astype(np.int32)
    return tagged(dolfinx.mesh.create_submesh(mesh, 3, kept)[0], {"top": 0.0, "bottom": -1.16})


def cracked(shift: float = 0.0) -> tuple[Any, Any, Any]:
    """Return two blocks that touch each other at x = 2.3, each with its own nodes there, between the ends shifted."""
    mesh, _, _ = block(x=(*X[:9], 2.4, 3.4))
    middles = dolfinx.mesh.compute_midpoints(mesh, 3, np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32))
    kept = np.flatnonzero(np.abs(middles[:, 0] - 2.35) > 1e-6).astype(np.int32)
    parts = dolfinx.mesh.create_submesh(mesh, 3, kept)[0]
    points = parts.geometry.x
    second = np.isclose(points[:, 0], 2.4)
    points[second & (points[:, 1] > 0.1) & (points[:, 1] < 2.5), 1] += shift
    points[second, 0] = 2.3
    return tagged(parts, {"top": 0.0, "bottom": -1.16})


def including() -> tuple[Any, Any, Any]:
    mesh, cells, facets = block()
    values = np.where(cells.indices == 5, 7, TAGS["layer"]).astype(np.int32)
    return mesh, meshtags(mesh, 3, cells.indices, values), facets


def wedge(x: Any) -> tuple[Any, Any, Any]:
    """Return a quarter of a body with a free side across x."""
    mesh, cells, facets = block(x=x)
    mesh.geometry.x[:, 0] *= 1.0 + 0.03 * mesh.geometry.x[:, 1]
    return mesh, cells, facets


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "no file": (lambda: "nowhere.msh", r"mesh: the file nowhere\.msh does not exist"),
    "another file": (lambda: __file__, r"must be a \.msh file, .* got .*test_own_mesh\.py"),
    "no tags": (lambda: (block()[0], None, None), "tags are needed, got None"),
    "no top": (lambda: block(facets=("bottom",)), r"no facet has the tag 11 \(top\), got the tags 1[0-9]"),
    "a facet left out": (lambda: block(skip=1), r"1 outer facets at z = -?[\d.]+ m lack the tag"),
    "thicker": (lambda: block(z=tuple(2.0 * z for z in Z)), r"from z = -1\.16 to 0 m, got -2\.32 to 0 m; .* in metres"),
    "shifted": (lambda: block(z=tuple(z + 1.16 for z in Z)), r"got 0 to 1\.16 m"),
    "bulging": (bulging, r"must reach from z = -1\.16 to 0 m, got -1\.16 to 0\.001 m"),
    "a ball outside": (lambda: block(x=tuple(0.3 * x for x in X)), r"ball 1 at \(1, 0\) m needs .* got 0\.02 m"),
    "a free side": (
        lambda: wedge((*X[:7], 1.5)),
        r"ball 1 at \(1, 0\) m needs 0\.\d+ m of mesh to every free side, got 0\.5",
    ),
    "coarse": (lambda: block(x=X[::4], y=Y[::2]), r"at least 9 corners .* got 4; make the elements there smaller"),
    "a hole": (
        hollow,
        r"a slab with vertical sides, without cavities, got 10\.\d+ m\^3 under a top of 8\.84 m\^2; fill",
    ),
    "parts": (
        cracked,
        r"must share their nodes, 24 pairs .* one place, the first at \(2\.3, .* m; join the volumes, in gmsh",
    ),
    "parts with unlike cells": (lambda: cracked(0.05), r"must share their nodes, 8 pairs of nodes are at one place"),
    "an inclusion": (
        including,
        r"needs the tag 1 \(layer\), got 1 without, got the tags 1, 7; a layer has one material",
    ),
    # newer versions of DOLFINx find no facets of prisms
    "prisms": (lambda: block(CellType.prism, facets=()), "hexahedron or tetrahedron, got prism"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mesh_that_does_not_fit_is_refused_before_any_long_work(name: str) -> None:
    make, words = WRONG[name]
    with pytest.raises(InvalidProblem, match=words):
        finite_strain.solve(pair(0.1, poisson=0.3), mesh=make(), comm=COMM)


def fitted(problem: Problem, meshed: Any) -> Any:
    return OwnMesh(meshed, COMM).fit(problem, prescribed(problem).expected())


def test_a_substrate_needs_cells_of_its_own() -> None:
    problem = replace(pair(0.1, poisson=0.3), substrate=Elastic(1e3, 0.3))
    with pytest.raises(InvalidProblem, match=r"no cell has the tag 2 \(substrate\)"):
        fitted(problem, block())
    mesh, cells, facets = block(z=(-2.0, *Z))
    values = np.where(dolfinx.mesh.compute_midpoints(mesh, 3, cells.indices)[:, 2] < -1.16, 2, 1).astype(np.int32)
    _, given = fitted(problem, (mesh, meshtags(mesh, 3, cells.indices, values), facets))
    assert given.depth == pytest.approx(2.0 - 1.16)


def test_a_mesh_is_a_part_of_the_scene_only_at_its_mirror_planes() -> None:
    quarter, _ = fitted(pair(0.1, poisson=0.3), block())
    assert quarter.planes == (0, 1) and len(quarter.balls) == 1  # noqa: PT018
    x = (*(-c for c in X[:0:-1]), *X)
    half, given = fitted(pair(0.1, poisson=0.3), block(x=x))
    assert half.planes == (1,) and len(half.balls) == 2  # noqa: PT018
    assert given.x == pytest.approx((-3.4, 3.4))
    with pytest.raises(InvalidProblem, match=r"ball 0 at \(-1, 0\) m needs"):  # unlike loads have no plane x = 0
        fitted(pair(replace(pair(0.1).load, values=(0.1, 0.12)), poisson=0.3), block())


def test_a_digest_follows_the_mesh_and_not_its_numbering() -> None:
    problem = single(0.1)
    lines = {"x": CENTRED, "y": CENTRED, "z": (-1.0, -0.5, -0.2, 0.0)}
    digests = [fitted(problem, block(**lines))[1].digest for _ in range(2)]  # type: ignore[arg-type]
    assert digests[0] == digests[1]
    lines["z"] = (-1.0, -0.5, -0.21, 0.0)
    assert fitted(problem, block(**lines))[1].digest != digests[0]  # type: ignore[arg-type]


@pytest.mark.parametrize(("kind", "value", "what"), [("approach", None, "normal force"), ("force", 0.05, "approach")])
def test_the_error_of_a_single_ball_beside_a_wall_is_that_of_what_is_not_given(
    kind: str, value: float | None, what: str
) -> None:
    alone = replace(SMALL, balls=SMALL.balls[1:], load=Load(kind, (value or SMALL.load.values[1],)))
    solved = finite_strain.solve(
        alone, model="small_strain", accuracy=0.3, mesh=block(**SPARSE), comm=COMM, numerics=ONE_LOAD
    ).solved
    assert solved.accuracy["relative_to"]["what"] == f"the {what}"
    assert not any(note.startswith(FAINT) for note in solved.notes)
    squares = sum(term**2 for term in solved.accuracy["terms"].values())
    assert math.sqrt(squares) == relatively(solved.accuracy["reached"], 1e-6)
