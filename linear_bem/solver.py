"""Problem in, solution out: choose and refine the discretisation until T is as exact as asked."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from linear_bem.errors import InvalidProblem, NotConverged, UnsupportedProblem
from linear_bem.grid.contacts import GridContacts, grid_levels
from linear_bem.indenter import Sphere
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.problem import Problem
from linear_bem.resting_balls import rested
from linear_bem.result import BallResult, Result, Solved
from linear_bem.small_strain_range import beyond
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.initial_guess import DENSE, Start, first_guess
from linear_bem.smooth.tangential_forces import half_space_pulls
from linear_bem.touching_balls import Touched, missed_pulls, places, smooth_state

Array = NDArray[np.float64]

CERTIFIED = 1e-3
"""Largest recomputed residual (over approach, peak pressure, load) of an answer that is handed out."""
WORTH_KEEPING = 5.0
"""Error over the asked one up to which the best polynomials are handed out (with a note) rather than a grid tried."""
ROUTES_SUFFICE = 1e-3
"""Where no more accuracy is asked, three times the difference of two routes to T is taken without a refinement."""

STEEP, WIDE, GRID_FIRST = 0.75, 0.7, 16
"""Contact radius over a sphere's, or over the layer's thickness, from which on up to so many balls go to a grid at once
where no more is asked."""

CHANCE = 1e-2
"""Least error of T over the largest and over the square of cell over contact radius: two grids may agree by chance."""


@dataclass(frozen=True)
class Solution:
    """A certified answer with its error estimates: ``contacts`` gives fields, `result` the numbers.

    ``tangential_force_error`` [N] per ball: the larger of the change of T with the last refinement and of the
    difference between the mutual formula and the slope integral, which share neither quadrature nor cancellation.
    """

    problem: Problem
    contacts: SmoothContacts | GridContacts
    tangential_force_error: Array
    seconds: float
    notes: tuple[str, ...] = ()

    def pressure(self, x: Array, y: Array) -> Array:
        """Return the contact pressure [Pa] at surface points [m]."""
        return self.contacts.pressure(x, y)

    def displacement(self, x: Array, y: Array) -> Array:
        """Return the surface displacement [m], positive into the layer, at surface points [m]."""
        return self.contacts.displacement(x, y)

    def outline(self, ball: int) -> tuple[Array, Array]:
        """Return points x, y [m] on the edge of one ball's contact."""
        return self.contacts.outline(ball)

    def result(self) -> Result:
        """Return the numbers in the shape that all models share."""
        c = self.contacts
        balls = tuple(
            BallResult(
                position=(float(ball.position[0]), float(ball.position[1])),
                radius=float(ball.radius),
                approach=float(c.approaches[i]),
                normal_force=float(c.normal_forces[i]),
                tangential_force=_pair(c.mutual_force[i]),
                tangential_force_error=float(self.tangential_force_error[i]),
                peak_pressure=float(c.peak_pressures[i]),
                contact_area=float(c.contact_areas[i]),
                tangential_force_routes={"mutual": _pair(c.mutual_force[i]), "slope": _pair(c.slope_force[i])},
            )
            for i, ball in enumerate(self.problem.balls)
        )
        solved = Solved(
            converged=True,
            iterations=c.iterations,
            unknowns=c.unknowns,
            seconds=self.seconds,
            versions={"numpy": np.__version__, "scipy": scipy.__version__},
            notes=self.notes,
            certificate=c.certificate,
            tolerances=dict.fromkeys(c.certificate, CERTIFIED),
        )
        return Result(model="linear_bem", balls=balls, solved=solved)


def _pair(v: Array) -> tuple[float, float]:
    return float(v[0]), float(v[1])


def solve(problem: Problem, tangential_force: float = 1e-4) -> Result:
    """Return the small-strain answer with T to the relative accuracy ``tangential_force``.

    The accuracy is relative to the largest T in the problem, or to 1e-4 of the force that a half-space of the layer's
    material would transmit if that is more (T may pass through zero); where it cannot be reached, or T is known less
    exactly relative to itself, ``result.solved.notes`` says what was. Raises `NotConverged` where no certified answer
    is found.
    """
    return solve_contact(problem, tangential_force).result()


def solve_contact(problem: Problem, tangential_force: float = 1e-4) -> Solution:
    """Return the solution with its fields; see `solve`."""
    if problem.finite_strain is not None:
        raise UnsupportedProblem(
            "linear_bem: the effect finite_strain is not part of this model; use finite_strain, or drop the table"
        )
    if not 0.0 < tangential_force < 1.0:
        raise InvalidProblem(f"accuracy.tangential_force: must lie between 0 and 1, got {tangential_force:g}")
    begun = time.perf_counter()
    problem = problem.without_empty_layer()
    kernel = LayeredKernel.of(problem)
    contacts, error, notes = _refined(problem, kernel, tangential_force)
    notes = notes or _cancelled(contacts, error, tangential_force)
    worst = max(contacts.certificate.values())
    if worst > CERTIFIED:
        raise NotConverged(f"linear_bem: recomputed residuals exceed {CERTIFIED:g}: {contacts.certificate}")
    return Solution(
        problem,
        contacts,
        error,
        time.perf_counter() - begun,
        (*notes, *beyond(problem, contacts.approaches, contacts.contact_areas)),
    )


