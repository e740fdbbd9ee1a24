r"""A third formula for T: minus the derivative of the elastic energy with respect to a ball's position.

The elastic energy is U = 1/2 int p w dA. At fixed approaches the normal forces do no work, so an
in-plane displacement of ball i changes U by -T_i per length. Each component needs four more solutions
(fourth-order difference). This formula is independent of the mutual formula and the slope integral.
"""

from dataclasses import replace

import numpy as np

from linear_bem.errors import InvalidProblem
from linear_bem.lifted_balls import nearest
from linear_bem.magnitudes import is_number
from linear_bem.problem import Load
from linear_bem.profiles import difference
from linear_bem.solution import Solution, solved
from linear_bem.solver import solve_contact


def elastic_energy(solution: Solution) -> float:
    """Return the elastic energy [J], half the work of the contact pressure."""
    return solved(solution, "elastic_energy").contacts.elastic_energy


def energy_force(solution: Solution, ball: int, step: float | None = None) -> tuple[float, float]:
    """Return T (x, y) [N] on one ball as -dU/d(position) at the solution's approaches.

    The ``step`` [m] of the difference defaults to 1 % of the distance to the nearest neighbour or image, for a single
    ball to 1 % of its radius. The moved ball may overlap others, because only contacts with the layer are modelled.
    """
    problem = solved(solution, "energy_force").problem
    solution.require_ball(ball)
    if step is not None and not (is_number(step) and 0.0 < step < np.inf):
        raise InvalidProblem(f"step: must be a length greater than 0 and finite, or None, got {step!r} m")
    approaches = tuple(float(d) for d in solution.contacts.approaches)
    here = np.array(problem.balls[ball].position)
    apart = float(nearest(problem)[ball])
    h = step if step is not None else 0.01 * (apart if np.isfinite(apart) else problem.balls[ball].radius)

    def energy(dx: float, dy: float) -> float:
        moved = [replace(b, asperity=True) for b in problem.balls]
        moved[ball] = replace(moved[ball], position=(float(here[0] + dx), float(here[1] + dy)))
        shifted = replace(problem, balls=tuple(moved), load=Load("approach", approaches))
        return solve_contact(shifted, 1e-6).contacts.elastic_energy

    return -difference(lambda s: energy(s, 0.0), h), -difference(lambda s: energy(0.0, s), h)
