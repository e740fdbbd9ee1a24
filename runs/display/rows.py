"""Rows of result tables for the terminal and HTML: numbers in the scene's units, a value with its error as a pair."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from runs.display.numbers import Scale, Vector, attraction, line_of

Row = dict[str, Any]
"""Cells by the headings of their columns."""
LEGEND = "T > 0: towards the other balls (attraction), T < 0: away from them (separation)"
COMPONENTS = "; Tx, Ty: along x and y"
OF_SEVERAL = "T / Q of more than two balls: the part of T along the line to the centre of the other balls"
OF_VECTORS = ", along T linear (|T| ratio: of the lengths; turned: from T linear to T finite, counterclockwise)"
LARGEST = 3
"""Number of balls with the largest |T| that are named."""
ROUNDOFF = 1e-9
"""A component below this fraction of its force is roundoff."""
RATIO, SIZE_RATIO, TURNED = "T / Q", "|T| / Q", "turned [\u00b0]"
OVER_R, OVER_E = "D / R", "Q / E R²"
"""Headings of the dimensionless columns, which need a wide table."""


def ball_rows(balls: Sequence[Mapping[str, Any]], scale: Scale) -> list[Row]:
    """Return the state of every ball; forces are those on the ball. In a periodic cell T / Q has no sign."""
    units, rows = scale.units, []
    for index, ball in enumerate(balls):
        force, load = ball["tangential_force"], ball["normal_force"]
        tx, ty = _components(force)
        lengths = {"radius": ball["radius"]} if scale.unlike else {}
        lengths |= {"x": ball["position"][0], "y": ball["position"][1]}
        row: Row = {"ball": index}
        row |= {units.length.heading(symbol): value / units.length.size for symbol, value in lengths.items()}
        row |= _load(ball["approach"], load, scale)
        row |= {
            units.force.heading("Tx"): tx / units.force.size,
            units.force.heading("Ty"): ty / units.force.size,
            units.force.heading("±"): ball["tangential_force_error"] / units.force.size,
        }
        along = math.hypot(tx, ty) if scale.periodic else attraction(balls, index, (tx, ty))
        row[SIZE_RATIO if scale.periodic else RATIO] = along / load if load > 0.0 else None
        if ball.get("peak_pressure") is not None:
            row[units.pressure.heading("peak p")] = ball["peak_pressure"] / units.pressure.size
        rows.append(row)
    return rows


def legend_of_balls(balls: Sequence[Mapping[str, Any]], scale: Scale) -> list[str]:
    """Return the sign convention of `ball_rows`, if they have any, and, for more than two balls, the largest T."""
    if len(balls) < 2 or scale.periodic:
        return []
    if len(balls) == 2:
        return [LEGEND + COMPONENTS]
    sizes = [math.hypot(*ball["tangential_force"]) for ball in balls]
    first = sorted(range(len(balls)), key=lambda i: -sizes[i])[:LARGEST]
    named = ", ".join(f"ball {i} ({scale.units.force(sizes[i])})" for i in first)
    return [LEGEND + COMPONENTS, OF_SEVERAL, f"largest |T|: {named}"]


def legend_of_line(balls: Sequence[Mapping[str, Any]], kind: str, along: str = "T") -> str:
    """Return the sign convention of T over a load path; ``kind`` is that of the `line_of` the force ``along``."""
    part = f"T here: the component along {along} at full load"
    if kind == "tangential" and len(balls) > 1:
        return part
    return LEGEND if len(balls) < 3 else f"{LEGEND}; {part}"


def path_rows(steps: Sequence[Mapping[str, Any]], ball: int, scale: Scale) -> list[Row]:
    """Return the load path of one ball; T is the component along the `line_of` T at full load."""
    rows, unit, last = [], scale.units.force, steps[-1]["balls"]
    (x, y), _ = line_of(last, ball, last[ball]["tangential_force"], periodic=scale.periodic)
    for index, step in enumerate(steps, start=1):
        state, record = step["balls"][ball], step.get("record", {})
        load, (tx, ty) = state["normal_force"], state["tangential_force"]
        force = x * tx + y * ty
        rows.append(
            {
                "step": index,
                **_load(state["approach"], load, scale),
                unit.heading("T"): (force / unit.size, state["tangential_force_error"] / unit.size),
                RATIO: force / load if load > 0.0 else None,
                "iterations": record.get("iterations"),
                "cut-backs": record.get("cuts"),
            }
        )
    return rows


def comparison_rows(
    compared: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale
) -> list[Row]:
    """Return the load path of one ball in both models, with the strengthening factors of T."""
    unit, path = scale.units.force, [row for row in compared if row["ball"] == ball]
    (x, y), _ = compared_line(path, balls, ball)

    def along(force: Sequence[float | None] | None) -> float | None:
        tx, ty = _components(force)
        return None if math.isnan(tx + ty) else x * tx + y * ty

    def over(value: float | None, size: float) -> float | None:
        return value / size if value is not None and size > 0.0 else None

    return [
        {
            "step": row["step"],
            **_load(row["approach"], row["normal_force"], scale, both=False),
            unit.heading("T linear"): over(along(row["tangential_linear"]), unit.size),
            unit.heading("T finite"): (
                over(along(row["tangential_finite"]), unit.size),
                over(row["tangential_finite_error"], unit.size),
            ),
            RATIO: over(along(row["tangential_finite"]), row["normal_force"]),
            "S_Q": (row["strengthening_at_force"], row["strengthening_at_force_error"]),
            "S_D": (row["strengthening_at_approach"], row["strengthening_at_approach_error"]),
        }
        for row in path
    ]


def compared_line(
    path: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], ball: int
) -> tuple[Vector, str]:
    """Return the `line_of` the last known T linear of a ball's rows, of T finite if none is known."""
    linear = [force for row in path if not math.isnan(sum(force := _components(row["tangential_linear"])))]
    return line_of(balls, ball, [balls[ball]["tangential_force"], *linear][-1])


