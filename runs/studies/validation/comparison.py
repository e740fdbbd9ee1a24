"""A comparison of our numbers with those of a source, both with errors."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from runs.studies.framework.saved_cases import Found
from runs.studies.validation.sources import SOURCES, Source

AGREES, CLOSE, DIFFERS = "agrees", "close", "differs"
SECOND = "second route"
"""Prefix of a group that is not the source's: another route to our number, not part of the verdict on the source."""
FORCE_BAR = 1e-4
"""Relative error of a force of `linear_bem`: the change between two discretisations that its solver permits."""
RADIUS_BAR = 1e-3
"""Its relative error of peak pressure, contact radius, and stiffness over radius: difference of two unlike bodies."""
CLOSE_BAND = 0.01
"""Relative difference up to which a source without a stated error counts as close."""


@dataclass(frozen=True)
class Point:
    """Our number and that of the source, with absolute errors ``bar`` and ``error`` (nan: the source states none)."""

    at: str
    x: float
    ours: float
    bar: float
    theirs: float
    error: float = 0.0

    @property
    def off(self) -> float:
        """Return our number over theirs, minus one."""
        return self.ours / self.theirs - 1.0

    @property
    def verdict(self) -> str:
        """Return `AGREES` within both errors, `CLOSE` within 1 % of a source without a stated error, else `DIFFERS`."""
        stated = 0.0 if math.isnan(self.error) else self.error
        if abs(self.ours - self.theirs) <= self.bar + stated:
            return AGREES
        return CLOSE if math.isnan(self.error) and abs(self.off) <= CLOSE_BAND else DIFFERS


Groups = dict[str, list[Point]]
"""Points by scene."""


@dataclass(frozen=True)
class Comparison:
    """Comparison with the source named by ``key``; ``points`` computes its groups from the finished cases."""

    key: str
    quantity: str
    scene: str
    model: str
    points: Callable[[Found], Groups]

    @property
    def source(self) -> Source:
        """Return the published result."""
        return SOURCES[self.key]
