"""Sensitivity of the tangential force to the inputs by the linear model: exponents of T, a step of Poisson's ratio.

The exponent of an input x is d ln T / d ln x for the largest T, along its direction: 1 % more x changes T
by that many per cent. It is a central difference of T with the step `STEP` or, where a scene allows only one side
(closer balls would overlap), a one-sided difference of second order. By dimensional analysis

    T = E1 R^2 f(nu, h/R, L/R, E2/E1, D/R)   or, under given forces,   f(..., Q / (E1 R^2)),

so the exponents of moduli and force add up to 1, and those of lengths plus twice that of the force to 2. The two sums
are used only to check the exponents.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from linear_bem.errors import InvalidProblem, ThirdBodyError
from linear_bem.indenter import Indenter
from linear_bem.problem import Problem
from linear_bem.sequence.contact_sequence import nearby_forces
from linear_bem.solution import Solution
from linear_bem.touching import nearest_distances
from runs.comparison.strengthening_factors import ROUNDOFF
from runs.display.numbers import SHOWN, Scale, leading_ball, number, percent
from runs.models import MODELS, Run, at_small_strain
from runs.process.json_values import Document

STEP = 0.005
"""Logarithm of the ratio between neighbouring values of an input; the error falls with its square."""
PRECISION = 1e-3
"""Relative accuracy of each T. Neighbouring values share their discretisation, so that most of its error cancels."""
SOLUTIONS = 15
"""Largest number of linear solutions that it needs."""
TITLE = "sensitivity of T to the inputs"
STEEP, UNLIKE = 20.0, 2.0
"""Largest exponent of a T that does not nearly vanish; largest ratio of T at finite strain to T of the linear model,
or its inverse, up to which the sensitivities hold at finite strain too."""
POISSON_STEP = 0.01
"""Change of Poisson's ratio that is tried: typical scatter between rubbers."""
WORDS = {
    "h": "thickness of the layer",
    "R": "radius of the balls",
    "L": "distance of the balls",
    "E1": "Young's modulus of the layer",
    "E2": "Young's modulus of the substrate",
    "D": "approach",
    "Q": "normal force",
}
MODULI = {"E1": 1.0, "E2": 1.0, "Q": 1.0}
LENGTHS = {"h": 1.0, "R": 1.0, "L": 1.0, "D": 1.0, "Q": 2.0}
"""Weights of the exponents in the two sums that must be 1 and 2 by dimensional analysis."""

Change = Callable[[Problem, float], Problem]
"""A problem with one input multiplied by a factor."""


def record(problem: Problem, ball: int | None = None) -> Document | None:
    """Return the sensitivity of T at full load to the inputs as a JSON object; None where no T acts.

    T is that on a ``ball``, by default the one with the largest. ``exponents`` by symbol; ``poisson``: Poisson's ratio
    before and after a step, ``change``: the relative change of T by it; ``moduli`` and ``lengths``: the sums of
    exponents that must be 1 and 2. ``failure``: the error of the linear model that prevents all this.
    """
    try:
        return _record(at_small_strain(problem), ball)
    except ThirdBodyError as error:
        return {"failure": str(error)}


def _record(problem: Problem, ball: int | None) -> Document | None:
    solve, solutions = MODELS["linear_bem"].solve, list[Solution]()
    states = solve(problem, Run(PRECISION, inspect=solutions.append)).balls
    ball = leading_ball([state.to_dict() for state in states]) if ball is None else ball
    x, y = states[ball].tangential_force
    size = math.hypot(x, y)
    if size <= max(states[ball].tangential_force_error, ROUNDOFF * max(s.normal_force for s in states)):
        return None

    def relative(changed: Problem) -> float:
        forces = nearby_forces(solutions[0], changed)
        found = solve(changed, Run(PRECISION)).balls[ball].tangential_force if forces is None else forces[ball]
        return float(found[0] * x + found[1] * y) / size**2

    exponents = {symbol: _exponent(problem, change, relative) for symbol, change in _inputs(problem).items()}
    nu = problem.layer.poisson
    other = min(nu + POISSON_STEP, 0.5) if nu < 0.5 else nu - POISSON_STEP
    change = relative(dataclasses.replace(problem, layer=dataclasses.replace(problem.layer, poisson=other))) - 1.0
    moduli, lengths = (sum(weights.get(k, 0.0) * v for k, v in exponents.items()) for weights in (MODULI, LENGTHS))
    return {
        "ball": ball, "exponents": exponents, "poisson": (nu, other), "change": change, "moduli": moduli,
        "lengths": lengths,
    }  # fmt: skip


