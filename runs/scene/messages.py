"""Messages about faults of a scene: table, key, rule, value received and remedy."""

import copy
import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, get_args

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from linear_bem.law import LAWS
from runs.scene.effects import EFFECTS
from runs.scene.units import NUMBER_AND_UNIT, Units, in_unit

PROBLEM_FAULT = re.compile(r"(?P<table>\w+)\.(?P<key>\w+)(?P<index>\[\d+\])?: (?P<rule>.*)", re.DOTALL)
UNQUOTED = re.compile(r"(\w+)\s*=\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?\s*[A-Za-zµ][\w/*^·²]*)\s*(?:#.*)?")
KEYS = re.compile(r"\w+\.\w+(, \w+\.\w+)+: ")
EXAMPLES: dict[str, dict[str, Any]] = {
    "layer": {"thickness": "10 mm", "young": "1 MPa", "poisson": 0.48},
    "balls": {"radius": "8 mm", "positions": [["-8 mm", 0], ["8 mm", 0]], "shape": "sphere"},
    "load": {"approach": "1.5 mm"},
    "accuracy": {"tangential_force": 0.01, "seconds": 600, "unknowns": 100_000},
    "elements": {"form": "mixed"},
    "output": {"fields": ["displacement", "von_mises"], "every": 1},
    **{name: dict(effect.example) for name, effect in EFFECTS.items()},
}
"""A valid value of every key: shown as remedy, and substituted for a faulty value while the rest is checked."""
RARER_EXAMPLES: dict[str, dict[str, Any]] = {
    "load": {"force": "2 N", "total_force": "4 N", "steps": ["0.5 mm", "1 mm"]},
    "balls": {"semi_axes": ["8 mm", "6 mm", "8 mm"], "slope": "20 deg", "tip_radius": "1 mm", "edge_radius": "0.5 mm"},
    "finite_strain": {"share": 0.2, "ratios": [0.01, 0.001], "limit": 30, "exponents": [2, -2], "weights": [0.8, 0.2]},
}
"""The same for keys that only some scenes take."""
INSTEAD = {
    "diameter": "give radius, half of it",
    "shear_modulus": "give young, 2 (1 + poisson) times it",
    "modulus": "give young, Young's modulus",
    "nu": "give poisson",
    "rigid": "the base is rigid where [substrate] is left out",
    "indentation": "give approach",
    "tolerance": "[accuracy] tangential_force is the accuracy of T, [reciprocation] tolerance that of a drift's steps",
}
"""What to write in place of keys that people expect."""


def of_key(error: ErrorDetails, tables: type[BaseModel]) -> str:
    """Return the text of one fault that pydantic found in a scene."""
    place = [part for part in error["loc"] if isinstance(part, str)]
    table, key = [*place, "", ""][:2]
    where = f"[{table}] {key}".rstrip() if key or table in EXAMPLES else table
    match error["type"]:
        case "extra_forbidden":
            return f"{where}: unknown {'key' if key else 'table or key'}{_meant(table, key, tables)}"
        case "missing":
            return f"{where}: is missing; {_example(table, key)}"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"{where}: must be a table, got {_written(error['input'])}; {_example(table, '')}"
        case "literal_error":
            rule = f"must be {error['ctx']['expected']}".replace("'", '"')
        case "tuple_type":
            rule = "must be a list"
        case "string_type":
            rule = "must be a string"
        case _:
            rule = error["msg"]
    received = "" if table == "load" and not key else f", got {_written(error['input'])}"
    return f"{where}: {rule}{received}; {_example(table, key)}".removesuffix("; ")


def of_toml(fault: str, text: str) -> str:
    """Return the text of a fault that makes a file no TOML, with the line and a remedy."""
    place = re.search(r"line (\d+)", fault)
    line = text.splitlines()[int(place[1]) - 1].strip() if place and int(place[1]) <= len(text.splitlines()) else ""
    remedy = "see https://toml.io for the format"
    if fault.startswith(("Cannot overwrite", "Cannot declare")):
        remedy = "a key or a table is given twice: keep one"
    elif number := re.search(r"=\s*([-+]?\d+),(\d+)", line):
        remedy = f"write decimals with a point: {number[1]}.{number[2]}"
    elif unquoted := UNQUOTED.fullmatch(line):
        remedy = f'write values with units in quotes: {unquoted[1]} = "{unquoted[2]}"'
    return f"is not TOML: {fault}{f', which reads: {line}' if line else ''}; {remedy}"


