"""The unknown functions of a model in one solver vector: the displacement, then a pressure for each mixed region.

Every rank's part of the vector holds its displacement components first, then its pressures. A pressure
unknown is stored as a length [m], its value over a stiffness per length: the volume equations are then forces [N]
like the others, and one norm bounds all of them in any system of units.
"""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
from petsc4py import PETSc

from finite_strain import compat

Values = tuple[np.ndarray, ...]
"""Values of all fields on this rank, ghosts included: (nodes, 3), then (vertices,) for each pressure [m]."""


class Fields:
    """The displacement and the pressures as functions, as arrays and in a solver's vector."""

    def __init__(self, displacement: Any, pressures: list[Any]) -> None:
        self.displacement = displacement
        self.pressures = pressures
        self.functions = [displacement, *pressures]
        dofmaps = [function.function_space.dofmap for function in self.functions]
        ends = np.cumsum([dofmap.index_map_bs * dofmap.index_map.size_local for dofmap in dofmaps])
        self.ranges = [slice(int(a), int(b)) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
        """The range of each field in this rank's part of a solver's vector."""

    def like(self) -> Fields:
        """Return new fields, zero, in the same spaces."""
        displacement, *pressures = [dolfinx.fem.Function(function.function_space) for function in self.functions]
        return Fields(displacement, pressures)

    def set(self, x: PETSc.Vec) -> None:
        """Copy a solver's vector into the functions and refresh their ghosts."""
        for function, part in zip(self.functions, self.ranges, strict=True):
            vector = compat.vector_of(function)
            vector.array[:] = x.array_r[part]
            vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)

    def get(self, x: PETSc.Vec) -> None:
        """Copy the functions into a solver's vector."""
        values = x.array
        for function, part in zip(self.functions, self.ranges, strict=True):
            values[part] = compat.vector_of(function).array_r

    @property
    def points(self) -> tuple[np.ndarray, ...]:
        """The undeformed points (rows, 3) [m] at which each field has its values."""
        return tuple(function.function_space.tabulate_dof_coordinates() for function in self.functions)

    @property
    def owned(self) -> tuple[int, ...]:
        """Number of rows of each field that this rank owns: the first ones."""
        return tuple(function.function_space.dofmap.index_map.size_local for function in self.functions)

    def copy(self) -> Values:
        """Return the present values."""
        nodal, *pressures = (function.x.array.copy() for function in self.functions)
        return nodal.reshape(-1, 3), *pressures

    def restore(self, values: Values) -> None:
        """Set the functions to values that `copy` returned."""
        for function, rows in zip(self.functions, values, strict=True):
            function.x.array[:] = rows.ravel()


def idle_dofs(function: Any, cells: np.ndarray) -> np.ndarray:
    """Return the local dofs of a scalar function that none of the cells (of any rank) touches (collective)."""
    function.x.array[compat.cell_dofs(function.function_space)[cells].ravel()] = 1.0
    vector = compat.vector_of(function)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
    idle = np.flatnonzero(function.x.array == 0.0).astype(np.int32)
    function.x.array[:] = 0.0
    return idle
