"""The box to be meshed for a reduced scene, with a block under each ball."""

from __future__ import annotations

from finite_strain.geometry.estimates import LEAST_SHARE, Expected, alone
from finite_strain.geometry.extent import Extent
from finite_strain.geometry.symmetry import Reduction
from linear_bem.problem import Problem
from meshes.box import Box, Zone, half_widths

LATEST = 0.85
"""Where a line of the mesh goes round a contact at most: over its block's half-width. T is integrated outside it."""


def box_to_mesh(
    problem: Problem, reduction: Reduction, expected: list[Expected], extent: Extent, fineness: float,
    first: float = 1.0, growth: float = 1.0,
) -> Box:  # fmt: skip
    """Return the box for the reduced scene, meshed with a fineness; ``first`` is the first load fraction answered.

    ``growth`` is that of the element sizes over the usual one.
    """
    sides = []
    for axis in (0, 1):
        coordinates = [ball.position[axis] for ball in reduction.balls]
        low = 0.0 if axis in reduction.planes else min(coordinates) - extent.margin
        sides.append((low, max(coordinates) + extent.margin))
    deepest = max(approach / ball.radius for ball, (approach, _, _) in zip(problem.balls, expected, strict=True))
    radii = []
    for ball in reduction.balls:
        # a ball that hardly touches is meshed as if it were pressed in a little
        least = alone(
            problem.layer, problem.substrate, ball.shape, ball.radius, approach=LEAST_SHARE * deepest * ball.radius
        ).contact_radius
        radii.append(max(expected[ball.index][2], least))
    positions = [ball.position for ball in reduction.balls]
    widths = half_widths(positions, radii, sides[0], sides[1], reduction.planes)
    lines = [min(a, LATEST * m) if a < m else a for a, m in zip(radii, widths, strict=True)]
    smallest = first ** (1.0 / 2.0 if problem.load.kind == "approach" else 1.0 / 3.0)  # as Hertz's contact grows
    zones = tuple(Zone(*zone, smallest) for zone in zip(positions, lines, widths, strict=True))
    return Box(sides[0], sides[1], problem.layer.thickness, extent.depth, zones, fineness, growth)
