"""A run that ends as by Ctrl-C, after some of its looks for a signal."""

from __future__ import annotations

from collections.abc import Callable


def killed_after(looks: int) -> Callable[[], None]:
    """Return a stand-in of `runs.process.signals.check` that raises `KeyboardInterrupt` after ``looks`` calls."""
    left = iter(range(looks))

    def check() -> None:
        if next(left, None) is None:
            raise KeyboardInterrupt

    return check
