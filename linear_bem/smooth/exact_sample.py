"""Some of many balls are solved again, exactly: this shows the error of T from the solver's degrees, pairs and mesh.

Each ball of `SmoothContacts.sample` is pressed alone, at a higher degree of p^2, into the surface that all others have
displaced, by a direct sum over them. Its T follows from another direct sum. Only the pressures of the others are kept;
their errors have an effect of second order on this ball.
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
"""Largest last step of a single ball and precision of its equations; the solver's precision if that is less."""
SHARPER = 4
"""Increase of the degree of p^2 over the solver's."""
WIDER, ROUND = 1.2, 10
"""Radius of the disc on which a polynomial represents the others' displacement, over the contact's; its degree."""


@dataclass(frozen=True)
class SampleError:
    """Indices of the sample in ``touching``, errors of T and Q [N], largest relative error of forces and approaches."""

    places: tuple[int, ...]
    tangential_force: Array
    normal_force: float
    settled: float


def sample_error(contacts: SmoothContacts, report: Report = silent) -> SampleError:
    """Return the errors on the balls of the sample; that of T is infinite if a single ball finds no solution."""
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
    """Return nodes and approach [m] of each ball of the sample, solved alone with its shape; None: no solution."""
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
