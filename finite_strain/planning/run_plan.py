"""The plan of a run: symmetry, discretisations, load steps, and their cost."""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.util import find_spec
from itertools import accumulate
from statistics import NormalDist
from typing import Any

from finite_strain.equilibrium.solver_options import choose, given_in
from finite_strain.geometry.estimates import LEAST_SHARE, alone, edge_of, with_expressions
from finite_strain.geometry.extent import Extent, choose_extent
from finite_strain.geometry.load_control import prescribed
from finite_strain.geometry.symmetry import Reduction, reduce_scene
from finite_strain.mechanics.volumetric import describe_forms, form_faults
from finite_strain.numerics import DEFAULT, Numerics
from finite_strain.planning.cost import SPEEDUP, START_SECONDS, Mesh
from finite_strain.planning.records import Discretisation
from finite_strain.planning.refinement import FIRST, HIGHEST, ORDER, PATH_FINDER, STEP, Budget
from linear_bem.closed_forms import Indentation
from linear_bem.counts import grouped
from linear_bem.errors import InvalidProblem, ThirdBodyError, UnsupportedProblem
from linear_bem.indenter import HeightFunction
from linear_bem.law import Hyperfoam, Law, Ogden
from linear_bem.problem import Problem, SurfaceResponse
from meshes.box import Box, Zone, half_widths

MODELS = ("finite_strain", "small_strain")
MOST_AT_FIRST = 5e5
"""Largest number of unknowns of the first answering discretisation where no budget is stated."""
MOST_COUNTED = 2e6
"""Number of unknowns, as estimated, up to which a mesh is counted: a million take 0.2 s, many balls longer."""
LATEST = 0.85
"""Largest radius of the mesh line along a contact's edge over its block's half-width. T is integrated outside it."""
DETAIL = 2.0
"""Width of the elements at the edge of a flat end over the radius of its rounding, times the fineness."""
REACHED, MIXED_REACHED, ALONE_REACHED = 0.11, 0.5, 0.4
"""Constant of `RunPlan.first_error`, by 117 runs of 0.02 R to 1.4 R, those of studies `stability` and `strengthening`
among them; factors on it in the mixed form, and for one ball, whose force or approach counts."""
SCATTER, LEAST = 0.58, 0.1
"""Standard deviation of the logarithm of the error reached over `RunPlan.first_error`, measured by `plan_errors` of
``runs.studies.scaling``; least chance of another number of meshes that a plan names."""
HIGHER = 0.27
"""Error of order 4 over that of order 3: the median of 30 runs, half of them within 0.14 and 0.46."""
ENOUGH, NEARBY = 3, 0.5
"""Number of nearby load steps with output from which on their changes alone show the error at full load. Nearby are
loads with contacts at least half as wide by Hertz's law."""
_SHARED_NODES = 1.35
"""Nodes of a mesh over the cube of the order times its hexahedra: outer faces have nodes of their own."""
RANKS = 2
"""Processes that a plan's time and memory are for, unless said."""


@dataclass(frozen=True)
class GivenMesh:
    """A user's own mesh: x and y intervals and depth of the substrate [m], number of cells, kind, and its digest."""

    x: tuple[float, float]
    y: tuple[float, float]
    depth: float
    cells: int
    simplices: bool
    digest: str


