"""Notes on a doubtful solution: accuracy not reached, strains that are not small, own profiles that seem wrong."""

import math

import numpy as np

from linear_bem.arrays import Array
from linear_bem.depth import MEANINGLESS, ball_depth_note, given_by_base, given_by_others, large_strain_note
from linear_bem.dual import POINTED
from linear_bem.error_estimate import pulls, reference_force
from linear_bem.indenter import HeightFunction, Indenter
from linear_bem.lifted_balls import Contacts
from linear_bem.problem import Ball, Problem
from linear_bem.profiles import is_ball

NARROW = 3.0
"""Approach over the contact radius of an own profile from which a note questions its units."""


def own_profile_notes(contacts: Contacts) -> tuple[str, ...]:
    """Return a note on the first own profile that is pointed, or seems to be in another unit than the ball's radius.

    In unlike units its contact is wider than the ball, or far narrower than its approach.
    """
    problem, forces, areas = contacts.problem, contacts.normal_forces, contacts.contact_areas
    for number, (ball, area, approach) in enumerate(zip(problem.balls, areas, contacts.approaches, strict=True)):
        if isinstance(ball.indenter, Indenter) and not isinstance(ball.indenter, HeightFunction):
            continue
        if _is_pointed(ball):
            return (f"the profile of ball {number} is pointed at its axis: its peak pressure has no limit",)
        radius, beside = float(np.sqrt(area / np.pi)), ""
        if 0.0 < NARROW * radius < approach - given_by_base(problem, number, forces, areas):
            beside = f"is less than 1/{NARROW:g} of its approach"
        elif radius > ball.radius:
            beside = f"exceeds the ball's radius, {ball.radius:g} m"
        if beside:
            return (
                f"the contact radius of ball {number}, {radius:.3g} m, {beside}; unless intended, check the units of "
                "its profile and of its radius",
            )
    return ()


def _is_pointed(ball: Ball) -> bool:
    """Return whether an own profile has a tip: a slope right beside its axis, in all directions."""
    near = 1e-9 * ball.radius
    x, y = near * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    body = ball.indenter
    heights = body.height(x, y) if isinstance(body, Indenter) else body(x, y)
    return bool(np.min(np.asarray(heights)) > POINTED * near)


def large_strain_notes(problem: Problem, approaches: Array, forces: Array, areas: Array) -> tuple[str, ...]:
    """Return notes where small strain does not hold: too deep for the layer, or for a round ball.

    ``approaches`` [m], normal ``forces`` [N] and contact ``areas`` [m^2] are those of all balls.
    """
    deepest = int(np.argmax(approaches))
    base = given_by_base(problem, deepest, forces, areas)
    notes = large_strain_note(problem.layer, float(approaches[deepest]), base)
    if any(MEANINGLESS in note for note in notes):
        return notes
    deep = tuple(f"{note}; finite_strain solves approaches up to about 0.9 of it" for note in notes)
    of_radius = {problem.balls[i].radius: int(i) for i in np.argsort(approaches) if is_ball(problem.balls[i])}
    shares = [
        (approaches[i] / radius, given_by_others(problem, i, forces) / radius)
        for radius, i in of_radius.items()
        if approaches[i] > radius
    ]
    return deep + ball_depth_note(*max(shares, key=lambda pair: pair[0] - pair[1], default=(0.0, 0.0)))


def unreached(limit: str, contacts: Contacts, of_forces: tuple[float, float], of_others: tuple[float, float]) -> str:
    """Return a note on errors, each reached and asked for, of T and of forces and approaches; ``limit`` ended it."""
    reference, largest = reference_force(contacts), float(np.max(np.abs(contacts.mutual_force)))
    size = f"{reference:.1e} N, as T nearly vanishes" if math.inf > reference > largest else "its size"
    return (
        f"{limit} reached: the error of T is {of_forces[0]:.1e} of {size}, {of_forces[1]:.1e} was asked for, that of "
        f"forces and approaches {of_others[0]:.1e}, {of_others[1]:.1e} was asked for"
    )


def small_force_note(contacts: Contacts, error: Array, wanted: float) -> tuple[str, ...]:
    """Return a note where T is so small that its error relative to itself exceeds the requested one."""
    largest, known = float(np.max(np.abs(contacts.mutual_force))), float(np.max(error))
    transmitted = float(np.max(pulls(contacts)))
    if contacts.problem.size == 1 or transmitted == 0.0 or known <= wanted * largest:
        return ()  # a single ball has no T, not even in a cell
    share = (
        f"{known / largest:.0e} of the largest T ({wanted:.0e} was requested)" if known < largest else "above every T"
    )
    return (
        f"T is close to zero: it is known to {known:.1e} N, which is {share} and {known / transmitted:.0e} of what a "
        "half-space would transmit",
    )
