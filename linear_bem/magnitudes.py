"""Accepted magnitudes of numbers: no powers that overflow, no number that is lost in roundoff beside others."""

import math
from collections.abc import Mapping
from numbers import Real

SIZES = 1e-30, 1e30
"""Least and largest radius [m], other length of a body [m], slope of a cone, and Young's modulus of a layer [Pa]."""
RATIOS = 1e-9, 1e9
"""Least and largest other length over the largest radius of a ball, and other modulus over the layer's."""
REMEDIES = {
    "layer.thickness": ", or take inf for a half-space, 0 for the substrate alone",
    "periodic.lengths": ", or leave periodic out",
    "substrate.young": ", or leave the substrate out: the base is then rigid",
}
"""Further remedies in messages, by key."""


def is_number(value: object) -> bool:
    """Return whether a value is a real number (no bool) that a float can hold: whole numbers may be too large."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and isinstance(float(value), float)
    except OverflowError:
        return False


def range_faults(numbers: Mapping[str, float], unit: str = "", of: float = 1.0, what: str = "") -> list[str]:
    """Return a message per number outside `SIZES` or, if ``what`` describes ``of`` in words, outside `RATIOS` of it.

    Numbers that are not positive and finite are left to other checks.
    """
    least, most = RATIOS if what else SIZES
    faults = []
    for key, value in numbers.items():
        if 0.0 < value < math.inf and 0.0 < of < math.inf and not least * of <= value <= most * of:
            bound, limit = ("least", least) if value < of else ("most", most)
            reason = f", {limit:g} of {what}" if what else ""
            remedy = f"check its unit{REMEDIES.get(key.partition('[')[0], '')}"
            said, got = (f"{number:.3g} {unit}".rstrip() for number in (limit * of, value))
            faults.append(f"{key}: must be at {bound} {said}{reason}, got {got}; {remedy}")
    return faults
