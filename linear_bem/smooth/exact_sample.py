"""Some of many balls solved again, exactly: the error of their T that the solver's degrees, pairs and mesh leave.

Each ball of `SmoothContacts.sample` is pressed into the surface that all others have moved, summed directly over all of
them, at a higher degree of p^2 and as the only ball. Its T follows from another direct sum. What remains the same are
the others' pressures, whose errors are of second order in this one.
"""

from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from linear_bem.load_control import Groups
from linear_bem.profiles import Height, height
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.multipole import disc_nodes, interpolation
from linear_bem.smooth.newton import solve_zones

ALONE = 1e-8
"""Last step of a single ball."""
SHARPER = 4
"""Degrees by which the single ball's p^2 is above the solver's."""
WIDER, ROUND = 1.2, 10
"""Disc about a contact, over its reach, on which the others' displacement is a polynomial, and its degree."""


@dataclass(frozen=True)
class SampleError:
    """Places of the sample in ``touching``, errors of T and Q [N], largest relative error of forces and approaches."""

    places: tuple[int, ...]
    tangential_force: Array
    normal_force: float
    settled: float


def sample_error(contacts: SmoothContacts, report: Report = silent) -> SampleError:
    """Return the errors of T on the balls of the sample; infinite where a ball alone finds no solution."""
    direct, errors, normal_force, settled = contacts.direct, [], 0.0, 0.0
    report_part = seldom(report)
    for done, k in enumerate(contacts.sample):
        report_part(f"{done} of {len(contacts.sample)} contacts solved exactly")
        ball, n = contacts.touching[k], contacts.smooth.nodes[k]
        spread = WIDER * n.zone.reach
        x, y = (c + spread * u for c, u in zip(n.zone.centre, disc_nodes(ROUND)[:2], strict=True))
        shape = _risen(height(contacts.problem.balls[ball]), n.zone.centre, spread, direct.displacement(k, x, y, False))
        approach, force = contacts.approaches[[ball]], n.force
        given = contacts.problem.load.kind == "force"
        groups: Groups = [([0], force)] if given else []
        zone = n.zone.reframed(n.zone.degree + SHARPER)
        try:
            alone = solve_zones(contacts.kernel, [shape], [zone], approach, groups, ALONE)
        except NotConverged:
            errors.append(np.inf)
            continue
        errors.append(float(np.max(np.abs(direct.force(k, alone.nodes[0]) - contacts.mutual_force[ball]))))
        change = alone.approaches[0] / approach[0] if given else alone.nodes[0].force / force
        settled = max(settled, abs(float(change) - 1.0))
        normal_force = max(normal_force, abs(alone.nodes[0].force - force) / contacts.kernel.singular)
    return SampleError(contacts.sample, np.array(errors), normal_force, settled)


def _risen(profile: Height, centre: Array, spread: float, values: Array) -> Height:
    """Return a ball's height above a surface that already has these displacements [m] on a disc's nodes."""

    def shape(x: Array, y: Array) -> Array:
        outside = interpolation((x - centre[0]) / spread, (y - centre[1]) / spread, ROUND) @ values
        return np.asarray(profile(x, y) + outside)

    return shape
