"""What ``plan`` advises: which absent effects would matter and by how much, and which present ones do not.

Every change refers to the tangential force on one ball, that with the largest. The linear model computes it with and
without the effect; only the change by finite strain comes from a fit (`runs.comparison.strengthening_fit`), as it takes
minutes to compute.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linear_bem.errors import ThirdBodyError
from linear_bem.indenter import Paraboloid, Sphere
from linear_bem.problem import Elastic, Load, Problem
from linear_bem.result import Result
from runs.comparison.strengthening_fit import FITTED_LAW, fit_error, outside, strengthening_at_force
from runs.display.numbers import number, percent
from runs.look_ahead import offsets_from
from runs.models import MODELS, USUAL, Run

SHARE = 0.05
"""Accuracy of the computed changes, as a fraction of that of the scene."""
STIFFNESSES = (1e4, 1e3, 1e2, 1e1)
"""Ratios of substrate modulus to layer modulus that are tried if the scene has a rigid base, until T changes."""
PATIENCE = 60.0
"""Default time limit of the advice [s]; effects that would exceed it are left out."""
FINER = 1.5
"""Time of a solution for the advice over that of the less accurate solution from which it starts."""
UNLIKE = 0.05
"""Largest relative difference of approaches over radii at which balls count as equal for the fit of finite strain."""
FRICTION = 0.3
"""Coefficient of friction for which a drift is quoted."""


@dataclass(frozen=True)
class Advice:
    """One effect: whether the scene has it, the relative change of T by it with its error, and what to do."""

    effect: str
    present: bool
    change: float | None
    error: float | None
    matters: bool | None
    text: str


class Adviser:
    """Judges the effects of one scene; ``ahead`` is its linear solution, ``accuracy`` the relative accuracy of T.

    ``law`` is the name of its law at finite strain, which the problem itself does not have.

    ``ball``: the ball judged, by default the one with the largest T.

    ``patience``: total time limit [s] of its solutions; ``left_out``: effects whose solutions would exceed it;
    ``spent``: estimated time [s] of the solutions so far.
    """

    def __init__(
        self, problem: Problem, ahead: Result, accuracy: float | None, effects: tuple[str, ...],
        patience: float = PATIENCE, law: str = FITTED_LAW, ball: int | None = None,
    ) -> None:  # fmt: skip
        self.problem, self.law = problem, law
        self.ahead = ahead
        self.effects, self.patience = effects, patience
        self.accuracy = accuracy or USUAL
        sizes = [math.hypot(*ball.tangential_force) for ball in ahead.balls]
        self.ball = sizes.index(max(sizes)) if ball is None else ball
        self.size = sizes[self.ball]
        self.away = np.hypot(*offsets_from(problem.positions[self.ball], problem).T).tolist()
        self.run = Run(max(SHARE * self.accuracy, 1e-4))
        self.is_known = ahead.balls[self.ball].tangential_force_error <= (self.run.tangential_force or 0.0) * self.size
        self.spent = 0.0 if self.is_known else FINER * ahead.solved.seconds  # of the state that changes refer to
        self.left_out: list[str] = []

    def advise(self) -> list[Advice]:
        """Return advice for every effect that can be judged; none for a single ball, on which no T acts."""
        if self.problem.size < 2 or self.size <= self.ahead.balls[self.ball].tangential_force_error:
            return []
        found = [self._finite_strain()]
        if "reciprocation" not in self.effects:
            found.append(self._reciprocation())
        stiffnesses = len(STIFFNESSES) if self.problem.substrate is None else 1
        for part, solutions in (
            (self._shape, 1), (self._substrate, stiffnesses), (self._poisson, 1), (self._contact_size, 0),
            (self._neighbours, 0),
        ):  # fmt: skip
            name = part.__name__.strip("_").replace("_", " ")
            if not self.affords(solutions):
                self.left_out.append(name)
                continue
            try:
                found += part()
            except ThirdBodyError as error:
                found.append(Advice(name, False, None, None, None, f"{name}: cannot be judged ({error})"))
        return found

    def affords(self, solutions: int) -> bool:
        """Return whether so many more solutions are within the patience; if so, they count as spent."""
        more = self.spent + solutions * FINER * self.ahead.solved.seconds
        if more >= self.patience:
            return False
        self.spent = more
        return True

    def _changed(self, problem: Problem, solve: Callable[[Problem, Run], Result] = MODELS["linear_bem"].solve) -> float:
        """Return the relative change of T, along its direction, if ``problem`` is solved instead."""
        x, y = solve(problem, self.run).balls[self.ball].tangential_force
        exact_x, exact_y = self._exact
        return (x * exact_x + y * exact_y) / (exact_x**2 + exact_y**2) - 1.0

    @cached_property
    def _exact(self) -> tuple[float, float]:
        known = self.ahead if self.is_known else MODELS["linear_bem"].solve(self.problem, self.run)
        return known.balls[self.ball].tangential_force

    def _judged(self, change: float) -> bool:
        return abs(change) > self.accuracy

    def _finite_strain(self) -> Advice:
        present = "finite_strain" in self.effects
        layer, substrate, radius = self.problem.layer, self.problem.substrate, self.problem.balls[self.ball].radius
        approach, thickness = self.ahead.balls[self.ball].approach / radius, layer.thickness / radius
        distance = min(away for i, away in enumerate(self.away) if i != self.ball) / radius
        stiffness = math.inf if substrate is None else substrate.young / layer.young
        change = strengthening_at_force(approach, thickness, layer.poisson, distance) - 1.0
        beyond = outside(approach, thickness, distance, layer.poisson, stiffness)
        if not all(isinstance(each.indenter, Sphere | Paraboloid) for each in self.problem.balls):
            beyond.append("spheres and paraboloids only")
        alike = [each.approach / of.radius for each, of in zip(self.ahead.balls, self.problem.balls, strict=True)]
        if max(alike) - min(alike) > UNLIKE * max(alike) or len({each.radius for each in self.problem.balls}) > 1:
            beyond.append("equal balls and approaches")
        if self.law != FITTED_LAW:
            beyond.append(f"the law {FITTED_LAW} (here {self.law})")
        error = fit_error(approach, thickness, layer.poisson, distance)
        is_near = abs(change) - error <= self.accuracy < abs(change) + error
        matters = None if beyond or is_near else self._judged(change)
        verb = "changes" if present else "would change"
        sign, (size, unsure) = "+" if change >= 0.0 else "", (number(100.0 * value, 2) for value in (change, error))
        said = f"{sign}{size} \u00b1 {unsure} % at equal force, by a fit"
        if beyond:
            said = f"an unknown amount, in either direction: the fit is for {', '.join(beyond)}"
            said += "" if {"reciprocation", "periodic"} & {*self.effects} else "; `thirdbody compare` computes it"
        do = "" if present else "; add [finite_strain]"
        if matters is False:
            do = "; it can be left out" if present else "; not needed"
        known, sure = (None, None) if beyond else (change, error)
        return Advice("finite_strain", present, known, sure, matters, f"finite strain {verb} T by {said}{do}")

    def _shape(self) -> list[Advice]:
        shapes = {ball.shape for ball in self.problem.balls}
        if len(shapes) != 1 or not isinstance(shape := next(iter(shapes)), str):
            return []
        other = "sphere" if shape == "paraboloid" else "paraboloid"
        balls = tuple(dataclasses.replace(ball, shape=other) for ball in self.problem.balls)
        change = self._changed(dataclasses.replace(self.problem, balls=balls))
        matters = self._judged(change)
        words = f"the exact {'sphere would change' if other == 'sphere' else 'sphere: a paraboloid would change'}"
        do = f'; use shape = "{other}"' if matters and other == "sphere" else ""
        return [Advice("sphere", shape == "sphere", change, None, matters, f"{words} T by {percent(change)}{do}")]

    def _substrate(self) -> list[Advice]:
        layer, substrate = self.problem.layer, self.problem.substrate
        if not math.isfinite(layer.thickness):
            return []
        others = [None] if substrate else [Elastic(ratio * layer.young, 0.3) for ratio in STIFFNESSES]
        for other in others:
            change = self._changed(dataclasses.replace(self.problem, substrate=other))
            matters: bool | None = self._judged(change)
            if matters:
                break
        if other is None:
            text = f"the substrate's compliance: a rigid base would change T by {percent(change)}"
        else:
            ratio = other.young / layer.young
            text = f"a substrate {ratio:g} times as stiff as the layer would change T by {percent(change)}"
            if matters:
                matters, text = None, f"{text}; add [substrate] if yours is no stiffer"
        return [Advice("substrate", substrate is not None, change, None, matters, text)]

    def _poisson(self) -> list[Advice]:
        layer = self.problem.layer
        if layer.poisson == 0.5:
            return []
        change = self._changed(dataclasses.replace(self.problem, layer=dataclasses.replace(layer, poisson=0.5)))
        text = f"Poisson's ratio: 0.5 instead of {layer.poisson:g} would change T by {percent(change)}"
        return [Advice("poisson", True, change, None, self._judged(change), text)]

    def _contact_size(self) -> list[Advice]:
        change = self._changed(self.problem, MODELS["point_load"].solve)
        matters = self._judged(change)
        words = "" if matters else "; --model point_load suffices"
        text = f"size of the contacts: treating the balls as point loads would change T by {percent(change)}{words}"
        return [Advice("contact size", True, change, None, matters, text)]

    def _neighbours(self) -> list[Advice]:
        """Advise beyond which distance neighbours can be neglected, by the point-load law of each pair."""
        rings = sorted({round(d, 12) for d in self.away if d > 0.0})
        if len(rings) < 2:
            return []
        law = MODELS["point_load"].solve
        forces = [ball.normal_force for ball in self.ahead.balls]

        def within(reach: float) -> tuple[float, float]:
            near = (i for i, away in enumerate(self.away) if away <= reach * (1.0 + 1e-9))
            kept = [i for i in near if forces[i] > 0.0 or i == self.ball]
            balls = tuple(self.problem.balls[i] for i in kept)
            alone = dataclasses.replace(self.problem, balls=balls, load=Load("force", tuple(forces[i] for i in kept)))
            return law(alone, Run()).balls[kept.index(self.ball)].tangential_force

        whole = within(rings[-1])
        size = math.hypot(*whole)
        nearest, change, left = rings[-1], 0.0, 0.0
        for ring in rings[-2::-1]:
            left = math.dist(within(ring), whole) / size
            if left > self.accuracy:
                break
            nearest, change = ring, left
        all_matter = nearest == rings[-1]
        if all_matter:
            change, text = left, f"even the farthest neighbours change T by {percent(left)}"
        else:
            beyond = number(nearest / self.problem.balls[self.ball].radius, 3)
            text = f"neighbours beyond {beyond} R change T by {percent(change)} in all"
        return [Advice("neighbours", True, change, None, all_matter, text)]

    def _reciprocation(self) -> Advice:
        ball = self.ahead.balls[self.ball]
        share = self.size / ball.normal_force if ball.normal_force > 0.0 else math.inf
        drift = share / FRICTION
        text = (
            f"reciprocating sliding would move a ball by about {number(100.0 * drift, 2)} % of the sliding path "
            f"(|T|/({FRICTION:g} Q)); add [reciprocation] if it slides"
        )
        return Advice("reciprocation", False, None, None, None, text)
