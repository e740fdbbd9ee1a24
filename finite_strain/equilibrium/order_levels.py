"""Multigrid over the order of the elements: the tangent's levels are orders p, 2 and 1 on one mesh (p-multigrid).

The Lagrange spaces are nested, so a correction of low order is interpolated exactly, and the coarse operators are
Galerkin's. Order 1 has 1/27 (1/64) of the unknowns of order 3 (4), and PETSc solves it by factors
[Ronquist Patera 1987, doi 10.1007/BF01061297; Brown 2010, doi 10.1007/s10915-010-9396-8].
A component that is constrained at an order keeps a row of its own there, which no other row or column touches.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model
from finite_strain.discretisation.nodal_values import element_of

_ROUNDOFF = 1e-12
"""Shape functions, at most about 1, below which a value counts as zero."""


def set_levels(preconditioner: PETSc.PC, model: Model) -> None:
    """Make a preconditioner multigrid for the model's displacement rows, before its options are set (collective)."""
    spaces = [compat.function_space(model.mesh, order) for order in (2, 1) if order < model.order]
    preconditioner.setType("mg")
    preconditioner.setMGLevels(len(spaces) + 1)
    fine, fixed = model.space, model.constrained
    for number, coarse in enumerate(spaces):
        matrix, fixed = _interpolation(fine, coarse, fixed)
        preconditioner.setMGInterpolation(len(spaces) - number, matrix)
        matrix.destroy()  # the preconditioner keeps it
        fine = coarse


def _interpolation(fine: Any, coarse: Any, fixed: np.ndarray) -> tuple[PETSc.Mat, np.ndarray]:
    """Return the matrix from coarse to fine displacements, and which coarse components (nodes, 3) are constrained.

    ``fixed`` (nodes, 3) says so of this rank's fine nodes, ghosts included. A coarse component is constrained if its
    shape function does not vanish at all constrained fine nodes.
    """
    shapes = _shapes(fine, coarse)
    held = abs(shapes).T @ fixed.astype(float) > 0.0
    nodes, axes = np.nonzero(held)
    own_row = np.asarray(shapes.tocsc().argmax(axis=0)).ravel()[nodes]  # a node of the same vertex, edge, face or cell
    size = 3 * np.array(shapes.shape)
    free = sparse.diags((~fixed).ravel().astype(float)), sparse.diags((~held).ravel().astype(float))
    units = sparse.csr_matrix((np.ones(len(nodes)), (3 * own_row + axes, 3 * nodes + axes)), shape=size)
    own_fine, own_coarse = (3 * space.dofmap.index_map.size_local for space in (fine, coarse))
    local = (free[0] @ sparse.kron(shapes, sparse.eye(3)) @ free[1] + units).tocsr()[:own_fine]
    local.eliminate_zeros()
    numbers = coarse.dofmap.index_map.local_to_global(np.arange(len(held), dtype=np.int32))
    columns = (3 * numbers[:, None] + np.arange(3)).ravel()[local.indices]
    order = np.lexsort((columns, np.repeat(np.arange(own_fine), np.diff(local.indptr))))
    csr = (local.indptr.astype(PETSc.IntType), columns[order].astype(PETSc.IntType), local.data[order])
    matrix = PETSc.Mat().createAIJ(((own_fine, None), (own_coarse, None)), csr=csr, comm=fine.mesh.comm)
    matrix.setBlockSizes(3, 3)
    return matrix, held


def _shapes(fine: Any, coarse: Any) -> sparse.csr_matrix:
    """Return the values (fine nodes, coarse nodes) of the coarse shape functions at this rank's fine nodes."""
    fine_dofs, coarse_dofs = compat.cell_dofs(fine), compat.cell_dofs(coarse)
    elements = [element_of(dofs.shape[1]) for dofs in (fine_dofs, coarse_dofs)]
    values = elements[1].tabulate(0, elements[0].points)[0].reshape(fine_dofs.shape[1], coarse_dofs.shape[1])
    nodes, first = np.unique(fine_dofs, return_index=True)  # one of the cells that share a node
    cells, places = np.unravel_index(first, fine_dofs.shape)
    entries = values[places]
    kept = np.abs(entries) > _ROUNDOFF
    size = [space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts for space in (fine, coarse)]
    rows = np.repeat(nodes, kept.sum(axis=1))
    return sparse.csr_matrix((entries[kept], (rows, coarse_dofs[cells][kept])), shape=size)
