"""Which balls touch: contacts at one degree, with balls that were taken for lifted found on the way."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import NotConverged
from linear_bem.grid.contacts import GridContacts
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem
from linear_bem.resting_balls import rest, rested
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.initial_guess import Start, light_touch, overlap, solve_smooth
from linear_bem.smooth.newton import SmoothSolution
from linear_bem.smooth.tangential_forces import half_space_pulls
from linear_bem.smooth.zone import Zone

Array = NDArray[np.float64]


class Touched(NotConverged):
    """Balls that were taken for lifted touch the surface; ``zones`` holds a first guess of their contacts."""

    def __init__(self, zones: dict[int, Zone]) -> None:
        super().__init__("linear_bem: a ball taken for lifted touches the surface")
        self.zones = zones

    def added_to(self, guess: Start) -> Start:
        """Return a first guess with these contacts too."""
        touching = sorted([*guess.touching, *self.zones])
        known = {**dict(zip(guess.touching, guess.zones, strict=True)), **self.zones}
        return Start(touching, [known[i] for i in touching], guess.approaches)


def _overlapping(contacts: SmoothContacts | GridContacts) -> dict[int, tuple[float, tuple[float, float]]]:
    """Return by how much [m] balls without force are below where they would just touch the surface, and where [m]."""
    load = contacts.problem.load
    if load.kind == "force":
        return {}
    largest, found = float(np.max(np.abs(contacts.approaches))), {}
    for i in np.flatnonzero(contacts.normal_forces == 0.0):
        rests, place = rest(contacts, int(i))
        depth = float(contacts.approaches[i]) - rests
        if depth > 1e-9 * largest:
            found[int(i)] = depth, place
    return found


def smooth_state(
    problem: Problem, kernel: LayeredKernel, degree: int, start: Start | SmoothContacts | GridContacts, precision: float
) -> SmoothContacts:
    """Return the contacts at one degree, with the balls that touch found on the way."""
    assert not isinstance(start, GridContacts)
    touching = list(start.touching)
    origin: Start | SmoothSolution = start if isinstance(start, Start) else start.smooth
    approaches = start.approaches.copy()
    smooth = solve_smooth(problem, kernel, degree, origin, touching, approaches, precision)
    if overlap(smooth.nodes):
        raise NotConverged("linear_bem: contacts of neighbouring balls merge")
    approaches[touching] = smooth.approaches
    if problem.load.kind == "total_force":
        approaches[:] = smooth.approaches[0]
    contacts = SmoothContacts(problem, kernel, tuple(touching), smooth, approaches, precision)
    contacts = rested(contacts)
    overlapping = _overlapping(contacts)
    if overlapping:
        raise Touched({i: light_touch(problem.balls[i], place, d) for i, (d, place) in overlapping.items()})
    return contacts


def places(contacts: SmoothContacts | GridContacts) -> Array:
    """Return the axes' positions [m], shape (balls, 2)."""
    return np.array([ball.position for ball in contacts.problem.balls], dtype=float)


def missed_pulls(contacts: GridContacts) -> Array:
    """Return what contacts smaller than a cell, which a grid does not see, would add to every T [N]: Hertz's forces."""
    forces = contacts.normal_forces.copy()
    seen = half_space_pulls(contacts.kernel, places(contacts), forces)
    for i, (depth, _) in _overlapping(contacts).items():
        radius = contacts.problem.balls[i].radius
        forces[i] = 4.0 / 3.0 * math.sqrt(radius * depth**3) / (math.pi * contacts.kernel.singular)
    return np.asarray(half_space_pulls(contacts.kernel, places(contacts), forces) - seen)
