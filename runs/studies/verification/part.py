"""A part of the study: its cases and its table, with a verdict in each row."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from runs.studies.framework.case import Case
from runs.studies.framework.saved_cases import Found

COARSE = 0.2
"""Relative accuracy of T in the quick version, which gives the coarsest meshes."""
RIGHT, WRONG = "right", "WRONG"
"""Verdicts of a row; None where nothing is claimed."""
WIDEST = 0.1
"""Relative error bar above which an answer gets no verdict."""
Row = Mapping[str, Any]


def claimed(holds: bool, bar: float = 0.0) -> str | None:
    """Return the verdict on a row; ``bar`` is its own relative error bar."""
    return None if bar > WIDEST else RIGHT if holds else WRONG


@dataclass(frozen=True)
class Part:
    """One question: ``cases`` of the quick or the full version, and the ``rows`` of its table.

    A row's "verdict" is one of those above.
    """

    name: str
    title: str
    cases: Callable[[bool], list[Case]]
    rows: Callable[[Found], list[dict[str, Any]]]
