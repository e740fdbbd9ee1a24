"""Many balls: one degree of p^2 is accepted if a sample of balls, solved exactly, confirms the requested accuracy of T.

Two degrees for all balls would cost several times as much as one. The error of T scales with the forces that neighbours
exert on each other, so the largest ratio of both in the sample, times `UNSAMPLED`, gives the error on every ball. T is
also proportional to the ball's own normal force: unless that is prescribed, its largest error in the sample, times
`UNSAMPLED`, adds to the error of T.

Each ball of `SmoothContacts.sample` is pressed alone, at a higher degree of p^2, into the surface that all others have
displaced, by a direct sum over them. Its T follows from another direct sum. This shows the error from the solver's
degrees, pairs and mesh. Only the pressures of the others are kept; their errors have an effect of second order.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linear_bem.arrays import Array
from linear_bem.error_estimate import errors_of_one, felt, least_error, pulls, quantities, reference_force
from linear_bem.errors import NotConverged
from linear_bem.far_field.kernel_split import RULES
from linear_bem.lifted_balls import Touched, smooth_state
from linear_bem.profiles import Height, height
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.initial_guess import Guess, Start, solve_smooth
from linear_bem.smooth.many_balls import Lost, sweep_zones
from linear_bem.smooth.newton import Nodes
from linear_bem.smooth.polynomials import disc_nodes, interpolation
from linear_bem.solution import Solution, is_certified, require_certified

SAMPLE = ", sample: "
"""Marks progress lines of work whose time hardly depends on the number of balls; it follows the degree."""
ROUGH = 3e-2
"""Relative change at which sweeps at degree 2 end."""
DEGREES = (4, 6, 8)
"""Degrees of p^2, in the order of trial."""
WIDE = 0.95
"""Largest contact radius over layer thickness up to which degree 4 is tried: wider contacts have larger residuals."""
SWEPT, PAIRS, PULLED, AGAIN = 0.07, 0.1, 300.0, 0.005
"""Factors on the requested accuracy of T: last change of a sweep; precision of a pair; the same per T over the
neighbours' forces (largest values), if that is less; precision from the second degree on. Pairs cause an error of T of
about 3e-4 of their precision times these forces.

If T is much less than a half-space would transmit, as in a thin layer on a stiff base, the mesh's error decides.
"""
FINEST = RULES[-1][0]
"""Finest precision of pairs that a mesh permits; beyond it, all pairs would be summed."""
LEFT = 0.5
"""Largest share of T's error that may come from the last change of the sweeps; else they go on at the same degree."""
UNSAMPLED = 4.0
"""Error on any ball over the largest one in the sample, both over the neighbours' forces: measured up to 2.6 on 300 to
1000 balls on layers of 0.2 to 0.3 R, and up to 3.6 on 100 whose forces differ by up to 100 times."""
ROUNDOFF = 1e-14
"""Error of T on any ball over the largest neighbours' force on a ball: roundoff where a mesh sums up both."""
FREE = {"approach": ("normal_force",), "force": ("approach",), "total_force": ("normal_force", "approach")}
"""Forces or approaches that are not prescribed, by kind of load."""
CHANGES = 40
"""Largest number of times that balls may lose or find contact."""
ALONE = 1e-5
"""Largest last step of a single ball and precision of its equations; the solver's precision if that is less."""
SHARPER = 4
"""Increase of the degree of p^2 over the solver's."""
WIDER, ROUND = 1.2, 10
"""Radius of the disc on which a polynomial represents the others' displacement, over the contact's; its degree."""
Solve = Callable[[Guess, int, float, float, Report], SmoothContacts]
"""`solve_smooth` or `smooth_state`."""


def solve_by_sample(guess: Start, wanted: float, report: Report, size: int | None) -> Solution:
    """Return contacts of the lowest sufficient degree, or of the highest that converges, with a note.

    ``size`` is the number of sampled balls at equal steps, by default that for very many balls.
    Raises `NotConverged` if no degree converges.
    """
    best: Solution | None = None
    contacts: SmoothContacts | None = None
    start = _at_degree(solve_smooth, guess, 2, ROUGH, PAIRS * wanted, report)
    share = float(np.max(np.abs(start.mutual_force))) / max(float(np.max(pulls(start))), 1e-300)
    sharpest = max(AGAIN * wanted, FINEST)
    pairs = min(PAIRS * wanted, max(PULLED * share * wanted, sharpest))
    wide = bool(np.max(start.zones.reach) > WIDE * guess.kernel.thickness)
    for degree in DEGREES[wide:]:
        try:
            contacts = _settled(start, degree, wanted, pairs)
        except NotConverged:
            if contacts is None:
                raise
            break
        start = contacts
        if size is not None:
            contacts = replace(contacts, sampled=size)
        sample = f"{len(contacts.sample)} of {len(contacts.touching)} contacts"
        report(f"degree {degree}{SAMPLE}residuals of {sample}")
        if not is_certified(contacts):
            continue
        report(f"degree {degree}{SAMPLE}{sample} are solved exactly")
        best = _judged(contacts, wanted, report)
        report(f"degree {degree}: results")
        if not best.notes:
            return best
        pairs = min(pairs, sharpest)
    if best is None:
        assert contacts is not None
        require_certified(contacts)
    assert best is not None
    return best


