"""Small-strain solution of a contact problem: the discretisation is refined until T has the requested accuracy."""

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from linear_bem.arguments import require_accuracy, require_sample, require_supported
from linear_bem.arrays import Array
from linear_bem.depth import depth_faults, overlap_note
from linear_bem.doubts import large_strain_notes, own_profile_notes, small_force_note, unreached
from linear_bem.error_estimate import (
    Errors,
    change,
    error_by_change,
    error_of_one,
    error_of_one_grid,
    errors_by_change,
    errors_of_one,
    felt,
    least_error,
    missed_pulls,
    quantities,
    reference_force,
    route_difference,
    size_of_errors,
)
from linear_bem.errors import InvalidProblem, NotConverged, UnsupportedProblem
from linear_bem.grid.contacts import GridContacts, grid_levels
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.lifted_balls import Contacts, Touched, rested, smooth_state
from linear_bem.memory import require
from linear_bem.problem import Problem
from linear_bem.report import Report, Timed, seldom, silent
from linear_bem.result import Result
from linear_bem.sampled_solution import solve_by_sample
from linear_bem.smooth.contacts import CHECKED, SmoothContacts
from linear_bem.smooth.initial_guess import DENSE, ROUGHEST, Start, first_guess, is_steep
from linear_bem.solution import Solution, is_certified, require_certified

WORTH_KEEPING = 5.0
"""Largest error over the requested one at which the best polynomials are accepted (with a note) without grids."""
ROUTES_SUFFICE = 1e-3
"""Accuracy at or above which three times the difference of the two formulas for T is the error, without refinement."""
WIDE, GRID_FIRST = 0.7, 16
"""Contact radius over the layer's thickness; number of balls. If the ratio is exceeded, or a contact `is_steep`, up to
that number of balls go to grids directly, for accuracies not below `ROUTES_SUFFICE`."""
GRIDDED = 500
"""Largest number of balls that go to grids if polynomials do not converge."""
SUMMED = 2.0
"""Error of T by the sums over pairs and images, over their precision times `felt`: up to 1.3 measured in cells."""
USABLE = 1e-2
"""Largest error of T over its size of polynomials that miss the accuracy but are used where no grid is better; in a
periodic cell, which has no grids, the change of forces and approaches may meet it instead (T vanishes in a lattice)."""
FINEST = 5e-8
"""Largest precision of sums over pairs in a periodic cell: sums then use the finest rule of `kernel_split.IN_CELL`."""
BYTES = 130e3
"""Memory per ball of many; measured: 60 kB at degree 4, 120 kB at degree 6."""
DEGREES = (2, 4, 6, 8, 10, 12)
"""Degrees of the polynomials p^2, in the order of trial."""


def solve(problem: Problem, accuracy: float = 1e-4, report: Report = silent) -> Result:
    """Return the small-strain result with T to a relative accuracy.

    Parameters
    ----------
    problem
        Layer, substrate, balls and load; SI units.
    accuracy
        Wanted error of T (0 to 1), relative to the largest T in the problem, or to 1e-4 of the force that a half-space
        of the layer's material would transmit if that is more (T may pass through zero). The same relative accuracy is
        required of the change of forces and approaches between two solutions, but not below 1e-4 nor above 1e-3; the
        errors given with them may be larger.
    report
        Function that receives a line of text at every step of the solver, and may raise an exception to end it.

    Returns
    -------
    Result
        Per ball approach [m], normal force [N], tangential force [N] on the ball, peak pressure [Pa] and contact area
        [m^2], each with its error. If the accuracy cannot be reached, or the error of T is larger relative to T itself,
        ``result.solved.notes`` states the accuracy reached.

    Raises
    ------
    InvalidProblem
        Accuracy out of range, a profile that is not convex or not 0 at its apex, an impossible surface response, an
        approach through a layer on a rigid base, a force that presses twice as deep, a round ball 100 radii deep.
    UnsupportedProblem
        An effect that this model lacks, or contacts that need more cells than fit.
    TooLarge
        More balls than fit into the free memory.
    NotConverged
        No certified solution is found.

    Examples
    --------
    >>> from linear_bem import Ball, Layer, Load, Problem, solve
    >>> pair = (Ball((-8e-3, 0.0), 8e-3), Ball((8e-3, 0.0), 8e-3))
    >>> scene = Problem(Layer(1e6, 0.48, 10e-3), pair, Load("approach", (1e-3, 1e-3)))
    >>> result = solve(scene, accuracy=1e-3)
    >>> ball = result.balls[0]
    >>> print(f"Q = {ball.normal_force:.3f} N, T = {ball.tangential_force[0]:.4f} N")
    Q = 7.107 N, T = -0.0105 N

    """
    require_supported(problem)
    faults = depth_faults(problem)
    if faults:
        raise InvalidProblem(*faults)
    return solve_contact(problem, accuracy, report).result()


