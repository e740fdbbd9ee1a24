"""The hard cases: what makes each hard, which models are asked, and what its answer is checked against.

Dimensionless, R = 1 and E1 = 1, but for the scaled twin. A check names another case of the study that must give the
same force by another route: another model, another path, a limit, the same problem in other units. The meshes are
the coarsest that an accuracy sizes: what is asked here is whether an answer stands within its own error bar.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem
from linear_bem.result import Result, Step
from runs.models import MODELS, Run
from runs.studies.case import Case

STIFF = Elastic(1e3, 0.3)
ACCURACY = 0.1
"""Relative accuracy of T that sizes the meshes; none finer follow, whatever the first two reach."""
QUICK_ACCURACY = 0.2
TWO_MESHES = {"finite_strain.refinement.MOST_MESHES": 1}
STEPS = "finite_strain.schedule"
"""Module of the constants that choose the load steps."""
DOMAIN = "finite_strain.domain"
"""Module of the constants that grade the meshes."""
END, NO_LOAD, SAME_FORCE = "end", "no load", "same force"
"""Where two cases are compared: at full load, in the limit of no load, or where the other passes the same Q."""
FINITE, SMALL, LINEAR, POINT = "finite_strain", "small_strain", "linear_bem", "point_load"


@dataclass(frozen=True)
class Check:
    """What a case must agree with: ``other`` is that case's name, ``factor`` what its T is multiplied with.

    ``within`` is the relative difference granted; 0: what both error bars add up to. ``at`` is the load compared at.
    """

    words: str
    other: str
    within: float = 0.0
    factor: float = 1.0
    at: str = END


@dataclass(frozen=True)
class Hard:
    """A hard case: ``checks`` by model; a model without one is judged by energy, force balance and its own routes."""

    name: str
    words: str
    problem: Problem
    models: tuple[str, ...]
    checks: Mapping[str, Check] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=lambda: TWO_MESHES)
    stop_after: int | None = None
    accuracy: float | None = None
    budget: Mapping[str, float] = field(default_factory=dict)


class LinearPath(Case):
    """A case of linear_bem with the load steps that elements pass, to hold theirs against."""

    def key(self) -> str:
        """Return a digest unlike that of the case at full load alone."""
        return f"path-{super().key()}"

    def solve(self, run: Run) -> Result:
        """Return the answer at full load, with those at the load steps before."""
        from finite_strain.planning import planned_fractions  # noqa: PLC0415  (no DOLFINx, but not for every command)

        load = self.problem.load
        steps = []
        for fraction in planned_fractions(self.problem):
            values = [fraction * value for value in load.values]
            result = MODELS[LINEAR].solve(self.problem.with_load(load.kind, values), run)
            steps.append(Step(result.balls, {"fraction": fraction}))
        return dataclasses.replace(result, steps=tuple(steps))


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
    """Return every hard case; those that others are checked against come first, the longest last."""
    from finite_strain.schedule import GROWTH  # noqa: PLC0415

    one_step = {f"{STEPS}.LARGEST_STEP": 10.0, f"{STEPS}.GROWTH": 1e9}
    # five usual steps in one: the first step, which sizes the meshes, stays what it was
    leap = {f"{STEPS}.LARGEST_STEP": 10.0, f"{STEPS}.GROWTH": GROWTH**5}
    graded = {f"{DOMAIN}.FAR_CONTACTS": 1.3, f"{DOMAIN}.FAR_NEIGHBOURS": 0.0, f"{DOMAIN}.FAR_GROWTH": 8.0}
    usual = pair(0.1)

    def checks(name: str) -> dict[str, Check]:
        return {
            SMALL: Check("linear_bem, another model of the same problem", f"{name}-linear-bem"),
            FINITE: Check("the limit of no load: small_strain", f"{name}-small-strain", at=NO_LOAD),
        }

    def three(name: str, words: str, problem: Problem, check: Check | None = None, **more: Any) -> Hard:
        own = {} if check is None else {FINITE: check}
        return Hard(name, words, problem, (FINITE, SMALL, LINEAR), checks(name) | own, **more)

    def finite(name: str, words: str, constants: Mapping[str, float], check: Check, **more: Any) -> Hard:
        return Hard(name, words, usual, (FINITE,), {FINITE: check}, {**TWO_MESHES, **constants}, **more)

    twin = "usual-finite-strain"
    point = {POINT: Check("linear_bem, another model of the same problem", "usual-linear-bem")}
    return [
        Hard("usual", "touching balls, D = 0.1 R on h = 1.16 R, to compare with", usual,
             (FINITE, SMALL, LINEAR, POINT), checks("usual") | point),
        finite("one-step", "the whole load in one step, on meshes for that step", one_step,
               Check("path independence: many steps", twin)),
        finite("leap", "the usual meshes, from the first step to full load at once", leap,
               Check("path independence: many steps", twin, 1e-3)),
        finite("restart", "stopped after the third load step and started again", {},
               Check("a run that was not stopped", twin, 1e-6), stop_after=3),
        Hard("scaled", "the same in other units: lengths 1000 times, moduli 1e9 times", pair(0.1, scale=1e3),
             (FINITE,), {FINITE: Check("scaling: T ~ E R^2", twin, 1e-6, 1e15)}),
        finite("coarse", "elements twice as large: two over the first contact's diameter",
               {"finite_strain.planning.COARSEST": 2.5}, Check("the usual mesh", twin), budget={"unknowns": 700.0}),
        finite("badly-graded", "elements that grow twice as fast as their distance from the contact", graded,
               Check("the usual mesh", twin)),
        three("light", "hardly touching: D = 1e-4 R", pair(1e-4)),
        three("nearly-incompressible", "nu = 0.4999", pair(0.1, poisson=0.4999),
              Check("nu = 0.5", "incompressible-finite-strain", 0.01)),
        three("incompressible", "nu = 0.5", pair(0.1, poisson=0.5)),
        three("no-lateral-strain", "nu = 0", pair(0.1, poisson=0.0)),
        three("very-thin", "h = 0.1 R, D = 0.02 R", pair(0.02, thickness=0.1), accuracy=0.05),
        three("very-thick", "h = 20 R, D = 0.1 R", pair(0.1, thickness=20.0)),
        three("stiff-substrate", "a substrate 1e7 times as stiff", pair(0.1, substrate=Elastic(1e7, 0.3)),
              Check("a rigid base", "rigid-base-finite-strain")),
        three("rigid-base", "no substrate", pair(0.1, substrate=None)),
        three("equal-substrate", "a substrate of the layer's own material", pair(0.1, substrate=Elastic(1.0, 0.48))),
        three("soft-substrate", "a substrate a tenth as stiff", pair(0.1, substrate=Elastic(0.1, 0.3))),
        three("unequal", "radii 1 and 0.25", pair(0.05, radii=(1.0, 0.25))),
        three("force", "forces prescribed, 0.085 E R^2 on each", usual.with_load("force", (0.085, 0.085)),
              Check("approaches prescribed", twin, at=SAME_FORCE)),
        Hard("lifted", "one ball without load", usual.with_load("force", (0.085, 0.0)), (FINITE, SMALL, LINEAR)),
        Hard("deepest", "D = 0.95 h, more than the solver takes", pair(1.1), (FINITE, SMALL)),
        three("very-deep", "D = 1.0 R in h = 2 R", pair(1.0, thickness=2.0)),
        three("very-deep-foam", "the same for nu = 0.3", pair(1.0, thickness=2.0, poisson=0.3)),
        three("merging", "contacts that merge: D = 1.2 R on h = 6 R", pair(1.2, thickness=6.0)),
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
    elements = model in (FINITE, SMALL)
    accuracy = 1e-4 if not elements else QUICK_ACCURACY if quick else hard.accuracy or ACCURACY
    check = hard.checks.get(model)
    labels = {
        "case": hard.name,
        "words": hard.words,
        "check": dataclasses.asdict(check) if check is not None else None,
    }
    stop = hard.stop_after if model == FINITE else None
    name = f"{hard.name}-{model.replace('_', '-')}"
    if not elements:
        kind = LinearPath if model == LINEAR else Case
        return kind(name, problem, model, accuracy, labels=labels)
    return Case(name, problem, model, accuracy, hard.constants, labels, stop, hard.budget)
