"""Extent of the model: to the sides and into the substrate, chosen from the decay of the linear response.

Sides that slide in their plane act as mirrors of the balls, and the bottom of the meshed substrate is fixed;
`finite_strain.accuracy.pairs` corrects the first-order effect.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import pdist

from finite_strain.geometry.load_control import prescribed
from linear_bem.closed_forms import Indentation
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem

ALLOWED = 2.0
"""First-order effect of domain truncation on T over the required accuracy."""
SHIFT = 0.02
"""First-order effect of domain truncation on an approach over the approach, for prescribed approaches."""
NEGLIGIBLE = 0.1
"""Fraction of the half-space's mutual force below which T counts as near zero: accuracies then refer to this value."""
_GROWTH, _STEPS = 1.25, 30
"""Growth of a trial length from step to step, and the largest number of steps."""


@dataclass(frozen=True)
class Extent:
    """Distance [m] from the outermost balls' axes to the sides, and depth [m] of the meshed substrate (0: none)."""

    margin: float
    depth: float


def scale_of_force(problem: Problem, forces: np.ndarray) -> float:
    """Return the force [N] below which a tangential force counts as near its zero, for normal forces (n,) [N].

    T passes through zero where the half-space's attraction and its reduction by the base cancel, but the error of T
    does not. The scale is a tenth of the largest attraction Q_i Q_j (1 - nu^2) / (pi E r^2) of a pair on a half-space.
    """
    one, other = np.triu_indices(problem.size, 1)
    pairs = forces[one] * forces[other] / pdist(problem.positions) ** 2
    return NEGLIGIBLE * float(pairs.max(initial=0.0)) / (math.pi * problem.layer.contact_modulus)


def choose_extent(problem: Problem, expected: Sequence[Indentation], accuracy: float) -> Extent:
    """Return an extent for a relative accuracy of T; ``expected`` holds the state of each ball alone.

    The sides act like images of the balls at twice the margin, by the linear kernel K: on T by K' and on an approach by
    K. Cutting a substrate at a depth z below the surface reduces its displacement by about (1 - nu^2) Q / (pi E z).
    """
    forces = np.array([state.normal_force for state in expected])
    thickness, distances = problem.layer.thickness, pdist(problem.positions)
    nearest = float(distances.min()) if distances.size else 0.0
    largest = max(ball.radius for ball in problem.balls)
    kernel, load = LayeredKernel.of(problem), float(forces.sum())
    scale = scale_of_force(problem, forces)
    if nearest > 0.0:
        slope = abs(float(kernel.slope(np.array([nearest]))[0]))
        scale = max(scale, float(np.sort(forces)[-2:].prod()) * slope)
    given = not prescribed(problem).forces_given
    deepest, widest = (max(getattr(state, name) for state in expected) for name in ("approach", "contact_radius"))

    def acts(pull: float, shift: float) -> bool:
        moves_balls = given and load * shift > SHIFT * deepest
        return moves_balls or float(forces.max()) * load * pull > ALLOWED * accuracy * scale > 0.0

    depth = 0.0
    if problem.substrate is not None:
        depth = 0.5 * thickness
        for _ in range(_STEPS):
            below = thickness + depth
            lost = 1.0 / (math.pi * problem.substrate.contact_modulus * below)
            if not acts(lost * nearest / below**2, lost):
                break
            depth *= _GROWTH
    margin = max(1.2 * thickness, 2.0 * largest, 3.0 * widest, 4.0 * deepest, 1.25 * nearest, 0.4 * depth)
    for _ in range(_STEPS):
        # K' changes sign with distance: a single small effect may be accidental
        away = 2.0 * margin * np.array([1.0, _GROWTH])
        pull, shift = (4.0 * float(np.abs(values(away)).max()) for values in (kernel.slope, kernel.displacement))
        if not acts(pull, shift):
            break
        margin *= _GROWTH
    return Extent(margin, depth)
