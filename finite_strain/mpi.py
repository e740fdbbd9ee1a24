"""Collective helpers: work on rank 0 with errors raised on all ranks, and a folder that all ranks share."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TypeVar, cast

from mpi4py import MPI

from linear_bem.errors import OutputUnusable, ThirdBodyError

Value = TypeVar("Value")


def on_root(comm: MPI.Comm, action: Callable[[], Value]) -> Value:
    """Run ``action`` on rank 0 and return its value on every rank; if it fails, raise on every rank."""
    failure: ThirdBodyError | None = None
    value = None
    if comm.rank == 0:
        try:
            value = action()
        except ThirdBodyError as error:
            failure = error
        except OSError as error:
            failure = OutputUnusable(f"output folder cannot be written: {error}")
        except Exception as error:  # gmsh raises the base class itself
            failure = ThirdBodyError(f"{type(error).__name__}: {error}")
    failure, value = comm.bcast((failure, value), root=0)
    if failure is not None:
        raise failure
    return value


def on_all(comm: MPI.Comm, action: Callable[[], Value]) -> Value:
    """Return ``action()``, run on every rank; if it fails on some, raise on all: the error there, a notice elsewhere.

    The notice is a `ThirdBodyError` only if all errors are: callers free collective objects only after such errors.
    """
    failure: Exception | None = None
    value = None
    try:
        value = action()
    except Exception as error:
        failure = error
    ours = comm.allgather(None if failure is None else isinstance(failure, ThirdBodyError))
    failed = {rank: kind for rank, kind in enumerate(ours) if kind is not None}
    if failed:
        note = ThirdBodyError if all(failed.values()) else RuntimeError
        raise failure or note(f"the run or a function of the user failed on rank(s) {', '.join(map(str, failed))}")
    return cast(Value, value)


@contextmanager
def working_folder(folder: Path | None, comm: MPI.Comm) -> Iterator[Path]:
    """Yield the folder, created if needed, or a scratch folder that is deleted at the end of the block."""
    if folder is not None:
        on_root(comm, lambda: folder.mkdir(parents=True, exist_ok=True))
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="thirdbody-") if comm.rank == 0 else nullcontext() as scratch:
        yield Path(comm.bcast(scratch, root=0))
        comm.barrier()