def _settled(start: SmoothContacts, degree: int, wanted: float, pairs: float) -> SmoothContacts:
    """Return the contacts at a degree, swept until T has settled: on a thin layer T is a small sum of large terms."""
    contacts = _at_degree(smooth_state, start, degree, SWEPT * wanted, pairs, start.report)
    left, most = LEFT * wanted * reference_force(contacts), float(np.max(felt(contacts)))
    if contacts.smooth.residual * most <= left:  # `felt` is 0 for a single ball
        return contacts
    try:
        return _at_degree(smooth_state, contacts, degree, left / most, pairs, start.report)
    except NotConverged:
        return contacts


def _at_degree(solve: Solve, start: Guess, degree: int, swept: float, pairs: float, report: Report) -> SmoothContacts:
    """Return the contacts at a degree; balls may lose contact and, with `smooth_state`, come into contact."""
    for _ in range(CHANGES):
        try:
            return solve(start, degree, swept, pairs, report)
        except Lost as lost:
            report(f"{len(start.touching) - len(lost.kept)} ball(s) lose contact")
            touching = tuple(start.touching[k] for k in lost.kept)
            start = Start(start.problem, start.kernel, touching, lost.zones, start.approaches)
        except Touched as touched:
            report(f"{len(touched.zones)} ball(s) come into contact")
            start = touched.added_to(touched.contacts)
    raise NotConverged(f"linear_bem: balls changed contact {CHANGES} times; press them deeper or closer to equal depth")


def _judged(contacts: SmoothContacts, wanted: float, report: Report) -> Solution:
    """Return the contacts with the error of T estimated from the sample."""
    sample, scale = sample_error(contacts, report), pulls(contacts)
    vars(contacts).pop("direct", None)  # its nodes take memory
    balls = [contacts.touching[k] for k in contacts.sample]
    ratio = float(np.max(sample.tangential_force / np.maximum(scale[balls], 1e-300)))
    share = UNSAMPLED * ratio  # infinite if a sampled ball finds no solution
    error = share * np.where(scale > 0.0, scale, 1.0) + contacts.smooth.residual * felt(contacts)
    error = np.maximum(error, np.maximum(least_error(contacts), ROUNDOFF * np.max(scale)))
    free = FREE[contacts.problem.load.kind]
    if "normal_force" in free:
        pull = np.hypot(*contacts.mutual_force.T) / np.maximum(contacts.normal_forces, 1e-300)
        error = error + UNSAMPLED * sample.normal_force * pull
    error = np.where(scale > 0.0, error, 0.0)
    errors, known = errors_of_one(contacts), quantities(contacts)
    # the sample shows the errors of the quantities that are not prescribed
    for name in free:
        errors[name] = np.maximum(errors[name], UNSAMPLED * sample.settled * np.abs(known[name]))
    reference = reference_force(contacts)
    reached = float(np.max(error)) / reference
    accuracy = {
        "asked": wanted,
        "reached": reached,
        "sample": balls,
        "sample_error": float(np.max(sample.tangential_force)) / reference,
        "forces_and_approaches": sample.settled,
    }
    notes: tuple[str, ...] = ()
    if reached > wanted:
        notes = (
            f"T was requested to {wanted:.0e} of its largest size and is estimated to {reached:.0e}: "
            f"{len(balls)} balls solved exactly differ by up to {accuracy['sample_error']:.0e}",
        )
    return Solution(contacts.problem, contacts, error, errors, notes, accuracy)


@dataclass(frozen=True, eq=False)
class SampleError:
    """Errors of T (sample,) and Q [N], largest relative error of forces and approaches."""

    tangential_force: Array
    normal_force: float
    settled: float


def sample_error(contacts: SmoothContacts, report: Report = silent) -> SampleError:
    """Return the errors on the balls of the sample; that of T is infinite if a single ball finds no solution."""
    direct, problem, shapes, report_part = contacts.direct, contacts.problem, [], seldom(report)
    for done, k in enumerate(contacts.sample):
        report_part(f"{done} of {len(contacts.sample)} contacts pressed into the others' surface")
        zone = contacts.zones[k]
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
        ball, force, (here, approach) = contacts.touching[k], float(contacts.smooth.nodes[k].forces), alone
        errors.append(float(np.max(np.abs(direct.force(k, here) - contacts.mutual_force[ball]))))
        change = approach / contacts.approaches[ball] if problem.load.kind == "force" else here.forces / force
        settled = max(settled, abs(float(change) - 1.0))
        normal_force = max(normal_force, abs(here.forces - force) / contacts.kernel.singular)
    return SampleError(np.array(errors), normal_force, settled)


def _alone(contacts: SmoothContacts, shapes: list[Height]) -> list[tuple[Nodes, float] | None]:
    """Return nodes and approach [m] of each ball of the sample, solved alone with its shape; None: no solution."""
    nodes = contacts.smooth.nodes[np.array(contacts.sample)]
    zones, forces = nodes.zone.reframed(nodes.zone.degree + SHARPER), nodes.forces
    approaches = contacts.approaches[[contacts.touching[k] for k in contacts.sample]]
    given, precision = contacts.problem.load.kind == "force", min(ALONE, contacts.precision)

    def solved(places: Sequence[int]) -> list[tuple[Nodes, float] | None]:
        groups = [([at], forces[k]) for at, k in enumerate(places)] if given else []
        here = [shapes[k] for k in places], zones[np.array(places)], approaches[list(places)]
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
