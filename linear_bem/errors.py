"""What can go wrong, one class each; every class is also the nearest built-in exception."""

from __future__ import annotations


class ThirdBodyError(Exception):
    """Base of every error that this project raises on purpose: its text names rule, value and remedy."""


class InvalidProblem(ThirdBodyError, ValueError):
    """The problem as stated has no meaning (negative thickness, overlapping balls, ...).

    ``faults`` holds one text per fault, so that all of them are reported at once.
    """

    def __init__(self, *faults: str) -> None:
        self.faults = faults
        super().__init__("\n".join(faults))


class UnsupportedProblem(ThirdBodyError, NotImplementedError):
    """The problem is meaningful, but the chosen model lacks an effect that it calls for."""


class NotConverged(ThirdBodyError, ArithmeticError):
    """A solver stopped short of its criterion; no number of the unfinished state is reported."""


class OutputUnusable(ThirdBodyError, OSError):
    """A folder or file cannot be written, read, or belongs to another run."""


class MissingDependency(ThirdBodyError, ImportError):
    """A package that the chosen model needs cannot be imported by this Python."""