def compared_ball_rows(compared: Sequence[Mapping[str, Any]], scale: Scale) -> list[Row]:
    """Return T of both models on every ball at the last step, the ratio of their lengths and the angle between them.

    The errors of ratio and angle are those at the same normal force, as that of S_Q.
    """
    return [_compared_ball(row, scale) for row in compared if row["step"] == compared[-1]["step"]]


def may_turn(rows: Sequence[Row]) -> bool:
    """Whether T of both models differ in direction: that of more than two balls, or by more than the error."""
    return len(rows) > 2 or any(angle is not None and abs(angle) > error for angle, error in (r[TURNED] for r in rows))


def _compared_ball(row: Mapping[str, Any], scale: Scale) -> Row:
    unit, forces = scale.units.force, [_components(row[f"tangential_{model}"]) for model in ("linear", "finite")]
    (lx, ly), (tx, ty) = forces
    linear, finite = (math.hypot(*force) for force in forces)
    ratio: tuple[float | None, float | None] = (None, None)
    turned = ratio
    if None not in (row["strengthening_at_force"], row["strengthening_at_force_error"], row["tangential_linear_error"]):
        angle = math.atan2(lx * ty - ly * tx, lx * tx + ly * ty)
        error, factor = row["tangential_linear_error"], row["strengthening_at_force"]
        own = row["strengthening_at_force_error"] * linear - abs(factor) * error  # at the same force
        shares = [error / linear, own / finite if finite else math.inf]
        ratio = (finite / linear, (own + finite * shares[0]) / linear)
        turned = (math.degrees(angle), math.degrees(min(math.pi, sum(shares))))
    return {
        "ball": row["ball"],
        unit.heading("|T| linear"): None if math.isnan(linear) else linear / unit.size,
        unit.heading("|T| finite"): (
            finite / unit.size,
            None if (e := row["tangential_finite_error"]) is None else e / unit.size,
        ),
        "|T| ratio": ratio,
        TURNED: turned,
        "S_Q": (row["strengthening_at_force"], row["strengthening_at_force_error"]),
    }


def _components(force: Sequence[float | None] | None) -> list[float]:
    """Return a force (null in a saved run: not known) without components that are roundoff."""
    known = [math.nan if component is None else component for component in force or (None, None)]
    return [0.0 if abs(component) <= ROUNDOFF * math.hypot(*known) else component for component in known]


def _load(approach: float, load: float, scale: Scale, *, both: bool = True) -> Row:
    """Return approach and force in the scene's units, the approach over R and, ``both``, the force over E R^2."""
    length, force = scale.units.length, scale.units.force
    row = {length.heading("D"): approach / length.size, OVER_R: approach / scale.radius}
    row[force.heading("Q")] = load / force.size
    return row | {OVER_E: load / scale.force} if both else row
