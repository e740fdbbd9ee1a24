"""How much finite strain strengthens the tangential force: ratios with errors, and the answer in one sentence.

S = T_finite . e / |T_linear| with e the direction of the linear force. Its error is the sum of both models'
relative errors (bounds, not independent deviations, so they add): (e_finite + |S| e_linear) / |T_linear|.
At equal force e_finite excludes the contribution to the error of T at given approach from the finite model's error
of Q; at equal approach it includes the contribution from its error of D at given force.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from runs.display.numbers import Scale, attraction, leading_ball, line_of, number, with_error

BELOW_ERROR = "the linear tangential force is below its own error: no ratio"
ROUNDOFF = 1e-9
"""A force below this fraction of the largest force of its step is roundoff of a symmetric sum."""


def compare_steps(
    finite: Sequence[Mapping[str, Any]], at_force: Sequence[Mapping[str, Any]], at_approach: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return one row per step and ball from three load paths of equal length."""
    return [
        _row(index, ball, states)
        for index, states in enumerate(zip(finite, at_force, at_approach, strict=True))
        for ball in range(len(states[0]["balls"]))
    ]


def _row(index: int, ball: int, states: tuple[Mapping[str, Any], ...]) -> dict[str, Any]:
    step, force_step, approach_step = states
    finite, same_force, same_approach = (state["balls"][ball] for state in states)
    at_force, at_approach = _errors(step, ball)
    ratio_q, error_q, note_q = strengthening(finite, same_force, _floor(force_step), at_force)
    ratio_d, error_d, note_d = strengthening(finite, same_approach, _floor(approach_step), at_approach)
    load = finite["normal_force"]
    notes = [note_q, note_d, *(state["record"].get("failure") for state in states[1:])]
    return {
        "step": index + 1,
        "ball": ball,
        "normal_force": load,
        "normal_force_error": _recorded(step, "normal_force_error", ball),
        "approach": finite["approach"],
        "approach_error": _recorded(step, "approach_error", ball),
        "tangential_linear": same_force["tangential_force"],
        "tangential_linear_error": same_force["tangential_force_error"],
        "approach_linear_at_force": same_force["approach"],
        "tangential_linear_at_approach": same_approach["tangential_force"],
        "tangential_linear_at_approach_error": same_approach["tangential_force_error"],
        "normal_force_linear_at_approach": same_approach["normal_force"],
        "tangential_finite": finite["tangential_force"],
        "tangential_finite_error": finite["tangential_force_error"],
        "tangential_ratio": attraction(step["balls"], ball, finite["tangential_force"]) / load if load > 0.0 else None,
        "strengthening_at_force": ratio_q,
        "strengthening_at_force_error": error_q,
        "strengthening_at_approach": ratio_d,
        "strengthening_at_approach_error": error_d,
        "note": "; ".join(dict.fromkeys(note for note in notes if note)) or None,
    }


def _recorded(step: Mapping[str, Any], name: str, ball: int) -> float:
    """Return an estimated error of the finite-strain model, 0 where the quantity is prescribed."""
    errors = step.get("record", {}).get(name)
    return 0.0 if errors is None else float(errors[ball])


def _floor(step: Mapping[str, Any]) -> float:
    return ROUNDOFF * max(math.hypot(*ball["tangential_force"]) for ball in step["balls"])


def _errors(step: Mapping[str, Any], ball: int) -> tuple[float, float]:
    """Return the finite-strain model's error of T [N] at given normal force and at given approach."""
    state, record = step["balls"][ball], step.get("record", {})
    at_approach = state["tangential_force_error"]
    at_force = (
        record["tangential_force_error_at_force"][ball] if "tangential_force_error_at_force" in record else at_approach
    )
    if state["approach"] > 0.0:
        # T ~ Q^2 ~ D^3 to leading order
        relative = 3.0 * _recorded(step, "approach_error", ball) / state["approach"]
        at_approach += relative * math.hypot(*state["tangential_force"])
    return at_force, at_approach


def strengthening(
    finite: Mapping[str, Any], linear: Mapping[str, Any], floor: float = 0.0, finite_error: float | None = None
) -> tuple[float | None, float | None, str | None]:
    """Return ratio, absolute error and note; no ratio unless the linear force exceeds its error and ``floor``.

    ``finite_error`` [N], if given, replaces the error of T of the finite state.
    """
    (tx, ty), (lx, ly) = finite["tangential_force"], linear["tangential_force"]
    size, error = math.hypot(lx, ly), linear["tangential_force_error"]
    if math.isnan(size):
        return None, None, None
    if not size > max(error, floor):
        return None, None, BELOW_ERROR
    ratio = (tx * lx + ty * ly) / size**2
    own = finite["tangential_force_error"] if finite_error is None else finite_error
    return ratio, (own + abs(ratio) * error) / size, None


def last_row(rows: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return the row at the end of the load path of the leading ball, or of another if only that has a ratio."""
    last = [row for row in rows if row["step"] == rows[-1]["step"] and row["strengthening_at_force"] is not None]
    leading = leading_ball(balls)  # also shown in tables and figures
    return next((row for row in last if row["ball"] == leading), last[0] if last else None)


def of_ball(row: Mapping[str, Any], balls: Sequence[Mapping[str, Any]]) -> str:
    """Return which ball a row is about, where that is not clear."""
    return "" if len(balls) == 2 else f" on ball {row['ball']}"


def answer(rows: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], scale: Scale) -> str:
    """Return a sentence on the change of the tangential force by finite strain at the end of the load path."""
    if len(balls) == 1:
        return "A single ball has no tangential force: there is nothing to compare."
    row = last_row(rows, balls)
    if row is None:
        return "The linear tangential force is below its own error on every ball: there is nothing to compare."
    depth, load = row["approach"], scale.units.force(row["normal_force"], 3)
    over = "" if scale.dimensionless else f"{number(depth / scale.radius, 3)} R, "
    state = f"At D = {scale.units.length(depth, 3)} ({over}Q = {load})"
    ratio, error = row["strengthening_at_force"], row["strengthening_at_force_error"]
    _, kind = line_of(balls, row["ball"], row["tangential_linear"])
    if ratio + error < 0.0:
        opposite = {"attraction": "separation", "separation": "attraction"}.get(kind, "opposite")
        text = (
            f"{state} finite strain turns the linear {kind} force{of_ball(row, balls)} into {opposite}, "
            f"{with_error(-ratio, error)} times as large at equal force"
        )
    else:
        text = (
            f"{state} finite strain makes the {kind} force{of_ball(row, balls)} {with_error(ratio, error)} times the "
            "linear one at equal force"
        )
    if row["strengthening_at_approach"] is not None:
        ratio, error = row["strengthening_at_approach"], row["strengthening_at_approach_error"]
        text += f" and {with_error(ratio, error)} times at equal approach"
    return f"{text}."
