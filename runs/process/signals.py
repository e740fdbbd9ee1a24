"""SIGINT (Ctrl-C) and SIGTERM: recorded, so that no solver mistakes them for a failed iteration."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

resumable = False
"""Whether this run saves its finished parts, so that it can be resumed."""
_received: int | None = None
_held = False
_speaker: subprocess.Popen[bytes] | None = None


def listen() -> None:
    """Turn SIGINT and SIGTERM into `KeyboardInterrupt`."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _note)


def received() -> int | None:
    """Return the number of the signal that asked this run to stop."""
    return _received


def last_words() -> str:
    """Return the line that a stopped run prints."""
    saves = sys.argv[1:2] == ["study"] or resumable
    return f"thirdbody: stopped{'; finished steps are saved, and the same command continues from there' * saves}"


def speak_at_once() -> None:
    """Let a child process print `last_words` when a signal arrives.

    An MPI launcher kills its ranks a second after the signal, before Python can answer in the midst of a solver's work.
    """
    global _speaker  # noqa: PLW0603
    words = ["sh", "-c", 'trap "" INT TERM; test -n "$(head -c 1)" && echo "$0" >&2', last_words()]
    _speaker = subprocess.Popen(words, stdin=subprocess.PIPE, bufsize=0)
    assert _speaker.stdin is not None
    os.set_blocking(_speaker.stdin.fileno(), False)
    signal.set_wakeup_fd(_speaker.stdin.fileno())


def spoken() -> bool:
    """Return whether the child process prints the last words."""
    return _speaker is not None and _received is not None


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
