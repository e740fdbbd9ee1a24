"""File locks, which the system releases when their process ends: they show whether a run is alive or was killed."""

import contextlib
import fcntl
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from linear_bem.errors import OutputUnusable

RUNNING, STOPPED = "running", "stopped"
"""State that a run writes at its start, and its actual state if its process is gone (killed, or machine failed)."""


def take(file: IO[str], *, wait: bool = False, shared: bool = False) -> bool | None:
    """Return whether this process got the lock of an open file; None where the file system has no locks."""
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def seen(state: str, path: Path) -> str:
    """Return the actual state of the run with the lock ``path``; the written ``state`` if locks do not work."""
    if state != RUNNING:
        return state
    try:
        with open(path, encoding="utf-8") as file:
            return STOPPED if take(file) else RUNNING
    except OSError:
        return RUNNING


@contextlib.contextmanager
def alone(path: Path, wait: Callable[[], None], option: str) -> Iterator[None]:
    """Hold the lock ``path``; ``wait`` is called before waiting for another process that holds it.

    Raises `OutputUnusable` where its folder cannot be written; ``option`` names another.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = open(path, "w", encoding="utf-8")  # noqa: SIM115  (held as long as the block)
    except OSError as error:
        raise OutputUnusable(
            f"{path.parent}: cannot write there: {error.strerror or error}; name another {option}"
        ) from None
    with lock:
        if take(lock) is False:
            wait()
            take(lock, wait=True)
        yield
