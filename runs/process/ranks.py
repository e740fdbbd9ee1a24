"""MPI rank of this process, known before MPI is loaded, and the common end of a run on all ranks."""

import os
import sys
import time
from typing import Any

from linear_bem.errors import MissingDependency

LAUNCHERS = (
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
    ("PMI_RANK", "PMI_SIZE"),
    ("MV2_COMM_WORLD_RANK", "MV2_COMM_WORLD_SIZE"),
    ("SLURM_PROCID", "SLURM_STEP_NUM_TASKS"),
)
PATIENCE = 5.0
"""Time [s] that a failing rank waits for the others to fail as well before it aborts them."""

_farewell: Any = None


def rank_and_size() -> tuple[int, int]:
    """Return this process's rank and the number of ranks, from the launcher's environment."""
    return _from_launcher() or (0, 1)


def launched() -> bool:
    """Return whether an MPI launcher started this process and reads its output."""
    return _from_launcher() is not None


def _from_launcher() -> tuple[int, int] | None:
    for rank, size in LAUNCHERS:
        try:
            return int(os.environ[rank]), int(os.environ[size])
        except (KeyError, ValueError):
            continue
    return None


def hosts() -> int:
    """Return the number of machines that the ranks run on, if the launcher states the ranks per machine."""
    for name in ("OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_NTASKS_PER_NODE"):
        if os.environ.get(name, "").isdigit():
            return -(-rank_and_size()[1] // int(os.environ[name]))
    return 1


def is_root() -> bool:
    """Return whether this process is the one that prints and writes files."""
    return rank_and_size()[0] == 0


def joined() -> bool:
    """Return whether this process takes part in a run over MPI."""
    return _farewell is not None


def world() -> Any:
    """Return the communicator of all ranks; raises `MissingDependency` without mpi4py or its MPI's launcher."""
    global _farewell  # noqa: PLW0603
    try:
        from mpi4py import MPI  # noqa: PLC0415  (only a run that needs MPI loads it)
    except ImportError as error:
        raise MissingDependency(
            f"mpi4py cannot be imported by {sys.executable}: {error}; `thirdbody doctor` names the remedy"
        ) from None
    started, seen = rank_and_size()[1], MPI.COMM_WORLD.size
    if started != seen:
        library = MPI.Get_library_version().split(",")[0].strip("\0 \n")
        raise MissingDependency(
            f"the launcher started {started} process(es), but mpi4py ({library}) sees {seen}: start the ranks with the "
            "mpirun of that MPI; under Slurm choose a plugin from `srun --mpi=list`"
        )
    if _farewell is None:
        _farewell = MPI.COMM_WORLD.Dup()
    return MPI.COMM_WORLD


def share(value: Any, root: int = 0) -> Any:
    """Return the ``value`` of the rank ``root`` on every rank; without MPI, the value itself."""
    return value if _farewell is None else _farewell.bcast(value, root=root)


def all_arrive(comm: Any, patience: float = PATIENCE) -> bool:
    """Return whether all ranks of ``comm`` arrive within ``patience`` seconds (collective)."""
    request = comm.Ibarrier()
    deadline = time.monotonic() + patience
    while not request.Test():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def end_together(code: int, last_words: str, patience: float) -> None:
    """Return when all ranks are about to end; abort them if some wait for this one in a collective call."""
    if _farewell is None or _farewell.size == 1:
        return
    if not all_arrive(_farewell, patience):
        from mpi4py import MPI  # noqa: PLC0415

        if _farewell.rank > 0:
            print(last_words, file=sys.__stderr__, flush=True)
        MPI.COMM_WORLD.Abort(code)
