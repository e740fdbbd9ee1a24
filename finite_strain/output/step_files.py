"""Writes the files of a load step: arrays with rows from all ranks into one HDF5 file, and an XDMF file with it.

Rank 0 writes, because Debian's h5py does not support MPI. Each step has an XDMF file, and there is an index over all
steps for ParaView and meshio. The text is written here because the library's own writer puts every field on a
separate grid, which meshio cannot read and ParaView shows as separate blocks.
"""

import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree as Xml

import h5py
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from finite_strain.mpi import on_root
from linear_bem.errors import OutputUnusable

INDEX = "fields.xdmf"
_CELLS = {8: "Hexahedron", 4: "Tetrahedron"}
_NUMBERS = {"f": ("Float", 8), "i": ("Int", 8)}
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
    missing = dict[str, None]()
    for path in (folder / f"{stem(number)}.h5" for number in numbers):
        try:
            with _opened(path) as file:
                missing |= dict.fromkeys(f"field {name}" for name in fields if name not in file["node_fields"])
        except OutputUnusable:
            missing[path.name] = None
    if not missing:
        return []
    return [
        f"{', '.join(missing)} missing in {folder}: fields of saved steps are not written again; empty the folder to "
        "solve again"
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
    _write(folder / f"{stem(number)}.xdmf", [_grid(folder, number, timed=False)], temporal=False)
    _write_index(folder)


def _write_index(folder: Path) -> None:
    numbers = sorted(int(path.stem.removeprefix("step_")) for path in folder.glob("step_*.h5"))
    if numbers:
        _write(folder / INDEX, [_grid(folder, n, timed=True) for n in numbers], temporal=True)


def _grid(folder: Path, number: int, timed: bool) -> Xml.Element:
    """Return the XDMF grid of one step, with the sizes in its HDF5 file; its number is used as time."""
    grid = Xml.Element("Grid", Name=stem(number), GridType="Uniform")
    with _opened(folder / f"{stem(number)}.h5") as file:
        cells = file["cells"]
        kind = _CELLS[cells.shape[1]]
        topology = Xml.SubElement(grid, "Topology", TopologyType=kind, NumberOfElements=str(len(cells)))
        _item(topology, cells, number)
        _item(Xml.SubElement(grid, "Geometry", GeometryType="XYZ"), file["points"], number)
        if timed:
            Xml.SubElement(grid, "Time", Value=str(number))
        for group, center in (("node_fields", "Node"), ("cell_fields", "Cell")):
            for name, data in file[group].items():
                kind = data.attrs["kind"]
                attribute = Xml.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center=center)
                _item(attribute, data, number)
    return grid


def _opened(path: Path) -> h5py.File:
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise OutputUnusable(
            f"{path} cannot be read ({error}): remove it; the same command then continues without its fields"
        ) from error


def _item(parent: Xml.Element, data: h5py.Dataset, number: int) -> None:
    kind, precision = _NUMBERS[data.dtype.kind]
    item = Xml.SubElement(
        parent, "DataItem", Dimensions=" ".join(map(str, data.shape)), NumberType=kind, Precision=str(precision),
        Format="HDF",
    )  # fmt: skip
    item.text = f"{stem(number)}.h5:{data.name}"


def _write(path: Path, grids: list[Xml.Element], temporal: bool) -> None:
    root = Xml.Element("Xdmf", Version="3.0")
    parent = Xml.SubElement(root, "Domain")
    if temporal:
        parent = Xml.SubElement(parent, "Grid", Name="load path", GridType="Collection", CollectionType="Temporal")
    parent.extend(grids)
    draft = path.with_suffix(".part")
    Xml.ElementTree(root).write(draft, xml_declaration=True, encoding="utf-8")
    draft.replace(path)
