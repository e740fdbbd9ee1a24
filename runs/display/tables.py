"""Result tables on the terminal: scaled numbers, one line per ball or load step."""

import math
import os
import re
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from linear_bem.counts import grouped
from linear_bem.depth import LARGE_STRAIN
from runs.display.numbers import Scale, error_terms, number, short_number, with_error, with_error_in_parentheses
from runs.display.rows import OVER_E, OVER_R, Row, ball_rows
from runs.process import ranks
from runs.scene.unit_doubts import NO_UNIT, SOFT

WIDE = 116
"""Width in characters of the widest table with its errors written out."""
SHORT = 0
"""In place of a number of significant digits: use `runs.display.numbers.short_number`."""
DIGITS = {"Tx": 5, "Ty": 5, "±": 2, "T / Q": 3, "|T| / Q": 3, "peak p": 3}
"""Significant digits of a column, keyed by the first symbol of its heading; 4 for others."""
COMPARED = DIGITS | {"T / Q": SHORT}
"""The same in a comparison of both models."""
MANY, SHOWN = 100, 20
"""Number of balls above which a table shows only some of them, and how many it then shows."""
LARGEST_T = "the largest tangential force"
"""What the accuracy of T refers to, unless T nearly vanishes."""
ON_PAGES = ("iterations", "cut-backs")
"""Columns shown only in HTML."""


def console() -> Console:
    """Return the console of standard output.

    As wide as the terminal or ``COLUMNS``; wide enough for every table if neither is known. An MPI launcher
    gives each rank its own pseudo-terminal: its width is ignored, and no colours are used.
    """
    if ranks.rank_and_size()[1] == 1 and sys.stdout.isatty():
        return Console()
    columns = os.environ.get("COLUMNS", "")
    width = int(columns) if columns.isdigit() and int(columns) > 0 else 200
    return Console(width=width, force_terminal=False, color_system=None, no_color=True, soft_wrap=width >= WIDE)


def say(out: Console, *lines: str, style: str = "") -> None:
    """Print lines as they are."""
    for line in lines:
        out.print(line, style=style, highlight=False, markup=False)


def notes(*accounts: Mapping[str, Any]) -> list[str]:
    """Return the notes of some results ("solved"), each once, without `warnings`."""
    return [f"note: {note}" for note in _notes(*accounts) if not _is_first(note)]


def warnings(*accounts: Mapping[str, Any]) -> list[str]:
    """Return the notes that belong before the numbers: small strain does not hold, or a unit is doubtful."""
    return [f"warning: {note}" for note in _notes(*accounts) if _is_first(note)]


def _is_first(note: str) -> bool:
    return note.startswith(LARGE_STRAIN) or NO_UNIT in note or SOFT in note


def _notes(*accounts: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(note for solved in accounts for note in solved["notes"]))


def is_narrow(out: Console) -> bool:
    """Whether a console needs short tables: errors in parentheses, no numbers over R and E R^2."""
    return out.width < WIDE


def show_balls(out: Console, balls: Sequence[Mapping[str, Any]], scale: Scale, title: str) -> None:
    """Print the state of every ball; of more than `MANY` balls only those with the largest T, in descending order."""
    rows, which = some_balls(balls, scale)
    show(out, title + (f": {which}" if which else ""), rows, scale)


def some_balls(balls: Sequence[Mapping[str, Any]], scale: Scale) -> tuple[Sequence[Row], str]:
    """Return the rows of a table of balls and, where they are too many for one, which are shown."""
    rows = ball_rows(balls, scale)
    if len(balls) <= MANY:
        return rows, ""
    largest = sorted(range(len(balls)), key=lambda i: -math.hypot(*balls[i]["tangential_force"]))[:SHOWN]
    return [rows[i] for i in largest], f"the {SHOWN} largest T of {len(balls)} balls, descending; result.json has all"


def show_compared_balls(out: Console, rows: Sequence[Row], scale: Scale) -> None:
    """Print T of both models at full load on all balls, or of very many balls on those with the largest T."""
    title = "all balls at full load, at equal normal force"
    if len(rows) > MANY:
        finite = scale.units.force.heading("|T| finite")
        rows = sorted(rows, key=lambda row: -row[finite][0])[:SHOWN]
        title = f"the {SHOWN} balls with the largest T at full load, at equal normal force; steps.csv has T on all"
    show(out, title, rows, scale, COMPARED)


