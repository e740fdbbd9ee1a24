"""The box that a discretisation of a plan meshes, with a block under each ball."""

from __future__ import annotations

from typing import TYPE_CHECKING

from finite_strain.geometry.estimates import LEAST_SHARE, alone
from finite_strain.geometry.load_control import prescribed
from meshes.box import Box, Zone, half_widths

if TYPE_CHECKING:
    from finite_strain.planning.records import Discretisation
    from finite_strain.planning.run_plan import RunPlan

LATEST = 0.85
"""Where a line of the mesh goes round a contact at most: over its block's half-width. T is integrated outside it."""


def box_to_mesh(plan: RunPlan, level: Discretisation) -> Box:
    """Return the box around the balls of the plan's reduced scene."""
    problem, reduction, extent = plan.problem, plan.reduction, plan.extent.larger(level.extent)
    sides = []
    for axis in (0, 1):
        coordinates = [ball.position[axis] for ball in reduction.balls]
        low = 0.0 if axis in reduction.planes else min(coordinates) - extent.margin
        sides.append((low, max(coordinates) + extent.margin))
    radii = []
    for ball in reduction.balls:
        # a ball that hardly touches is meshed as if it were pressed in a little
        least = LEAST_SHARE * plan.deepest * ball.radius
        hardly = alone(problem.layer, problem.substrate, ball.shape, ball.radius, approach=least)
        radii.append(max(plan.expected[ball.index][2], hardly.contact_radius))
    positions = [ball.position for ball in reduction.balls]
    widths = half_widths(positions, radii, sides[0], sides[1], reduction.planes)
    lines = [min(a, LATEST * m) if a < m else a for a, m in zip(radii, widths, strict=True)]
    smallest = plan.goals[0] ** (0.5 / prescribed(problem).power)  # as Hertz's contact grows
    zones = tuple(Zone(*zone, smallest) for zone in zip(positions, lines, widths, strict=True))
    return Box(sides[0], sides[1], problem.layer.thickness, extent.depth, zones, level.fineness, plan.numerics.growth)
