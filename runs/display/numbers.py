"""Formatting of numbers: in the units of the scene, over R and E R^2, and with their errors."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from linear_bem.indenter import Indenter
from linear_bem.problem import Ball, Problem
from runs.scene.units import DIMENSIONLESS, Units

Vector = Sequence[float]


@dataclass(frozen=True)
class Scale:
    """Units of the numbers shown: R [m], E [Pa], the scene's units; ``unlike``: radii differ, R is that of ball 0.

    ``periodic``: the other balls are on all sides, so that T towards them has no meaning.
    """

    radius: float
    young: float
    units: Units = DIMENSIONLESS
    unlike: bool = False
    periodic: bool = False

    @classmethod
    def of(cls, problem: Problem, scene: Mapping[str, Any] | None = None) -> Scale:
        """Return the scale of ``problem``; ``scene`` holds the tables of its scene file."""
        radii = [ball.radius for ball in problem.balls]
        return cls.from_numbers(radii, problem.layer.young, scene)

    @classmethod
    def from_numbers(cls, radii: Sequence[float], young: float, scene: Mapping[str, Any] | None = None) -> Scale:
        """Return the scale of balls of these radii [m] on a layer of a Young's modulus [Pa]."""
        units = Units.written(scene or {}) or (DIMENSIONLESS if radii[0] == young == 1.0 else Units())
        return cls(float(radii[0]), float(young), units, len(set(radii)) > 1, "periodic" in (scene or {}))

    @property
    def force(self) -> float:
        """E R^2 [N]."""
        return self.young * self.radius**2

    @property
    def dimensionless(self) -> bool:
        """Whether the scene's numbers are already over R and E."""
        return self.units == DIMENSIONLESS

    def both(self, approach: float) -> str:
        """Return an approach [m] in the scene's unit and over R: "1.5 mm (0.1875 R)"."""
        own = self.units.length(approach)
        return own if self.dimensionless else f"{own} ({number(approach / self.radius)} R)"

    def legend(self) -> str:
        """Return the definition of R and E."""
        whose = "ball 0" if self.unlike else "the balls"
        if self.dimensionless:
            return f"R: radius of {whose}, E: Young's modulus of the layer; both are 1 in this scene"
        size, modulus = self.units.length(self.radius), self.units.pressure(self.young)
        return f"R = {size}: radius of {whose}; E = {modulus}: Young's modulus of the layer"


def leading_ball(balls: Sequence[Mapping[str, Any]]) -> int:
    """Return the index of the ball with the largest tangential force; the first if several are equal."""
    sizes = [math.hypot(*ball["tangential_force"]) for ball in balls]
    return next(i for i, size in enumerate(sizes) if size >= max(sizes) * (1.0 - 1e-6))


SHOWN = 3
"""Largest number of kinds, radii or loads of balls that are listed one by one."""


def bodies(problem: Problem, scale: Scale) -> str:
    """Return shapes and sizes of the balls: "sphere, radius 8 mm"; of more than `SHOWN` sizes, the range of radii."""
    found = list(dict.fromkeys(_body(ball, scale) for ball in problem.balls))
    if len(found) <= SHOWN:
        return "; ".join(found)
    kind, *others = {_kind(ball) for ball in problem.balls}
    if others or kind not in ("sphere", "paraboloid"):
        return f"{'; '.join(found[:SHOWN])}; {len(found) - SHOWN} other(s)"
    least, most = (size(ball.radius for ball in problem.balls) for size in (min, max))
    return f"{kind} of {len(found)} sizes, radii {scale.units.length(least)} to {scale.units.length(most)}"


def _kind(ball: Ball) -> str:
    return type(ball.indenter).__name__.lower() if isinstance(ball.indenter, Indenter) else "profile f(x, y)"


def _body(ball: Ball, scale: Scale) -> str:
    body, length = ball.indenter, scale.units.length
    if not isinstance(body, Indenter):
        return f"{_kind(ball)}, radius {length(ball.radius)}"
    sizes = []
    for field in dataclasses.fields(body):
        values = value if isinstance(value := getattr(body, field.name), tuple) else (value,)
        if field.name == "slope":
            sizes.append(f"slope {number(math.degrees(value))} degrees")
        else:
            said = " x ".join(number(each / length.size) for each in values)
            sizes.append(f"{field.name.replace('_', ' ')} {said} {length.name}")
    return f"{_kind(ball)}, {', '.join(sizes)}"


def toward_others(balls: Sequence[Mapping[str, Any]], index: int) -> tuple[float, float] | None:
    """Return the unit vector from ball ``index`` to the centre of the others; None where there is no such direction."""
    others = [b["position"] for i, b in enumerate(balls) if i != index]
    if not others:
        return None
    x, y = balls[index]["position"]
    dx = math.fsum(p[0] for p in others) / len(others) - x
    dy = math.fsum(p[1] for p in others) / len(others) - y
    length = math.hypot(dx, dy)
    reach = max(math.dist(p, (x, y)) for p in others)
    return None if length <= 1e-9 * reach else (dx / length, dy / length)


