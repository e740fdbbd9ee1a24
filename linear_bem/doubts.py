"""Notes on a doubtful solution: where small strain does not hold, and own profiles that seem wrong."""

import math

import numpy as np

from linear_bem.arrays import Array
from linear_bem.depth import MEANINGLESS, ball_depth_note, dent, large_strain_note
from linear_bem.dual import POINTED
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
    radii, base = np.sqrt(contacts.contact_areas / np.pi), _given_by_base(*loads_of(contacts))
    for number, (ball, radius, approach) in enumerate(
        zip(contacts.problem.balls, radii, contacts.approaches, strict=True)
    ):
        own = not isinstance(ball.indenter, Indenter) or isinstance(ball.indenter, HeightFunction)
        if own and _is_pointed(ball):
            return (f"the profile of ball {number} is pointed at its axis: its peak pressure has no limit",)
        beside = f"exceeds the ball's radius, {ball.radius:g} m" if radius > ball.radius else ""
        beside = f"is less than 1/{NARROW:g} of its approach" if 0.0 < NARROW * radius < approach - base else beside
        if own and beside:
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


def loads_of(contacts: Contacts) -> tuple[Problem, Array, Array, Array]:
    """Return the arguments of `large_strain_notes` for solved contacts."""
    return contacts.problem, contacts.approaches, contacts.normal_forces, contacts.contact_areas


def large_strain_notes(problem: Problem, approaches: Array, forces: Array, areas: Array) -> tuple[str, ...]:
    """Return notes where small strain does not hold: too deep for the layer, or for a round ball.

    ``approaches`` [m], normal ``forces`` [N] and contact ``areas`` [m^2] are those of all balls.
    """
    notes = large_strain_note(
        problem.layer, float(np.max(approaches)), _given_by_base(problem, approaches, forces, areas)
    )
    if any(MEANINGLESS in note for note in notes):
        return notes
    deep = tuple(f"{note}; finite_strain solves approaches up to about 0.9 of it" for note in notes)
    shares = (d / ball.radius for d, ball in zip(approaches, problem.balls, strict=True) if is_ball(ball))
    return deep + ball_depth_note(max(shares, default=0.0))


def _given_by_base(problem: Problem, approaches: Array, forces: Array, areas: Array) -> float:
    """Return about how deep [m] the substrate is dented under the deepest ball, by its own force and by the others'."""
    substrate, ball = problem.substrate, int(np.argmax(approaches))
    own = dent(substrate, problem.layer.thickness, float(forces[ball]), float(areas[ball]))
    if substrate is None or problem.size == 1 or problem.periodic is not None:
        return own  # in a cell approaches do not contain the mean level of the base
    away = np.hypot(*(np.delete(problem.positions, ball, axis=0) - problem.positions[ball]).T)
    return own + float(np.sum(np.delete(forces, ball) / away)) / (math.pi * substrate.contact_modulus)
