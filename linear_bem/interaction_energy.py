r"""A third formula for T: minus the derivative of the elastic energy by a ball's position, at fixed approaches.

The elastic energy is U = 1/2 int p w dA. At fixed approaches the normal forces do no work, so an
in-plane displacement of ball i changes U by -T_i. Each component takes four more solutions (a
fourth-order difference); it shares no formula with the mutual force and the slope integral.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linear_bem.problem import Load, Problem
from linear_bem.profiles import difference, height
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.solver import Solution, solve_contact


class _Passable(Problem):
    """A problem whose balls may pass through each other."""

    def _overlaps(self) -> list[str]:
        return []


def elastic_energy(solution: Solution) -> float:
    """Return the elastic energy [J], half the work of the contact pressure."""
    contacts = solution.contacts
    if isinstance(contacts, SmoothContacts):
        total = 0.0
        for i, n in zip(contacts.touching, contacts.smooth.nodes, strict=True):
            # inside the contact the surface follows the ball
            w = contacts.approaches[i] - height(solution.problem.balls[i])(n.x, n.y)
            total += 0.5 * float(n.loads @ w) / contacts.kernel.singular
        return total
    state = contacts.state
    return sum(
        0.5 * float(np.sum(p * w)) * patch.cell**2 / contacts.kernel.singular
        for patch, p, w in zip(contacts.patches.patches, state.pressures, state.displacements, strict=True)
    )


def energy_force(solution: Solution, ball: int, step: float | None = None) -> tuple[float, float]:
    """Return T on one ball [N] as -dU/d(position) at the solution's approaches.

    ``step`` [m] of the difference: by default 1 % of the distance to the nearest neighbour. Touching balls may be
    moved into each other, because only their contacts with the layer are modelled.
    """
    problem = solution.problem
    approaches = tuple(float(d) for d in solution.contacts.approaches)
    here = np.array(problem.balls[ball].position)
    others = [np.hypot(*(here - b.position)) for j, b in enumerate(problem.balls) if j != ball]
    h = step if step is not None else 0.01 * min(others, default=problem.balls[ball].radius)

    def energy(dx: float, dy: float) -> float:
        moved = list(problem.balls)
        moved[ball] = replace(moved[ball], position=(float(here[0] + dx), float(here[1] + dy)))
        shifted = _Passable(problem.layer, tuple(moved), Load("approach", approaches), problem.substrate)
        return elastic_energy(solve_contact(shifted, 1e-6))

    return -difference(lambda s: energy(s, 0.0), h), -difference(lambda s: energy(0.0, s), h)
