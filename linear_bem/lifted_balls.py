"""Balls without load: which of them touch the deformed surface, and at which height an unloaded ball rests on it."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from linear_bem.errors import NotConverged
from linear_bem.grid.contacts import GridContacts
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import unloaded
from linear_bem.problem import Problem
from linear_bem.profiles import height
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.initial_guess import Start, light_touch, overlap, solve_smooth
from linear_bem.smooth.newton import SmoothSolution
from linear_bem.smooth.zone import Zone

Contacts = SmoothContacts | GridContacts
Same = TypeVar("Same", SmoothContacts, GridContacts)


class Touched(NotConverged):
    """Balls assumed lifted touch the surface; ``zones`` holds initial guesses of their contacts."""

    def __init__(self, zones: dict[int, Zone]) -> None:
        super().__init__("linear_bem: a ball assumed lifted touches the surface")
        self.zones = zones

    def added_to(self, guess: Start) -> Start:
        """Return the initial guess with these contacts added."""
        touching = sorted([*guess.touching, *self.zones])
        known = {**dict(zip(guess.touching, guess.zones, strict=True)), **self.zones}
        return Start(touching, [known[i] for i in touching], guess.approaches)


def rest(contacts: Contacts, ball: int) -> tuple[float, tuple[float, float]]:
    """Return the approach [m] at which an unloaded ball just touches the deformed surface, and its position [m]."""
    f = height(contacts.problem.balls[ball])
    centre, reach = np.array(contacts.problem.balls[ball].position), 0.1 * contacts.problem.balls[ball].radius
    value = np.inf
    for _ in range(12):
        grid = np.linspace(-reach, reach, 7)
        x, y = np.meshgrid(centre[0] + grid, centre[1] + grid)
        gap = contacts.displacement(x, y) + f(x, y)
        best = np.unravel_index(int(np.argmin(gap)), gap.shape)
        value = min(value, float(gap[best]))
        centre, reach = np.array([x[best], y[best]]), 0.4 * reach
    return value, (float(centre[0]), float(centre[1]))


def rested(contacts: Same) -> Same:
    """Return the contacts with every ball of zero prescribed force at the height where it just touches."""
    resting = unloaded(contacts.problem.load)
    if not resting:
        return contacts
    approaches = contacts.approaches.copy()
    approaches[resting] = [rest(contacts, i)[0] for i in resting]
    return replace(contacts, approaches=approaches)


def overlapping(contacts: Contacts) -> dict[int, tuple[float, tuple[float, float]]]:
    """Return, for balls without force that penetrate the surface, depth [m] and deepest point [m] by index."""
    if contacts.problem.load.kind == "force":
        return {}
    largest, found = float(np.max(np.abs(contacts.approaches))), {}
    for i in np.flatnonzero(contacts.normal_forces == 0.0):
        rests, place = rest(contacts, int(i))
        depth = float(contacts.approaches[i]) - rests
        if depth > 1e-9 * largest:
            found[int(i)] = depth, place
    return found


def smooth_state(
    problem: Problem, kernel: LayeredKernel, degree: int, start: Start | SmoothContacts, precision: float
) -> SmoothContacts:
    """Return the contacts at one degree; raises `Touched` if further balls touch, and `NotConverged`."""
    touching = list(start.touching)
    origin: Start | SmoothSolution = start if isinstance(start, Start) else start.smooth
    approaches = start.approaches.copy()
    smooth = solve_smooth(problem, kernel, degree, origin, touching, approaches, precision)
    if overlap(smooth.nodes):
        raise NotConverged("linear_bem: contacts of neighbouring balls merge")
    approaches[touching] = smooth.approaches
    if problem.load.kind == "total_force":
        approaches[:] = smooth.approaches[0]
    contacts = rested(SmoothContacts(problem, kernel, tuple(touching), smooth, approaches, precision))
    found = overlapping(contacts)
    if found:
        raise Touched({i: light_touch(problem.balls[i], place, d) for i, (d, place) in found.items()})
    return contacts
