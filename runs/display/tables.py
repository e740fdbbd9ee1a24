"""Results as tables for people: scaled numbers, one line per ball or load step."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from runs.display.numbers import (
    Scale,
    error_terms,
    number,
    short_number,
    with_error,
    with_error_in_parentheses,
)
from runs.display.rows import Row, ball_rows, comparison_rows, path_rows
from runs.process import ranks

WIDE = 100
"""Width in characters of the widest table with its errors written out."""
SHORT = 0
"""Instead of a number of significant digits: format by `runs.display.numbers.short_number`."""
BALL = {
    "ball": 4, "x / R": 4, "y / R": 4, "D / R": 4, "Q [N]": 4, "Q / E R²": 4, "Tx [N]": 5, "Ty [N]": 5, "± [N]": 2,
    "T / Q": 3,
}  # fmt: skip
PATH = {"step": 4, "D / R": 4, "Q / E R²": 4, "T / E R²": 4, "T / Q": 3}
COMPARISON = {
    "step": 4, "D / R": 4, "Q / E R²": 4, "T linear / E R²": 4, "T finite / E R²": 4, "T / Q": SHORT, "S_Q": 4,
    "S_D": 4,
}  # fmt: skip
"""Columns of each table and their significant digits."""
NARROW = {"Q / E R²": "Q/E R²", "T linear / E R²": "T linear", "T finite / E R²": "T finite"}
"""Headings of the widest table that differ from the names of the columns."""


def console() -> Console:
    """Return the console of standard output.

    As wide as the terminal or ``COLUMNS``; wide enough for every table if neither is known. A launcher of several
    ranks gives each rank its own pseudo-terminal: the width of that is ignored, and no colours are used.
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
    """Return the notes of some results ("solved"), each once."""
    return [f"note: {note}" for note in dict.fromkeys(note for solved in accounts for note in solved["notes"])]


def ball_table(balls: Sequence[Mapping[str, Any]], scale: Scale, title: str) -> Table:
    """Return the state of every ball."""
    return _table(title, ball_rows(balls, scale), BALL)


def path_table(steps: Sequence[Mapping[str, Any]], ball: int, scale: Scale, title: str) -> Table:
    """Return the load path of one ball."""
    return _table(title, path_rows(steps, ball, scale), PATH)


def comparison_table(
    compared: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale, *, compact: bool
) -> Table:
    """Return the load path of one ball in both models, and how much finite strain strengthens T.

    ``compact``: errors in parentheses, in units of the last digit.
    """
    rows = comparison_rows(compared, balls, ball, scale)
    title = f"ball {ball}: finite against small strain"
    return _table(title, rows, COMPARISON, NARROW, compact=compact)


def _table(
    title: str,
    rows: Sequence[Row],
    columns: Mapping[str, int],
    headings: Mapping[str, str] | None = None,
    *,
    compact: bool = False,
) -> Table:
    headings = headings or {}
    table = Table(
        title=title, box=SIMPLE_HEAD, title_justify="left", title_style="bold", collapse_padding=True, pad_edge=False
    )
    for column in columns:
        table.add_column(headings.get(column, column), justify="right", overflow="fold")
    for row in rows:
        table.add_row(*(_cell(row[column], digits, compact) for column, digits in columns.items()))
    return table


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
    if not shares:
        return []
    # below 1e-7 % an estimate is roundoff: such a quantity is prescribed
    known = ", ".join(f"{words} {100.0 * share:.2g} %" for words, share in shares.items() if share > 1e-9)
    return [f"estimated errors: {known}"] if known else []


def accuracy_lines(solved: Mapping[str, Any]) -> list[str]:
    """Return the error of T at full load, its terms, and the meshes used."""
    accuracy = solved.get("accuracy") or {}
    terms = error_terms(accuracy)
    if not terms:
        return []
    meshes = "; ".join(f"{mesh_words(mesh)}: {mesh['unknowns']} unknowns" for mesh in accuracy["meshes"])
    return [f"T is known to {100.0 * accuracy['reached']:.2g} % at full load: {terms}", f"meshes: {meshes}"]


def mesh_words(mesh: Mapping[str, Any]) -> str:
    """Return order and fineness of a mesh, and by how much its domain is wider than planned; a dash for old runs."""
    if "order" not in mesh:
        return "-"
    wider = f", domain {mesh['extent']:.2g} times as wide" if mesh.get("extent", 1.0) != 1.0 else ""
    return f"order {mesh['order']}, fineness {mesh['fineness']:g}{wider}"
