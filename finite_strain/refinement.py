"""How finely to mesh next, and when to stop: the accuracy asked for against a stated budget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from finite_strain.companion import MeshRecord
from finite_strain.extrapolation import CAUTIOUS_ORDER
from linear_bem.errors import InvalidProblem

DEFAULT_UNKNOWNS = 60e3
"""Unknowns that the finest mesh may have where nothing is stated, or `DEFAULT_GROWTH` times the main mesh's."""
DEFAULT_GROWTH = 2.5
LEAST_RATIO, LARGEST_RATIO = 1.15, 1.6
"""Bounds of the ratio of element sizes of successive meshes: their difference must show, and tell an order."""
SECONDS_POWER = 1.4
"""Seconds grow with this power of the unknowns: between assembly (1) and a direct solver in space (2)."""
MARGIN = 0.9
"""Part of the accuracy asked for that the next mesh is sized for."""
MOST_MESHES = 6


@dataclass(frozen=True)
class Budget:
    """What refinement may cost: wall seconds of the whole run, and unknowns of its finest mesh (None: default)."""

    seconds: float | None = None
    unknowns: float | None = None

    def __post_init__(self) -> None:
        faults = [
            f"accuracy.{name}: must be greater than 0, got {value:g}"
            for name, value in (("seconds", self.seconds), ("unknowns", self.unknowns))
            if value is not None and not value > 0.0
        ]
        if faults:
            raise InvalidProblem(*faults)

    def most_unknowns(self, main: float) -> float:
        """Return the bound on the unknowns of any mesh, for a main mesh with some unknowns."""
        return max(DEFAULT_UNKNOWNS, DEFAULT_GROWTH * main) if self.unknowns is None else self.unknowns


@dataclass(frozen=True)
class Decision:
    """The element size of the next mesh over the main mesh's (None: no further mesh), and why."""

    size: float | None
    why: str


def first_ratio(wanted: float, companion: MeshRecord, budget: Budget) -> float:
    """Return how much finer than its companion the main mesh is: as planned, or what the seconds left allow."""
    if budget.seconds is None:
        return wanted
    left = max(budget.seconds - companion.seconds, 0.0)
    affordable = (left / max(companion.seconds, 1e-9)) ** (1.0 / (3.0 * SECONDS_POWER))
    return min(wanted, max(affordable, LEAST_RATIO))


def decide(asked: float, records: list[MeshRecord], budget: Budget, unavoidable: float) -> Decision:
    """Return whether and how finely to mesh again after the last of the finished meshes.

    ``unavoidable`` is the part of the relative error that no mesh removes.
    """
    last, main = records[-1], records[1]
    if last.reached <= asked:
        return Decision(None, "the accuracy asked for is met")
    if unavoidable >= MARGIN * asked:
        return Decision(None, "what remains is not the mesh's: the model's end or the solver's tolerance")
    if len(records) > MOST_MESHES:
        return Decision(None, f"{MOST_MESHES} refinements did not reach it")
    wanted = ((last.reached - unavoidable) / (MARGIN * asked - unavoidable)) ** (1.0 / CAUTIOUS_ORDER)
    wanted = min(max(wanted, LEAST_RATIO), LARGEST_RATIO)
    bounds = {
        f"{budget.most_unknowns(main.unknowns):.6g} unknowns": budget.most_unknowns(main.unknowns) / last.unknowns
    }
    if budget.seconds is not None:
        spent = sum(record.seconds for record in records)
        if spent >= budget.seconds:
            return Decision(None, f"the budget of {budget.seconds:g} s is spent: {spent:.0f} s")
        left = budget.seconds - spent
        bounds[f"{budget.seconds:g} s"] = max(left / last.seconds, 0.0) ** (1.0 / SECONDS_POWER)
    name, growth = min(bounds.items(), key=lambda item: item[1])
    ratio = min(wanted, growth ** (1.0 / 3.0))
    if ratio < LEAST_RATIO:
        next_unknowns = LEAST_RATIO**3 * last.unknowns
        return Decision(None, f"a mesh of {next_unknowns:.2g} unknowns or more would pass the budget of {name}")
    return Decision(last.size / ratio, f"the error is {100 * last.reached:.2g} %, {100 * asked:.2g} % was asked for")


def account(
    asked: float, records: list[MeshRecord], answered: int, budget: Budget, stopped: str, reference: str
) -> Mapping[str, Any]:
    """Return the structured account of accuracy for a result: asked, reached, the meshes used, why it ended."""
    last = records[answered]
    return {
        "asked": asked,
        "reached": last.reached,
        "met": last.reached <= asked,
        "relative_to": {"what": reference, "force": last.scale},
        "stopped": stopped,
        "budget": {
            "seconds": budget.seconds,
            "unknowns": budget.most_unknowns(records[1].unknowns) if len(records) > 1 else budget.unknowns,
        },
        "meshes": [
            {
                "element_size": record.size,
                "unknowns": record.unknowns,
                "seconds": record.seconds,
                "reached": None if record.reached != record.reached else record.reached,
                "tangential_force_per_squared_force": record.rows[-1]["per_squared_force"],
                "normal_forces": record.rows[-1]["normal_forces"],
            }
            for record in records[: answered + 1]
        ],
    }
