"""Results as tables for people: scaled numbers, one line per ball or load step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from runs.presentation import Scale, attraction, number, with_error

ROUNDOFF = 1e-9
LEGEND = "T > 0: towards the other balls (attraction), T < 0: away from them (separation)"


def console() -> Console:
    """Return the console of standard output; wide enough for every table where output is no terminal."""
    plain = Console()
    return plain if plain.is_terminal else Console(width=max(plain.width, 200), soft_wrap=True)


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


def comparison_table(
    rows: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale
) -> Table:
    """Return the load path of one ball in both models, and how much finite strain strengthens T."""
    columns = ["step", "D / R", "Q / E R\u00b2", "T linear", "T finite", "T / Q", "S_Q", "S_D"]
    table = _table(f"ball {ball}: finite against small strain", columns)
    for row in rows:
        if row["ball"] != ball:
            continue
        table.add_row(
            str(row["step"]),
            number(row["approach"] / scale.radius),
            number(row["normal_force"] / scale.force),
            _along(row["tangential_linear"], None, balls, ball, scale),
            _along(row["tangential_finite"], row["tangential_finite_error"], balls, ball, scale),
            number(row["tangential_ratio"], 3),
            with_error(row["strengthening_at_force"], row["strengthening_at_force_error"]),
            with_error(row["strengthening_at_approach"], row["strengthening_at_approach_error"]),
        )
    return table


def _seen(component: float, force: Sequence[float]) -> float:
    return component if abs(component) > ROUNDOFF * math.hypot(*force) else 0.0


def _along(force: Any, error: float | None, balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale) -> str:
    if force is None or any(c is None for c in force):
        return "-"
    return with_error(attraction(balls, ball, force) / scale.force, None if error is None else error / scale.force)


def leading_ball(balls: Sequence[Mapping[str, Any]], key: str = "tangential_force") -> int:
    """Return the index of the ball with the largest tangential force; the first of equals."""
    sizes = [math.hypot(*ball[key]) for ball in balls]
    return next(i for i, size in enumerate(sizes) if size >= max(sizes) * (1.0 - 1e-6))


def _table(title: str, columns: Sequence[str]) -> Table:
    table = Table(
        title=title, box=SIMPLE_HEAD, title_justify="left", title_style="bold", collapse_padding=True, pad_edge=False
    )
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    return table
