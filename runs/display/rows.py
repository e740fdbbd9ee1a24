"""Rows of result tables, for terminal and page: scaled numbers; a value with its error is a pair."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from runs.display.numbers import Scale, attraction

Row = dict[str, Any]
"""Cells by the headings of their columns."""
LEGEND = "T > 0: towards the other balls (attraction), T < 0: away from them (separation)"
ROUNDOFF = 1e-9
"""A component below this fraction of its force is roundoff."""


def ball_rows(balls: Sequence[Mapping[str, Any]], scale: Scale) -> list[Row]:
    """Return the state of every ball; forces are those on the ball."""
    rows = []
    for index, ball in enumerate(balls):
        force, load = ball["tangential_force"], ball["normal_force"]
        tx, ty = (component if abs(component) > ROUNDOFF * math.hypot(*force) else 0.0 for component in force)
        rows.append(
            {
                "ball": index,
                "x / R": ball["position"][0] / scale.radius,
                "y / R": ball["position"][1] / scale.radius,
                "D / R": ball["approach"] / scale.radius,
                "Q [N]": load,
                "Q / E R²": load / scale.force,
                "Tx [N]": tx,
                "Ty [N]": ty,
                "± [N]": ball["tangential_force_error"],
                "T / Q": attraction(balls, index, (tx, ty)) / load if load > 0.0 else None,
                "peak pressure / E": _over(ball.get("peak_pressure"), scale.young),
            }
        )
    return rows


def path_rows(steps: Sequence[Mapping[str, Any]], ball: int, scale: Scale) -> list[Row]:
    """Return the load path of one ball."""
    rows = []
    for index, step in enumerate(steps, start=1):
        state, record = step["balls"][ball], step.get("record", {})
        load, force = state["normal_force"], attraction(step["balls"], ball, state["tangential_force"])
        rows.append(
            {
                "step": index,
                "D / R": state["approach"] / scale.radius,
                "Q / E R²": load / scale.force,
                "T / E R²": (force / scale.force, state["tangential_force_error"] / scale.force),
                "T / Q": force / load if load > 0.0 else None,
                "iterations": record.get("iterations"),
                "cut-backs": record.get("cuts"),
            }
        )
    return rows


def comparison_rows(
    compared: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale
) -> list[Row]:
    """Return the load path of one ball in both models, and how much finite strain strengthens T."""

    def along(force: Sequence[float | None] | None) -> float | None:
        if force is None or any(component is None or math.isnan(component) for component in force):
            return None
        return attraction(balls, ball, [float(component or 0.0) for component in force]) / scale.force

    return [
        {
            "step": row["step"],
            "D / R": row["approach"] / scale.radius,
            "Q / E R²": row["normal_force"] / scale.force,
            "T linear / E R²": along(row["tangential_linear"]),
            "T finite / E R²": (along(row["tangential_finite"]), _over(row["tangential_finite_error"], scale.force)),
            "T / Q": row["tangential_ratio"],
            "S_Q": (row["strengthening_at_force"], row["strengthening_at_force_error"]),
            "S_D": (row["strengthening_at_approach"], row["strengthening_at_approach_error"]),
        }
        for row in compared
        if row["ball"] == ball
    ]


def _over(value: float | None, unit: float) -> float | None:
    return None if value is None else value / unit
