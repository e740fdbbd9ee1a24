"""The plan of a finite-element run: symmetry, load steps, the box to mesh, and the number of unknowns."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec

import numpy as np

from finite_strain.geometry.estimates import (
    LEAST_SHARE,
    alone,
    body_of,
    radius_seen,
    section_edge,
    with_expressions,
)
from finite_strain.geometry.extent import Extent, choose_extent
from finite_strain.geometry.load_control import prescribed
from finite_strain.geometry.symmetry import Reduction, reduce_scene
from finite_strain.mechanics.volumetric import describe_forms, form_faults
from finite_strain.numerics import DEFAULT, Numerics
from finite_strain.planning.records import Discretisation
from finite_strain.planning.refinement import FIRST, Budget
from linear_bem.closed_forms import Indentation
from linear_bem.counts import grouped
from linear_bem.depth import depth_faults
from linear_bem.errors import InvalidProblem, ThirdBodyError, UnsupportedProblem
from linear_bem.indenter import HeightFunction
from linear_bem.law import Law
from linear_bem.problem import Ball, Elements, Problem, SurfaceResponse
from meshes.box import Box, Zone, half_widths

MODELS = ("finite_strain", "small_strain")
LEAST_ACCURACY = 1e-4
"""Least relative error of T that may be asked for: study `accuracy` reaches 2.7e-4."""
MOST_AT_FIRST = 5e5
"""Largest number of unknowns of the first discretisation with results, unless a budget is given."""
MOST_COUNTED = 2e6
"""Largest estimated number of unknowns that is then counted exactly: 0.2 s per million, more with many balls."""
LATEST = 0.85
"""Largest radius of the mesh line along a contact's edge over its block's half-width. T is integrated outside it."""
SQUARE = 0.99 / math.sqrt(2.0)
"""Half the side of a square block over the distance from its middle to a free side, which its corners do not reach."""
DETAIL = 2.0
"""Width of the elements at the edge of a flat end over the radius of its rounding, times the fineness."""
ENOUGH, NEARBY = 3, 0.5
"""Number of nearby load steps with output whose changes alone show the error at full load. Loads are nearby if their
contacts are at least half as wide by Hertz's law."""
_SHARED_NODES = 1.35
"""Nodes of a mesh over the cube of the order times its hexahedra: outer faces have nodes of their own."""


