"""Accepted magnitudes of numbers: no powers that overflow, no number that is lost in roundoff beside others."""

import math
from collections.abc import Mapping, Sequence
from numbers import Real

from linear_bem.counts import listed

SIZES = 1e-30, 1e30
"""Least and largest radius [m], other length of a body [m], slope of a cone, and Young's modulus of a layer [Pa]."""
RATIOS = 1e-9, 1e9
"""Least and largest other length over the largest radius of a ball, and other modulus over the layer's."""
APPROACHES, FORCES = (1e-12, 1e9), (1e-18, 1e18)
"""Least and largest approach over the radius, and force over E R^2."""
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


def are_numbers(values: object) -> bool:
    """Return whether a value is a collection of real numbers."""
    try:
        return all(is_number(value) for value in values)  # type: ignore[attr-defined]
    except TypeError:
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


def load_faults(kind: str, values: Sequence[float], radii: Sequence[float], young: float) -> list[str]:
    """Return a message per fault of a load on balls of these radii [m] on a layer of a Young's modulus [Pa]."""
    if kind not in ("approach", "force", "total_force"):
        return [f'load: must be "approach", "force" or "total_force", got "{kind}"']
    expected = 1 if kind == "total_force" else len(radii)
    faults = []
    if len(values) != expected:
        one = "" if kind != "total_force" else "; force takes one per ball"
        faults.append(f"load.{kind}: needs {expected} value(s), got {len(values)}{one}")
    if not all(math.isfinite(v) for v in values):
        faults.append(f"load.{kind}: must be finite, got {listed(values)}")
    elif kind == "approach" and values and not any(v > 0.0 for v in values):
        faults.append(f"load.approach: at least one ball must be pressed in (> 0), got {listed(values)} m")
    elif kind != "approach" and (min(values, default=0.0) < 0.0 or not any(v > 0.0 for v in values)):
        faults.append(f"load.{kind}: must not be negative and not all zero, got {listed(values)} N")
    else:
        # one total force is compared with the first ball
        for i, (value, radius) in enumerate(zip(values, radii, strict=False)):
            unit = radius if kind == "approach" else young * radius * radius
            least, most = (limit * unit for limit in (APPROACHES if kind == "approach" else FORCES))
            if unit > 0.0 and (0.0 < value < least or value > most):
                rule = f"at most {most:.3g}" if value > most else f"at least {least:.3g}, or 0"
                faults.append(f"load.{kind}[{i}]: must be {rule}, got {value:g}")
    return faults
