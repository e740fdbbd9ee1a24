"""Status messages on standard error: lines and, on a terminal, a progress bar or a spinner with the time."""

import contextlib
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from runs.display.numbers import duration
from runs.process import ranks
from runs.session.clock import Clock

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


class Bar:
    """Progress bar of the planned work with elapsed and remaining time, below the lines of a run."""

    def __init__(self, clock: Clock) -> None:
        from rich.console import Console  # noqa: PLC0415  (only on a terminal)
        from rich.progress import BarColumn, ProgressColumn, TextColumn  # noqa: PLC0415
        from rich.progress import Progress as RichProgress  # noqa: PLC0415
        from rich.table import Column  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        class Times(ProgressColumn):
            def render(self, task: Any) -> Text:
                left = clock.left
                return Text(duration(clock.elapsed) + (f", about {duration(left)} left" if left else ""))

        words, times = TextColumn("{task.description}", markup=False), Times(Column(no_wrap=True))
        self.bar = RichProgress(
            words, BarColumn(), times, console=Console(stderr=True), transient=True, refresh_per_second=2
        )
        self._clock, self._task = clock, self.bar.add_task("starting", total=1.0)

    def show(self, state: str) -> None:
        """Show what is being done."""
        self.bar.update(self._task, description=state, completed=self._clock.done or 0.0)


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