def of_problem(text: str, data: Mapping[str, Any]) -> str:
    """Return the text of a fault that the problem itself found, with the value as the scene writes it."""
    match = PROBLEM_FAULT.fullmatch(text)
    if match is None:
        keys = KEYS.match(text)
        return text if keys is None else re.sub(r"(\w+)\.(\w+)", r"[\1] \2", keys[0]) + text[keys.end() :]
    table, key = match["table"], match["key"]
    written = data.get(table, {}).get(key)
    index = match["index"] if isinstance(written, list) else None
    which = "" if index is None else f" of ball {index[1:-1]}" if table in ("balls", "load") else index
    rule, _, remedy = match["rule"].partition("; ")
    if "overlap" in rule or table in ("periodic", "load"):
        rule = in_unit(rule, (Units.written(data) or Units()).length)
    if "overlap" in rule:
        remedy = "move them apart or make them smaller"
        if table == "periodic":
            remedy = "make the cell longer or the balls smaller"
        elif "across the cell's edge" in rule:
            remedy = f"{remedy}, or the cell larger"
    quantity = isinstance(written, str) and NUMBER_AND_UNIT.fullmatch(written) is not None
    as_given = f" (written {_written(written)})" if quantity and f"got {written}" not in rule else ""
    if key != "steps":  # their unit is that of the load
        remedy = remedy or _example(table, key)
    if key == "approach" and "rigid base" in rule and Units.written(data) is not None:
        number = written if index is None else written[int(index[1:-1])]
        if isinstance(number, int | float):
            unit = (Units.written(data) or Units()).length.name
            remedy = f'{remedy}; a bare number is in metres: write "{number:g} {unit}" if it is in {unit}'
    return f"[{table}] {key}{which}: {rule}{as_given}; {remedy}".removesuffix("; ")


def concerns(text: str, doubtful: set[str]) -> bool:
    """Return whether a problem's fault concerns a stand-in ("table.key") instead of a key as written."""
    match = PROBLEM_FAULT.fullmatch(text)
    if match is None:
        return False
    table, key = match["table"], match["key"]
    of_balls = {"balls.positions", "balls.radius"} & doubtful
    if "balls.shape" in doubtful and key in {"radius", *RARER_EXAMPLES["balls"]}:
        return True  # the shape decides which of them a ball needs
    if key == "steps" and any(name.startswith("load.") for name in doubtful):
        return True
    if table == "load" and {"layer", "layer.thickness", "layer.young", "layer.poisson", "substrate"} & doubtful:
        return True  # it may press through the stand-in, or into the base
    return f"{table}.{key}" in doubtful or (table in ("balls", "load") and bool(of_balls)) or table in doubtful


def stand_in(errors: Iterable[ErrorDetails], data: Mapping[str, Any]) -> tuple[dict[str, Any], set[str]]:
    """Return ``data`` with every faulty key dropped or replaced, and the names of the replaced ones."""
    repaired, doubtful = copy.deepcopy(dict(data)), set[str]()
    for error in errors:
        table, key = [*(part for part in error["loc"] if isinstance(part, str)), "", ""][:2]
        inside = repaired.get(table)
        if error["type"] == "extra_forbidden":
            (inside if key and isinstance(inside, dict) else repaired).pop(key or table, None)
            if not key:
                doubtful.update(difflib.get_close_matches(table, EXAMPLES, n=1))  # it may be meant
        elif key and isinstance(inside, dict):
            inside[key] = examples(table).get(key, "1 N")
            doubtful.add(f"{table}.{key}")
        elif table in EXAMPLES:
            repaired[table] = copy.deepcopy(EXAMPLES[table])
            doubtful |= {table, *(f"{table}.{k}" for k in EXAMPLES[table])}
        else:
            repaired.pop(table, None)
    return repaired, doubtful


def _meant(table: str, key: str, tables: type[BaseModel]) -> str:
    known = {name: list(kind.model_fields) for name, kind in tables_of(tables)}
    here = known.get(table, []) if key else list(tables.model_fields)
    name = key or table
    elsewhere = [t for t, keys in known.items() if name in keys and t != table]
    if table == "finite_strain" and key in LAWS:
        return f'; write law = "{key}" and its parameters in [finite_strain]'
    if key in INSTEAD:
        return f"; {INSTEAD[key]}"
    close = difflib.get_close_matches(name, here, n=1)
    if close:
        return f'; did you mean "{close[0]}"?'
    if key in tables.model_fields:
        return f"; it is a table of its own: write [{key}]"
    if elsewhere:
        return f"; it belongs in [{'] or ['.join(elsewhere)}]"
    return f"; known here: {', '.join(here)}"


def tables_of(tables: type[BaseModel]) -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield every table of a scene with its name, in the order in which a scene has them."""
    for name, field in tables.model_fields.items():
        for kind in (field.annotation, *get_args(field.annotation)):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield name, kind


def examples(table: str) -> dict[str, Any]:
    """Return a valid value of every key of a table."""
    return {**EXAMPLES.get(table, {}), **RARER_EXAMPLES.get(table, {})}


def _example(table: str, key: str) -> str:
    keys = EXAMPLES.get(table, {})
    if key in examples(table):
        return f"for example {key} = {_written(examples(table)[key])}"
    if not key and keys:
        return f"for example [{table}] with " + ", ".join(f"{k} = {_written(v)}" for k, v in keys.items())
    return ""


def _written(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, list):
        text = f"[{', '.join(map(_written, value))}]"
    else:
        text = f"{value}"
    return text if len(text) <= 80 else f"{text[:77]}..."
