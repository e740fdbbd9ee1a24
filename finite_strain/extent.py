"""How far the model reaches: to the sides and into the substrate, chosen from the decay of the linear solution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from finite_strain.far_field import REMAINS, SHIFT_REMAINS, FarField, Stack
from linear_bem.problem import Problem

ALLOWED = 0.5
"""First-order effect of the model's end, over the accuracy asked for; a third of it stays in the error."""
_GROWTH = 1.25
_STEPS = 30
LEAST_SLENDERNESS = 0.4
"""Margin over the depth of the substrate."""
_FAR = 1e6
"""Margin over the height of layer and substrate at which no image is felt."""
NEGLIGIBLE = 0.1
"""Part of the half-space's mutual force below which T counts as near its zero: accuracies then refer to this part."""
STIFFENING = 1.5
"""d ln Q / d ln D where the load path does not tell: Hertz's."""


@dataclass(frozen=True)
class Extent:
    """Distance [m] from the outermost balls' axes to the sides, and depth [m] of the meshed substrate (0: none)."""

    margin: float
    depth: float


def scale_of_force(problem: Problem, forces: np.ndarray) -> float:
    """Return the force [N] below which a tangential force counts as near its zero, for normal forces (n,) [N].

    T passes through zero where the half-space's attraction and what the base takes from it cancel; its
    error does not. It is therefore measured against a tenth of the attraction Q_i Q_j (1 - nu^2) / (pi E r^2)
    of the half-space at least.
    """
    positions = np.array([ball.position for ball in problem.balls])
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    np.fill_diagonal(distances, np.inf)
    pairs = np.outer(forces, forces) / distances**2
    return NEGLIGIBLE * float(pairs.max()) / (math.pi * problem.layer.contact_modulus)


def far_field(problem: Problem, positions: np.ndarray, planes: tuple[int, ...], extent: Extent) -> FarField:
    """Return the effect of an extent on balls at ``positions`` (n, 2) [m] in the model's frame."""
    sides = []
    for axis in (0, 1):
        high = float(positions[:, axis].max()) + extent.margin
        sides.append((-high if axis in planes else float(positions[:, axis].min()) - extent.margin, high))
    return FarField(problem, extent.depth, positions, tuple(sides))


def choose_extent(
    problem: Problem,
    positions: np.ndarray,
    planes: tuple[int, ...],
    expected: list[tuple[float, float, float]],
    accuracy: float,
) -> Extent:
    """Return the smallest extent whose first-order effect on T stays below half of the relative accuracy.

    ``expected`` holds (approach, force, contact radius) of each ball. Depth is chosen first, with the sides
    far away, for half of what is allowed; then the margin.
    """
    forces = np.array([force for _, force, _ in expected])
    radius = max(ball.radius for ball in problem.balls)
    widest, deepest = max(a for _, _, a in expected), max(d for d, _, _ in expected)
    thickness = problem.layer.thickness
    margin = max(1.5 * thickness, 2.0 * radius, 3.0 * widest, 4.0 * deepest, 1.25 * _nearest(positions))
    mutual = Stack(problem.layer, problem.substrate, 10.0 * thickness).mutual(positions, forces)
    scale = max(scale_of_force(problem, forces), float(np.linalg.norm(mutual, axis=1).max()))

    def effect(extent: Extent) -> float:
        """Return the relative effect on the largest T: directly, and through Q where approaches are given."""
        far = far_field(problem, positions, planes, extent)
        moved, pulls = far.sizes(forces)
        direct = float(pulls.max()) / scale if scale > 0.0 else 0.0
        if problem.load.kind != "approach":
            return direct
        share = [m / d for m, (d, _, _) in zip(moved, expected, strict=True) if d > 0.0]
        return direct + SHIFT_REMAINS / REMAINS * 2.0 * STIFFENING * float(max(share))

    depth = 0.0
    if problem.substrate is not None:
        depth = 0.5 * min(thickness, margin)
        for _ in range(_STEPS):
            if effect(Extent(_FAR * (thickness + depth), depth)) <= 0.5 * ALLOWED * accuracy:
                break
            depth *= _GROWTH
    # a column narrower than deep would not be a layer with distant sides, but a bar
    margin = max(margin, LEAST_SLENDERNESS * depth)
    for _ in range(_STEPS):
        # K' changes its sign with distance: one small effect may be chance
        if max(effect(Extent(m, depth)) for m in (margin, _GROWTH * margin)) <= ALLOWED * accuracy:
            break
        margin *= _GROWTH
    return Extent(margin, depth)


def _nearest(positions: np.ndarray) -> float:
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    return float(distances[distances > 0.0].min(initial=np.inf)) if len(positions) > 1 else 0.0
