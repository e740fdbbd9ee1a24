"""Some of many balls solved again, exactly: the error of their T that the solver's degrees, pairs and mesh leave.

Each ball of `SmoothContacts.sample` is pressed into the surface that all others have moved, summed directly over all of
them, at a higher degree of p^2 and as the only ball. Its T follows from another direct sum. What remains the same are
the others' pressures, whose errors are of second order in this one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from linear_bem.profiles import Height, height
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.many_balls import sweep_zones
from linear_bem.smooth.multipole import disc_nodes, interpolation
from linear_bem.smooth.newton import Nodes

ALONE = 1e-5
"""Last step of a ball alone, and precision of its equations, at most; the solver's where that is less."""
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
    direct, problem, shapes, report_part = contacts.direct, contacts.problem, [], seldom(report)
    for done, k in enumerate(contacts.sample):
        report_part(f"{done} of {len(contacts.sample)} contacts pressed into the others' surface")
        zone = contacts.smooth.nodes[k].zone
        spread = WIDER * zone.reach
        x, y = (c + spread * u for c, u in zip(zone.centre, disc_nodes(ROUND)[:2], strict=True))
        others = direct.displacement(k, x, y, False)
        shapes.append(_risen(height(problem.balls[contacts.touching[k]]), zone.centre, spread, others))
    errors, normal_force, settled = [], 0.0, 0.0
    for done, (k, alone) in enumerate(zip(contacts.sample, _alone(contacts, shapes), strict=True)):
        report_part(f"{done} of {len(contacts.sample)} contacts solved exactly")
        if alone is None:
            errors.append(np.inf)
            continue
        ball, force, (here, approach) = contacts.touching[k], contacts.smooth.nodes[k].force, alone
        errors.append(float(np.max(np.abs(direct.force(k, here) - contacts.mutual_force[ball]))))
        change = approach / contacts.approaches[ball] if problem.load.kind == "force" else here.force / force
        settled = max(settled, abs(float(change) - 1.0))
        normal_force = max(normal_force, abs(here.force - force) / contacts.kernel.singular)
    return SampleError(contacts.sample, np.array(errors), normal_force, settled)


def _alone(contacts: SmoothContacts, shapes: list[Height]) -> list[tuple[Nodes, float] | None]:
    """Return nodes and approaches [m] of the sample's balls, each alone under its ``shapes``; None: no solution."""
    nodes = [contacts.smooth.nodes[k] for k in contacts.sample]
    zones = [n.zone.reframed(n.zone.degree + SHARPER) for n in nodes]
    approaches = contacts.approaches[[contacts.touching[k] for k in contacts.sample]]
    given, precision = contacts.problem.load.kind == "force", min(ALONE, contacts.precision)

    def solved(places: Sequence[int]) -> list[tuple[Nodes, float] | None]:
        groups = [([at], nodes[k].force) for at, k in enumerate(places)] if given else []
        here = [shapes[k] for k in places], [zones[k] for k in places], approaches[list(places)]
        try:
            found = sweep_zones(contacts.kernel, *here, groups, precision, apart=True)
        except NotConverged:
            return [None] if len(places) == 1 else [one for k in places for one in solved([k])]
        return list(zip(found.nodes, found.approaches.tolist(), strict=True))

    return solved(range(len(nodes)))


def _risen(profile: Height, centre: Array, spread: float, values: Array) -> Height:
    """Return a ball's height above a surface that already has these displacements [m] on a disc's nodes."""

    def shape(x: Array, y: Array) -> Array:
        outside = interpolation((x - centre[0]) / spread, (y - centre[1]) / spread, ROUND) @ values
        return np.asarray(profile(x, y) + outside)

    return shape
