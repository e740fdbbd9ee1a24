"""Saved states: checkpoints of a run, and initial guesses on other meshes and element orders.

A state holds the nodes of all cells and the values at the fields' nodes, the same on every rank. It does not depend on
numbering, number of ranks or DOLFINx version, and can be evaluated at any point.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from finite_strain import compat
from finite_strain.contact.contact_energy import Penalised
from finite_strain.discretisation.nodal_values import element_of
from finite_strain.discretisation.point_location import Locations
from finite_strain.discretisation.unknowns import Fields, Values
from linear_bem.errors import OutputUnusable


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One state: ``nodes`` (cells, n, 3) [m] of the mesh, and values (cells, nodes, components) of each field.

    ``approaches`` (balls,) [m] are those of the balls; ``source`` is the penalised state that defines the multipliers.
    """

    fraction: float
    nodes: np.ndarray
    values: tuple[np.ndarray, ...]
    approaches: np.ndarray
    source: Penalised

    @classmethod
    def take(cls, fraction: float, fields: Fields, approaches: np.ndarray, source: Penalised) -> Snapshot:
        """Return the present state of a model's fields, on every rank (collective)."""
        mesh, space = fields.displacement.function_space.mesh, fields.displacement.function_space
        owned = mesh.topology.index_map(3).size_local
        nodes = mesh.geometry.x[compat.geometry_dofs(mesh)[:owned]]
        parts = [nodes, source.displacement[compat.cell_dofs(space)[:owned]]]
        for function in fields.functions:
            size = function.function_space.dofmap.index_map_bs
            parts.append(function.x.array.reshape(-1, size)[compat.cell_dofs(function.function_space)[:owned]])
        gathered = mesh.comm.allgather(parts)
        nodes, pressing, *values = (np.concatenate(pieces) for pieces in zip(*gathered, strict=True))
        return cls(fraction, nodes, tuple(values), np.array(approaches), replace(source, displacement=pressing))

    def at(self, fields: Fields, locations: Locations | None = None) -> tuple[Values, Penalised]:
        """Return the values of this state at the nodes of a model's fields (this rank's, ghosts included).

        ``locations`` avoids a new search for points in a mesh that was searched before. Raises `OutputUnusable`
        if the nodes do not lie in the mesh of the state.
        """
        locations = locations or Locations()
        found = [locations.find(self.nodes, points) for points in fields.points]
        nodal, *pressures = (_evaluate(values, *at) for values, at in zip(self.values, found, strict=True))
        source = replace(self.source, displacement=_evaluate(self.source.displacement, *found[0]))
        return (nodal, *(values.ravel() for values in pressures)), source

    def save(self, path: Path) -> None:
        """Write the state to a file atomically (on one rank)."""
        draft = path.with_suffix(".part")
        with draft.open("wb") as file:
            named = {f"values{number}": values for number, values in enumerate(self.values)}
            named |= {f"source_{name}": value for name, value in vars(self.source).items()}
            np.savez(file, fraction=self.fraction, nodes=self.nodes, approaches=self.approaches, **named)
        draft.replace(path)

    @classmethod
    def fault(cls, path: Path) -> str:
        """Return why a file cannot be loaded; an empty text if it can."""
        try:
            cls.load(path)
        except OutputUnusable as error:
            return str(error).split(":", maxsplit=1)[0]
        return ""

    @classmethod
    def load(cls, path: Path) -> Snapshot:
        """Return the state in a file; raises `OutputUnusable`."""
        try:
            with path.open("rb") as file, np.load(file) as saved:  # numpy leaves a damaged file open
                fields = tuple(saved[name] for name in saved.files if name.startswith("values"))
                source = Penalised(*(saved[f"source_{each.name}"] for each in dataclass_fields(Penalised)))
                return cls(float(saved["fraction"]), saved["nodes"], fields, saved["approaches"], source)
        except (OSError, EOFError, ValueError, KeyError, BadZipFile, zlib.error) as error:
            raise OutputUnusable(f"{path} cannot be read ({error}): remove it to start from the beginning") from error


def _evaluate(values: np.ndarray, cells: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Interpolate nodal values (cells, nodes, k) at reference coordinates (n, 3) in cells (n,)."""
    element = element_of(values.shape[1])
    answer = np.empty((len(cells), values.shape[2]))
    for begin in range(0, len(cells), 4096):
        part = slice(begin, begin + 4096)
        shapes = element.tabulate(0, places[part])[0].reshape(len(cells[part]), -1)
        answer[part] = np.einsum("na,nak->nk", shapes, values[cells[part]])
    return answer
