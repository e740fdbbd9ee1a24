"""Progress messages of a solver."""

import time
from collections.abc import Callable

Report = Callable[[str], None]
"""Receives a line at every step; an exception that it raises ends the solution."""


def silent(text: str) -> None:
    """Drop the line."""


class Timed:
    """Passes lines on and keeps the time of the last one."""

    def __init__(self, report: Report) -> None:
        self._report, self.last = report, time.monotonic()

    def __call__(self, text: str) -> None:
        """Pass a line on."""
        self._report(text)
        self.last = time.monotonic()


def seldom(report: Report, before: str = "") -> Report:
    """Return a report that prefixes ``before`` and drops lines within 2 s of the last line or of this call.

    If ``report`` is `Timed`, the last line of the whole solution counts.
    """
    timed = report if isinstance(report, Timed) else Timed(report)

    def passed_on(text: str) -> None:
        if time.monotonic() - timed.last >= 2.0:
            timed(before + text)

    return passed_on
