"""Arrays whose rows are spread over the ranks, in one HDF5 file: written in turns, never gathered.

Debian's h5py knows no MPI, so each rank in its turn opens the file and adds its rows; no rank holds more than its own
rows. The file takes its place when the last rank is done: whole, or not at all.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI

from linear_bem.errors import OutputUnusable

ROOM = 1_000_000
"""Bytes for what a file holds beside its arrays."""


def write_in_turns(
    comm: MPI.Comm, path: Path, arrays: Mapping[str, np.ndarray], describe: Callable[[h5py.File], None]
) -> None:
    """Write each array's rows, one rank's under the other's (collective); ``describe`` adds the rest on rank 0.

    Raises `OutputUnusable` on every rank if any rank could not write.
    """
    rows = np.array([len(array) for array in arrays.values()], dtype=np.int64)
    ends = np.array(comm.scan(rows, op=MPI.SUM))
    totals = comm.bcast(ends, root=comm.size - 1)
    draft = path.with_name(f"{path.name}.part")
    needed = sum(int(total) * _row_bytes(array) for array, total in zip(arrays.values(), totals, strict=True)) + ROOM
    failure = comm.recv(source=comm.rank - 1) if comm.rank > 0 else _no_room(path, needed)
    if failure is None:
        try:
            with h5py.File(draft, "r+" if comm.rank > 0 else "w") as file:
                if comm.rank == 0:
                    for (name, array), total in zip(arrays.items(), totals, strict=True):
                        file.create_dataset(name, (int(total), *array.shape[1:]), array.dtype)
                    describe(file)
                for (name, array), end in zip(arrays.items(), ends, strict=True):
                    if len(array):
                        file[name][end - len(array) : end] = array
            if comm.rank == comm.size - 1:
                draft.replace(path)
        except (OSError, RuntimeError) as error:  # HDF5 that cannot flush raises the latter
            failure = f"{path} cannot be written: {error}"
    if comm.rank < comm.size - 1:
        comm.send(failure, dest=comm.rank + 1)
    failure = comm.bcast(failure, root=comm.size - 1)
    if failure is not None:
        raise OutputUnusable(failure)


def _row_bytes(array: np.ndarray) -> int:
    return array.dtype.itemsize * int(np.prod(array.shape[1:], dtype=np.int64))


def _no_room(path: Path, needed: int) -> str | None:
    """Return what is wrong if the disk has not the bytes that a file needs: HDF5 does not survive a full one."""
    try:
        free = shutil.disk_usage(path.parent).free
    except OSError:  # a folder that is not there: opening the file will tell
        return None
    if free >= needed:
        return None
    return (
        f"{path} cannot be written: No space left on device ({free / 1e6:.1f} MB free, {needed / 1e6:.1f} MB needed); "
        "make room, and the same command goes on from the last step"
    )