def _exponent(problem: Problem, change: Change, relative: Callable[[Problem], float]) -> float:
    """Return the slope at 0 of the parabola through T at 0 and at two steps, on both sides if the scene allows it."""
    for near, far in ((1.0, -1.0), (1.0, 2.0), (-1.0, -2.0)):
        try:
            pair = [change(problem, math.exp(steps * STEP)) for steps in (near, far)]
        except InvalidProblem as error:
            refused = error
            continue
        first, second = (relative(changed) - 1.0 for changed in pair)
        return (far**2 * first - near**2 * second) / (near * far * (far - near) * STEP)
    raise refused


def _inputs(problem: Problem) -> dict[str, Change]:
    """Return, for each input of a problem, the function that multiplies it by a factor."""
    inputs: dict[str, Change] = {"E1": partial(_constant, "layer", "young"), "R": _radius, "L": _distance}
    if math.isfinite(problem.layer.thickness):
        inputs["h"] = partial(_constant, "layer", "thickness")
    if problem.substrate is not None:
        inputs["E2"] = partial(_constant, "substrate", "young")
    inputs["D" if problem.load.kind == "approach" else "Q"] = _load
    return {symbol: inputs[symbol] for symbol in WORDS if symbol in inputs}


def _constant(part: str, key: str, problem: Problem, factor: float) -> Problem:
    solid: Any = getattr(problem, part)
    changed: dict[str, Any] = {part: dataclasses.replace(solid, **{key: factor * getattr(solid, key)})}
    return dataclasses.replace(problem, **changed)


def _load(problem: Problem, factor: float) -> Problem:
    return problem.with_load(problem.load.kind, [factor * value for value in problem.load.values])


def _distance(problem: Problem, factor: float) -> Problem:
    balls = tuple(
        dataclasses.replace(ball, position=(factor * ball.position[0], factor * ball.position[1]))
        for ball in problem.balls
    )
    cell = problem.periodic  # images move apart as the balls do
    if cell is not None:
        cell = dataclasses.replace(cell, lengths=(factor * cell.lengths[0], factor * cell.lengths[1]))
    return dataclasses.replace(problem, balls=balls, periodic=cell)


def _radius(problem: Problem, factor: float) -> Problem:
    balls = []
    for ball in problem.balls:
        if isinstance(ball.shape, str):
            balls.append(dataclasses.replace(ball, radius=factor * ball.radius))
        elif not isinstance(ball.shape, Indenter):  # a similar body of another size
            balls.append(dataclasses.replace(ball, radius=factor * ball.radius, shape=_scaled(ball.shape, factor)))
        else:  # a body of a scene
            body: Any = ball.shape
            lengths = {key: np.multiply(factor, value) for key, value in asdict(body).items() if key not in body.ratios}
            body = dataclasses.replace(body, **{key: value.tolist() for key, value in lengths.items()})
            balls.append(dataclasses.replace(ball, shape=body, radius=body.apex_radius))
    return dataclasses.replace(problem, balls=tuple(balls))


def _scaled(profile: Callable[..., Any], factor: float) -> Callable[..., Any]:
    return lambda x, y: factor * profile(x / factor, y / factor)


