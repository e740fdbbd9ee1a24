"""A step's fields for ParaView as functions of order p on the curved elements: a folder in ADIOS2's format VTX."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np

from finite_strain import compat
from finite_strain.discretisation.discrete_model import Model
from finite_strain.mpi import on_root
from linear_bem.errors import OutputUnusable


def write_vtx(model: Model, path: Path, number: int, fields: Mapping[str, np.ndarray]) -> None:
    """Write values (local nodes, *shape), ghosts included, in the scene's frame; ``number`` is the time (collective).

    Needs `compat.vtx_writer`. An existing folder is replaced once the new one is complete.
    """
    draft = path.with_name("draft.bp")
    shapes = {values.shape[1:] for values in fields.values()}
    spaces = {shape: compat.function_space(model.mesh, model.order, shape) for shape in sorted(shapes)}
    functions = [_function(model, spaces[values.shape[1:]], name, values) for name, values in fields.items()]
    places = model.mesh.geometry.x
    own = places.copy()
    places[:] = model.reduction.scene_points(own)  # the writer uses the functions' mesh
    try:
        with compat.vtx_writer()(model.comm, str(draft), functions) as writer:
            writer.write(float(number))
    except RuntimeError as error:
        raise OutputUnusable(f"{path} cannot be written: {error}") from error
    finally:
        places[:] = own

    def replace() -> None:
        shutil.rmtree(path, ignore_errors=True)
        draft.rename(path)

    on_root(model.comm, replace)


def _function(model: Model, space: Any, name: str, values: np.ndarray) -> dolfinx.fem.Function:
    """Return nodal values as a function in a space on the model's mesh, which may number the nodes differently."""
    function, rows = dolfinx.fem.Function(space), values.reshape(len(values), -1)
    function.name = name
    function.x.array.reshape(-1, rows.shape[1])[compat.cell_dofs(space)] = rows[compat.cell_dofs(model.space)]
    function.x.scatter_forward()
    return function
