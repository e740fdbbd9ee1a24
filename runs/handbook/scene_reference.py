"""The page that explains the scene file key by key, generated from the pydantic models that read it.

``python -m runs.handbook.scene_reference`` prints it.
"""

import inspect
import json
import re
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from runs.scene import balls, units
from runs.scene.effects import EFFECTS
from runs.scene.messages import examples, tables_of
from runs.scene.scene_file import Tables
from runs.studies.framework.page import markdown

UNITS = {"length": "m", "angle": "rad", "force": "N", "pressure": "Pa"}
"""Words in the names of the types of `runs.scene.units`, and the unit of a plain number."""
PLAIN = {str: "text", int: "integer", float: "number", bool: "true or false"}
NAMED = {
    "Whole": "integer",
    "Numbers": "list of numbers",
    "Direction": "list of two numbers",
    "Positions": "list of [x, y] (m)",
    "Listed": "list of loads",
    "SemiAxes": "three lengths (m), or a list with three per ball",
    "Shapes": " or ".join(map('`"{}"`'.format, balls.SHAPE_KEYS)) + ", or a list with one per ball",
}
"""Descriptions of types whose names do not tell the user what to write."""


def page() -> str:
    """Return the page in Markdown."""
    from finite_strain.output.field_catalogue import CATALOGUE  # noqa: PLC0415  (without DOLFINx)

    parts = [HEAD]
    for name, table in tables_of(Tables):
        effect = EFFECTS.get(name)
        parts.append(f"## `[{name}]`\n")
        if effect is not None:
            parts.append(f"Effect: {effect.words}. Without this table, {effect.without}.\n")
        parts.append(_prose(table))
        rows = [_row(name, key, field) for key, field in table.model_fields.items()]
        parts.append("\n".join(markdown(rows, aligned=False)) + "\n")
        if name == "output":
            fields = [
                {"field": f"`{field}`", "unit": each.unit, "meaning": each.meaning} for field, each in CATALOGUE.items()
            ]
            parts += [FIELDS, "\n".join(markdown(fields, aligned=False)) + "\n"]
    return "\n".join(parts)


HEAD = """# The scene file, key by key

A scene is a TOML file: first the `title`, then tables. Lengths, forces, pressures and angles are
strings with a unit, such as `"10 mm"`, `"57.4 kPa"`, `"2 N/mm^2"` or `"20 deg"`, or plain numbers in m, N, Pa and rad.
All units of the library pint are known, with prefixes: `"mPa"` is a millipascal, `"MPa"` a megapascal, `"um"` a micron.
`[layer]`, `[balls]` and `[load]` are required; all other tables are optional. Where a table is given, it needs its keys
marked *required*. An *effect* without its table is not simulated and costs nothing. Faults are reported
before the computation, each with its table, key, rule and value: first all faults of single keys, then those of values
that do not fit each other.

This page is generated from the code that reads scenes.
"""


FIELDS = """The fields, at the nodes of the undeformed mesh; each cell also has its `region`, 1 the layer, 2 the
substrate:
"""


def _prose(table: type[BaseModel]) -> str:
    text = inspect.cleandoc(table.__doc__ or "")
    text = re.sub(r"^\[\w+\]: ", "", text).replace("``", "`")
    return text[:1].upper() + text[1:] + "\n"


def _row(table: str, key: str, field: FieldInfo) -> dict[str, str]:
    known = examples(table)
    return {
        "key": f"`{key}`",
        "meaning": " ".join((field.description or "").split()),
        "value": meaning(field),
        "default": "required" if field.is_required() else "" if field.default is None else _toml(field.default),
        "example": _toml(known[key]) if key in known else "",
    }


def meaning(field: FieldInfo) -> str:
    """Return the description of a key's permitted values."""
    if field.metadata:
        known = [name for name, kind in _types() if list(kind.__metadata__) == field.metadata]
        return _words(known[0])
    annotation = field.annotation
    kinds = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    return " or ".join(_of(kind) for kind in kinds if kind is not type(None))


def _of(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return " or ".join(f"`{json.dumps(value)}`" for value in get_args(kind))
    if get_origin(kind) is tuple:
        return f"list of {_of(get_args(kind)[0])}s"
    named = [name for name, known in _types() if known == kind]
    return _words(named[0]) if named else PLAIN[kind]


def _types() -> list[tuple[str, Any]]:
    """Return the types that parse the values of a scene."""
    return [(name, kind) for name, kind in (vars(units) | vars(balls)).items() if hasattr(kind, "__metadata__")]


def _words(name: str) -> str:
    if name in NAMED:
        return NAMED[name]
    words = re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower()
    unit = next((f" ({unit})" for word, unit in UNITS.items() if word in words), "")
    if get_args(getattr(units, name))[0] == units.OneOrMany:
        words = f"{words.removesuffix('s')}, or a list with one per ball"
    return words + unit


def _toml(value: Any) -> str:
    return f"`{json.dumps(value)}`"


if __name__ == "__main__":
    print(page())
