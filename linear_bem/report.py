"""Progress messages of a solver."""

from collections.abc import Callable

Report = Callable[[str], None]
"""Takes a line at every step; an exception that it raises ends the solution."""


def silent(text: str) -> None:
    """Drop the line."""
