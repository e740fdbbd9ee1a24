"""Large counts and lists of numbers as people read them."""

from collections.abc import Sequence


def grouped(count: float) -> str:
    """Return a count with its digits in groups of three: "60 000"."""
    return f"{count:,.0f}".replace(",", " ")


def listed(values: Sequence[float]) -> str:
    """Return the different values, at most five."""
    several = [f"{value:g}" for value in dict.fromkeys(values)]
    return ", ".join(several[:5]) + (", ..." if len(several) > 5 else "")
