"""Progress messages of a solver."""

import time
from collections.abc import Callable

Report = Callable[[str], None]
"""Takes a line at every step; an exception that it raises ends the solution."""


def silent(text: str) -> None:
    """Drop the line."""


def seldom(report: Report, before: str = "", seconds: float = 3.0) -> Report:
    """Return a report with ``before`` in front that drops lines within so many seconds of its last, or of this call."""
    last = time.monotonic()

    def passed_on(text: str) -> None:
        nonlocal last
        if time.monotonic() - last >= seconds:
            report(before + text)
            last = time.monotonic()

    return passed_on
