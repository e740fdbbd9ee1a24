"""Decides which discretisation to run next and when to stop, by the required accuracy and the budget."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from finite_strain.planning.records import Discretisation, Record
from linear_bem.counts import grouped
from linear_bem.errors import InvalidProblem

PATH_FINDER = Discretisation(order=2, fineness=1.0)
"""The first discretisation; its states are predictors for the others."""
FIRST = Discretisation(order=3, fineness=1.0)
"""The first discretisation with results. The errors of higher ones are estimated against it: against the path finder
they would be overestimated (`python -m tests.finite_strain.bars`)."""
DEFAULT_UNKNOWNS = 120e3
"""Default limit on the unknowns of the finest mesh."""
ORDER = 3.0
"""Order of convergence in the element size, for the size of the next mesh; from the theory in `error_budget`."""
SECONDS_POWER = 1.4
"""Seconds grow with this power of the unknowns: between assembly (1) and a direct solver in space (2)."""
HIGHEST = 4
"""Highest order of the elements; beyond it the mesh is refined."""
STEP = 0.5
"""Smallest increment of the fineness between successive meshes; it sets the number of elements around a contact."""
WIDER, STIFFER = 1.5, 8.0
"""Growth factors of the domain and of the penalty where they limit the accuracy."""
MOST_LEVELS = 8
"""Largest number of discretisations of a run."""
STEADY = 0.5
"""Remaining fraction of an error above which a refinement did not reduce the cause of the error."""


@dataclass(frozen=True)
class Budget:
    """The budget of refinement: wall seconds of the whole run, and unknowns of its finest mesh (None: default)."""

    seconds: float | None = None
    unknowns: float | None = None

    def __post_init__(self) -> None:
        wrong = {name: value for name, value in vars(self).items() if value is not None and not value > 0.0}
        if wrong:
            raise InvalidProblem(*(f"accuracy.{name}: must be greater than 0, got {wrong[name]:g}" for name in wrong))
        for name, value in vars(self).items():
            if isinstance(value, np.generic):  # which cannot be written as JSON
                object.__setattr__(self, name, value.item())

    @property
    def most_unknowns(self) -> float:
        """The bound on the unknowns of any mesh."""
        return DEFAULT_UNKNOWNS if self.unknowns is None else self.unknowns


def decide(  # noqa: PLR0911  (each return is one reason to stop)
    asked: float, records: Sequence[Record], budget: Budget, unknowns: Callable[[Discretisation], float],
    mesh_given: bool = False,
) -> Discretisation | str:  # fmt: skip
    """Return the discretisation to run after the last finished record, or why there is none.

    ``unknowns`` estimates the number of unknowns. With a user's mesh, only order and penalty are raised.
    """
    last = records[-1]
    if len(records) == 1:
        return FIRST  # an error estimate needs two discretisations
    if last.reached <= asked and last.resolved:
        return "the accuracy asked for is met"
    if len(records) >= MOST_LEVELS:
        return f"{MOST_LEVELS} discretisations did not reach it"
    if last.resolved:
        level = _next(asked, records)
    elif records[-2].resolved:  # order and penalty do not help elements that are nearly turned inside out
        level = replace(last.level, fineness=last.level.fineness + STEP)
    else:
        level = "elements nearly turned inside out, on a finer mesh as well"
    if isinstance(level, str):
        return f"the accuracy is limited by {level}"
    if mesh_given and (level.fineness, level.extent) != (last.level.fineness, last.level.extent):
        return "a user's mesh is neither refined nor widened: give a finer or wider one"

    def size(each: Discretisation) -> float:
        return unknowns(each) * last.unknowns / unknowns(last.level)

    if not mesh_given:
        level = _affordable(level, records, lambda each: size(each) > budget.most_unknowns)
    wanted = size(level)
    following = f"the next discretisation ({level})"
    if wanted > budget.most_unknowns:
        most = grouped(budget.most_unknowns)
        return f"{following}, about {grouped(wanted)} unknowns, passes the budget of {most} unknowns"
    if budget.seconds is not None:
        spent = sum(record.seconds for record in records)
        needed = last.seconds * (wanted / last.unknowns) ** SECONDS_POWER
        if spent + needed > budget.seconds:
            return (
                f"{following} would take about {needed:.0f} s and pass the budget of {budget.seconds:g} s "
                f"({spent:.0f} s spent)"
            )
    return level


def coarser(records: Sequence[Record]) -> Record:
    """Return the record with which the last one is compared: the latest of lower resolution."""
    *earlier, fine = records
    return next((r for r in reversed(earlier) if r.level.resolution < fine.level.resolution), earlier[-1])


def _next(asked: float, records: Sequence[Record]) -> Discretisation | str:
    """Return the discretisation that reduces the largest error term, or the error that no discretisation reduces."""
    last, before = records[-1], records[-2]
    level = last.level
    largest = _largest(last)
    if largest == "solver" and math.isfinite(last.reached):
        return "the solver's tolerance"
    if largest == "enforcement":
        stiffened = replace(before.level, penalty=level.penalty) == level != before.level
        if not stiffened or last.terms[largest] < STEADY * before.terms.get(largest, 0.0):
            return replace(level, penalty=STIFFER * level.penalty)
        if level.order == HIGHEST:  # penalties do not depend on the mesh
            return "penetration: Newton's method fails with stiffer penalties"
        level = before.level
    steady = bool(before.terms) and last.terms.get("transfer", 0.0) > STEADY * before.terms["transfer"]
    if _may_widen(last, before) and (steady or level.extent > before.level.extent):
        return replace(level, extent=WIDER * level.extent)
    if level.order < HIGHEST:
        return replace(level, order=level.order + 1)
    ratio = last.reached / asked if math.isfinite(last.reached) else 8.0
    wanted = min(max(level.fineness * ratio ** (1.0 / ORDER), level.fineness + STEP), 2.0 * level.fineness)
    return replace(level, fineness=STEP * math.ceil(wanted / STEP - 1e-9))


def _affordable(
    level: Discretisation, records: Sequence[Record], is_too_large: Callable[[Discretisation], bool]
) -> Discretisation:
    """Return the level, less fine if it is too large, or a wider domain if it still is and this may help."""
    last = records[-1]
    while is_too_large(level) and level.fineness > last.level.fineness + STEP:
        level = replace(level, fineness=level.fineness - STEP)
    wider = replace(last.level, extent=WIDER * last.level.extent)
    may_help = is_too_large(level) and not is_too_large(wider) and _may_widen(last, records[-2])
    return wider if may_help else level


def _largest(record: Record) -> str:
    """Return the name of the largest error term."""
    return max(record.terms, key=lambda name: record.terms[name], default="discretisation")


def _may_widen(last: Record, before: Record) -> bool:
    """Return whether a wider domain may reduce the largest error, and has reduced it if it was widened.

    An error of truncation falls at least as the root of the width. An unknown error at full load stays unknown: the
    path finder, with which a wider domain is compared, did not reach it.
    """
    if _largest(last) != "transfer" or not last.resolved or not math.isfinite(last.reached):
        return False
    ratio = last.level.extent / before.level.extent
    return ratio <= 1.0 or last.terms["transfer"] < before.terms["transfer"] / math.sqrt(ratio)


def account(
    asked: float, records: Sequence[Record], answered: int, budget: Budget, stopped: str, reference: str
) -> Mapping[str, Any]:
    """Return the accuracy record of a result: required, reached, discretisations, reason for stopping."""
    last = records[answered]
    meshes = [
        {
            **asdict(record.level), "unknowns": record.unknowns, "seconds": record.seconds,
            "reached": None if record.reached != record.reached else record.reached,
            "normal_forces": record.rows[-1].own.normal_force.tolist(),
        }
        for record in records[: answered + 1]
        if record.rows
    ]  # fmt: skip
    return {
        "asked": asked, "reached": last.reached, "met": last.reached <= asked, "terms": dict(last.terms),
        "relative_to": {"what": reference, "force": last.scale}, "stopped": stopped,
        "budget": {"seconds": budget.seconds, "unknowns": budget.most_unknowns}, "meshes": meshes,
    }  # fmt: skip
