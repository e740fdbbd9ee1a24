"""Numbers of a scene: plain SI floats, or strings with a unit that pint knows ("10 mm", "57.4 kPa")."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, PlainValidator
from pydantic_core import PydanticCustomError

from linear_bem.magnitudes import is_number

T = TypeVar("T")
NUMBER_AND_UNIT = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?inf)\s*(?P<unit>[^\d\s+\-.,][^+,]*)?\s*", re.DOTALL
)
UNIT = re.compile(r"(?:[^\W\d_]+(?:(?:\^|\*\*)-?\d|[\u00b2\u00b3])?(?:\s*[*/\u00b7]\s*|\s+|$))+")
"""Names with small exponents: pint would evaluate any expression, even 9**9**9."""
SIZES = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "rad": {"deg": math.pi / 180.0, "rad": 1.0},
}
"""Sizes of common units by their SI unit: a scene with no others does not wait a quarter second for pint."""
COMMON = tuple(name for sizes in SIZES.values() for name in sizes)
"""Units that are suggested for a name that differs from them in its capitals alone."""
DIMENSIONS = {
    "m": ("a length", "10 mm"),
    "Pa": ("a pressure", "57.4 kPa"),
    "N": ("a force", "2 N"),
    "rad": ("an angle", "20 deg"),
}


def fault(text: str) -> PydanticCustomError:
    """Return the validation error with the message ``text``, which may hold braces."""
    return PydanticCustomError("quantity", "{text}", {"text": text})


@lru_cache(maxsize=1)
def _units() -> Any:
    import pint  # noqa: PLC0415  (slow, and few scenes need it)

    return pint.UnitRegistry()


def number(value: object) -> float:
    """Return a dimensionless number as a float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        comma = isinstance(value, str) and re.fullmatch(r"\s*[-+]?\d+,\d+\s*", value)
        raise fault("must be a plain number" + ("; write decimals with a point, without quotes" if comma else ""))
    if not is_number(value):
        raise fault("must be a number below 1.8e308")
    if math.isnan(value):
        raise fault("must be a number, not nan")
    return float(value)


