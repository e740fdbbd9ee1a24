"""A user's mesh: reads it, checks it against the problem, and tags it like the meshes that a run makes.

`finite_strain.solve` says what it must be.
"""

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from scipy.spatial import cKDTree

from finite_strain import compat
from finite_strain.discretisation.regions import constant
from finite_strain.geometry.symmetry import Reduction, reduce_scene
from finite_strain.mpi import on_root
from finite_strain.planning.run_plan import GivenMesh
from linear_bem.closed_forms import Indentation
from linear_bem.errors import InvalidProblem
from linear_bem.problem import Problem
from meshes.box import SIDES, TAGS

CELLS = {"hexahedron": (8, 27), "tetrahedron": (4, 10)}
"""Numbers of nodes of the accepted cells: straight ones, and curved ones of order 2."""
FLAT = 1e-6
"""Largest distance of nodes from the plane of their face, over the thickness of the layer."""
SOLID = 1e-3
"""Largest relative difference between the layer's volume and its thickness times the area of the top."""
LEAST_NODES = 9
"""Fewest corners of elements under a ball's expected contact at full load: two elements across it."""
CLEAR = 1.5
"""Least distance of a ball's axis from the mesh's sides, over the radius of its expected contact."""
DIAGONAL = math.sqrt(2.0)
"""Factor on it for free sides: the block in which T is integrated is a square, and ends before them."""


