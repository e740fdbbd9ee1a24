"""Elapsed and remaining time of a run over its meshes, estimated from the plan and from the pace so far."""

import time
from collections.abc import Callable, Sequence

GROWTH = 1.5
"""Exponent of the growth of time with the number of unknowns from one mesh to the next."""
TRUST = 0.1
"""Share of the planned work after which the pace so far counts as much as the plan's: the first meshes are small, and
their pace says little about that of large ones."""


class Clock:
    """Estimates the remaining time; ``expected``: planned times [s] of the first meshes, empty without a plan."""

    def __init__(self, expected: Sequence[float] = (), now: Callable[[], float] = time.monotonic) -> None:
        self._expected, self._trust, self._now = list(expected), TRUST * sum(expected), now
        self._began = self._worked = now()
        self._share, self._mesh, self._unknowns, self._saved = 0.0, 0, 0.0, 0.0

    @property
    def elapsed(self) -> float:
        """Seconds since the run began."""
        return self._now() - self._began

    def begin(self) -> None:
        """Note that the work begins: the time before, for example for compilation, does not count towards the pace."""
        self._worked = self._now()

    def next_mesh(self, unknowns: float, saved: float = 0.0) -> None:
        """Begin a mesh, of which the share ``saved`` is done; an unplanned mesh is taken to cost more than the last."""
        self._mesh += 1
        if self._expected and self._mesh >= len(self._expected):
            self._expected.append(self._expected[-1] * (unknowns / self._unknowns) ** GROWTH)
        self._unknowns, self._share = unknowns, saved
        if saved > 0.0:
            self._saved = self._work()

    def reached(self, share: float) -> None:
        """Note the completed share of the current mesh's work."""
        self._share = share

    @property
    def done(self) -> float | None:
        """Completed share of the planned work; None without a plan."""
        total = sum(self._expected)
        return self._work() / total if total > 0.0 else None

    @property
    def left(self) -> float | None:
        """Seconds to the end of the current and all further planned meshes; None without a plan."""
        total = sum(self._expected)
        if total <= 0.0:
            return None
        done = self._work()
        pace = (self._now() - self._worked + self._trust) / (done - self._saved + self._trust)
        return pace * (total - done)

    def _work(self) -> float:
        present = self._expected[self._mesh : self._mesh + 1]
        return sum(self._expected[: self._mesh]) + self._share * sum(present)
