"""Forecast of a run: the number of meshes with its probability, and their time and memory."""

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from statistics import NormalDist
from typing import Any

from finite_strain.equilibrium.solver_options import choose, given_in
from finite_strain.geometry.load_control import prescribed
from finite_strain.mechanics.volumetric import describe_forms
from finite_strain.planning.cost import START_SECONDS, Mesh, speedup
from finite_strain.planning.records import Discretisation
from finite_strain.planning.refinement import FIRST, HIGHEST, ORDER, PATH_FINDER, STEP
from finite_strain.planning.run_plan import LATEST, RunPlan
from linear_bem.counts import grouped
from linear_bem.law import Hyperfoam, Ogden

REACHED, MIXED_REACHED, ALONE_REACHED = 0.11, 0.5, 0.4
"""Constant of `first_error`, from 117 runs of 0.02 R to 1.4 R, including the studies `stability` and `strengthening`;
factors on it in the mixed form, and for one ball, whose force or approach counts."""
SCATTER, LEAST = 0.58, 0.02
"""Standard deviation of the logarithm of the error reached over `first_error`, measured by ``python -m
tests.runs.plan_errors``; least probability at which another number of meshes is reported."""
HIGHER = 0.27
"""Error of order 4 over that of order 3: the median of 30 runs, half of them within 0.14 and 0.46."""
RANKS = 2
"""Default number of processes for time and memory."""


def first_error(plan: RunPlan) -> float:
    """Return the error of T that `FIRST` will reach: large if contacts come near the sides of their blocks."""
    box, problem = plan.box(FIRST), plan.problem
    room = min(1.0 - min(zone.contact_radius / zone.half_width, LATEST) for zone in box.zones)
    constant = REACHED * (ALONE_REACHED if problem.size == 1 else 1.0)
    constant *= MIXED_REACHED if "mixed" in describe_forms(problem).values() else 1.0
    return float(constant * plan.deepest ** (2.0 / 3.0) / (room * (len(box.levels()[0]) - 1) ** 2))


def chances(plan: RunPlan) -> tuple[tuple[Discretisation, float], ...]:
    """Return the discretisations in the order of a run, each with the probability that it is the last."""
    rows, level, error, beyond = [(PATH_FINDER, 0.0)], FIRST, first_error(plan), 1.0
    while True:
        before, beyond = beyond, 1.0 - NormalDist(math.log(error), SCATTER).cdf(math.log(plan.accuracy))
        rises, finer = level.order < HIGHEST, level.fineness + STEP
        following = replace(level, order=HIGHEST) if rises else replace(level, fineness=finer)
        no_more = plan.given is not None and not rises
        if beyond < LEAST or no_more or plan.unknowns(following) > plan.budget.most_unknowns:
            return (*rows, (level, before))
        rows.append((level, before - beyond))
        error *= HIGHER if rises else (level.fineness / finer) ** ORDER
        level = following


def likely(rows: Sequence[tuple[Discretisation, float]]) -> tuple[Discretisation, ...]:
    """Return the discretisations of a run whose `FIRST` reaches `first_error`, the median, from its `chances`."""
    reached = accumulate(chance for _, chance in rows)
    last = next(number for number, share in enumerate(reached) if share >= 0.5)
    return tuple(level for level, _ in rows[: last + 1])


def forecast(plan: RunPlan, ranks: int = RANKS) -> dict[str, Any]:
    """Return the plan in words and numbers: SI units; seconds and memory of the likely discretisations.

    Keys with ``processor_`` refer to a single process; ``seconds_of_meshes`` hold the times of each discretisation.
    ``perhaps`` has the cost of other numbers of meshes whose probability is at least `LEAST`.
    """
    problem, most, box = plan.problem, plan.budget.most_unknowns, plan.box(PATH_FINDER)
    forms = describe_forms(problem)
    mixed, given = "mixed" in forms.values(), given_in(os.environ.get("PETSC_OPTIONS", ""))
    pairs = len(plan.loads) * plan.is_paired
    free = prescribed(problem).moves(len(plan.reduction.balls)).shape[1]
    effect = problem.finite_strain
    stretches = effect is not None and isinstance(effect.chosen, Ogden | Hyperfoam)

    def mesh(unknowns: float, level: Discretisation) -> Mesh:
        steps = plan.path if level == PATH_FINDER else plan.loads
        direct = choose(unknowns, mixed, given, level.order).direct
        layers = plan.box(level).layers
        return Mesh(unknowns, level.order, layers, len(steps), pairs, direct, mixed, stretches, free, plan.deepest)

    rows = chances(plan)
    meshes, taken = [mesh(plan.unknowns(level), level) for level, _ in rows], likely(rows)
    others = {n: chance for n, (_, chance) in enumerate(rows, start=1) if n != len(taken) and chance >= LEAST}
    seconds = [each.seconds for each in meshes]
    seconds[0] += START_SECONDS
    wall = [spent / speedup(each.unknowns, ranks) for spent, each in zip(seconds, meshes, strict=True)]

    def cost(number: int) -> dict[str, float]:
        spent, last = sum(seconds[:number]), meshes[number - 1]
        return {
            "seconds": sum(wall[:number]), "processor_seconds": spent, "memory_bytes": last.memory_bytes(ranks),
            "processor_memory_bytes": last.memory_bytes(1),
        }  # fmt: skip

    last, largest = meshes[len(taken) - 1], mesh(most, replace(FIRST, order=HIGHEST))
    perhaps = [{"meshes": number, "chance": chance, **cost(number)} for number, chance in others.items()]
    return {
        "forms": forms,
        "linear_solver": choose(last.unknowns, mixed, given, last.order).describe(),
        "symmetries": [f"mirror plane {'xy'[axis]} = 0 of the balls' own frame" for axis in plan.reduction.planes],
        "unknowns": round(last.unknowns),
        "meshes": [f"{level}: about {grouped(plan.unknowns(level))} unknowns" for level in taken]
        + [f"finer or wider ones, up to {grouped(most)} unknowns, while the error at full load exceeds that asked for"],
        **cost(len(taken)),
        "memory_bytes_at_most": largest.memory_bytes(ranks),
        "seconds_of_meshes": wall[: len(taken)], "processor_seconds_of_meshes": seconds[: len(taken)],
        **({"perhaps": perhaps} if perhaps else {}),
        "domain": {"x": list(box.x), "y": list(box.y), "layer": box.thickness, "substrate": box.substrate},
        "load_steps": len(plan.goals),
        "accuracy": {"asked": plan.accuracy, "unknowns_at_most": most, "seconds_at_most": plan.budget.seconds},
    }  # fmt: skip