@dataclass(frozen=True)
class RunPlan:
    """The parts of a run: ``goals`` are the load fractions with output.

    ``loads`` are those at which discretisations are compared: the goals, and more of them where there are few.
    """

    problem: Problem
    reduction: Reduction
    goals: tuple[float, ...]
    accuracy: float
    budget: Budget
    numerics: Numerics
    expected: tuple[Indentation, ...]
    extent: Extent = field(repr=False)
    given: GivenMesh | None = None

    @property
    def model(self) -> str:
        """The model's name, which follows from the problem's effect."""
        return model_of(self.problem)

    @property
    def is_paired(self) -> bool:
        """Whether the small-strain problem runs beside the run's own."""
        return self.problem.finite_strain is not None

    @property
    def has_own_functions(self) -> bool:
        """Whether the layer's law is a function psi(F), or a body a function f(x, y)."""
        effect = self.problem.finite_strain
        of_bodies = any(isinstance(ball.shape, HeightFunction) for ball in self.problem.balls)
        return of_bodies or (effect is not None and not isinstance(effect.chosen, Law))

    @property
    def deepest(self) -> float:
        """The largest expected approach over its ball's radius."""
        return max(e.approach / ball.radius for ball, e in zip(self.problem.balls, self.expected, strict=True))

    @property
    def loads(self) -> tuple[float, ...]:
        """The load fractions at which every discretisation has results, rising."""
        last = self.goals[-1]
        if not self.is_paired or sum(goal >= self.nearby * last for goal in self.goals) >= ENOUGH:
            return self.goals  # the error of small strain alone is known where linear_bem has an answer
        more = (f * last for f in self.numerics.more_loads)
        return tuple(sorted({*self.goals, *(m for m in more if not any(math.isclose(m, g) for g in self.goals))}))

    @property
    def nearby(self) -> float:
        """The least load, over another one, at which the changes between discretisations count for the other one."""
        return NEARBY ** (2.0 * prescribed(self.problem).power)

    @property
    def path(self) -> tuple[float, ...]:
        """The load fractions of the path finder."""
        return prescribed(self.problem).fractions(self.deepest, self.loads, self.numerics.largest_step)

    def box(self, level: Discretisation) -> Box:
        """Return the box that a discretisation meshes, with a block under each ball of the reduced scene."""
        problem, reduction = self.problem, self.reduction
        margin, depth = level.extent * self.extent.margin, level.extent * self.extent.depth
        sides = []
        for axis in (0, 1):
            coordinates = [ball.position[axis] for ball in reduction.balls]
            low = 0.0 if axis in reduction.planes else min(coordinates) - margin
            sides.append((low, max(coordinates) + margin))
        if self.given is not None:
            sides, depth = [self.given.x, self.given.y], self.given.depth
        radii, edges = [], [edge_of(ball.shape) for ball in reduction.balls]
        for ball, edge in zip(reduction.balls, edges, strict=True):
            # the mesh of a ball that hardly touches assumes a small approach
            hardly = alone(problem, ball, approach=LEAST_SHARE * self.deepest * ball.radius)
            radius = max(self.expected[ball.index].contact_radius, hardly.contact_radius)
            radii.append(radius if edge is None else edge[0])
        positions = [ball.position for ball in reduction.balls]
        widths = half_widths(positions, radii, sides[0], sides[1], reduction.planes)
        lines = [min(a, LATEST * m) if a < m else a for a, m in zip(radii, widths, strict=True)]
        smallest = self.goals[0] ** (0.5 / prescribed(problem).power)  # as Hertz's contact grows
        zones = tuple(
            Zone(place, a, m, smallest) if edge is None else Zone(place, a, m, 1.0, DETAIL * edge[1])
            for place, a, m, edge in zip(positions, lines, widths, edges, strict=True)
        )
        growth = self.numerics.growth
        return Box(sides[0], sides[1], problem.layer.thickness, depth, zones, level.fineness, growth)

    def unknowns(self, level: Discretisation) -> float:
        """Count the unknowns of a discretisation by its mesh in the plane; without gmsh, estimate them within 30 %."""
        p, pressures = level.order, sum(form == "mixed" for form in describe_forms(self.problem).values())
        if self.given is None:
            box = self.box(level)
            cells = box.estimated_hexahedra()
        else:
            cells = self.given.cells / (6.0 if self.given.simplices else 1.0)
        estimate = _SHARED_NODES * cells * (3.0 * p**3 + pressures * (p - 1.0) ** 3)
        if self.given is not None or estimate > MOST_COUNTED or find_spec("gmsh") is None:
            return estimate
        from meshes.layer import counted  # noqa: PLC0415  (imports gmsh)

        try:
            quads, rim = counted(box)
        except ThirdBodyError:  # said when the mesh is made
            return estimate
        # Euler's formula, for the nodes of displacements and of pressures
        nodes = [(q * q * quads + q * rim / 2.0 + 1.0) * (q * box.layers + 1.0) for q in (p, p - 1)]
        return 3.0 * nodes[0] + pressures * nodes[1]

    @property
    def first_error(self) -> float:
        """The error of T that `FIRST` will reach: large if contacts come near the sides of their blocks."""
        box = self.box(FIRST)
        room = min(1.0 - zone.contact_radius / zone.half_width for zone in box.zones)
        constant = REACHED * (ALONE_REACHED if self.problem.size == 1 else 1.0)
        constant *= MIXED_REACHED if "mixed" in describe_forms(self.problem).values() else 1.0
        return float(constant * self.deepest ** (2.0 / 3.0) / (room * (len(box.levels()[0]) - 1) ** 2))

    @cached_property
    def chances(self) -> tuple[tuple[Discretisation, float], ...]:
        """The discretisations in the order in which they are taken, each with the chance that the run ends with it."""
        rows, level, error, beyond = [(PATH_FINDER, 0.0)], FIRST, self.first_error, 1.0
        while True:
            before, beyond = beyond, 1.0 - NormalDist(math.log(error), SCATTER).cdf(math.log(self.accuracy))
            rises, finer = level.order < HIGHEST, level.fineness + STEP
            following = replace(level, order=HIGHEST) if rises else replace(level, fineness=finer)
            if (
                beyond < LEAST
                or (self.given is not None and not rises)
                or self.unknowns(following) > self.budget.most_unknowns
            ):
                return (*rows, (level, before))
            rows.append((level, before - beyond))
            error *= HIGHER if rises else (level.fineness / finer) ** ORDER
            level = following

    @property
    def likely(self) -> tuple[Discretisation, ...]:
        """The discretisations of a run whose `FIRST` reaches `first_error`, the median."""
        total = accumulate(chance for _, chance in self.chances)
        return tuple(level for level, _ in self.chances[: 1 + next(i for i, sum_ in enumerate(total) if sum_ >= 0.5)])

    def describe(self, ranks: int = RANKS) -> dict[str, Any]:
        """Return the plan in words and numbers: SI units; seconds and memory of the likely discretisations.

        ``processor_`` is what one process takes alone; ``seconds_of_meshes`` are those of each discretisation.
        ``perhaps`` has the cost of other numbers of meshes, with the chance of each.
        """
        most, box, forms = self.budget.most_unknowns, self.box(PATH_FINDER), describe_forms(self.problem)
        mixed, given = "mixed" in forms.values(), given_in(os.environ.get("PETSC_OPTIONS", ""))
        pairs = len(self.loads) * self.is_paired
        free = len(self.reduction.balls) * prescribed(self.problem).forces_given
        effect = self.problem.finite_strain
        stretches = effect is not None and isinstance(effect.chosen, Ogden | Hyperfoam)

        def mesh(unknowns: float, level: Discretisation) -> Mesh:
            steps = self.path if level == PATH_FINDER else self.loads
            direct = choose(unknowns, mixed, given, level.order).direct
            layers = self.box(level).layers
            return Mesh(
                unknowns, level.order, layers, len(steps), pairs, direct, mixed, stretches, free, self.deepest
            )  # fmt: skip

        meshes, number = [mesh(self.unknowns(level), level) for level, _ in self.chances], len(self.likely)
        others = [
            {"meshes": n, "chance": chance}
            for n, (_, chance) in enumerate(self.chances, start=1)
            if n != number and chance >= LEAST
        ]
        seconds = [each.seconds for each in meshes]
        seconds[0] += START_SECONDS
        speed = ranks ** math.log2(SPEEDUP)

        def cost(number: int) -> dict[str, float]:
            spent, last = sum(seconds[:number]), meshes[number - 1]
            return {
                "seconds": spent / speed, "processor_seconds": spent, "memory_bytes": last.memory_bytes(ranks),
                "processor_memory_bytes": last.memory_bytes(1),
            }  # fmt: skip

        last, largest = meshes[number - 1], mesh(most, replace(FIRST, order=HIGHEST))
        return {
            "forms": forms,
            "linear_solver": choose(last.unknowns, mixed, given, last.order).describe(),
            "symmetries": [f"mirror plane {'xy'[axis]} = 0 of the balls' own frame" for axis in self.reduction.planes],
            "unknowns": round(last.unknowns),
            "meshes": [f"{level}: about {grouped(self.unknowns(level))} unknowns" for level in self.likely]
            + [f"finer ones, up to {grouped(most)} unknowns, while the error at full load exceeds what was asked"],
            **cost(number),
            "memory_bytes_at_most": largest.memory_bytes(ranks),
            "seconds_of_meshes": [value / speed for value in seconds[:number]],
            **({"perhaps": [{**other, **cost(int(other["meshes"]))} for other in others]} if others else {}),
            "domain": {"x": list(box.x), "y": list(box.y), "layer": box.thickness, "substrate": box.substrate},
            "load_steps": len(self.goals),
            "accuracy": {"asked": self.accuracy, "unknowns_at_most": most, "seconds_at_most": self.budget.seconds},
        }


