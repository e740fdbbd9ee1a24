"""Balls that carry no load: where they just touch the surface that the others have deformed."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from linear_bem.grid.contacts import GridContacts
from linear_bem.profiles import height
from linear_bem.smooth.contacts import SmoothContacts

Contacts = TypeVar("Contacts", SmoothContacts, GridContacts)


def rested(contacts: Contacts) -> Contacts:
    """Return the contacts with every ball of zero prescribed force at the height where it just touches."""
    load = contacts.problem.load
    resting = [i for i, q in enumerate(load.values) if q == 0.0] if load.kind == "force" else []
    if not resting:
        return contacts
    approaches = contacts.approaches.copy()
    approaches[resting] = [rest_height(contacts, i) for i in resting]
    return replace(contacts, approaches=approaches)


def rest_height(contacts: SmoothContacts | GridContacts, ball: int) -> float:
    """Return the approach [m] at which an unloaded ball just touches the deformed surface."""
    return rest(contacts, ball)[0]


def rest(contacts: SmoothContacts | GridContacts, ball: int) -> tuple[float, tuple[float, float]]:
    """Return the approach [m] at which an unloaded ball just touches the deformed surface, and where [m]."""
    f = height(contacts.problem.balls[ball])
    x0, y0 = contacts.problem.balls[ball].position
    centre, reach = np.array([x0, y0]), 0.1 * contacts.problem.balls[ball].radius
    value = np.inf
    for _ in range(12):
        grid = np.linspace(-reach, reach, 7)
        x, y = np.meshgrid(centre[0] + grid, centre[1] + grid)
        gap = contacts.displacement(x, y) + f(x, y)
        best = np.unravel_index(int(np.argmin(gap)), gap.shape)
        value = min(value, float(gap[best]))
        centre, reach = np.array([x[best], y[best]]), 0.4 * reach
    return value, (float(centre[0]), float(centre[1]))
