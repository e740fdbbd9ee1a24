"""Which load fractions a run passes on its way to full load."""

from __future__ import annotations

from linear_bem.problem import LoadKind

GROWTH = 1.5
"""Largest ratio of successive approaches; the contact radius grows by about its square root."""
LARGEST_STEP = 0.13
"""Largest increment of the approach over the radius."""
ANSWERS = 6
"""Load steps of a comparison along the load."""
FIRST = 0.13
"""First approach over the radius: Newton's method reaches it from the undeformed layer."""


def load_fractions(kind: LoadKind, deepest: float) -> list[float]:
    """Return increasing fractions of the load that end in 1, for a deepest (expected) approach over its ball's radius.

    Fractions are of the approach where that is prescribed, and of the force otherwise, with
    Q ~ D^(3/2) between the two.
    """
    approaches = [deepest]
    while approaches[-1] > FIRST * GROWTH**0.5:
        approaches.append(max(approaches[-1] / GROWTH, approaches[-1] - LARGEST_STEP))
    power = 1.0 if kind == "approach" else 1.5
    return [(a / approaches[0]) ** power for a in reversed(approaches)]


def answered_fractions(kind: LoadKind) -> list[float]:
    """Return the load fractions that a comparison along the load answers at: equal steps of the approach."""
    power = 1.0 if kind == "approach" else 1.5
    return [(n / ANSWERS) ** power for n in range(1, ANSWERS + 1)]
