"""Results as tables for people: scaled numbers, one line per ball or load step."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from runs.display.numbers import (
    Scale,
    attraction,
    error_terms,
    number,
    short_number,
    with_error,
    with_error_in_parentheses,
)
from runs.process import ranks

ROUNDOFF = 1e-9
WIDE = 100
"""Columns that the widest table needs with its errors written out."""
LEGEND = "T > 0: towards the other balls (attraction), T < 0: away from them (separation)"


def console() -> Console:
    """Return the console of standard output.

    As wide as the terminal or ``COLUMNS``; wide enough for every table where neither tells. A launcher of
    several ranks hands each a pseudo-terminal that is not the reader's: no width, no colours there.
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
    table = _table(
        title, ["ball", "x / R", "y / R", "D / R", "Q [N]", "Q / E R\u00b2", "Tx [N]", "Ty [N]", "\u00b1 [N]", "T / Q"]
    )
    for index, ball in enumerate(balls):
        tx, ty = ball["tangential_force"]
        load = ball["normal_force"]
        table.add_row(
            str(index),
            *(number(c / scale.radius) for c in ball["position"]),
            number(ball["approach"] / scale.radius),
            number(load),
            number(load / scale.force),
            number(_seen(tx, (tx, ty)), 5),
            number(_seen(ty, (tx, ty)), 5),
            number(ball["tangential_force_error"], 2),
            number(attraction(balls, index, (tx, ty)) / load if load > 0.0 else None, 3),
        )
    return table


def path_table(steps: Sequence[Mapping[str, Any]], ball: int, scale: Scale, title: str) -> Table:
    """Return the load path of one ball."""
    table = _table(title, ["step", "D / R", "Q / E R\u00b2", "T / E R\u00b2", "T / Q"])
    for index, step in enumerate(steps, start=1):
        state = step["balls"][ball]
        load, force = state["normal_force"], attraction(step["balls"], ball, state["tangential_force"])
        table.add_row(
            str(index),
            number(state["approach"] / scale.radius),
            number(load / scale.force),
            with_error(force / scale.force, state["tangential_force_error"] / scale.force),
            number(force / load if load > 0.0 else None, 3),
        )
    return table


def accuracy_lines(solved: Mapping[str, Any]) -> list[str]:
    """Return how well T is known at full load, of what its error consists, and on which meshes it was found."""
    accuracy = solved.get("accuracy") or {}
    terms = error_terms(accuracy)
    if not terms:
        return []
    meshes = "; ".join(f"{mesh_words(mesh)}: {mesh['unknowns']} unknowns" for mesh in accuracy["meshes"])
    return [f"T is known to {100.0 * accuracy['reached']:.2g} % at full load: {terms}", f"meshes: {meshes}"]


def mesh_words(mesh: Mapping[str, Any]) -> str:
    """Return order and fineness of a mesh, and by how much its domain is wider than planned; a dash for old runs'."""
    if "order" not in mesh:
        return "-"
    wider = f", domain {mesh['extent']:.2g} times as wide" if mesh.get("extent", 1.0) != 1.0 else ""
    return f"order {mesh['order']}, fineness {mesh['fineness']:g}{wider}"


def comparison_table(
    rows: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale, *, compact: bool
) -> Table:
    """Return the load path of one ball in both models, and how much finite strain strengthens T.

    ``compact``: errors in parentheses, in units of the last digit.
    """
    written = with_error_in_parentheses if compact else with_error
    plain = short_number if compact else number
    columns = ["step", "D / R", "Q/E R\u00b2", "T linear", "T finite", "T / Q", "S_Q", "S_D"]
    table = _table(f"ball {ball}: finite against small strain", columns)
    for row in rows:
        if row["ball"] != ball:
            continue
        table.add_row(
            str(row["step"]),
            plain(row["approach"] / scale.radius),
            plain(row["normal_force"] / scale.force),
            plain(_along(row["tangential_linear"], balls, ball, scale)),
            written(
                _along(row["tangential_finite"], balls, ball, scale), _over(row["tangential_finite_error"], scale.force)
            ),
            short_number(row["tangential_ratio"]),
            written(row["strengthening_at_force"], row["strengthening_at_force_error"]),
            written(row["strengthening_at_approach"], row["strengthening_at_approach_error"]),
        )
    return table


def _seen(component: float, force: Sequence[float]) -> float:
    return component if abs(component) > ROUNDOFF * math.hypot(*force) else 0.0


def _along(force: Any, balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale) -> float | None:
    if force is None or any(c is None or math.isnan(c) for c in force):
        return None
    return attraction(balls, ball, force) / scale.force


def _over(value: float | None, unit: float) -> float | None:
    return None if value is None else value / unit


def _table(title: str, columns: Sequence[str]) -> Table:
    table = Table(
        title=title, box=SIMPLE_HEAD, title_justify="left", title_style="bold", collapse_padding=True, pad_edge=False
    )
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    return table