def solve_contact(
    problem: Problem, accuracy: float = 1e-4, report: Report = silent, sample: int | None = None, *,
    on_grids: bool = False,
) -> Solution:  # fmt: skip
    """Return the solution with its fields; parameters and errors as for `solve`.

    Loads that `solve` refuses as too deep are solved here, and noted. With ``sample``, the error is judged as for very
    many balls, by a sample of about twice this number. ``on_grids`` solves every contact on a grid, none by polynomials
    (a second route to the same result); with a periodic cell or a ``sample`` it raises `UnsupportedProblem`.
    """
    require_supported(problem)
    require_accuracy(accuracy)
    require_sample(sample)
    if on_grids and (problem.periodic is not None or sample is not None):
        raise UnsupportedProblem("on_grids: contacts on grids have no periodic cell and no sample; leave on_grids out")
    begun, report = time.perf_counter(), Timed(report)
    problem = problem.without_empty_layer()
    kernel = LayeredKernel.of(problem)
    require(BYTES * problem.size, f"linear_bem: {problem.size} balls", "take fewer balls or a larger machine")
    found = _refined(problem.in_cell(), kernel, accuracy, report, sample, on_grids=on_grids)
    contacts = found.contacts
    of_error = found.notes or small_force_note(contacts, found.tangential_force_error, accuracy)
    loads = contacts.approaches, contacts.normal_forces, contacts.contact_areas
    overlap = overlap_note(problem, contacts.approaches)
    notes = (*own_profile_notes(contacts), *large_strain_notes(contacts.problem, *loads), *overlap, *of_error)
    require_certified(contacts)
    return replace(found, problem=problem, notes=notes, seconds=time.perf_counter() - begun)


def _refined(
    problem: Problem, kernel: LayeredKernel, wanted: float, report: Report, sample: int | None, *, on_grids: bool
) -> Solution:
    """Return contacts by polynomials if these converge, else, or if asked for, on grids."""
    report(f"{problem.size} ball(s): first guess")
    guess = first_guess(problem, kernel, seldom(report, "first guess: "))
    if on_grids:
        return _on_grids(guess, wanted, report, None)
    if sample is not None or len(guess.touching) > CHECKED:
        try:
            return solve_by_sample(guess, wanted, report, sample)
        except NotConverged as failed:
            if problem.size > GRIDDED:
                tried = "" if kernel.cell is not None else f"; up to {GRIDDED} balls are tried on grids as well"
                raise NotConverged(f"{failed}{tried}") from failed
    by_grid = kernel.cell is None and wanted >= ROUTES_SUFFICE and problem.size <= GRID_FIRST
    by_grid = by_grid and (is_steep(guess) or bool(np.max(guess.zones.radius) > WIDE * kernel.thickness))
    if by_grid:
        try:
            return _on_grids(guess, wanted, report, None)
        except UnsupportedProblem:  # more cells than fit, as for a long body beside small ones
            pass
    best = _by_polynomials(guess, wanted, report)
    if isinstance(best, Solution):
        return best
    if kernel.cell is None:
        return _on_grids(guess, wanted, report, best)
    if best is not None and min(best.reached, best.settled) <= USABLE:
        return best.estimated(wanted)
    width = f"{np.max(guess.zones.radius) / kernel.thickness:.2g}"
    raise UnsupportedProblem(
        f"periodic: the contacts did not converge as smooth pressures (radius up to {width} layer thicknesses, "
        f"possible up to {ROUGHEST:g}), and contacts on grids (for merging contacts, sharp tips, punches, contacts "
        "wider than the layer is thick) have no cell; press the balls less deep, or drop the effect"
    )


def _enough(wanted: float) -> float:
    """Return the relative accuracy required of forces and approaches at a relative accuracy of T."""
    return float(np.clip(wanted, 1e-4, 1e-3))


@dataclass(frozen=True, eq=False)
class _Refined:
    """Contacts, errors of T [N] and of other results per ball, error of T over `reference_force`, change of others."""

    contacts: Contacts
    error: Array
    errors: Errors
    reached: float
    settled: float

    def excess(self, wanted: float) -> float:
        """Return the larger of both errors over the requested ones."""
        return max(self.reached / wanted, self.settled / _enough(wanted))

    def estimated(self, wanted: float) -> Solution:
        """Return contacts of the best degree, with a note."""
        return Solution(
            self.contacts.problem, self.contacts, self.error, self.errors, self.notes("highest usable degree", wanted)
        )

    def notes(self, limit: str, wanted: float) -> tuple[str, ...]:
        """Return a note if an error of T, forces or approaches is above the one asked for; ``limit`` ended it."""
        values, touching = quantities(self.contacts), self.contacts.normal_forces > 0.0
        shares = []
        for name in ("normal_force", "approach"):
            known = touching & (values[name] > 0.0)  # a ball held at the undeformed surface may be touched by a bulge
            shares.append(float(np.max(self.errors[name][known] / values[name][known], initial=0.0)))
        if self.reached <= wanted and max(shares) <= _enough(wanted):
            return ()
        return (unreached(limit, self.contacts, (self.reached, wanted), (max(shares), _enough(wanted))),)


