"""Multigrid over the order of the elements, on one mesh (p-multigrid).

Upright hexahedra of order p have two levels: order p, and order 1 along the layer with order p across it, which PETSc
solves by direct factors (1/p^2 of the unknowns). The mixed form has a level of order 2 along the layer in between.
Other meshes, and systems whose second level would be too large for factors, have levels of orders p, 2 and 1. The
reasons are in `runs/studies/scaling/README.md`.

The Lagrange spaces are nested, so a correction of a lower level is interpolated exactly, and the coarse operators are
Galerkin's [Ronquist Patera 1987, doi 10.1007/BF01061297; Brown 2010, doi 10.1007/s10915-010-9396-8].
A component that is constrained at a level keeps its own row there, uncoupled from all other rows and columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.nodal_values import element_of

_ROUNDOFF = 1e-12
"""Shape functions, at most about 1, below which a value counts as zero."""
_UPRIGHT = 1e-6
"""Horizontal part of a cell's upright edges over their length, at most."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """A level below a finer one: shape functions (fine nodes, coarse nodes) of this rank's nodes, ghosts included.

    The first ``owned`` coarse nodes are this rank's; ``numbers`` are the global numbers of all coarse nodes here.
    """

    shapes: sparse.csr_matrix
    owned: int
    numbers: np.ndarray


def set_levels(preconditioner: PETSc.PC, model: Model, along: Sequence[int]) -> None:
    """Make a preconditioner multigrid for the model's displacement rows, before its options are set (collective).

    ``along``: the lower levels' orders along the layer, if they keep the order across it and the mesh has upright
    hexahedra; empty for levels of lower order in all directions.
    """
    levels = upright(model.space, [order for order in along if order < model.order]) or orders(model)
    preconditioner.setType("mg")
    preconditioner.setMGLevels(len(levels) + 1)
    fixed, owned = model.constrained, model.space.dofmap.index_map.size_local
    for number, level in enumerate(levels):
        matrix, fixed = interpolation(level, fixed, owned, model.comm)
        preconditioner.setMGInterpolation(len(levels) - number, matrix)
        matrix.destroy()  # the preconditioner keeps it
        owned = level.owned


def orders(model: Model) -> list[Coarse]:
    """Return the levels of orders 2 and 1 below the model's, one after the other (collective)."""
    levels, fine = [], model.space
    for order in (2, 1):
        if order < model.order:
            space = compat.function_space(model.mesh, order)
            levels.append(of_order(fine, space))
            fine = space
    return levels


def of_order(fine: Any, space: Any) -> Coarse:
    """Return the level of a Lagrange ``space`` of lower order, below the ``fine`` space on the same mesh."""
    fine_dofs, coarse_dofs = compat.cell_dofs(fine), compat.cell_dofs(space)
    elements = [element_of(dofs.shape[1]) for dofs in (fine_dofs, coarse_dofs)]
    values = elements[1].tabulate(0, elements[0].points)[0].reshape(fine_dofs.shape[1], coarse_dofs.shape[1])
    nodes, first = np.unique(fine_dofs, return_index=True)  # one of the cells that share a node
    cells, places = np.unravel_index(first, fine_dofs.shape)
    entries = values[places]
    kept = np.abs(entries) > _ROUNDOFF
    rows = np.repeat(nodes, kept.sum(axis=1))
    maps = [each.dofmap.index_map for each in (fine, space)]
    size = [nodes.size_local + nodes.num_ghosts for nodes in maps]
    shapes = sparse.csr_matrix((entries[kept], (rows, coarse_dofs[cells][kept])), shape=size)
    return Coarse(shapes, maps[1].size_local, maps[1].local_to_global(np.arange(size[1], dtype=np.int32)))