def rows(found: Mapping[str, Any], problem: Problem, scale: Scale, known: float | None = None) -> list[dict[str, str]]:
    """Return a row per input: its value, the change of T by a change of it, and the change equivalent to T's error.

    ``found`` is a `record` without failure, ``known`` the relative error of T.
    """
    if "failure" in found:
        return [{"input": "-", "change of T": "not known"}]
    nu, other = found["poisson"]
    step = f"{nu:g} \u2192 {other:g}: {percent(found['change'])}"
    table = [_row("nu: Poisson's ratio of the layer", number(nu), step, found["change"] / (other - nu), "", known)]
    for symbol, exponent in found["exponents"].items():
        step = f"1 % more: {percent(0.01 * exponent)}"
        name = "E" if symbol == "E1" and problem.substrate is None else symbol
        table.append(
            _row(f"{name}: {WORDS[symbol]}", _value(symbol, problem, scale), step, 0.01 * exponent, " %", known)
        )
    return table


def _row(name: str, value: str, step: str, slope: float, unit: str, known: float | None) -> dict[str, str]:
    row = {"input": name, "value": value, "change of T": step}
    if known is not None:
        change = known / abs(slope) if slope else None
        # a power law is not valid for an input that more than doubles
        large = "-" if change is None else "more than 100 %" if unit == " %" and change > 100.0 else ""
        row["input change equal to T's error"] = large or f"\u00b1 {number(change, 2)}{unit}"
    return row


def _value(symbol: str, problem: Problem, scale: Scale) -> str:
    units, layer, substrate = scale.units, problem.layer, problem.substrate
    unit, values = {
        "h": (units.length, [layer.thickness]),
        "R": (units.length, [ball.radius for ball in problem.balls]),
        "L": (units.length, [float(nearest_distances(problem.positions, problem.cell).min())]),
        "E1": (units.pressure, [layer.young]),
        "E2": (units.pressure, [] if substrate is None else [substrate.young]),
        "D": (units.length, problem.load.values),
        "Q": (units.force, problem.load.values),
    }[symbol]
    known = list(dict.fromkeys(values))
    others = [f"{len(known) - SHOWN} other(s)"] if len(known) > SHOWN else []
    return ", ".join([*(unit(value) for value in known[:SHOWN]), *others])


def ratio(found: Mapping[str, Any], comparison: Sequence[Mapping[str, Any]], kind: str) -> float | None:
    """Return T at finite strain over T of the linear model under the same load, on the ball of ``found``.

    ``comparison``: rows of `compare_steps`; ``kind``: kind of the load.
    """
    key = "strengthening_at_approach" if kind == "approach" else "strengthening_at_force"
    known = [row[key] for row in comparison if row["ball"] == found.get("ball")]
    return known[-1] if known else None


def holds(ratio: float | None) -> bool:
    """Return whether the sensitivity holds at finite strain, where T is ``ratio`` times the linear model's."""
    return ratio is None or 1.0 / UNLIKE <= ratio <= UNLIKE


def beside(document: Mapping[str, Any], problem: Problem, scale: Scale) -> tuple[list[dict[str, str]], str]:
    """Return table and caption for the document of a comparison; the error of T is that of the ball they name."""
    found = document["sensitivity"]
    factor = ratio(found, document["comparison"], problem.load.kind)
    known = None
    if "failure" not in found and holds(factor):
        ball = document["finite"]["balls"][found["ball"]]
        size = math.hypot(*ball["tangential_force"])
        known = ball["tangential_force_error"] / size if size else None
    return rows(found, problem, scale, known), check(found, factor)


def check(found: Mapping[str, Any], ratio: float | None = None) -> str:
    """Return the caption of the table, with its validity at finite strain, or why there is no table.

    ``ratio`` is the result of `ratio`, where finite strain was computed.
    """
    if "failure" in found:
        return f"the sensitivity of T to the inputs could not be computed: {found['failure']}"
    text = f"by the linear model at full load, on ball {found['ball']}; + makes T larger"
    if not holds(ratio):
        return f"{text}; T at finite strain is {number(ratio)} times the linear model's: its sensitivity differs"
    if ratio is None and max(map(abs, found["exponents"].values())) > STEEP:
        return f"{text}; T nearly vanishes in the linear model: at finite strain, T and its sensitivity may differ"
    return text
