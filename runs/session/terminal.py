"""Status messages on standard error: lines and, on a terminal, a spinner with the time of a long computation."""

import contextlib
import sys
import threading
import time
from collections.abc import Iterator

from runs.display.numbers import duration
from runs.process import ranks

FIRST, GROWTH = 5.0, 2.0
"""Time [s] until the first progress message of a long computation, and growth factor of the pauses that follow."""


def print_status(text: str) -> None:
    """Write a line to standard error, after what standard output holds back: both may end in one file."""
    with contextlib.suppress(OSError, ValueError):  # reported at the end
        sys.stdout.flush()
    print(text, file=sys.stderr, flush=True)


def on_terminal() -> bool:
    """Whether standard error is a terminal, and not the pseudo-terminal of an MPI launcher."""
    return sys.stderr.isatty() and not ranks.launched()


@contextlib.contextmanager
def waiting(words: str, first: float = FIRST) -> Iterator[None]:
    """Show the elapsed time of a computation of unknown duration: by a spinner on a terminal, else by lines."""
    began, done = time.monotonic(), threading.Event()

    def passed() -> str:
        return f"{words}: {duration(time.monotonic() - began)} so far"

    def lines() -> None:
        pause = first
        while not done.wait(pause):
            print_status(passed())
            pause *= GROWTH

    def spin() -> None:
        from rich.console import Console  # noqa: PLC0415  (only on a terminal)

        if done.wait(min(first, 1.0)):
            return
        with Console(stderr=True).status(words) as status:
            while not done.wait(0.5):
                status.update(passed())

    thread = threading.Thread(target=spin if on_terminal() else lines, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
