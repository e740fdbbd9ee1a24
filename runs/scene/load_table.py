"""The scene's table [load]: one key of the load, and the intermediate load steps."""

from functools import partial
from typing import Self

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from linear_bem.errors import InvalidProblem
from linear_bem.problem import LoadKind
from runs.scene.units import Force, Forces, Lengths, Listed, OneOrMany, Table, fault, many, number, quantity

LOAD_KEYS: tuple[LoadKind, ...] = ("approach", "force", "total_force")
SAME = 1e-9
"""Relative difference below which a load step is full load."""


class LoadTable(Table):
    """[load]: exactly one of ``approach``, ``force`` and ``total_force``, and optional intermediate ``steps``."""

    approach: Lengths | None = None
    """Depth of each ball's lowest point below the undeformed surface."""
    force: Forces | None = None
    """Normal force on each ball; its approach results from it."""
    total_force: Force | None = None
    """Normal force on a rigid holder that presses all balls equally deep and does not tilt."""
    steps: Listed | None = None
    """Intermediate loads with output, in rising order; where the balls' loads differ, as fractions of full load."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        named = [key for key in LOAD_KEYS if getattr(self, key) is not None]
        if len(named) != 1:
            got = f"{len(named)} ({', '.join(named)})" if named else "none of them"
            raise fault(f"needs exactly one of approach, force, total_force, got {got}")
        return self

    @property
    def given(self) -> tuple[LoadKind, OneOrMany]:
        """The key that is given, and its value."""
        return next((key, value) for key in LOAD_KEYS if (value := getattr(self, key)) is not None)

    def fractions(self) -> tuple[float, ...] | None:
        """Return the steps as fractions of the load, full load appended; raises `InvalidProblem`."""
        if self.steps is None:
            return None
        kind, value = self.given
        loads = set(value) if isinstance(value, tuple) else {value}
        alike = len(loads) == 1
        full = loads.pop() if alike else 1.0
        unit = "" if not alike else "m" if kind == "approach" else "N"
        what = f"of {kind}" if unit else "between 0 and 1, fractions of the unlike loads"
        written = ", ".join(str(step) for step in self.steps) or "none"
        try:
            steps = many([*self.steps], partial(quantity, unit=unit) if unit else number, "step")
        except PydanticCustomError as error:
            remedy = "" if unit else "; write steps = [0.25, 0.5]"
            raise InvalidProblem(
                f"load.steps: must hold values {what} ({error.message()}), got {written}{remedy}"
            ) from None
        if not steps or steps[0] <= 0.0 or steps != tuple(sorted({*steps})):
            raise InvalidProblem(f"load.steps: must be greater than 0 and rise, got {written}; list small loads first")
        if not full * (1.0 + SAME) >= steps[-1]:
            most, got = (f"{value:g} {unit}".rstrip() for value in (full, steps[-1]))
            rule = f"must not exceed the load of {most}, got {got}"
            bare = any(not isinstance(step, str) for step in self.steps) and unit
            meant = f", or write its unit: bare numbers are in {unit}" if bare else ""
            raise InvalidProblem(f"load.steps: {rule}; raise {kind} or drop the step{meant}")
        return (*(step / full for step in steps if step < full * (1.0 - SAME)), 1.0)
