"""T of problems close to a solved one, by the polynomials of its contacts: much cheaper than another solution."""

from dataclasses import replace

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.lifted_balls import smooth_state
from linear_bem.problem import Problem
from linear_bem.smooth.contacts import CHECKED, SmoothContacts
from linear_bem.smooth.initial_guess import Start
from linear_bem.solution import Solution


def nearby_forces(near: Solution, problem: Problem) -> Array | None:
    """Return T [N] on every ball (balls, 2) of a problem that differs by a per cent or so from that of ``near``.

    The degree is that of ``near``, so that most of the error cancels in the difference of both; no error is estimated.
    None where the contacts are on grids, merge, or gain or lose a ball, and for many balls: these need `solve_contact`.
    """
    contacts, problem = near.contacts, problem.without_empty_layer().in_cell()
    if not isinstance(contacts, SmoothContacts) or len(contacts.touching) > CHECKED or contacts.sampled is not None:
        return None
    moved = (problem.positions - contacts.problem.positions)[list(contacts.touching)]
    zones = replace(contacts.zones, centre=contacts.zones.centre + moved)
    approaches = np.array(problem.load.values) if problem.load.kind == "approach" else contacts.approaches
    start = Start(problem, LayeredKernel.of(problem), contacts.touching, zones, approaches)
    try:
        return smooth_state(start, zones.degree, contacts.precision).mutual_force
    except NotConverged:
        return None
