"""Writes the files of a load step: arrays with rows from all ranks into one HDF5 file, and an XDMF file with it.

Rank 0 writes, because Debian's h5py does not support MPI. Each step has an XDMF file, and there is an index over all
steps for ParaView and meshio. The text is written here because the library's own writer puts every field on a
separate grid, which meshio cannot read and ParaView shows as separate blocks.
"""

import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from finite_strain.mpi import on_root
from linear_bem.errors import OutputUnusable

INDEX = "fields.xdmf"
_CELLS = {8: "Hexahedron", 4: "Tetrahedron"}
_NUMBERS = {"f": "Float", "i": "Int"}
ROOM = 1_000_000
"""Allowance [bytes] for the parts of a file other than its arrays."""


def write_gathered(
    comm: MPI.Comm, path: Path, arrays: Mapping[str, np.ndarray], describe: Callable[[h5py.File], None]
) -> None:
    """Write each array's rows, numbered as in the folder's first step (collective); ``describe`` adds the rest.

    The file is written atomically. Raises `OutputUnusable` on every rank if it could not be written.
    """
    parts = {name: comm.gather(array, root=0) for name, array in arrays.items()}

    def write() -> None:
        whole = {name: np.concatenate(rows) for name, rows in parts.items() if rows is not None}
        first = min(path.parent.glob("step_*.h5"), default=path)
        if first < path:
            with _opened(first) as file:
                whole = _renumbered(whole, file["points"][:], file["cells"][:])
        _check_room(path, sum(array.nbytes for array in whole.values()) + ROOM)
        draft = path.with_name(f"{path.name}.part")
        try:
            with h5py.File(draft, "w") as file:
                for name, array in whole.items():
                    file.create_dataset(name, data=array)
                describe(file)
            draft.replace(path)
        except (OSError, RuntimeError) as error:  # HDF5 that cannot flush raises the latter
            raise OutputUnusable(f"{path} cannot be written: {error}") from error

    on_root(comm, write)


def _renumbered(whole: Mapping[str, np.ndarray], points: np.ndarray, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Return arrays in the numbering of an earlier step's points and cells, which other ranks may have written.

    Programs that read points and cells once would otherwise put the fields of a resumed run in wrong places.
    """
    if np.array_equal(points, whole["points"]) and np.array_equal(cells, whole["cells"]):
        return dict(whole)
    at = cKDTree(whole["points"]).query(points)[1]  # of each earlier point
    if len(np.unique(at)) < len(at):  # coinciding nodes cannot be distinguished
        return dict(whole)
    number = np.empty_like(at)
    number[at] = np.arange(len(at))
    mine, theirs = (np.lexsort(np.sort(rows, axis=1).T) for rows in (number[whole["cells"]], cells))
    row = np.empty_like(mine)  # of each earlier cell
    row[theirs] = mine
    kinds = {"node_fields": at, "cell_fields": row}
    fields = {name: array[kinds[name.split("/")[0]]] for name, array in whole.items() if "/" in name}
    return {"points": points, "cells": cells, **fields}


def _check_room(path: Path, needed: int) -> None:
    """Raise `OutputUnusable` if the disk has too little space for a file: HDF5 crashes on a full disk."""
    if path.parent.exists() and (free := shutil.disk_usage(path.parent).free) < needed:
        raise OutputUnusable(
            f"{path} cannot be written: No space left on device ({free / 1e6:.1f} MB free, {needed / 1e6:.1f} MB "
            "needed); make room, and the same command continues from the last step"
        )


def missing_files(folder: Path, numbers: Sequence[int], fields: Sequence[str]) -> list[str]:
    """Return a note on files of saved steps that cannot be read, and on ``fields`` that those files do not have."""
    faults = dict[str, None]()
    for path in (folder / f"{stem(number)}.h5" for number in numbers):
        try:
            with _opened(path) as file:
                there = file["node_fields"]
                faults |= dict.fromkeys(f"field {name} is missing" for name in fields if name not in there)
        except OutputUnusable:
            faults[f"{path.name} is {'damaged' if path.exists() else 'missing'}"] = None
    if not faults:
        return []
    return [
        f"{folder}: {', '.join(faults)}: fields of saved steps are not written again; empty the folder to solve again"
    ]


def move_steps(source: Path, target: Path) -> None:
    """Move all files of one folder into another, where they replace those of the same names; write the index of all."""
    for path in source.iterdir():
        if (old := target / path.name).is_dir():  # of VTX
            shutil.rmtree(old)
        path.replace(old)
    source.rmdir()
    _write_index(target)


def stem(number: int) -> str:
    """Return the name of a step's files without suffix."""
    return f"step_{number:04d}"


def write_step_and_index(folder: Path, number: int) -> None:
    """Write the XDMF file of a step with an HDF5 file, and the index over all such steps."""
    _write(folder / f"{stem(number)}.xdmf", _grid(folder, number, time=""))
    _write_index(folder)


def _write_index(folder: Path) -> None:
    numbers = sorted(int(path.stem.removeprefix("step_")) for path in folder.glob("step_*.h5"))
    if numbers:
        grids = [_grid(folder, n, time=f'<Time Value="{n}" />') for n in numbers]
        kind = 'Name="load path" GridType="Collection" CollectionType="Temporal"'
        _write(folder / INDEX, f"<Grid {kind}>{''.join(grids)}</Grid>")


def _grid(folder: Path, number: int, time: str) -> str:
    """Return the XDMF grid of one step, with the sizes in its HDF5 file."""

    def item(data: h5py.Dataset) -> str:
        shape, kind = " ".join(map(str, data.shape)), _NUMBERS[data.dtype.kind]
        size = f'Dimensions="{shape}" NumberType="{kind}" Precision="{data.dtype.itemsize}" Format="HDF"'
        return f"<DataItem {size}>{stem(number)}.h5:{data.name}</DataItem>"

    with _opened(folder / f"{stem(number)}.h5") as file:
        cells = file["cells"]
        topology = f'TopologyType="{_CELLS[cells.shape[1]]}" NumberOfElements="{len(cells)}"'
        parts = [
            f"<Topology {topology}>{item(cells)}</Topology>",
            f'<Geometry GeometryType="XYZ">{item(file["points"])}</Geometry>{time}',
        ]
        for group, center in (("node_fields", "Node"), ("cell_fields", "Cell")):
            for name, data in file[group].items():
                kind = f'Name="{name}" AttributeType="{data.attrs["kind"]}" Center="{center}"'
                parts.append(f"<Attribute {kind}>{item(data)}</Attribute>")
    return f'<Grid Name="{stem(number)}" GridType="Uniform">{"".join(parts)}</Grid>'


def _opened(path: Path) -> h5py.File:
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise OutputUnusable(
            f"{path} cannot be read ({error}): remove it; the same command then continues without its fields"
        ) from error


def _write(path: Path, grid: str) -> None:
    draft = path.with_suffix(".part")
    draft.write_text(f'<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>{grid}</Domain></Xdmf>', encoding="utf-8")
    draft.replace(path)
