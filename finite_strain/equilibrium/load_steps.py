"""Which load fractions a run passes on its way to full load."""

from __future__ import annotations

import math
from collections.abc import Sequence

from linear_bem.problem import LoadKind

ANSWERS = 6
"""Load steps of a comparison along the load."""


def load_fractions(kind: LoadKind, deepest: float, goals: Sequence[float], largest: float) -> tuple[float, ...]:
    """Return rising fractions of the load that meet all goals, for a deepest approach over its ball's radius.

    ``largest`` is the largest increment of that.

    Fractions are of the approach where that is prescribed, and of the force otherwise, with
    Q ~ D^(3/2) between the two. Between two goals steps of the approach are equal.
    """
    power = _power(kind)
    fractions, before = list[float](), 0.0
    for goal in goals:
        after = goal ** (1.0 / power)
        parts = max(math.ceil(deepest * (after - before) / largest - 1e-9), 1)
        fractions += [*((before + (after - before) * n / parts) ** power for n in range(1, parts)), goal]
        before = after
    return tuple(fractions)


def answered_fractions(kind: LoadKind) -> tuple[float, ...]:
    """Return the load fractions that a comparison along the load answers at: equal steps of the approach."""
    return tuple((n / ANSWERS) ** _power(kind) for n in range(1, ANSWERS + 1))


def _power(kind: LoadKind) -> float:
    return 1.0 if kind == "approach" else 1.5