@dataclass(frozen=True)
class GivenMesh:
    """A user's mesh: x and y intervals and depth of the substrate [m], number of cells, kind, and its digest.

    ``room``: distances [m] of the part's balls from free sides; infinite if the mesh is a part of the infinite layer.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    depth: float
    cells: int
    simplices: bool
    room: tuple[float, ...]
    digest: str


@dataclass(frozen=True)
class RunPlan:
    """The parts of a run; ``goals`` are the load fractions with output."""

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
    def is_hyperelastic(self) -> bool:
        """Whether the layer is deformed at finite strain."""
        return self.problem.finite_strain is not None

    @property
    def has_free_sides(self) -> bool:
        """Whether the user's mesh ends at free sides: `linear_bem`, with its infinite layer, has no answer for it."""
        return self.given is not None and math.isfinite(min(self.given.room))

    @property
    def is_paired(self) -> bool:
        """Whether the small-strain problem is solved beside the hyperelastic one."""
        return self.is_hyperelastic and not self.has_free_sides

    @property
    def pair(self) -> "RunPlan":
        """The plan of the small-strain problem beside this one, with elements of the same form: their errors cancel."""
        elements = Elements(describe_forms(self.problem)["layer"])
        return replace(self, problem=replace(self.problem, finite_strain=None, elements=elements))

    @property
    def has_own_functions(self) -> bool:
        """Whether the layer's law is a function psi(F), or a body a function f(x, y) or of a class of the user's."""
        effect, bodies = self.problem.finite_strain, [type(ball.indenter) for ball in self.problem.balls]
        of_bodies = any(body is HeightFunction or body.__module__ != HeightFunction.__module__ for body in bodies)
        return of_bodies or (effect is not None and not isinstance(effect.chosen, Law))

    @property
    def deepest(self) -> float:
        """The largest expected approach over its ball's radius."""
        return max(e.approach / ball.radius for ball, e in zip(self.problem.balls, self.expected, strict=True))

    @property
    def loads(self) -> tuple[float, ...]:
        """The rising load fractions at which discretisations are compared: the goals, and more if these are few."""
        last = self.goals[-1]
        is_known = not (self.is_hyperelastic or self.has_free_sides)  # by linear_bem
        if is_known or sum(goal >= self.nearby * last for goal in self.goals) >= ENOUGH:
            return self.goals
        more = (f * last for f in self.numerics.more_loads)
        return tuple(sorted({*self.goals, *(m for m in more if not any(math.isclose(m, g) for g in self.goals))}))

    @property
    def nearby(self) -> float:
        """Smallest ratio of two loads at which the changes between discretisations at one also count for the other."""
        return NEARBY ** (2.0 * prescribed(self.problem).power)

    @property
    def path(self) -> tuple[float, ...]:
        """The load fractions of the path finder."""
        return prescribed(self.problem).fractions(self.deepest, self.loads, self.numerics.largest_step)

    def box(self, level: Discretisation) -> Box:
        """Return the box that a discretisation meshes, with a block under each ball of the reduced scene."""
        problem, reduction = self.problem, self.reduction
        margin, depth = level.extent * self.extent.margin, level.extent * self.extent.depth
        positions, sides = [ball.position for ball in reduction.balls], []
        for axis, coordinates in enumerate(zip(*positions, strict=True)):
            low = 0.0 if axis in reduction.planes else min(coordinates) - margin
            sides.append((low, max(coordinates) + margin))
        if self.given is not None:
            sides, depth = [self.given.x, self.given.y], self.given.depth
        radii, edges = [], [body_of(ball).edge for ball in reduction.balls]
        for ball, edge in zip(reduction.balls, edges, strict=True):
            # the mesh of a ball that hardly touches assumes a small approach
            hardly = alone(problem, ball, approach=LEAST_SHARE * self.deepest * ball.radius)
            radius = max(self.expected[ball.index].contact_radius, hardly.contact_radius)
            radii.append(radius if edge is None else edge[0])
        widths = half_widths(positions, radii, sides[0], sides[1], reduction.planes)
        if self.given is not None:  # no corner of a block, outside which T is integrated, reaches a free side
            widths = [min(m, SQUARE * room) for m, room in zip(widths, self.given.room, strict=True)]
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
        except ThirdBodyError:  # reported when the mesh is made
            return estimate
        # Euler's formula, for the nodes of displacements and of pressures
        nodes = [(q * q * quads + q * rim / 2.0 + 1.0) * (q * box.layers + 1.0) for q in (p, p - 1)]
        return 3.0 * nodes[0] + pressures * nodes[1]


Fit = Callable[[Problem, Sequence[Indentation]], tuple[Reduction, GivenMesh]]


