"""T of problems close to a solved one, by the polynomials of its contacts: much cheaper than another solution."""

from dataclasses import replace

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.lifted_balls import smooth_state
from linear_bem.load_control import unloaded
from linear_bem.problem import Problem
from linear_bem.smooth.contacts import CHECKED, SmoothContacts
from linear_bem.smooth.initial_guess import Start
from linear_bem.solution import Solution

SOLVED = 1e-6
"""Largest last step of the solver, over the largest coefficient of a pressure: states beyond it are not used."""


def nearby_forces(near: Solution, problem: Problem) -> Array | None:
    """Return T [N] on every ball (balls, 2) of a problem that differs by a per cent or so from that of ``near``.

    The degree is that of ``near``, so that most of the error cancels in the difference of both; no error is estimated.
    None where the contacts are on grids, merge, or gain or lose a ball, for many balls, and for another kind of load or
    model: these need `solve_contact`.
    """
    contacts, problem = near.contacts, problem.without_empty_layer().in_cell()
    if not isinstance(contacts, SmoothContacts) or len(contacts.touching) > CHECKED or contacts.sampled is not None:
        return None
    before, now = near.problem.load, problem.load
    alike = problem.size == near.problem.size and before.kind == now.kind and unloaded(before) == unloaded(now)
    if problem.finite_strain is not None or not alike:
        return None
    moved = (problem.positions - contacts.problem.positions)[list(contacts.touching)]
    zones = replace(contacts.zones, centre=contacts.zones.centre + moved)
    approaches = np.array(problem.load.values) if problem.load.kind == "approach" else contacts.approaches
    start = Start(problem, LayeredKernel.of(problem), contacts.touching, zones, approaches)
    try:
        found = smooth_state(start, zones.degree, contacts.precision)
    except NotConverged:
        return None
    return found.mutual_force if found.smooth.residual <= SOLVED else None