Fit = Callable[[Problem, Sequence[Indentation]], tuple[Reduction, GivenMesh]]


def plan_run(
    problem: Problem, tangential_force: float, model: str, budget: Budget | None = None,
    steps: Sequence[float] | None = (1.0,), numerics: Numerics = DEFAULT, fit: Fit | None = None,
) -> RunPlan:  # fmt: skip
    """Return the plan of a run that answers at some fractions of the load (None: at six equal steps of the approach).

    ``model`` is the one that the caller expects; ``fit`` gives the part and measures of an own mesh. Raises
    `UnsupportedProblem`, naming the key, for what it does not support, and if the problem needs the other model.
    """
    if not 0.0 < tangential_force < 1.0:
        raise InvalidProblem(f"accuracy.tangential_force: must lie between 0 and 1, got {tangential_force:g}")
    problem = with_expressions(problem)
    _check_supported(problem, model)
    load = prescribed(problem)
    goals = load.answered_fractions() if steps is None else tuple(steps)
    if not goals or min(goals) <= 0.0 or list(goals) != sorted(set(goals)):
        raise InvalidProblem(f"load.steps: must be greater than 0 and rise, got {list(goals)} times the full load")
    expected = load.expected()
    reduction, given = (reduce_scene(problem), None) if fit is None else fit(problem, expected)
    plan = RunPlan(
        problem, reduction, goals, tangential_force, budget or Budget(), numerics, tuple(expected),
        choose_extent(problem, expected, tangential_force), given,
    )  # fmt: skip
    least, most = plan.unknowns(FIRST), plan.budget.unknowns or MOST_AT_FIRST
    if least > most:
        said = f"the coarsest mesh with an error estimate has about {grouped(float(f'{least:.2g}'))} unknowns"
        if plan.budget.unknowns:
            raise UnsupportedProblem(f"accuracy.unknowns: {said}, got {grouped(most)}; raise it")
        ratio = problem.layer.thickness / max(ball.radius for ball in problem.balls)
        raise UnsupportedProblem(
            f"layer.thickness, balls.positions: {said}, more than {grouped(most)}, with a layer of {ratio:.3g} R and "
            "these distances; take a thinner layer or nearer balls, use linear_bem, or set accuracy.unknowns"
        )
    return plan


