"""File locks, which the system releases when their process ends: they show whether a run is alive or was killed."""

import fcntl
from pathlib import Path
from typing import IO

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
