"""Balls without load: which of them touch the deformed surface, and at which height an unloaded ball rests on it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from linear_bem.grid.contacts import GridContacts
from linear_bem.load_control import deepest, may_touch, unloaded
from linear_bem.problem import Problem
from linear_bem.profiles import height, is_ball
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.contacts import CHECKED, SmoothContacts
from linear_bem.smooth.displacement import displacement_about
from linear_bem.smooth.initial_guess import Guess, Start, light_touch, overlap, solve_smooth
from linear_bem.smooth.zone import Zone, stacked
from linear_bem.touching import largest_half_width, nearest_distances

Contacts = SmoothContacts | GridContacts
Same = TypeVar("Same", SmoothContacts, GridContacts)


TOUCHING, OVERLOOKED = 1e-9, 1e-4
"""Least depth over the largest approach at which a ball without force counts as touching, for few and for many balls.

At 1e-4 of the others' depth, a ball carries 1e-6 of their force."""
CLEAR = 0.4
"""Largest distance of a touching point from its ball's axis, over that of the next axis, for many balls: a polynomial
fits the displacement up to there, but not under the next contact."""
MOST_STEPS = 60
"""Largest number of steps of the search for a lowest point."""


class Touched(NotConverged):
    """Balls assumed lifted in ``contacts`` touch the surface; ``zones`` holds a first guess of their contacts."""

    def __init__(self, zones: dict[int, Zone], contacts: SmoothContacts) -> None:
        super().__init__("linear_bem: a ball assumed lifted touches the surface")
        self.zones, self.contacts = zones, contacts

    def added_to(self, guess: Guess) -> Start:
        """Return the initial guess with these contacts added."""
        new = stacked(list(self.zones.values())).reframed(guess.zones.degree)
        touching = (*guess.touching, *self.zones)
        order = np.argsort(touching)
        zones = stacked([*guess.zones, *new])[order]
        return Start(guess.problem, guess.kernel, tuple(sorted(touching)), zones, guess.approaches)


def rest(contacts: Contacts, ball: int) -> tuple[float, tuple[float, float]]:
    """Return the approach [m] at which an unloaded ball just touches the deformed surface, and its position [m].

    Bodies other than balls may be flat or long: the search covers their whole width, and narrows more slowly.
    """
    body = contacts.problem.balls[ball]
    f, centre = height(body), np.array(body.position)
    wide = largest_half_width(body.indenter, body.radius)
    reach, narrower = (0.1 * body.radius, 0.4) if is_ball(body) else (wide, 0.6)
    value = np.inf
    for _ in range(MOST_STEPS):
        grid = np.linspace(-reach, reach, 7)
        x, y = np.meshgrid(centre[0] + grid, centre[1] + grid)
        gap = contacts.displacement(x, y) + f(x, y)
        best = np.unravel_index(int(np.argmin(gap)), gap.shape)
        value = min(value, float(gap[best]))
        centre = np.array([x[best], y[best]])
        if min(best) > 0 and max(best) < 6:  # else the lowest point may lie beyond the square
            reach *= narrower
        if reach < 4e-6 * body.radius:
            break
    return value, (float(centre[0]), float(centre[1]))


def rests(contacts: Contacts, balls: Sequence[int]) -> list[tuple[float, tuple[float, float]]]:
    """Return `rest` of these balls; with many smooth contacts all at once, to about 1e-5 of the displacement."""
    if not isinstance(contacts, SmoothContacts) or len(contacts.touching) <= CHECKED:
        said = seldom(contacts.report, "height of rest: ")
        found: list[tuple[float, tuple[float, float]]] = []
        for done, i in enumerate(balls):
            said(f"{done} of {len(balls)} balls without load")
            found.append(rest(contacts, i))
        return found
    centres = contacts.problem.positions[list(balls)]
    reach = np.array([0.1 * contacts.problem.balls[i].radius for i in balls])
    reach = np.minimum(reach, CLEAR * nearest(contacts.problem)[list(balls)])
    moved = displacement_about(contacts.kernel, contacts.smooth.nodes, centres, reach, contacts.precision)
    profiles = [height(contacts.problem.balls[i]) for i in balls]
    at, size, value = np.zeros((len(balls), 2)), 1.0, np.full(len(balls), np.inf)
    grid = np.stack([v.ravel() for v in np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 7)])])
    for _ in range(12):
        xi, eta = np.moveaxis(np.clip(at[:, :, None] + size * grid, -0.7, 0.7), 1, 0)
        x, y = centres[:, :1] + reach[:, None] * xi, centres[:, 1:] + reach[:, None] * eta
        gap = moved(xi, eta) + np.array([f(u, v) for f, u, v in zip(profiles, x, y, strict=True)])
        best = np.argmin(gap, axis=1)[:, None]
        at = np.concatenate([np.take_along_axis(v, best, 1) for v in (xi, eta)], axis=1)
        value = np.minimum(value, np.take_along_axis(gap, best, 1)[:, 0])
        size *= 0.4
    places = centres + reach[:, None] * at
    found = [(float(v), (float(x), float(y))) for v, (x, y) in zip(value, places, strict=True)]
    for k in np.flatnonzero(np.any(np.abs(at) == 0.7, axis=1)):  # beyond the rim it may be lower
        found[k] = rest(contacts, balls[k])
    return found


def nearest(problem: Problem) -> Array:
    """Return the distance [m] from every ball's axis to the nearest other axis or image, its own images included."""
    cell = problem.cell
    return np.minimum(nearest_distances(problem.positions, cell), np.inf if cell is None else np.min(cell))


def rested(contacts: Same) -> Same:
    """Return the contacts with every ball of zero prescribed force at the height where it just touches."""
    resting = unloaded(contacts.problem.load)
    if not resting:
        return contacts
    approaches = contacts.approaches.copy()
    approaches[resting] = [value for value, _ in rests(contacts, resting)]
    return replace(contacts, approaches=approaches)


def overlapping(contacts: Contacts) -> dict[int, tuple[float, tuple[float, float]]]:
    """Return, for balls without force that penetrate the surface, depth [m] and deepest point [m] by index."""
    if contacts.problem.load.kind == "force":
        return {}
    lifted = np.flatnonzero((contacts.normal_forces == 0.0) & may_touch(contacts.approaches)).tolist()
    if not lifted:
        return {}
    few = not isinstance(contacts, SmoothContacts) or len(contacts.touching) <= CHECKED
    least = (TOUCHING if few else OVERLOOKED) * deepest(contacts.approaches)
    found = zip(lifted, rests(contacts, lifted), strict=True)
    depths = {i: (float(contacts.approaches[i]) - value, at) for i, (value, at) in found}
    return {i: (depth, at) for i, (depth, at) in depths.items() if depth > least}


def smooth_state(
    start: Guess, degree: int, precision: float, pair_precision: float | None = None, report: Report = silent
) -> SmoothContacts:
    """Return the contacts at one degree; raises `Touched` or `Lost` if balls gain or lose contact, `NotConverged`.

    ``precision``, ``pair_precision`` and ``report`` are those of `solve_smooth`.
    """
    contacts = solve_smooth(start, degree, precision, pair_precision, report)
    if overlap(start.kernel, contacts.zones):
        raise NotConverged("linear_bem: contacts of neighbouring balls merge; press them less deep")
    contacts = rested(contacts)
    found = overlapping(contacts)
    if found:
        raise Touched({i: light_touch(start.problem.balls[i], place, d) for i, (d, place) in found.items()}, contacts)
    return contacts