def show(out: Console, title: str, rows: Sequence[Row], scale: Scale, digits: Mapping[str, int] = DIGITS) -> None:
    """Print rows of numbers under their headings, with ``digits`` by the first symbol of the heading."""
    compact = is_narrow(out)
    if compact and not scale.dimensionless:
        rows = [{key: value for key, value in row.items() if key not in (OVER_R, OVER_E)} for row in rows]
    table = Table(
        title=Text(title, style="bold"), box=SIMPLE_HEAD, title_justify="left", collapse_padding=True, pad_edge=False
    )
    shown = [column for column in rows[0] if column not in ON_PAGES] if rows else []
    for column in shown:
        heading = Text(column.replace(" / ", "/") if compact else column)  # no markup: [mm] is a unit
        table.add_column(heading, justify="right", overflow="fold")
    for row in rows:
        table.add_row(*(_cell(row[column], _digits(column, digits), compact) for column in shown))
    out.print(table)


def show_words(out: Console, title: str, rows: Sequence[Mapping[str, str]]) -> None:
    """Print rows of text under their headings."""
    table = Table(title=Text(title, style="bold"), box=SIMPLE_HEAD, title_justify="left", pad_edge=False)
    for column in rows[0]:
        table.add_column(Text(column))
    for row in rows:
        table.add_row(*(Text(cell) for cell in row.values()))
    out.print(table)


def _digits(column: str, digits: Mapping[str, int]) -> int:
    return digits.get(column, digits.get(re.split(r" \[| / ", column)[0], 4))


def _cell(value: Any, digits: int, compact: bool) -> str:
    if isinstance(value, tuple):
        return with_error_in_parentheses(*value) if compact else with_error(*value)
    if isinstance(value, int):
        return str(value)
    return short_number(value) if compact or digits == SHORT else number(value, digits)


def error_lines(balls: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the largest relative error of Q, D, peak pressure and area, where the model estimates them."""
    names = {"normal_force": "Q", "approach": "D", "peak_pressure": "peak pressure", "contact_area": "contact area"}
    shares = {
        words: max((ball["errors"][key] / abs(ball[key]) for ball in balls if ball[key]), default=0.0)
        for key, words in names.items()
        if all(key in ball.get("errors", {}) for ball in balls)
    }
    # below 1e-7 % an estimate is roundoff: such a quantity is prescribed
    known = ", ".join(f"{words} {100.0 * share:.2g} %" for words, share in shares.items() if share > 1e-9)
    return [*([f"estimated errors: {known}"] if known else []), *missing_errors(balls)]


def missing_errors(balls: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line on a result of an earlier version, which has errors but none of pressures and areas."""
    if all("contact_area" in errors for ball in balls if (errors := ball.get("errors"))):
        return []
    return ["an earlier version saved this result, without errors of peak pressure and contact area: --fresh has them"]


def symbol_of(what: str) -> str:
    """Return the symbol of the quantity whose error is relative to ``what``: Q or D where there is no T."""
    return {"the normal force": "Q", "the approach": "D"}.get(what, "T")


def accuracy_lines(solved: Mapping[str, Any], balls: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the error of T at full load (of Q or D where there is no T), its terms, and the meshes used."""
    accuracy = solved.get("accuracy") or {}
    terms = error_terms(accuracy)
    if not terms:
        return []
    meshes = "; ".join(f"{mesh_words(mesh)}: {grouped(mesh['unknowns'])} unknowns" for mesh in accuracy["meshes"])
    what = accuracy["relative_to"]["what"]
    symbol = symbol_of(what)
    error = f"{100.0 * accuracy['reached']:.2g} %"
    known = f"{symbol} is known to {error} at full load"
    if symbol == "T" and len(balls) > 2:
        known = f"T on every ball is known to {error} of the largest T at full load"
    if symbol == "T" and what != LARGEST_T:
        known = f"at full load the error of T is {error} of {what} (T itself is smaller)"
    return [f"{known}: {terms}", f"meshes: {meshes}"]


def mesh_words(mesh: Mapping[str, Any]) -> str:
    """Return order and fineness of a mesh, and the factor by which its domain is wider than planned."""
    if "order" not in mesh:
        return "-"
    wider = f", domain {mesh['extent']:.2g} times as wide" if mesh.get("extent", 1.0) != 1.0 else ""
    return f"order {mesh['order']}, fineness {mesh['fineness']:g}{wider}"
