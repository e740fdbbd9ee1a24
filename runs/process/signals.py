"""SIGINT (Ctrl-C) and SIGTERM: recorded, so that no solver mistakes them for a failed iteration."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

resumable = False
"""Whether this run saves its finished parts, so that it can be resumed."""
_received: int | None = None
_held = False


def listen() -> None:
    """Turn SIGINT and SIGTERM into `KeyboardInterrupt`."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _note)


def received() -> int | None:
    """Return the number of the signal that asked this run to stop."""
    return _received


def check() -> None:
    """Raise `KeyboardInterrupt` when a signal has asked this run to stop."""
    if _received is not None:
        raise KeyboardInterrupt


@contextmanager
def held() -> Iterator[None]:
    """Defer a first signal to the end of the block, so that its changes are complete."""
    global _held  # noqa: PLW0603
    _held = True
    try:
        yield
    finally:
        _held = False
    check()


def _note(number: int, frame: FrameType | None) -> None:
    global _received  # noqa: PLW0603
    if _received is not None:
        sys.exit(128 + number)
    _received = number
    if not _held:
        raise KeyboardInterrupt
