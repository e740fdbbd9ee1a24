"""Notes on numbers of a scene whose unit may be wrong or missing."""

import itertools
import math
from collections.abc import Mapping
from typing import Any

from pydantic_core import PydanticCustomError

from runs.scene.units import Units, items_of, quantity

NO_UNIT, SOFT = "as it has no unit", "is softer than foam and rubber"
"""Words of the notes on numbers whose unit may be wrong."""
LENGTHS = {
    "layer": ("thickness",),
    "balls": ("positions", "radius", "semi_axes", "tip_radius", "edge_radius"),
    "load": ("approach",),
    "reciprocation": ("amplitude", "perturbation"),
    "periodic": ("lengths",),
}
"""Keys of lengths, by table; load steps are lengths only if all balls have the same approach."""


HUGE = 1.0
"""Radius [m] of a ball from which its unit is doubted."""


def unit_notes(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a note per key with a length without unit, beside lengths in another unit; 0 and infinity need none."""
    units, found = Units.written(data), list[str]()
    if units is None:
        return ()
    if units.length.name == "m":
        lengths = (data.get(table, {}).get(key) for table, keys in LENGTHS.items() for key in keys)
        return () if any(isinstance(value, str) for value in items_of(list(lengths))) else _huge_note(data)
    try:
        alike = len({quantity(value, "m") for value in items_of([data.get("load", {}).get("approach", [])])}) == 1
    except PydanticCustomError:
        alike = False
    steps = ("steps",) if alike else ()
    for table, keys in LENGTHS.items():
        for key in (*keys, *(steps if table == "load" else ())):
            items = items_of(data.get(table, {}).get(key))
            bare = (v for v in items if isinstance(v, int | float) and v != 0 and math.isfinite(v))
            found += [f"[{table}] {key} = {value:g}" for value in itertools.islice(bare, 1)]
    return tuple(f"{key} is in metres, {NO_UNIT}; other lengths are in {units.length.name}" for key in found)


def _huge_note(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a note on balls of a metre or more whose radius has no unit, in a scene with units but not of lengths."""
    radius = max((v for v in items_of(data.get("balls", {}).get("radius")) if isinstance(v, int | float)), default=0)
    if radius < HUGE:
        return ()
    return (f"[balls] radius = {radius:g} is in metres, {NO_UNIT}; other values have units: did you mean mm?",)
