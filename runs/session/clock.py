"""Time passed and time left of a run along its meshes, from the plan and from the pace so far."""

import time
from collections.abc import Callable, Sequence

GROWTH = 1.5
"""Power of the unknowns by which a finer mesh takes longer than the one before it."""
ENOUGH = 0.05
"""Part of the planned work after which the pace so far counts."""


class Clock:
    """``expected``: planned seconds of the first meshes; none where there is no plan."""

    def __init__(self, expected: Sequence[float] = (), now: Callable[[], float] = time.monotonic) -> None:
        self._expected, self._now = list(expected), now
        self._began = self._worked = now()
        self._share, self._mesh, self._unknowns, self._saved = 0.0, 0, 0.0, 0.0

    @property
    def elapsed(self) -> float:
        """Seconds since the run began."""
        return self._now() - self._began

    def begin(self) -> None:
        """Note that the work begins: time before, such as that of compiling, does not count towards the pace."""
        self._worked = self._now()

    def next_mesh(self, unknowns: float, saved: float = 0.0) -> None:
        """Begin a mesh of which a share was ``saved`` before; one that was not planned costs more than the last."""
        self._mesh += 1
        if self._expected and self._mesh >= len(self._expected):
            self._expected.append(self._expected[-1] * (unknowns / self._unknowns) ** GROWTH)
        self._unknowns = unknowns
        if saved > 0.0:
            self._saved = sum(self._expected[: self._mesh]) + saved * sum(self._expected[self._mesh : self._mesh + 1])
        self._share = saved

    def reached(self, share: float) -> None:
        """Note the share of the present mesh's work that is done."""
        self._share = share

    @property
    def done(self) -> float | None:
        """Share of the planned work that is done; None without a plan."""
        total = sum(self._expected)
        return self._work() / total if total > 0.0 else None

    @property
    def left(self) -> float | None:
        """Seconds to the end of the present mesh and of those planned after it; None without a plan."""
        total = sum(self._expected)
        if total <= 0.0:
            return None
        done = self._work()
        new = done - self._saved
        pace = (self._now() - self._worked) / new if new > ENOUGH * total else 1.0
        return pace * (total - done)

    def _work(self) -> float:
        present = self._expected[self._mesh : self._mesh + 1]
        return sum(self._expected[: self._mesh]) + self._share * sum(present)