def model_of(problem: Problem) -> str:
    """Return the model that a problem needs: hyperelastic with the effect `finite_strain`, else small strain."""
    return MODELS[problem.finite_strain is None]


def _check_supported(problem: Problem, model: str) -> None:
    if model not in MODELS:
        raise UnsupportedProblem(f"model: the finite-element models are {' and '.join(MODELS)}, got {model}")
    faults = []
    if model != model_of(problem):
        rule, remedy = ("needs", "FiniteStrain()") if model == MODELS[0] else ("takes no problem with", "None")
        faults.append(
            f"finite_strain: model {model} {rule} this effect, got {problem.finite_strain}; set it to {remedy}, or "
            f"ask for model {model_of(problem)}"
        )
    if not 0.0 < problem.layer.thickness < math.inf:
        rule = f"layer.thickness: {model} meshes the layer and needs a finite one"
        faults.append(f"{rule}, got {problem.layer.thickness:g}; use linear_bem")
    if isinstance(problem.layer, SurfaceResponse):
        faults.append(f"layer: {model} needs a material, got the response of its surface; use linear_bem")
    if problem.periodic is not None:
        faults.append(f"periodic: {model} has no cell that repeats; use linear_bem, or drop the effect")
    if any(ball.asperity for ball in problem.balls):
        faults.append(f"balls: {model} needs whole bodies, some are asperities; use linear_bem")
    faults += form_faults(problem, model)
    faults += prescribed(problem).faults(model)
    if faults:
        raise UnsupportedProblem("\n".join(faults))
