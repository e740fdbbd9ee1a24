"""Which cases are worth their time: the Pareto front of error against seconds, and the columns that it is drawn of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

OWN, TRUE = "error within the model", "error against finite strain"
"""Columns: relative errors of T against a better solution of the same model, and against the finite-strain answer."""
LADDER = ("model", "accuracy asked")
"""Knobs that a user turns, of which advice is drawn; the others are the solver's own."""


def front(rows: Sequence[Mapping[str, Any]], column: str) -> list[Mapping[str, Any]]:
    """Return the rows that no other beats in both error and seconds, cheapest first.

    Errors count no smaller than what their reference is known to.
    """

    def error(row: Mapping[str, Any]) -> float:
        return float(max(row[column], row[f"{column}, known to"] or 0.0))

    best: list[Mapping[str, Any]] = []
    for row in sorted((row for row in rows if row[column] is not None), key=lambda r: (r["seconds"], error(r))):
        if not best or error(row) < error(best[-1]):
            best.append(row)
    return best
