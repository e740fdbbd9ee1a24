"""The whole scene's fields for ParaView and meshio: each written step completed by reflection at its mirror planes."""

from collections.abc import Mapping
from pathlib import Path

from linear_bem.errors import OutputUnusable
from runs.pictures.written_step import read_step
from runs.process.files import replacing

FOLDER = "whole"


def write_whole(files: Mapping[int, Path], folder: Path) -> Path:
    """Write the steps in ``files`` (path by number) as whole scenes into ``folder``; return the index file of all.

    Vectors and tensors are reflected, nodes on a mirror plane are shared; names, units and kinds remain.
    """
    import h5py  # noqa: PLC0415  (only where fields are read)

    from finite_strain.output.step_files import INDEX, stem, write_step_and_index  # noqa: PLC0415

    try:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("step_*.*"):
            old.unlink()
    except OSError as error:
        raise OutputUnusable(f"{folder}: cannot be written: {error.strerror or error}; name another --out") from None
    for number, path in sorted(files.items()):
        step = read_step(path, number)
        arrays = {"points": step.points, "cells": step.cells, "cell_fields/region": step.region}
        arrays |= {f"node_fields/{name}": values for name, values in step.fields.items()}
        arrays["node_fields/displacement"] = step.displacement
        with replacing(folder / f"{stem(number)}.h5") as draft, h5py.File(path) as part, h5py.File(draft, "w") as file:
            for name, values in arrays.items():
                file[name] = values
                file[name].attrs.update(part[name].attrs)
            file["points"].attrs["meaning"] = "undeformed nodes of the whole scene, in its frame"
        write_step_and_index(folder, number)
    return folder / INDEX