def attraction(balls: Sequence[Mapping[str, Any]], index: int, force: Vector) -> float:
    """Return the component of ``force`` towards the other balls: positive attracts, negative separates.

    Its magnitude if the other balls have no common direction or there are none.
    """
    direction = toward_others(balls, index)
    return math.hypot(*force) if direction is None else direction[0] * force[0] + direction[1] * force[1]


ACROSS = 0.5
"""Share of |T| along the line to the other balls below which T is neither attraction nor separation."""


def line_of(
    balls: Sequence[Mapping[str, Any]], index: int, force: Vector, *, periodic: bool = False
) -> tuple[Vector, str]:
    """Return the unit vector along which T on a ball is shown, and what it is: attraction, separation or tangential.

    The vector points from one of two balls to the other. Of more balls it is along ``force``, or against it for
    separation. In a ``periodic`` cell it is along ``force``.
    """
    size, toward = math.hypot(*force), None if periodic else toward_others(balls, index)
    if not size > 0.0:
        return toward or (1.0, 0.0), "tangential"
    pull = 0.0 if toward is None else (toward[0] * force[0] + toward[1] * force[1]) / size
    if toward is None or abs(pull) < ACROSS:
        return (force[0] / size, force[1] / size), "tangential"
    sign, kind = (1.0, "attraction") if pull > 0.0 else (-1.0, "separation")
    return toward if len(balls) == 2 else (sign * force[0] / size, sign * force[1] / size), kind


def with_error(value: float | None, error: float | None) -> str:
    """Return "1.42 +- 0.03": the error to at most two significant digits, the value to the same decimal place."""
    parts = _to_the_place_of_the_error(value, error)
    if parts is None:
        return number(value)
    mantissa, deviation, digits, power = parts
    text = f"{mantissa:.{digits}f} \u00b1 {deviation:.{digits}f}"
    return text if power == 0 else f"({text})e{power:+03d}"


def with_error_in_parentheses(value: float | None, error: float | None) -> str:
    """Return "1.42(3)": the error in units of the value's last digit."""
    parts = _to_the_place_of_the_error(value, error)
    if parts is None:
        return number(value)
    mantissa, deviation, digits, power = parts
    shown = f"{deviation:.{digits}f}" if deviation >= 1.0 and digits else f"{deviation * 10**digits:.0f}"
    return f"{mantissa:.{digits}f}({shown})" + (f"e{power}" if power else "")


def _to_the_place_of_the_error(value: float | None, error: float | None) -> tuple[float, float, int, int] | None:
    """Return value and error over a power of ten, the decimal places that the error justifies, and the power."""
    if value is None or error is None or error <= 0.0 or not math.isfinite(error):
        return None
    exponent = math.floor(math.log10(max(abs(value), error)))
    power = exponent if not -3 <= exponent < 4 else 0
    place = math.floor(math.log10(error)) - power
    digits = max(0, -place + (1 if error / 10.0 ** (place + power) < 3.0 else 0))
    mantissa = round(value / 10.0**power, digits) + 0.0  # no -0.0
    return mantissa, error / 10.0**power, digits, power


def number(value: float | None, digits: int = 4) -> str:
    """Return ``value`` to ``digits`` significant digits, below a million without an exponent; a dash for None."""
    if value is None:
        return "-"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < 1e6 else text


def percent(change: float) -> str:
    """Return a relative change with its sign, to two digits or whole percent: "+1.2 %", "-104 %"."""
    value = 100.0 * change
    return f"{value:+.0f} %" if abs(value) >= 99.5 else f"{value:+.2g} %"


def short_number(value: float | None) -> str:
    """Return ``value`` to three significant digits in at most nine characters; a dash for None."""
    if value is None or value == 0.0 or 1e-3 <= abs(value) < 1e4:
        return number(value, 3)
    return f"{value:.2e}"


TERMS = {
    "discretisation": "discretisation",
    "enforcement": "contact enforcement",
    "transfer": "transfer of the small-strain correction",
    "solver": "solver",
}
"""Names of the terms of a finite-element run's error budget."""


def error_terms(accuracy: Mapping[str, Any]) -> str:
    """Return the terms of the error of T at full load: "discretisation 0.31 %, solver 1e-04 %"."""
    return ", ".join(f"{TERMS.get(k, k)} {100.0 * share:.2g} %" for k, share in (accuracy.get("terms") or {}).items())


def count(number: int, what: str) -> str:
    """Return "1 contact", or "2 contacts"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def duration(seconds: float) -> str:
    """Return a time as "48 s" or "3 min 05 s"."""
    if seconds < 59.5:
        return f"{seconds:.1f} s" if seconds < 9.95 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
