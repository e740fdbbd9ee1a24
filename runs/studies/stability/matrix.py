"""The hard cases (R = 1 and E1 = 1, except for the scaled one): difficulty, models, and the reference for the check.

The requested accuracy is low: the question is whether an answer lies within its own error bar.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from linear_bem.indenter import Cone, Ellipsoid, Indenter, Punch
from linear_bem.problem import Ball, Elastic, Layer, Load, Problem
from runs.studies.framework.case import FINITE, LINEAR, POINT, SMALL, Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import as_seen_by, pair, pressed

ACCURACY = 0.1
"""Relative accuracy of T requested of finite elements."""
QUICK_ACCURACY, LINEAR_ACCURACY = 0.2, 1e-4
FINER = {"unlike-incompressible": 0.02}
"""Accuracy of the cases of `combined` whose T is much smaller than the reference force of the accuracy."""
ONE_STEP = {"largest_step": 10.0, "more_loads": ()}
GRADED = {"growth": 2.0}
"""Twice the default growth of element sizes."""
QUADRATIC = (Level(2, 1.0), Level(2, 1.5))
END, NO_LOAD, SAME_FORCE = "end", "no load", "same force"
"""Load of a comparison of two cases: full load, the limit of zero load, or the load where the other has the same Q."""


@dataclass(frozen=True)
class Check:
    """The reference of a case: ``other`` is its name, ``factor`` multiplies its T.

    ``within``: relative tolerance (0: the sum of both error bars); ``at``: load of the comparison.
    """

    words: str
    other: str
    within: float = 0.0
    factor: float = 1.0
    at: str = END


@dataclass(frozen=True)
class Hard:
    """A hard case: ``checks`` by model; without one, a model is judged by energy, force balance and its routes to T.

    ``unknowns``: largest numbers of unknowns by model; ``more``: further fields of the cases of finite elements.
    """

    name: str
    words: str
    problem: Problem
    models: tuple[str, ...]
    checks: Mapping[str, Check] = field(default_factory=dict)
    accuracy: float | None = None
    unknowns: Mapping[str, float] = field(default_factory=dict)
    more: Mapping[str, Any] = field(default_factory=dict)


def scaled(problem: Problem, scale: float) -> Problem:
    """Return a problem with prescribed approaches and a substrate, lengths times ``scale``, moduli times its cube."""
    layer, below, modulus = problem.layer, problem.substrate, scale**3
    assert below is not None
    return dataclasses.replace(
        problem,
        layer=Layer(layer.young * modulus, layer.poisson, layer.thickness * scale),
        balls=tuple(Ball((b.position[0] * scale, b.position[1] * scale), b.radius * scale) for b in problem.balls),
        load=Load("approach", tuple(value * scale for value in problem.load.values)),
        substrate=Elastic(below.young * modulus, below.poisson),
    )


def hard_cases() -> list[Hard]:
    """Return every hard case; references come first, the longest last."""
    usual = pair(0.1)
    unequal = dataclasses.replace(pair(0.05), balls=(Ball((-0.5, 0.0), 1.0), Ball((0.5, 0.0), 0.25)))

    def checks(name: str) -> dict[str, Check]:
        return {
            # a tolerance: the error bar of small_strain is its difference from linear_bem
            SMALL: Check("linear_bem, another model of the same problem", f"{name}-linear-bem", ACCURACY),
            FINITE: Check("the limit of zero load: linear_bem", f"{name}-linear-bem", at=NO_LOAD),
        }

    def three(
        name: str, words: str, problem: Problem, check: Check | None = None, accuracy: float | None = None
    ) -> Hard:
        own = {} if check is None else {FINITE: check}
        return Hard(name, words, problem, (FINITE, SMALL, LINEAR), checks(name) | own, accuracy)

    def finite(name: str, words: str, check: Check, **more: Any) -> Hard:
        return Hard(name, words, usual, (FINITE,), {FINITE: check}, more=more)

    twin = "usual-finite-strain"
    point = {POINT: Check("linear_bem, another model of the same problem", "usual-linear-bem")}
    return [
        Hard("usual", "touching balls, D = 0.1 R on h = 1.16 R, as baseline", usual,
             (FINITE, SMALL, LINEAR, POINT), checks("usual") | point),
        finite("one-step", "the whole load in one step",
               Check("path independence: many steps, on a mesh made for them", twin), numerics=ONE_STEP, steps=(1.0,)),
        finite("restart", "interrupted after the third load step and resumed",
               Check("an uninterrupted run", twin, 1e-6), stop_after=3),
        Hard("scaled", "the same in other units: lengths 1000 times, moduli 1e9 times", scaled(usual, 1e3),
             (FINITE,), {FINITE: Check("scaling: T ~ E R^2", twin, 1e-6, 1e15)}),
        finite("coarse", "quadratic elements on the two coarsest meshes", Check("the usual elements", twin),
               levels=QUADRATIC),
        finite("badly-graded", "element sizes that grow twice as fast", Check("the usual mesh", twin), numerics=GRADED),
        Hard("light", "hardly touching: D = 1e-4 R", pair(1e-4), (FINITE, SMALL, LINEAR),
             {FINITE: checks("light")[FINITE]}, unknowns={FINITE: 250e3}),
        three("nearly-incompressible", "nu = 0.4999", pair(0.1, poisson=0.4999),
              Check("nu = 0.5", "incompressible-finite-strain", 0.01)),
        three("incompressible", "nu = 0.5", pair(0.1, poisson=0.5)),
        three("no-lateral-strain", "nu = 0", pair(0.1, poisson=0.0)),
        three("very-thin", "h = 0.1 R, D = 0.02 R", pair(0.02, thickness=0.1), accuracy=0.001),
        three("very-thick", "h = 20 R, D = 0.1 R", pair(0.1, thickness=20.0)),
        three("stiff-substrate", "a substrate 1e7 times as stiff", pair(0.1, substrate=Elastic(1e7, 0.3)),
              Check("a rigid base", "rigid-base-finite-strain")),
        three("rigid-base", "no substrate", pair(0.1, substrate=None)),
        three("equal-substrate", "a substrate of the layer's own material", pair(0.1, substrate=Elastic(1.0, 0.48))),
        three("soft-substrate", "a substrate a tenth as stiff", pair(0.1, substrate=Elastic(0.1, 0.3))),
        three("unequal", "radii 1 and 0.25", unequal),
        three("force", "forces prescribed, 0.085 E R^2 on each", usual.with_load("force", (0.085, 0.085)),
              Check("approaches prescribed", twin, at=SAME_FORCE)),
        Hard("lifted", "one ball without load", usual.with_load("force", (0.085, 0.0)), (FINITE, SMALL, LINEAR)),
        Hard("thin-layer", "h = 0.2 R, D = 0.05 R", pair(0.05, thickness=0.2), (FINITE, SMALL, LINEAR),
             {SMALL: checks("thin-layer")[SMALL]}, accuracy=0.006),
        Hard("resting", "one ball pressed in by 0.2 R, its neighbour only rests", pair((0.2, 0.0)),
             (FINITE, SMALL, LINEAR), {SMALL: checks("resting")[SMALL]},
             unknowns={FINITE: 200e3, SMALL: 200e3}),
        Hard("touching-deep", "L = 2 R, D = 1 R in h = 1.16 R: 0.86 of its thickness", pair(1.0), (FINITE,)),
        Hard("deepest", "D = 0.95 h, beyond the solver's limit", pair(1.1), (FINITE, SMALL)),
        three("very-deep", "D = 1.0 R in h = 2 R", pair(1.0, thickness=2.0)),
        three("very-deep-foam", "the same for nu = 0.3", pair(1.0, thickness=2.0, poisson=0.3)),
        three("merging", "contacts that merge: D = 1.2 R on h = 6 R", pair(1.2, thickness=6.0)),
        *(
            Hard(name, words, problem, (FINITE,), accuracy=FINER.get(name))
            for name, (words, problem) in combined().items()
        ),
    ]  # fmt: skip


def combined() -> dict[str, tuple[str, Problem]]:
    """Return cases that combine difficulties: what makes each hard, and its problem."""
    unlike = (Ball((-0.5, 0.0), 1.0), Ball((1.0, 0.0), 0.5))
    return {
        "deep-incompressible": ("D = 0.9 R in h = 1.16 R, nu = 0.5", pair(0.9, poisson=0.5, substrate=None)),
        "thick-incompressible": ("D = 1.4 R in h = 2 R, nu = 0.5", pair(1.4, 2.0, poisson=0.5, substrate=None)),
        "film": ("D = R in h = 1.16 R: 0.14 of the thickness is left", pair(1.0, substrate=None)),
        "film-foam": ("the same for nu = 0", pair(1.0, poisson=0.0, substrate=None)),
        "deep-merging": ("contacts that merge: D = 1.4 R in h = 2 R", pair(1.4, 2.0, substrate=None)),
        "unlike-approaches": ("D = 0.6 R and 0.2 R in h = 1.16 R", pair((0.6, 0.2), substrate=None)),
        "unlike-merging": ("radii 1 and 0.5, 1.5 apart, D = 0.6 in h = 3", pressed(unlike, 0.6, 3.0)),
        "unlike-incompressible": ("radii 1 and 0.5, nu = 0.5, D = 0.4 in h = 1.16", pressed(unlike, 0.4, poisson=0.5)),
        "soft-below-thin": ("h = 0.3 R on a substrate a tenth as stiff, D = 0.2 R",
                            pair(0.2, 0.3, substrate=Elastic(0.1, 0.3))),
        "stiff-film": ("h = 0.1 R on a substrate a hundredth as stiff, D = 0.05 R",
                       pair(0.05, 0.1, substrate=Elastic(0.01, 0.45))),
        "soft-below-deep": ("D = 0.8 R in h = 1.16 R on a substrate a tenth as stiff",
                            pair(0.8, substrate=Elastic(0.1, 0.3))),
        "row-deep": ("three balls in a row, D = 0.6 R in h = 1.16 R", pressed(_row(), 0.6)),
        "row-incompressible": ("three balls in a row, nu = 0.4999, D = 0.4 R in h = 2 R",
                               pressed(_row(), 0.4, 2.0, 0.4999)),
        "ellipsoids": ("semi-axes 0.8, 1.3 and 1, 2 apart, D = 0.5 in h = 1.16",
                       pressed(_two(Ellipsoid((0.8, 1.3, 1.0))), 0.5)),
        "cones": ("flanks of 20 deg, tips of radius 0.2, D = 0.3 in h = 1.16: flanks nearly meet",
                  pressed(_two(Cone(math.radians(20.0), 0.2)), 0.3)),
        "meeting-cones": ("the same, D = 0.4: flanks would overlap", pressed(_two(Cone(math.radians(20.0), 0.2)), 0.4)),
        "steep-cones": ("flanks of 45 deg, tips of radius 0.1, D = 0.4 in h = 2",
                        pressed(_two(Cone(math.radians(45.0), 0.1)), 0.4, 2.0)),
        "punches": ("radius 0.5, edges of radius 0.15, D = 0.3 in h = 1.16", pressed(_two(Punch(0.5, 0.15)), 0.3)),
        "sharp-punches": ("radius 0.5, edges of radius 0.02, D = 0.1 in h = 1.16",
                          pressed(_two(Punch(0.5, 0.02)), 0.1)),
        "punch-and-ball": ("a punch of radius 0.5 beside a ball, D = 0.1 and 0.3 in h = 1.16",
                           pressed((Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 0.5, Punch(0.5, 0.1))), (0.3, 0.1))),
        "deep-force": ("forces prescribed, 2 E R^2 on each ball, in h = 1.16 R",
                       pair(0.1, substrate=None).with_load("force", (2.0, 2.0))),
    }  # fmt: skip


def _row() -> tuple[Ball, ...]:
    return tuple(Ball((x, 0.0), 1.0) for x in (-2.0, 0.0, 2.0))


def _two(shape: Indenter) -> tuple[Ball, ...]:
    return tuple(Ball((x, 0.0), shape.apex_radius, shape) for x in (-1.0, 1.0))


def cases(quick: bool) -> list[Case]:
    """Return every case and model; a few shallow and coarse ones in the quick version."""
    chosen = hard_cases()
    if quick:
        names = ("usual", "one-step", "restart", "deepest", "lifted")
        shallow = {h.name: pair(0.022) for h in chosen if h.name in ("usual", "one-step", "restart")}
        chosen = [
            dataclasses.replace(
                h, problem=shallow.get(h.name, h.problem),
                more={**h.more, "stop_after": 1} if h.name == "restart" else h.more,
                words=h.words.replace("D = 0.1 R", "D = 0.022 R").replace("third", "first"),
            )
            for h in chosen
            if h.name in names
        ]  # fmt: skip
    return [
        case_of(hard, model, QUICK_ACCURACY if quick else hard.accuracy or ACCURACY)
        for hard in chosen
        for model in hard.models
    ]


def case_of(hard: Hard, model: str, accuracy: float) -> Case:
    """Return the case of a model; ``accuracy`` is that of finite elements, along the whole load path."""
    problem = as_seen_by(model, hard.problem)
    check = hard.checks.get(model)
    said = dataclasses.asdict(check) if check is not None else None
    labels = {"case": hard.name, "words": hard.words, "check": said}
    name = f"{hard.name}-{model.replace('_', '-')}"
    if model not in (FINITE, SMALL):
        return Case(name, problem, model, LINEAR_ACCURACY, labels=labels, steps=None if model == LINEAR else (1.0,))
    kind = LevelCase if "levels" in hard.more else Case
    budget = {"unknowns": hard.unknowns[model]} if model in hard.unknowns else {}
    return kind(name, problem, model, accuracy, labels, budget=budget, **{"steps": None, **hard.more})