def plan_run(
    problem: Problem, accuracy: float, model: str, budget: Budget | None = None,
    steps: Sequence[float] | None = (1.0,), numerics: Numerics = DEFAULT, fit: Fit | None = None,
) -> RunPlan:  # fmt: skip
    """Return the plan of a run with results at the load fractions ``steps`` (None: six equal steps of the approach).

    ``model`` is the one that the caller expects; ``fit`` returns the part and dimensions of a user's mesh. Raises
    `InvalidProblem`, and `UnsupportedProblem`, naming the key, also if the problem needs the other model.
    """
    if not accuracy < 1.0:
        raise InvalidProblem(f"accuracy.tangential_force: must be below 1 (2 % is 0.02), got {accuracy:g}")
    if not accuracy >= LEAST_ACCURACY:
        raise InvalidProblem(
            f"accuracy.tangential_force: must lie between {LEAST_ACCURACY:g}, about the best that finite "
            f"elements reach, and 1, got {accuracy:g}; raise it, or use linear_bem"
        )
    faults = depth_faults(problem)
    if faults:
        raise InvalidProblem(*faults)
    problem = with_expressions(problem)
    _check_supported(problem, model)
    load = prescribed(problem)
    goals = load.answered_fractions() if steps is None else tuple(map(float, steps))
    if not goals or not min(goals) > 0.0 or list(goals) != sorted(set(goals)):
        raise InvalidProblem(f"load.steps: must be greater than 0 and rise, got {list(goals)} times the full load")
    if not math.isclose(goals[-1], 1.0, rel_tol=1e-9):
        raise InvalidProblem(
            f"load.steps: the last must be 1, the full load, got {list(goals)}; steps are fractions of the load, as "
            "(0.5, 1.0)"
        )
    expected = load.expected()
    if load.forces_given and problem.finite_strain is not None:  # under approaches bodies that overlap are refused
        _check_apart(problem, expected)
    reduction, given = (reduce_scene(problem), None) if fit is None else fit(problem, expected)
    plan = RunPlan(
        problem, reduction, goals, float(accuracy), budget or Budget(), numerics, tuple(expected),
        choose_extent(problem, expected, accuracy), given,
    )  # fmt: skip
    least, most = plan.unknowns(FIRST), plan.budget.unknowns or MOST_AT_FIRST
    if least > most:
        said = f"the coarsest mesh with an error estimate has about {grouped(float(f'{least:.2g}'))} unknowns"
        if plan.budget.unknowns:
            raise UnsupportedProblem(f"accuracy.unknowns: {said}, got {grouped(most)}; raise it")
        if replace(plan, goals=goals[-1:]).unknowns(FIRST) <= most:
            small = f"with contacts as small as at {goals[0]:.3g} of the load"
            raise UnsupportedProblem(
                f"load.steps: {said}, more than {grouped(most)}, {small}; begin with a larger step"
            )
        ratio = problem.layer.thickness / max(ball.radius for ball in problem.balls)
        raise UnsupportedProblem(
            f"layer.thickness, balls.positions: {said}, more than {grouped(most)}, with a layer of {ratio:.3g} R and "
            "these distances; take a thinner layer or nearer balls, use linear_bem, or set accuracy.unknowns"
        )
    return plan


def _check_apart(problem: Problem, expected: Sequence[Indentation]) -> None:
    """Raise `UnsupportedProblem` if the expected contacts of two balls without flat ends meet."""
    balls = problem.balls
    for i, j in itertools.combinations(range(problem.size), 2):
        x, y = np.subtract(balls[j].position, balls[i].position)
        distance = math.hypot(x, y)
        first, second = _extent(balls[i], expected[i], x, y), _extent(balls[j], expected[j], -x, -y)
        if first + second >= distance:
            raise UnsupportedProblem(
                f"load.{problem.load.kind}, balls.positions: the contacts of balls {i} and {j}, which extend about "
                f"{first:.3g} and {second:.3g} m towards each other, would meet at a distance of {distance:.3g} m; "
                "press less, or move the balls apart"
            )


def _extent(ball: Ball, state: Indentation, x: float, y: float) -> float:
    """Return how far [m] a contact extends from its ball's axis towards a point (x, y) [m], 0 under a flat end.

    It has the shape of the body's section by the undeformed surface.
    """
    body = body_of(ball)
    if body.edge:
        return 0.0
    width = section_edge(body, state.approach, complex(x, y) / math.hypot(x, y))
    round_one = math.sqrt(2.0 * state.approach * radius_seen(body, state.approach))
    return state.contact_radius * width / round_one


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
        rule = f"layer.thickness: {model} meshes the layer and needs a finite thickness"
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
