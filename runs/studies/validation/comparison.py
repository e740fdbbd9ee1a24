"""A comparison: our numbers beside a source's, both with errors."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from runs.studies.framework.saved_cases import Found
from runs.studies.validation.sources import SOURCES, Source

AGREES, CLOSE, DIFFERS = "agrees", "close", "differs"
SECOND = "second route"
"""Begins the name of a group that is not the source's: another way to our number, left out of the source's verdict."""
CLOSE_BAND = 0.01
"""Relative difference up to which a source that states no error counts as close."""


@dataclass(frozen=True)
class Point:
    """One number of ours and of the source, with their absolute errors; ``error`` nan: the source states none."""

    at: str
    x: float
    ours: float
    bar: float
    theirs: float
    error: float = 0.0

    @property
    def off(self) -> float:
        """Return our number over theirs, less one."""
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
    """What a source, named by ``key``, is compared with; ``points`` reads its groups from the cases that are there."""

    key: str
    quantity: str
    scene: str
    model: str
    points: Callable[[Found], Groups]

    @property
    def source(self) -> Source:
        """Return the published result."""
        return SOURCES[self.key]
