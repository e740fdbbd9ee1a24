"""The contact of a rigid height field: its fields, its numbers, and a note where the grid is coarse."""

import html
import json
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from linear_bem.counts import grouped
from linear_bem.errors import InvalidProblem

COARSE = 0.25
"""Relative error of the contact area above which a note says that the grid is coarse."""


@dataclass(frozen=True)
class HeightFieldContact:
    """Pressure [Pa] and displacement [m] at the cells, approach [m], force [N], mean gap [m], contact area [m^2].

    ``cell`` is the side of a cell [m]. Arrays have the shape of the heights; displacements are positive into the layer.
    For a periodic surface, values are those of one period and, unless the base is rigid, displacement and approach are
    measured from the mean of the deformed surface. ``contact_area`` is that of the cells in contact, minus the part by
    which cells at its edges exceed the contact on average; ``contact_area_error`` comes from the edges' unknown
    position within cells (`linear_bem.grid.outline`). ``gap_in_contact`` and ``penetration_outside`` are recomputed
    residuals over the approach. ``notes`` warn if a layer is indented by more than a quarter of its thickness, where
    small strain does not hold, if contact spots are only a few cells wide, and if the slopes of the heights are so
    large that a unit may be wrong.
    """

    pressure: Array = field(repr=False)
    displacement: Array = field(repr=False)
    cell: float
    approach: float
    normal_force: float
    mean_gap: float
    contact_area: float
    contact_area_error: float
    iterations: int
    gap_in_contact: float
    penetration_outside: float
    notes: tuple[str, ...] = ()

    def summary(self) -> str:
        """Return the numbers of the contact, in SI units, and the notes as text."""
        area, error, peak = self.contact_area, self.contact_area_error, float(np.max(self.pressure))
        lines = [
            f"{grouped(self.pressure.size)} cells, {self.iterations} iteration{'' if self.iterations == 1 else 's'}",
            f"normal force {self.normal_force:.5g} N, approach {self.approach:.5g} m, mean gap {self.mean_gap:.5g} m",
            f"contact area {area:.4g} ± {error:.2g} m^2, largest pressure {peak:.4g} Pa",
        ]
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.summary())}</pre>"

    def plot(self) -> Any:
        """Return a matplotlib figure: a map of the contact pressure."""
        from linear_bem.plotting import map_of_pressure  # noqa: PLC0415  (matplotlib, only where something is drawn)

        return map_of_pressure(self.pressure, self.cell)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, HeightFieldContact):
            return NotImplemented
        return all(np.array_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def __hash__(self) -> int:
        return hash((self.cell, self.approach, self.normal_force, self.iterations))

    def to_json(self) -> str:
        """Return the JSON text, arrays as nested lists; `from_json` gives back the same numbers to the last bit."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return json.dumps({k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()})

    @classmethod
    def from_json(cls, text: str) -> "HeightFieldContact":
        """Return the contact that `to_json` wrote; raises `InvalidProblem`."""
        try:
            data = json.loads(text)
            arrays = {key: np.array(data[key], dtype=float) for key in ("pressure", "displacement")}
            return cls(**{**data, **arrays, "notes": tuple(data["notes"])})
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidProblem(
                f"from_json: must be the text that to_json wrote, got {text!r:.60}: {error}"
            ) from error


def coarse_note(found: HeightFieldContact) -> tuple[str, ...]:
    """Return a note on contact spots of so few cells that their area is hardly known."""
    share = found.contact_area_error / found.contact_area
    if share <= COARSE:
        return ()
    return (
        f"the contact area is known to {100.0 * share:.0f} % only, as contact spots are a few cells wide; sample the "
        "surface more finely if it is smooth between cells",
    )
