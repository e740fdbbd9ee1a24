"""What a model says at a load step, and what the discretisations of a run said so far: values, and their JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.errors import OutputUnusable

NAME = "discretisations.json"


@dataclass(frozen=True)
class ContactState:
    """One model's equilibrium on one discretisation; arrays have one entry per ball of the model, whole balls.

    ``penetration`` [m] is the largest; ``mean_gap`` [m] is weighted with the pressure, negative where the surface lies
    inside the ball; ``traction_force`` is T by the second route.
    """

    fraction: float
    approach: np.ndarray
    normal_force: np.ndarray
    tangential_force: np.ndarray
    traction_force: np.ndarray
    contact_area: np.ndarray
    peak_pressure: np.ndarray
    penetration: np.ndarray
    mean_gap: np.ndarray

    @property
    def per_squared_force(self) -> np.ndarray:
        """T / Q^2 (balls, 2) [1/N], zero without force."""
        squared = self.normal_force[:, None] ** 2
        return np.divide(self.tangential_force, squared, out=np.zeros_like(self.tangential_force), where=squared > 0.0)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ContactState:
        """Return the state that `text_of` wrote."""
        arrays = {name: np.array(value, dtype=float) for name, value in data.items() if name != "fraction"}
        return cls(fraction=float(data["fraction"]), **arrays)


@dataclass(frozen=True)
class Row:
    """What one discretisation says at a load step: the run's own model, and the small-strain one where it could."""

    own: ContactState
    small: ContactState | None = None

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Row:
        """Return the row that `text_of` wrote."""
        small = data["small"]
        return cls(ContactState.from_dict(data["own"]), None if small is None else ContactState.from_dict(small))


@dataclass(frozen=True)
class Discretisation:
    """Order of the elements, fineness of the mesh (see `meshes.box`), and extent and penalty over the planned ones."""

    order: int
    fineness: float
    extent: float = 1.0
    penalty: float = 1.0

    def __str__(self) -> str:
        wider = f", domain {self.extent:.2g} times as wide" if self.extent != 1.0 else ""
        stiffer = f", penalty {self.penalty:.2g} times as stiff" if self.penalty != 1.0 else ""
        return f"order {self.order}, fineness {self.fineness:g}{wider}{stiffer}"


@dataclass
class Record:
    """One discretisation of a run: what it is, what it answered at each load step, and what it took.

    ``reached`` is the largest error of T at full load over ``scale`` [N]; ``stopped`` says why it did not come to full
    load; ``steps`` are the answers (JSON objects of `linear_bem.result.Step`).
    """

    level: Discretisation
    unknowns: int = 0
    seconds: float = 0.0
    finished: bool = False
    rows: list[Row] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)
    terms: dict[str, float] = field(default_factory=dict)
    reached: float = math.nan
    scale: float = math.nan
    stopped: str = ""

    def at(self, fraction: float) -> Row | None:
        """Return what was answered at a load fraction."""
        return next((row for row in self.rows if row.own.fraction == fraction), None)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Record:
        """Return the record that `text_of` wrote."""
        parts = {"level": Discretisation(**data["level"]), "rows": [Row.from_dict(row) for row in data["rows"]]}
        return cls(**{**data, **parts})


def text_of(key: str, records: list[Record]) -> str:
    """Return the text of the file that holds every discretisation of a run."""
    return json.dumps({"key": key, "discretisations": list(map(asdict, records))}, default=np.ndarray.tolist)


def saved_records(path: Path, key: str) -> list[Record]:
    """Return what an earlier run of the same key left in a file."""
    try:
        saved = json.loads(path.read_text(encoding="utf-8"))
        return [Record.from_dict(record) for record in saved["discretisations"]] if saved["key"] == key else []
    except FileNotFoundError:
        return []
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise OutputUnusable(f"{path} cannot be read ({error}): remove it to start anew") from error