class OwnMesh:
    """Mesh, cell tags and facet tags (see `meshes.box.TAGS`) of a user (collective)."""

    def __init__(self, source: Any, comm: MPI.Comm) -> None:
        self.name = "mesh"
        if isinstance(source, (str, Path)):
            path = Path(source)
            if not on_root(comm, path.exists):
                raise InvalidProblem(f"mesh: the file {path} does not exist")
            if not on_root(comm, path.is_file) or path.suffix != ".msh":
                raise InvalidProblem(f"mesh: must be a .msh file, or (mesh, cell tags, facet tags), got {path}")
            self.name, source = f"mesh {path}", compat.read_mesh(path, comm)
        if not (isinstance(source, Sequence) and len(source) == 3 and isinstance(source[0], dolfinx.mesh.Mesh)):
            raise InvalidProblem(f"mesh: must be a .msh file, or (mesh, cell tags, facet tags), got {type(source)}")
        self.mesh, self.cell_tags, self.facet_tags = source
        self.comm = comm
        topology = self.mesh.topology
        cell = str(topology.cell_type).split(".")[-1]
        faults = [] if cell in CELLS else [f"{self.name}: cells must be {' or '.join(CELLS)}, got {cell}"]
        nodes = compat.geometry_dofs(self.mesh).shape[1]
        if not faults and nodes not in CELLS[cell]:
            faults.append(f"{self.name}: a {cell} must have {' or '.join(map(str, CELLS[cell]))} nodes, got {nodes}")
        if None in (self.cell_tags, self.facet_tags):
            faults.append(f"{self.name}: cell tags and facet tags are needed, got None; tag layer, top and bottom")
        if self.mesh.comm.size != comm.size:
            faults.append(f"{self.name}: its communicator has {self.mesh.comm.size} ranks, that of the run {comm.size}")
        if faults:
            raise InvalidProblem(*faults)
        for pair in ((2, 0), (2, 3), (3, 2)):
            topology.create_connectivity(*pair)
        owned = topology.index_map(3).size_local
        self.nodes = self.mesh.geometry.x[compat.geometry_dofs(self.mesh)[:owned]]
        self.regions = np.zeros(owned, dtype=int)
        here = self.cell_tags.indices < owned
        self.regions[self.cell_tags.indices[here]] = self.cell_tags.values[here]
        self.simplices = cell == "tetrahedron"

    def fit(self, problem: Problem, expected: Sequence[Indentation]) -> tuple[Reduction, GivenMesh]:
        """Return the part of the scene in the mesh, and the mesh's dimensions; raises `InvalidProblem` on all ranks."""
        low, high = self._range(np.ones(len(self.nodes), dtype=bool))
        thickness = problem.layer.thickness
        near = FLAT * thickness
        planes = tuple(axis for axis in (0, 1) if abs(low[axis]) <= near)
        reduction = reduce_scene(problem, planes)
        sides = {axis: (0.0 if axis in reduction.planes else float(low[axis]), float(high[axis])) for axis in (0, 1)}
        faults = self._faults_of_regions(problem, near)
        bottom = float(low[2])
        faults += self._faults_of_faces({"top": 0.0, "bottom": bottom}, near)
        if faults:
            raise InvalidProblem(*faults)
        self._check_glued(near)
        room = self._room(self._tag_sides(sides, near), reduction)
        self._check_solid(thickness)
        radii = [expected[ball.index].contact_radius for ball in reduction.balls]
        self._check_balls(reduction, radii, sides, room, near)
        cells = self.comm.allreduce(len(self.nodes))
        depth = -bottom - thickness if problem.substrate is not None else 0.0
        return reduction, GivenMesh(sides[0], sides[1], depth, cells, self.simplices, room, self._digest(near))

    @property
    def meshed(self) -> tuple[Any, Any, Any]:
        """Mesh, cell tags and facet tags for a model."""
        return self.mesh, self.cell_tags, self.facet_tags

    def _range(self, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest coordinates (3,) of the nodes of some cells of all ranks."""
        points = self.nodes[cells].reshape(-1, 3)
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        self.comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
        self.comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
        return low, high

    def _faults_of_regions(self, problem: Problem, near: float) -> list[str]:
        h = problem.layer.thickness
        levels = {"layer": (-h, 0.0)}
        if problem.substrate is not None:
            levels["substrate"] = (-np.inf, -h)
        faults, known = [], np.zeros(len(self.nodes), dtype=bool)
        for name, (below, above) in levels.items():
            cells = self.regions == TAGS[name]
            known |= cells
            low, high = self._range(cells)
            if not low[2] < high[2]:
                faults.append(f"{self.name}: no cell has the tag {TAGS[name]} ({name}), {self._found(self.cell_tags)}")
            elif abs(high[2] - above) > near or (below > -np.inf and abs(low[2] - below) > near):
                faults.append(
                    f"{self.name}: the {name} must reach from z = {below:g} to {above:g} m, got {low[2]:.6g} to "
                    f"{high[2]:.6g} m; give it the scene's thickness in metres, with the top at z = 0"
                )
        other = self.comm.allreduce(int(np.sum(~known)))
        if other:
            rule = " or ".join(f"{TAGS[name]} ({name})" for name in levels)
            faults.append(
                f"{self.name}: every cell needs the tag {rule}, got {other} without, {self._found(self.cell_tags)}; "
                "a layer has one material, without inclusions"
            )
        return faults

    def _found(self, tags: Any) -> str:
        """Return the values of cell or facet tags on all ranks (collective)."""
        values = sorted({int(value) for part in self.comm.allgather(np.unique(tags.values)) for value in part})
        return f"got the tags {', '.join(map(str, values))}" if values else "got no tags"

    def _own(self, facets: np.ndarray) -> np.ndarray:
        return np.asarray(facets[facets < self.mesh.topology.index_map(2).size_local])

    def _on(self, axis: int, value: float, near: float) -> np.ndarray:
        """Return this rank's outer facets on a plane."""
        where = dolfinx.mesh.locate_entities_boundary(self.mesh, 2, lambda x: np.abs(x[axis] - value) <= near)
        return self._own(where)

    def _faults_of_faces(self, levels: dict[str, float], near: float) -> list[str]:
        """Return a message per fault of the tagged facets; those of each name must be all at one level z [m]."""
        faults, mesh = [], self.name
        for name, value in levels.items():
            tagged, there = self._own(self.facet_tags.find(TAGS[name])), self._on(2, value, near)
            counts = [len(tagged), len(np.setdiff1d(tagged, there)), len(np.setdiff1d(there, tagged))]
            number, outside, untagged = self.comm.allreduce(np.array(counts))
            level, tag = f"z = {value:.6g} m", f"the tag {TAGS[name]} ({name})"
            if not number:
                faults.append(f"{mesh}: no facet has {tag}, {self._found(self.facet_tags)}; tag those at {level}")
            elif outside:
                rule = "must be flat: balls press into a plane" if name == "top" else "must be flat"
                faults.append(f"{mesh}: the {name} {rule} {level}, {outside} of its {number} facets leave it")
            elif untagged:
                faults.append(f"{mesh}: {untagged} outer facets at {level} lack {tag}")
        return faults

    def _tag_sides(self, sides: dict[int, tuple[float, float]], near: float) -> np.ndarray:
        """Replace the facet tags by those of top, bottom and the flat sides; return this rank's other outer facets."""
        found = {name: self.facet_tags.find(TAGS[name]) for name in ("top", "bottom")}
        found |= {name: self._on(axis, sides[axis][end], near) for name, (axis, end) in SIDES.items()}
        facets = np.concatenate(list(found.values())).astype(np.int32)
        numbers = np.concatenate([np.full(len(each), TAGS[name], dtype=np.int32) for name, each in found.items()])
        order = np.argsort(facets)
        self.facet_tags = dolfinx.mesh.meshtags(self.mesh, 2, facets[order], numbers[order])
        outer = dolfinx.mesh.locate_entities_boundary(self.mesh, 2, lambda x: np.full(x.shape[1], True))
        return np.setdiff1d(self._own(outer), facets)

    def _room(self, free: np.ndarray, reduction: Reduction) -> tuple[float, ...]:
        """Return the distance [m] of each ball's axis from free sides, infinite without (collective)."""
        space = compat.function_space(self.mesh, 1)  # that of the domain integral's weight, which vanishes there
        nodes = dolfinx.fem.locate_dofs_topological(space, 2, free.astype(np.int32))
        places = space.tabulate_dof_coordinates()[nodes, :2]
        least = [np.linalg.norm(places - ball.position, axis=1).min(initial=np.inf) for ball in reduction.balls]
        return tuple(self.comm.allreduce(float(distance), op=MPI.MIN) for distance in least)

    def _check_glued(self, near: float) -> None:
        """Raise `InvalidProblem` if two nodes are at one place: blocks of cells that only touch each other."""
        own = self.mesh.geometry.x[: self.mesh.geometry.index_map().size_local]
        places = np.concatenate(self.comm.allgather(own))
        twins = cKDTree(places).query_pairs(near, output_type="ndarray")
        if len(twins):
            x, y, z = places[twins[0, 0]]
            raise InvalidProblem(
                f"{self.name}: cells that meet must share their nodes, {len(twins)} pairs of nodes are at one place, "
                f"the first at ({x:.6g}, {y:.6g}, {z:.6g}) m; join the volumes, in gmsh by occ.fragment, before meshing"
            )

    def _check_solid(self, thickness: float) -> None:
        cells = ufl.Measure("dx", domain=self.mesh, subdomain_data=self.cell_tags)(TAGS["layer"])
        facets = ufl.Measure("ds", domain=self.mesh, subdomain_data=self.facet_tags)(TAGS["top"])
        forms = compat.compile_forms([constant(self.mesh, 1.0) * measure for measure in (cells, facets)], self.comm)
        volume, area = (self.comm.allreduce(dolfinx.fem.assemble_scalar(form)) for form in forms)
        if abs(volume - thickness * area) > SOLID * volume:
            raise InvalidProblem(
                f"{self.name}: the layer must be a slab with vertical sides, without cavities, got {volume:.6g} m^3 "
                f"under a top of {area:.6g} m^2; fill cavities with cells of the layer"
            )

    def _check_balls(
        self, reduction: Reduction, radii: Sequence[float], sides: dict[int, tuple[float, float]],
        rooms: Sequence[float], near: float,
    ) -> None:  # fmt: skip
        """Raise `InvalidProblem` if a ball presses outside the mesh, or on too few elements."""
        corners = self.nodes[:, : 4 if self.simplices else 8].reshape(-1, 3)
        here = corners[np.abs(corners[:, 2]) <= near, :2]
        top = np.unique(np.round(np.concatenate(self.comm.allgather(here)) / near), axis=0) * near
        faults = []
        for ball, radius, free in zip(reduction.balls, radii, rooms, strict=True):
            room = math.inf
            for axis, (low, high) in sides.items():
                below = math.inf if axis in reduction.planes else ball.position[axis] - low
                room = min(room, below, high - ball.position[axis])
            under = ball.copies * int(np.sum(np.linalg.norm(top - ball.position, axis=1) <= radius))
            where = f"{self.name}: ball {ball.index} at ({ball.position[0]:.6g}, {ball.position[1]:.6g}) m"
            if room < CLEAR * radius:
                faults.append(
                    f"{where} needs {CLEAR * radius:.3g} m of mesh on every side, got {room:.3g} m; a mesh of a part "
                    "is x >= 0 or y >= 0 of balls, bodies and loads that are mirror images"
                )
            elif free < DIAGONAL * CLEAR * radius:
                faults.append(
                    f"{where} needs {DIAGONAL * CLEAR * radius:.3g} m of mesh to every free side, got {free:.3g} m; "
                    "move the side away"
                )
            elif under < LEAST_NODES:
                faults.append(
                    f"{where} needs at least {LEAST_NODES} corners of elements under its contact, whose radius at full "
                    f"load is about {radius:.3g} m, got {under}; make the elements there smaller"
                )
        if faults:
            raise InvalidProblem(*faults)

    def _digest(self, near: float) -> str:
        """Return a text that is the same for the same mesh on any number of ranks."""
        rows = np.column_stack([self.nodes.mean(axis=1), np.ptp(self.nodes, axis=1), self.regions])
        parts = self.comm.gather(np.round(rows / near), root=0)
        whole = None if parts is None else np.concatenate(parts)
        text = "" if whole is None else hashlib.sha256(whole[np.lexsort(whole.T)].tobytes()).hexdigest()
        return str(self.comm.bcast(text, root=0))