Answer = tuple[SmoothContacts | GridContacts, Array, tuple[str, ...]]
"""Contacts, error of T [N] per ball, notes."""


def _refined(problem: Problem, kernel: LayeredKernel, wanted: float) -> Answer:
    """Return contacts by polynomials where these converge, else on grids."""
    guess = first_guess(problem, kernel)
    if wanted < ROUTES_SUFFICE or problem.size > GRID_FIRST or not (_steep(problem, guess) or _wide(kernel, guess)):
        answer = _by_polynomials(problem, kernel, wanted, guess)
        if answer is not None:
            return answer
    return _on_grids(problem, kernel, wanted, guess)


def _enough(wanted: float) -> float:
    """Return the relative accuracy of forces and approaches that goes with one of T."""
    return float(np.clip(wanted, 1e-4, 1e-3))


def _by_polynomials(problem: Problem, kernel: LayeredKernel, wanted: float, guess: Start) -> Answer | None:
    """Return contacts of the lowest degree that is exact enough, or of the best if that is good; None where neither."""
    enough = _enough(wanted)
    best: tuple[SmoothContacts, Array, float, float] | None = None
    before: SmoothContacts | None = None

    def score(reached: float, settled: float) -> float:
        return max(reached / wanted, settled / enough)

    many = len(guess.touching) > DENSE
    precision = min(1e-6, (1e-3 if many else 1e-4) * wanted)
    degrees = [2, 4, 6, 8, 10, 12]
    while degrees:
        degree = degrees.pop(0)
        try:
            after = smooth_state(problem, kernel, degree, guess if before is None else before, precision)
        except Touched as touched:
            guess, before, best = touched.added_to(guess), None, None
            degrees = [2, 4, 6, 8, 10, 12]
            continue
        except NotConverged:
            if degree > 2:
                break
            # a deep sphere's pressure may be too far from any parabola for Newton's method
            continue
        certified = max(after.certificate.values()) < CERTIFIED
        if before is None:
            error = _routes_error(after)
            reached = max(float(np.max(error)) / _size(after), 3.0 * after.smooth.residual)
            if certified and wanted >= ROUTES_SUFFICE and reached <= wanted:
                return after, error, ()
        else:
            error, settled = _change(before, after)
            error = np.maximum(error, np.max(np.abs(after.mutual_force - after.slope_force), axis=1))
            if after.smooth.residual > (precision if many else 0.0):
                error = error + 3.0 * after.smooth.residual * _pulls(after)
            reached = float(np.max(error)) / _size(after)
            if certified and (best is None or score(reached, settled) < score(*best[2:])):
                best = after, error, reached, settled
            if certified and score(reached, settled) <= 1.0:
                return after, error, ()
        before = after
    if best is not None and (score(*best[2:]) <= WORTH_KEEPING or (best[2] <= 1e-3 and best[3] <= enough)):
        # good, if not as good as asked: a grid would not be better
        return best[0], best[1], (_note("highest usable degree", wanted, best[2], best[3]),)
    return None


def _on_grids(problem: Problem, kernel: LayeredKernel, wanted: float, guess: Start) -> Answer:
    """Return contacts on the coarsest grid that is exact enough, or on the finest that fits."""
    previous: GridContacts | None = None
    error, reached, settled = np.full(problem.size, np.inf), np.inf, np.inf
    levels, fits = grid_levels(problem, kernel, guess), "fits"
    while True:
        try:
            contacts = next(levels, None)
        except NotConverged:
            if previous is None:
                raise
            contacts, fits = None, "converges"
        if contacts is None:
            break
        if previous is not None:
            error, settled = _change(previous, contacts)
            error = np.maximum(error, CHANCE * contacts.coarseness**2 * float(np.max(np.abs(contacts.mutual_force))))
            reached = float(np.max(error)) / _size(contacts)
            if reached <= wanted and settled <= _enough(wanted):
                return rested(contacts), error + missed_pulls(contacts), ()
        previous = contacts
    assert previous is not None
    missed = missed_pulls(previous)
    if not np.all(np.isfinite(error)):
        # there is one grid: the routes' difference is what there is to judge by
        error = np.maximum(np.max(np.abs(previous.mutual_force - previous.slope_force), axis=1), _floor(previous))
        reached = float(np.max(error)) / _size(previous)
        note = f"only one grid {fits}: T was asked to {wanted:.0e} of its size, its routes differ by {reached:.0e}"
        return rested(previous), error + missed, (note,)
    return rested(previous), error + missed, (_note(f"finest grid that {fits}", wanted, reached, settled),)


