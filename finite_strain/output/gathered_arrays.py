"""Arrays whose rows are spread over the ranks, in one HDF5 file that rank 0 writes: Debian's h5py knows no MPI."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI

from finite_strain.mpi import on_root
from linear_bem.errors import OutputUnusable

ROOM = 1_000_000
"""Bytes for what a file holds beside its arrays."""


def write_gathered(
    comm: MPI.Comm, path: Path, arrays: Mapping[str, np.ndarray], describe: Callable[[h5py.File], None]
) -> None:
    """Write each array's rows, one rank's under the other's (collective); ``describe`` adds the rest on rank 0.

    The file is there as a whole or not at all. Raises `OutputUnusable` on every rank if it could not be written.
    """
    parts = {name: comm.gather(array, root=0) for name, array in arrays.items()}

    def write() -> None:
        whole = {name: np.concatenate(rows) for name, rows in parts.items() if rows is not None}
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


def _check_room(path: Path, needed: int) -> None:
    """Raise `OutputUnusable` if the disk has not the bytes that a file needs: HDF5 does not survive a full one."""
    if path.parent.exists() and (free := shutil.disk_usage(path.parent).free) < needed:
        raise OutputUnusable(
            f"{path} cannot be written: No space left on device ({free / 1e6:.1f} MB free, {needed / 1e6:.1f} MB "
            "needed); make room, and the same command goes on from the last step"
        )