def whole(value: object) -> int:
    """Return a whole number."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise fault("must be a whole number")
    if abs(value) >= 2**63:  # TOML's limit, which Python does not check
        raise fault("must be a whole number below 2^63")
    return value


def direction(value: object) -> tuple[float, float]:
    """Return the unit vector along a list [x, y] of plain numbers."""
    x, y = many(value, number, "number", "must be a list [x, y] of two plain numbers, such as [1, 0]", 2)
    length = math.hypot(x, y)
    if not 0.0 < length < math.inf:
        raise fault("must point somewhere: a finite [x, y] that is not [0, 0]")
    return x / length, y / length


def quantity(value: object, unit: str) -> float:
    """Return ``value`` in ``unit`` (an SI unit: m, Pa, N or rad); a plain number is in ``unit`` already."""
    kind, example = DIMENSIONS[unit]
    if isinstance(value, list):
        raise fault(f"must be one value, {kind}, no list")
    if isinstance(value, int | float) and not isinstance(value, bool):
        return number(value)
    match = NUMBER_AND_UNIT.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        comma = "; write decimals with a point" if re.match(r"\s*[-+]?\d+,\d", str(value)) else ""
        raise fault(f'must be {kind}: a number in {unit}, or a string such as "{example}"{comma}')
    plain = float(match["number"])
    if match["unit"] is None:
        if math.isinf(plain):
            return plain
        raise fault(f'must be {kind} with its unit, such as "{example}"; a bare number in {unit} takes no quotes')
    name = match["unit"].strip()
    if name in SIZES[unit]:
        return _finite(plain * SIZES[unit][name], match["number"], unit)
    try:
        if UNIT.fullmatch(name) is None:
            raise ValueError(name)
        given = _units().parse_units(name)
        matches = given.is_compatible_with(unit)
    except Exception as error:  # pint raises a dozen kinds, tokenizer errors among them
        power = ", powers are written with ^" if re.search(r"[A-Za-z]\d$", name) else ""
        alike = (each for each in COMMON if _units().is_compatible_with(each, unit))
        meant = next((each for each in alike if each.lower() == name.lower()), None)
        power = f' (did you mean "{meant}"?)' if meant else power
        raise fault(f'must be {kind}, such as "{example}": "{name}" is not a unit{power}') from error
    if not matches:
        together = name.replace(" ", "")
        if together != name and together in COMMON and _units().is_compatible_with(together, unit):
            raise fault(f'must be {kind}, such as "{example}": "{name}" is not a unit (did you mean "{together}"?)')
        others = (what for si, (what, _) in DIMENSIONS.items() if given.is_compatible_with(si))
        is_what = next(others, f"of dimension {given.dimensionality}")
        raise fault(f'must be {kind}, such as "{example}": "{name}" is {is_what}')
    return _finite(float((plain * given).to(unit).magnitude), match["number"], unit)


def _finite(value: float, written: str, unit: str) -> float:
    if math.isinf(value) and "inf" not in written:
        raise fault(f"must be {DIMENSIONS[unit][0]} below 1.8e308 {unit}")
    return value


@dataclass(frozen=True)
class Unit:
    """A unit in which numbers are shown: its name, and its size in SI. A scene without units has R, E R² and E."""

    name: str
    size: float

    def __call__(self, value: float, digits: int = 4) -> str:
        """Return ``value`` [SI] in this unit: "1.5 mm"."""
        return f"{value / self.size:.{digits}g} {self.name}"

    def heading(self, symbol: str) -> str:
        """Return the heading of a column of numbers in this unit: "D [mm]", "D / R"."""
        return f"{symbol} / {self.name}" if self.name in ("R", "E R²", "E") else f"{symbol} [{self.name}]"


def in_unit(text: str, length: Unit) -> str:
    """Return a text with its lengths in metres ("0.016 m") in another unit."""
    return re.sub(r"(\d+\.?\d*(?:e[+-]?\d+)?|inf) m\b", lambda number: length(float(number[1]), 9), text)


@dataclass(frozen=True)
class Units:
    """The units in which a scene states lengths, forces and pressures; SI where it states none."""

    length: Unit = Unit("m", 1.0)
    force: Unit = Unit("N", 1.0)
    pressure: Unit = Unit("Pa", 1.0)

    @classmethod
    def written(cls, data: Mapping[str, Any]) -> Units | None:
        """Return the first unit of each kind in the tables of a valid scene; None where it has no units."""
        found: dict[str, Unit] = {}
        for value in items_of([data.get(table, {}) for table in ("layer", "balls", "load", "substrate")]):
            match = NUMBER_AND_UNIT.fullmatch(value) if isinstance(value, str) else None
            if match is None or match["unit"] is None or UNIT.fullmatch(name := match["unit"].strip()) is None:
                continue
            for kind, si in (("length", "m"), ("force", "N"), ("pressure", "Pa")):
                size = SIZES[si].get(name)
                if size is None and name not in COMMON and (unit := _units().parse_units(name)).is_compatible_with(si):
                    size = float((1.0 * unit).to(si).magnitude)
                if size is not None:
                    found.setdefault(kind, Unit(name, size))
        return cls(**found) if found else None


DIMENSIONLESS = Units(Unit("R", 1.0), Unit("E R²", 1.0), Unit("E", 1.0))
"""Units of a scene in which R and E are 1 by their numbers."""


def items_of(value: Any) -> Iterator[Any]:
    """Yield the values in nested tables and lists."""
    if isinstance(value, Mapping | list):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from items_of(item)
    else:
        yield value


def one_or_many(value: object, parse: Callable[[object], T]) -> T | tuple[T, ...]:
    """Return one parsed value, or a tuple of them for a list: one per ball."""
    return many(value, parse, "value") if isinstance(value, list) else parse(value)


def named(value: object, names: Sequence[str]) -> str:
    """Return a value that is one of some names."""
    if not isinstance(value, str) or value not in names:
        *others, last = (f'"{name}"' for name in names)
        raise fault(f"must be {', '.join(others)} or {last}")
    return value


def one_or_many_axes(value: object) -> tuple[float, ...] | tuple[tuple[float, ...], ...]:
    """Return three lengths [m], or a tuple of three of each of several bodies."""
    if isinstance(value, list) and any(isinstance(item, list) for item in value):
        return many(value, three_lengths, "value")
    return three_lengths(value)


def position_pairs(value: object) -> tuple[tuple[float, float], ...]:
    """Return the axis positions (x, y) [m] of a list of pairs."""
    if not isinstance(value, list) or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        raise fault('must be a list of [x, y] pairs, such as [["-8 mm", 0], ["8 mm", 0]]')
    flat = many([c for pair in value for c in pair], metres, "ball", per_item=2)
    return tuple(zip(flat[::2], flat[1::2], strict=True))


def many(
    value: object, parse: Callable[[object], T], of: str, rule: str = "must be a list", count: int | None = None,
    per_item: int = 1,
) -> tuple[T, ...]:  # fmt: skip
    """Return the parsed values of a list, of ``count`` values where that is given; ``rule`` is the fault of all else.

    ``of`` names an item of the list in the faults of its values, of which an item has ``per_item``.
    """
    if not isinstance(value, list) or count not in (None, len(value)):
        raise fault(rule)
    parsed, faults = list[T](), []
    for index, each in enumerate(value):
        try:
            parsed.append(parse(each))
        except PydanticCustomError as error:
            faults.append(f"{of} {index // per_item}: {error.message()}")
    if faults:
        raise fault("; ".join(faults))
    return tuple(parsed)


metres = partial(quantity, unit="m")
three_lengths = partial(
    many, parse=metres, of="length", rule='must be a list of three lengths, such as ["8 mm", "6 mm", "8 mm"]', count=3
)
Number = Annotated[float, PlainValidator(number)]
Numbers = Annotated[tuple[float, ...], PlainValidator(partial(many, parse=number, of="number"))]
Listed = Annotated[tuple[object, ...], PlainValidator(partial(many, parse=lambda value: value, of="item"))]
Whole = Annotated[int, PlainValidator(whole)]
Direction = Annotated[tuple[float, float], PlainValidator(direction)]
Length = Annotated[float, PlainValidator(metres)]
Pressure = Annotated[float, PlainValidator(partial(quantity, unit="Pa"))]
Force = Annotated[float, PlainValidator(partial(quantity, unit="N"))]
OneOrMany = float | tuple[float, ...]
Lengths = Annotated[OneOrMany, PlainValidator(partial(one_or_many, parse=metres))]
Angles = Annotated[OneOrMany, PlainValidator(partial(one_or_many, parse=partial(quantity, unit="rad")))]
Forces = Annotated[OneOrMany, PlainValidator(partial(one_or_many, parse=partial(quantity, unit="N")))]
TWO = "must be two lengths, along x and y"
TwoLengths = Annotated[tuple[float, float], PlainValidator(partial(many, parse=metres, of="length", rule=TWO, count=2))]
SemiAxes = Annotated[tuple[Any, ...], PlainValidator(one_or_many_axes)]
Positions = Annotated[tuple[tuple[float, float], ...], PlainValidator(position_pairs)]


class Table(BaseModel):
    """A table of the scene: unknown keys are faults; the text below a key describes it in the handbook."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
