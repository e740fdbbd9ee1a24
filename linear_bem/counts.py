"""Large counts as people read them."""


def grouped(count: float) -> str:
    """Return a count with its digits in groups of three: "60 000"."""
    return f"{count:,.0f}".replace(",", " ")
