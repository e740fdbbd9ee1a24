"""Error classes; each is also a subclass of the nearest built-in exception."""


class ThirdBodyError(Exception):
    """Base of all errors of this project; the message states the rule, the value and a remedy."""


class InvalidProblem(ThirdBodyError, ValueError):
    """The problem is not valid (negative thickness, overlapping balls, ...).

    ``faults`` holds one message per fault, so that all are reported at once.
    """

    def __init__(self, *faults: str) -> None:
        self.faults = faults
        super().__init__("\n".join(faults))


class UnsupportedProblem(ThirdBodyError, NotImplementedError):
    """The problem is valid, but the chosen model lacks an effect that it contains."""


class NotConverged(ThirdBodyError, ArithmeticError):
    """A solver did not reach its stopping criterion; no result is returned."""


class TooLarge(ThirdBodyError, MemoryError):
    """The problem needs more memory than is free; nothing was computed."""


class OutputUnusable(ThirdBodyError, OSError):
    """A folder or file cannot be written, read, or belongs to another run."""


class MissingDependency(ThirdBodyError, ImportError):
    """A package that the chosen model needs cannot be imported by this Python."""