def upright(fine: Any, orders: Sequence[int]) -> list[Coarse]:
    """Return levels of orders 2 or 1 along the layer and the space's own order across it (collective).

    Their nodes are the fine nodes above and below the mesh's vertices and, at order 2, one inner node of each edge and
    of each face. Empty if some cell is not an upright hexahedron.
    """
    comm, dofs = fine.mesh.comm, compat.cell_dofs(fine)
    element = element_of(dofs.shape[1])
    places, axes = element.points, np.zeros(0, dtype=int)
    is_upright = element.cell_type.name == "hexahedron"
    if is_upright and len(dofs):
        corners = fine.tabulate_dof_coordinates()[dofs[:, :8]]  # vertices come first
        edges = corners[:, [1, 2, 4]] - corners[:, :1]
        tilt = np.hypot(edges[:, :, 0], edges[:, :, 1]) / np.linalg.norm(edges, axis=2)
        axes = tilt.argmin(axis=1)
        is_upright = bool(tilt.min(axis=1).max() < _UPRIGHT)
    if not comm.allreduce(is_upright, op=MPI.LAND):
        return []
    index_map = fine.dofmap.index_map
    size = index_map.size_local + index_map.num_ghosts
    everywhere = index_map.local_to_global(np.arange(size, dtype=np.int32))
    number = dolfinx.fem.Function(fine)  # the owner sends it to the other ranks
    entries = number.x.array.reshape(size, fine.dofmap.index_map_bs)
    upper = [(places, dofs[axes == axis]) for axis in range(3)]
    above, levels = np.arange(size), []
    for order in orders:
        lower, parts = [], []
        for axis, (points, cells) in enumerate(upper):
            along = [k for k in range(3) if k != axis]
            coarse = _lattice(places[:, axis], axis, order)
            nodes = _inner(places, axis, dofs[axes == axis], coarse, everywhere)
            weights = np.isclose(points[:, None, axis], coarse[None, :, axis]).astype(float)
            for k in along:
                weights *= _along(points[:, None, k], coarse[None, :, k], order)
            i, j = np.nonzero(np.abs(weights) > _ROUNDOFF)
            parts.append((cells[:, i].ravel(), nodes[:, j].ravel(), np.tile(weights[i, j], len(cells))))
            lower.append((coarse, nodes))
        row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
        kept, place = np.unique(column, return_inverse=True)
        _, first = np.unique(row.astype(np.int64) * size + column, return_index=True)  # cells share nodes
        entry = value[first], (np.searchsorted(above, row[first]), place[first])
        owned = int(np.searchsorted(kept, index_map.size_local))
        before = comm.exscan(owned) or 0
        entries[kept[:owned], 0] = before + np.arange(owned)
        number.x.scatter_forward()
        numbers = np.rint(entries[kept, 0].real).astype(np.int64)
        levels.append(Coarse(sparse.csr_matrix(entry, shape=(len(above), len(kept))), owned, numbers))
        upper, above = lower, kept
    return levels


def _lattice(across: np.ndarray, axis: int, order: int) -> np.ndarray:
    """Return the coarse nodes (n, 3) of a cell: its nodes' heights combined with order 1 or 2 along the layer."""
    heights = np.unique(across.round(12))
    lines = [heights if k == axis else np.linspace(0.0, 1.0, order + 1) for k in range(3)]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)


def _inner(places: np.ndarray, axis: int, dofs: np.ndarray, coarse: np.ndarray, everywhere: np.ndarray) -> np.ndarray:
    """Return the fine node (cells, coarse places) that represents each coarse place, the same in all its cells.

    Among the inner nodes of an edge or face along the layer at one height, it has the smallest global number.
    """
    found = np.empty((len(dofs), len(coarse)), dtype=dofs.dtype)
    for number, place in enumerate(coarse):
        same = np.isclose(places, place)
        inside = (place == 0.5) & (places > _ROUNDOFF) & (places < 1.0 - _ROUNDOFF)
        inside[:, axis] = False  # nodes at other heights are other coarse nodes
        near = dofs[:, np.all(same | inside, axis=1)]
        found[:, number] = np.take_along_axis(near, everywhere[near].argmin(axis=1)[:, None], axis=1)[:, 0]
    return found


def _along(at: np.ndarray, node: np.ndarray, order: int) -> np.ndarray:
    """Return the shape functions of order 1 or 2 of nodes of [0, 1]."""
    linear = np.where(node > 0.5, at, 1.0 - at)
    if order == 1:
        return linear
    return np.where(node == 0.5, 4.0 * at * (1.0 - at), linear * (2.0 * linear - 1.0))


def interpolation(level: Coarse, fixed: np.ndarray, own_fine: int, comm: MPI.Comm) -> tuple[PETSc.Mat, np.ndarray]:
    """Return the matrix from coarse to fine displacements, and the mask (nodes, 3) of constrained coarse components.

    ``fixed`` (nodes, 3) is the mask at this rank's fine nodes, ghosts included, of which the first ``own_fine`` are its
    own. A coarse component is constrained if its shape function does not vanish at all constrained fine nodes.
    """
    shapes = level.shapes
    held = abs(shapes).T @ fixed.astype(float) > 0.0
    nodes, axes = np.nonzero(held)
    # a node of the same vertex, edge, face or cell; a rank may have none
    own_row = np.asarray(shapes.tocsc().argmax(axis=0)).ravel()[nodes] if shapes.shape[1] else nodes
    size = 3 * np.array(shapes.shape)
    free = sparse.diags((~fixed).ravel().astype(float)), sparse.diags((~held).ravel().astype(float))
    units = sparse.csr_matrix((np.ones(len(nodes)), (3 * own_row + axes, 3 * nodes + axes)), shape=size)
    rows = 3 * own_fine
    local = (free[0] @ sparse.kron(shapes, sparse.eye(3)) @ free[1] + units).tocsr()[:rows]
    local.eliminate_zeros()
    columns = (3 * level.numbers[:, None] + np.arange(3)).ravel()[local.indices]
    order = np.lexsort((columns, np.repeat(np.arange(rows), np.diff(local.indptr))))
    csr = (local.indptr.astype(PETSc.IntType), columns[order].astype(PETSc.IntType), local.data[order])
    matrix = PETSc.Mat().createAIJ(((rows, None), (3 * level.owned, None)), csr=csr, comm=comm)
    matrix.setBlockSizes(3, 3)
    return matrix, held
