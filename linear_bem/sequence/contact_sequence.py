"""Scenes close to a solved one: sequences, each solved from the previous solution, in milliseconds; T of one scene."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from linear_bem.arguments import require_accuracy, require_supported
from linear_bem.arrays import Array
from linear_bem.error_estimate import LEAST
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.lifted_balls import smooth_state
from linear_bem.load_control import deepest, force_groups, given_approaches, unloaded
from linear_bem.problem import Problem
from linear_bem.profiles import is_ball
from linear_bem.sequence.linearised import LinearisedContacts, LinearState
from linear_bem.smooth.contacts import CHECKED, SmoothContacts
from linear_bem.smooth.initial_guess import Start, first_guess
from linear_bem.smooth.tangential_forces import half_space_pulls
from linear_bem.solution import Solution
from linear_bem.solver import solve_contact

DEGREES = (4, 6, 8)
"""Degrees of p^2 of a cold solution, in the order of trial."""
SOLVED = 1e-6
"""Largest last step of the solver, over the largest coefficient of a pressure, of states used by `nearby_forces`."""
FAILED = NotConverged, np.linalg.LinAlgError, FloatingPointError
"""After these the next, slower way is tried."""
TOLERANCE = 1e-3
"""Residual of a cold solution over the accuracy; part of the error of T."""
GAP_SHARE = 0.1
"""Error of T over the relative gap: the error of forces is quadratic in that of the pressure (0.03 to 0.07 for deep
spheres)."""


@dataclass(frozen=True, eq=False)
class SequenceState:
    """The solution of one scene, one entry per ball: approaches [m], forces [N], T and its error estimate [N].

    ``gap_in_contact`` is the largest gap inside the contacts over the largest approach; ``cold`` is true if the scene
    was solved without the previous one.
    """

    approaches: Array
    normal_forces: Array
    tangential_force: Array
    tangential_force_error: Array
    gap_in_contact: float
    cold: bool


class ContactSequence:
    """Solves a sequence of similar scenes (moving balls, growing loads).

    >>> from linear_bem import Ball, ContactSequence, Layer, Load, Problem
    >>> def scene(distance):
    ...     pair = (Ball((0.0, 0.0), 1.0, "sphere"), Ball((distance, 0.0), 1.0, "sphere"))
    ...     return Problem(Layer(1.0, 0.48, 8.0), pair, Load("approach", (0.5, 0.5)))
    >>> sequence = ContactSequence(accuracy=1e-2)
    >>> [sequence.solve(scene(2.5 + 0.01 * k)).cold for k in range(3)]
    [True, False, False]

    ``accuracy`` of T is relative, as in `linear_bem.solve`. A state is accepted if its error estimate (difference
    of the two formulas for T, square of the drift since linearisation, a tenth of the gap over a body's own dent,
    residual, the kernel's table) and its gap over approach are within the accuracy; the equations are linearised again
    after too large a drift. Other scenes are solved cold, by polynomials of the lowest sufficient degree, else by
    `linear_bem.solve_contact`; so are scenes with an unloaded ball or another layer, substrate, radius, shape, cell
    or kind of load.

    Raises the errors of `linear_bem.solve_contact`.
    """

    def __init__(self, accuracy: float = 1e-2) -> None:
        require_accuracy(accuracy)
        self.accuracy = accuracy
        self._contacts: LinearisedContacts | None = None
        self._before: Problem | None = None
        self._approaches = np.empty(0)

    def solve(self, problem: Problem) -> SequenceState:
        """Return the state of one scene, from the previous scene if that is close enough."""
        require_supported(problem)
        problem = problem.without_empty_layer()
        contacts, before, self._before = self._contacts, self._before, problem
        self._contacts = None
        if contacts is not None and before is not None and _alike(before, problem):
            with suppress(*FAILED):
                if (state := self._warm(problem, contacts)) is not None:
                    return state
        if problem.periodic is None:
            with suppress(*FAILED):
                if (state := self._started(problem)) is not None:
                    return replace(state, cold=True)
        solution = solve_contact(problem, self.accuracy)
        found = solution.contacts
        return SequenceState(
            approaches=found.approaches,
            normal_forces=found.normal_forces,
            tangential_force=found.mutual_force,
            tangential_force_error=solution.tangential_force_error,
            gap_in_contact=found.certificate["gap_in_contact"],
            cold=True,
        )

    def _started(self, problem: Problem) -> SequenceState | None:
        """Return the state by the lowest sufficient degree, None if none suffices."""
        kernel = LayeredKernel.of(problem)
        contacts = smooth_state(first_guess(problem, kernel), 2, TOLERANCE * self.accuracy)
        for degree in DEGREES:
            contacts = smooth_state(contacts, degree, TOLERANCE * self.accuracy)
            self._approaches = contacts.approaches
            state = self._warm(problem, LinearisedContacts(problem, kernel, contacts.touching, contacts.zones))
            if state is not None:
                return state
        return None

    def _warm(self, problem: Problem, contacts: LinearisedContacts) -> SequenceState | None:
        """Return the state near linearised contacts, None if it is not accurate enough."""
        touching = list(contacts.touching)
        places = problem.positions[touching]
        values = given_approaches(problem.load, self._approaches)
        groups = force_groups(problem.load, touching, contacts.kernel.singular)
        for _ in range(5):
            state = contacts.solve(places, values[touching], groups)
            if not np.isfinite(state.drift) or np.any(state.forces <= 0.0):
                return None
            if state.drift**2 <= 0.1 * self.accuracy:
                break
            zones = contacts.moved(places, state.change)
            contacts = LinearisedContacts(problem, contacts.kernel, contacts.touching, zones)
        else:
            return None
        found = self._scattered(problem, contacts, state, places)
        if found is not None:
            self._contacts, self._approaches = contacts, found.approaches
        return found

    def _scattered(
        self, problem: Problem, contacts: LinearisedContacts, state: LinearState, places: Array
    ) -> SequenceState | None:
        """Return the state with an entry for every ball, None if it is not accurate enough."""
        touching = list(contacts.touching)
        gap = state.gap / deepest(state.approaches)
        forces = state.forces / contacts.kernel.singular
        pulls = half_space_pulls(contacts.kernel, places, forces)
        size = max(float(np.max(np.abs(state.mutual_force), initial=0.0)), 1e-4 * float(np.max(pulls)), 1e-300)
        routes = np.max(np.abs(state.mutual_force - state.slope_force), axis=1)
        shares = state.drift**2 + GAP_SHARE * state.gap_share + TOLERANCE * self.accuracy
        error = routes + shares * size + LEAST * pulls
        if gap > self.accuracy or float(np.max(error)) > self.accuracy * size:
            return None
        whole = problem.size
        out = SequenceState(np.zeros(whole), np.zeros(whole), np.zeros((whole, 2)), np.zeros(whole), gap, cold=False)
        out.approaches[:] = given_approaches(problem.load, state.approaches[:1])
        out.approaches[touching] = state.approaches
        out.normal_forces[touching] = forces
        out.tangential_force[touching] = state.mutual_force
        out.tangential_force_error[touching] = error
        return None if _lifted_may_touch(problem, contacts.kernel, out, touching) else out


def _alike(a: Problem, b: Problem) -> bool:
    """Return whether only positions and load values differ and no ball is unloaded."""
    if a.size != b.size or a.layer != b.layer or a.substrate != b.substrate or a.load.kind != b.load.kind:
        return False
    if a.periodic or b.periodic or unloaded(a.load) or unloaded(b.load):
        return False  # `solve_contact` finds their height of rest, and supports the cell
    return all(p.radius == q.radius and p.shape == q.shape for p, q in zip(a.balls, b.balls, strict=True))


def _lifted_may_touch(problem: Problem, kernel: LayeredKernel, state: SequenceState, touching: list[int]) -> bool:
    """Return whether a ball assumed lifted may touch, by the displacement of the others' point loads at its axis."""
    lifted = np.setdiff1d(np.arange(problem.size), touching)
    if lifted.size == 0:
        return False
    r = cdist(problem.positions[lifted], problem.positions[touching])
    dent = kernel.displacement(r) @ state.normal_forces[touching]
    # the surface's slope under a lifted ball takes a few per cent of the displacement; others may touch at their rim
    margin = np.array([0.05 if is_ball(problem.balls[i]) else 1.0 for i in lifted]) * np.abs(dent)
    return bool(np.any(state.approaches[lifted] > dent - margin))


def nearby_forces(near: Solution, problem: Problem) -> Array | None:
    """Return T [N] on every ball (balls, 2) of a problem that differs by a per cent or so from that of ``near``.

    The degree is that of ``near``, so that most of the error cancels in the difference of both; no error is estimated.
    None where the contacts are on grids, merge, or gain or lose a ball, for many balls, and for another kind of load or
    model: these need `solve_contact`.
    """
    contacts, problem = near.contacts, problem.without_empty_layer().in_cell()
    if not isinstance(contacts, SmoothContacts) or len(contacts.touching) > CHECKED or contacts.sampled is not None:
        return None
    before, now = near.problem.load, problem.load
    alike = problem.size == near.problem.size and before.kind == now.kind and unloaded(before) == unloaded(now)
    if problem.finite_strain is not None or not alike:
        return None
    moved = (problem.positions - contacts.problem.positions)[list(contacts.touching)]
    zones = replace(contacts.zones, centre=contacts.zones.centre + moved)
    approaches = given_approaches(problem.load, contacts.approaches)
    start = Start(problem, LayeredKernel.of(problem), contacts.touching, zones, approaches)
    try:
        found = smooth_state(start, zones.degree, contacts.precision)
    except NotConverged:
        return None
    return found.mutual_force if found.smooth.residual <= SOLVED else None