def _by_polynomials(guess: Start, wanted: float, report: Report) -> Solution | _Refined | None:
    """Return contacts of the lowest sufficient degree, or of the best degree if that nearly suffices.

    Otherwise the best degree for a comparison with grids, None if there is none.
    """
    candidates: list[_Refined] = []
    before: SmoothContacts | None = None
    many = len(guess.touching) > DENSE or guess.kernel.cell is not None
    precision, kernel = min(1e-6, (1e-3 if many else 1e-4) * wanted), guess.kernel
    # images in a cell nearly cancel the dent of a base softer than the layer
    of_pairs = None if kernel.cell is None else max(min(precision, FINEST) / max(kernel.far_ratio, 1.0), 1e-9)
    degrees = iter(DEGREES)
    while (degree := next(degrees, None)) is not None:
        try:
            after = smooth_state(before or guess, degree, precision, of_pairs, report)
        except Touched as touched:
            guess, before, candidates, degrees = touched.added_to(guess), None, [], iter(DEGREES)
            continue
        except NotConverged:
            if degree > 2:
                break
            continue  # a deep sphere's pressure may be too far from any parabola for Newton's method
        # the whole certificate takes a fifth of the time of a pair: it is computed only where it decides
        if before is None and wanted >= ROUTES_SUFFICE:
            error = error_of_one(after)
            reached = max(float(np.max(error)) / reference_force(after), 3.0 * after.smooth.residual)
            if reached <= wanted and is_certified(after):
                return Solution(after.problem, after, error, errors_of_one(after))
        elif before is not None:
            error, settled = change(before, after)
            error = np.maximum(error, route_difference(after))
            if after.smooth.residual > (precision if many else 0.0):
                error = error + 3.0 * after.smooth.residual * size_of_errors(after)
            errors = errors_by_change(before, after)
            reached = float(np.max(error)) / reference_force(after)
            if many:  # a higher degree does not reduce this part
                error = np.maximum(error, SUMMED * after.precision * felt(after))
            found = _Refined(after, error, errors, reached, settled)
            if found.excess(wanted) <= 1.0 and is_certified(after):
                return Solution(after.problem, after, error, errors)
            if math.isfinite(found.excess(wanted)):
                candidates.append(found)
        before = after
    candidates.sort(key=lambda found: found.excess(wanted))
    best = next((found for found in candidates if is_certified(found.contacts)), None)
    if best is None:
        return None
    suffices = best.excess(wanted) <= WORTH_KEEPING or (best.reached <= 1e-3 and best.settled <= _enough(wanted))
    return best.estimated(wanted) if suffices else best


def _on_grids(guess: Start, wanted: float, report: Report, smooth: _Refined | None) -> Solution:
    """Return contacts on the coarsest sufficient grid; if none suffices, the better of finest grid and polynomials."""
    last: _Refined | None = None
    levels, fits = grid_levels(guess, report), "fits"
    while True:
        try:
            contacts = next(levels, None)
        except (NotConverged, UnsupportedProblem) as failed:
            if last is None and smooth is not None and smooth.reached <= USABLE:
                return smooth.estimated(wanted)
            if last is None or isinstance(failed, UnsupportedProblem):
                raise
            contacts, fits = None, "converges"
        if contacts is None:
            break
        if last is None:
            last = _Refined(contacts, np.full(guess.problem.size, np.inf), errors_of_one(contacts), np.inf, np.inf)
            continue
        error, settled = change(last.contacts, contacts)
        is_known = np.isfinite(last.reached)
        error = error_by_change(contacts, error, last.error if is_known else None)
        errors = errors_by_change(last.contacts, contacts, last.errors if is_known else None)
        last = _Refined(contacts, error, errors, float(np.max(error)) / reference_force(contacts), settled)
        if last.excess(wanted) <= 1.0:
            return Solution(guess.problem, rested(contacts), error + missed_pulls(contacts), errors)
    assert last is not None
    assert isinstance(last.contacts, GridContacts)
    if smooth is not None and smooth.excess(wanted) <= last.excess(wanted) and smooth.reached <= USABLE:
        return smooth.estimated(wanted)
    error, notes = last.error, last.notes(f"finest grid that {fits}", wanted)
    if not np.all(np.isfinite(error)):
        error = np.maximum(route_difference(last.contacts), error_of_one_grid(last.contacts))
        error = np.maximum(error, least_error(last.contacts))
        reached = float(np.max(error)) / reference_force(last.contacts)
        notes = (
            f"only one grid {fits}: T was requested to {wanted:.0e} of its size; its routes differ by {reached:.0e}",
        )
    return Solution(guess.problem, rested(last.contacts), error + missed_pulls(last.contacts), last.errors, notes)