def _cancelled(contacts: SmoothContacts | GridContacts, error: Array, wanted: float) -> tuple[str, ...]:
    """Return a note where T is so small that it is not known to the accuracy asked for relative to itself."""
    largest, known = float(np.max(np.abs(contacts.mutual_force))), float(np.max(error))
    transmitted = float(np.max(_pulls(contacts)))
    if transmitted == 0.0 or known <= wanted * largest:
        # with one loaded ball there is no T to know
        return ()
    share = known / largest if largest > 0.0 else math.inf
    return (
        f"T is close to zero: it is known to {known:.1e} N, which is {share:.0e} of the largest T ({wanted:.0e} was "
        f"asked for) and {known / transmitted:.0e} of what a half-space would transmit",
    )


def _steep(problem: Problem, guess: Start) -> bool:
    """Return whether a contact comes close to the equator of its sphere, where the profile is singular."""
    spheres = ((problem.balls[i], zone) for i, zone in zip(guess.touching, guess.zones, strict=True))
    return any(isinstance(b.indenter, Sphere) and np.sqrt(z.jacobian) > STEEP * b.radius for b, z in spheres)


def _wide(kernel: LayeredKernel, guess: Start) -> bool:
    """Return whether a contact is so wide against the layer that a grid takes less than the high degrees it needs."""
    return max(float(np.sqrt(z.jacobian)) for z in guess.zones) > WIDE * kernel.thickness


def _note(limit: str, wanted: float, reached: float, settled: float) -> str:
    return (
        f"{limit} reached: T was asked to {wanted:.0e} of its size and is estimated to {reached:.0e}, "
        f"forces and approaches to {settled:.0e}"
    )


def _pulls(contacts: SmoothContacts | GridContacts, softest: float = 0.0, fading: float = math.inf) -> Array:
    return half_space_pulls(contacts.kernel, places(contacts), contacts.normal_forces, softest, fading)


def _size(contacts: SmoothContacts | GridContacts) -> float:
    """Return the force [N] that accuracy is relative to: the largest T, or 1e-4 of what a half-space would give.

    One ball alone has no T to resolve: its size is infinite, and forces and approaches decide.
    """
    if contacts.problem.size == 1:
        return math.inf
    largest = float(np.max(np.abs(contacts.mutual_force)))
    return max(largest, 1e-4 * float(np.max(_pulls(contacts))), 1e-12 * float(np.max(contacts.normal_forces)))


def _floor(contacts: SmoothContacts | GridContacts) -> Array:
    """Return what the kernel's table and the solver's tolerance leave of T's error [N] on every ball."""
    thickness, contrast = contacts.kernel.thickness, 1.0 + contacts.kernel.far_ratio
    softest = thickness if np.isfinite(thickness) else 0.0
    # the table's error fades where the layer's 1/r and the substrate's cancel
    return np.asarray(1e-9 * contrast * _pulls(contacts, softest, 100.0 * contrast * thickness))


def _routes_error(contacts: SmoothContacts) -> Array:
    """Return an estimate of T's error [N] from one solution: its routes' difference, and its residual's share of T."""
    routes = np.max(np.abs(contacts.mutual_force - contacts.slope_force), axis=1)
    residual = contacts.certificate["gap_in_contact"] * _pulls(contacts)
    return np.maximum(np.maximum(3.0 * routes, residual), _floor(contacts))


def _change(before: SmoothContacts | GridContacts, after: SmoothContacts | GridContacts) -> tuple[Array, float]:
    """Return the change of every T [N] and the largest relative change of loads and approaches.

    A tenth of the changes of area and peak pressure counts too, where these are smooth enough to judge by.
    """
    error = np.maximum(np.max(np.abs(after.mutual_force - before.mutual_force), axis=1), _floor(after))
    loads = float(np.max(np.abs(after.normal_forces - before.normal_forces)) / np.max(after.normal_forces))
    touching = after.normal_forces > 0.0
    moved = np.abs(after.approaches - before.approaches)[touching]
    approaches = float(np.max(moved) / np.max(np.abs(after.approaches[touching])))
    settled = max(loads, approaches)
    if isinstance(after, SmoothContacts) and isinstance(before, SmoothContacts):
        for old, new in (
            (before.contact_areas, after.contact_areas),
            (before.peak_pressures, after.peak_pressures),
        ):
            settled = max(settled, 0.1 * float(np.max(np.abs(new - old)[touching] / new[touching])))
    return error, settled
