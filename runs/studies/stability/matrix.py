"""The hard cases: what makes each hard, which models are asked, and what its answer is checked against.

Dimensionless, R = 1 and E1 = 1, but for the scaled twin. A check names another case of the study that must give the
same force by another route: another model, another path, a limit, the same problem in other units.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem
from runs.studies.case import Case

STIFF = Elastic(1e3, 0.3)
STEPS = "finite_strain.schedule"
"""Module of the constants that choose the load steps."""
FINITE, SMALL, LINEAR, POINT = "finite_strain", "small_strain", "linear_bem", "point_load"


@dataclass(frozen=True)
class Check:
    """What a case must agree with: ``other`` is that case's name, ``factor`` what its T is multiplied with.

    ``within`` is the relative difference granted beyond both error bars; None: error bars alone, all there is.
    """

    words: str
    other: str
    within: float = 0.0
    factor: float = 1.0


@dataclass(frozen=True)
class Hard:
    """A hard case: ``checks`` by model; a model without one is judged by energy, force balance and its own routes."""

    name: str
    words: str
    problem: Problem
    models: tuple[str, ...]
    checks: Mapping[str, Check] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    stop_after: int | None = None
    accuracy: float | None = None


def pair(
    approach: float,
    *,
    thickness: float = 1.16,
    poisson: float = 0.48,
    substrate: Elastic | None = STIFF,
    radii: tuple[float, float] = (1.0, 1.0),
    scale: float = 1.0,
) -> Problem:
    """Return two spheres that touch; ``scale`` multiplies lengths, and moduli by its cube."""
    half = (radii[0] * radii[1]) ** 0.5 * scale
    balls = tuple(Ball((side * half, 0.0), r * scale, "sphere") for side, r in zip((-1.0, 1.0), radii, strict=True))
    modulus = scale**3
    below = None if substrate is None else Elastic(substrate.young * modulus, substrate.poisson)
    load = Load("approach", (approach * scale,) * 2)
    return Problem(Layer(modulus, poisson, thickness * scale), balls, load, below, FiniteStrain())


def hard_cases() -> list[Hard]:
    """Return every hard case; those that others are checked against come first."""
    one_step = {f"{STEPS}.LARGEST_STEP": 10.0, f"{STEPS}.GROWTH": 1e9}
    three = (FINITE, SMALL, LINEAR)
    usual = pair(0.1)
    with_linear = "linear_bem, another model of the same problem"

    def linear(name: str, within: float = 0.0) -> dict[str, Check]:
        return {SMALL: Check(with_linear, f"{name}-linear-bem", within)}

    return [
        Hard("usual", "D = 0.1 R on h = 1.16 R, to compare with", usual, (*three, POINT), {
            POINT: Check(with_linear, "usual-linear-bem"), **linear("usual")}),
        Hard(
            "one-step", "the whole load in one step", usual, (FINITE,),
            {FINITE: Check("path independence: many steps", "usual-finite-strain", 1e-3)}, one_step,
        ),
        Hard(
            "restart", "stopped after the third load step and started again", usual, (FINITE,),
            {FINITE: Check("a run that was not stopped", "usual-finite-strain", 1e-6)}, stop_after=3,
        ),
        Hard(
            "scaled", "the same in other units: lengths 1000 times, moduli 1e9 times", pair(0.1, scale=1e3), (FINITE,),
            {FINITE: Check("scaling: T ~ E R^2", "usual-finite-strain", 1e-6, 1e15)},
        ),
        Hard(
            "coarse", "a mesh as coarse as the solver makes it", usual, (FINITE,),
            {FINITE: Check("the usual mesh", "usual-finite-strain")}, accuracy=0.9,
        ),
        Hard("light", "hardly touching: D = 1e-4 R", pair(1e-4), three, {
            FINITE: Check("small strain is the limit", "light-linear-bem"), **linear("light")}),
        Hard("nearly-incompressible", "nu = 0.4999", pair(0.1, poisson=0.4999), three, {
            FINITE: Check("nu = 0.5", "incompressible-finite-strain", 0.01), **linear("nearly-incompressible")}),
        Hard("incompressible", "nu = 0.5", pair(0.1, poisson=0.5), three, linear("incompressible")),
        Hard("auxetic-limit", "nu = 0", pair(0.1, poisson=0.0), three, linear("auxetic-limit")),
        Hard("very-thin", "h = 0.1 R, D = 0.02 R", pair(0.02, thickness=0.1), three, linear("very-thin")),
        Hard("very-thick", "h = 20 R, D = 0.1 R", pair(0.1, thickness=20.0), three, linear("very-thick")),
        Hard("very-deep", "D = 1.0 R in h = 2 R", pair(1.0, thickness=2.0), three),
        Hard("deepest", "D = 0.95 h, more than the solver takes", pair(1.1), (FINITE, SMALL)),
        Hard("merging", "contacts that merge: D = 1.2 R on h = 6 R", pair(1.2, thickness=6.0), three),
        Hard("stiff-substrate", "a substrate 1e7 times as stiff", pair(0.1, substrate=Elastic(1e7, 0.3)), three, {
            FINITE: Check("a rigid base", "rigid-base-finite-strain", 1e-3), **linear("stiff-substrate")}),
        Hard("rigid-base", "no substrate", pair(0.1, substrate=None), three, linear("rigid-base")),
        Hard("equal-substrate", "a substrate of the layer's own modulus", pair(0.1, substrate=Elastic(1.0, 0.48)),
             three, linear("equal-substrate")),
        Hard("soft-substrate", "a substrate a tenth as stiff", pair(0.1, substrate=Elastic(0.1, 0.3)), three,
             linear("soft-substrate")),
        Hard("unequal", "radii 1 and 0.25", pair(0.05, radii=(1.0, 0.25)), three, linear("unequal")),
        Hard("force", "the same forces prescribed", usual.with_load("force", (0.085, 0.085)), three, linear("force")),
        Hard("lifted", "one ball without load", usual.with_load("force", (0.085, 0.0)), three),
    ]  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """Return every case and model; the quick version has few, shallow and coarse ones."""
    chosen = hard_cases()
    if quick:
        names = ("usual", "one-step", "restart", "deepest", "lifted")
        shallow = {h.name: pair(0.022) for h in chosen if h.name in ("usual", "one-step", "restart")}
        chosen = [
            dataclasses.replace(h, problem=shallow.get(h.name, h.problem), stop_after=1 if h.stop_after else None)
            for h in chosen
            if h.name in names
        ]
    return [_case(hard, model, quick) for hard in chosen for model in hard.models]


def _case(hard: Hard, model: str, quick: bool) -> Case:
    problem = hard.problem
    if model != FINITE:
        problem = Problem(problem.layer, problem.balls, problem.load, problem.substrate)
    accuracy = 1e-4 if model in (LINEAR, POINT) else 0.2 if quick else hard.accuracy or 0.05
    constants = hard.constants if model in (FINITE, SMALL) else {}
    check = hard.checks.get(model)
    labels = {
        "case": hard.name,
        "words": hard.words,
        "check": dataclasses.asdict(check) if check is not None else None,
    }
    stop = hard.stop_after if model == FINITE else None
    return Case(f"{hard.name}-{model.replace('_', '-')}", problem, model, accuracy, constants, labels, stop)
