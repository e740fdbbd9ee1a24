"""The meshes that ran before along the same load path: their differences from the present one are the mesh error."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.errors import OutputUnusable

NAME = "companion.json"


@dataclass(frozen=True)
class CoarseState:
    """What a coarser mesh answers at a load fraction: T / Q^2 (balls, 2) [1/N], Q [N] and D [m] (balls,)."""

    per_squared_force: np.ndarray
    normal_forces: np.ndarray
    approaches: np.ndarray


@dataclass
class MeshRecord:
    """What one mesh of the sequence answered and cost.

    ``size`` is its element size over the main mesh's; ``rows`` hold T / Q^2 [1/N], Q [N] and D [m] of the
    model's balls at each load fraction; ``steps`` the answers, where a coarser mesh allows any; ``reached``
    the largest error of T at full load over ``scale`` [N]; ``stopped`` says why the mesh did not come to full load.
    """

    size: float
    unknowns: int = 0
    seconds: float = 0.0
    finished: bool = False
    rows: list[dict[str, Any]] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)
    reached: float = math.nan
    scale: float = math.nan
    stopped: str = ""

    def at(self, fraction: float) -> CoarseState:
        """Return the mesh's answer at a load fraction that it met; finer meshes answer at no other."""
        row = next(row for row in self.rows if row["fraction"] == fraction)
        return CoarseState(*(np.array(row[name]) for name in ("per_squared_force", "normal_forces", "approaches")))

    def goals(self, planned: Sequence[float]) -> list[float]:
        """Return the load fractions that finer meshes answer at: the planned ones, as far as this mesh came."""
        met = [row["fraction"] for row in self.rows]
        return [fraction for fraction in planned if fraction in met] + ([met[-1]] if met[-1] not in planned else [])


def text_of(key: str, records: list[MeshRecord]) -> str:
    """Return the text of the file that holds every mesh of a run."""
    return json.dumps({"key": key, "meshes": [asdict(record) for record in records]})


def saved_records(path: Path, key: str) -> list[MeshRecord]:
    """Return the meshes that an earlier run of the same key left in a file."""
    try:
        saved = json.loads(path.read_text(encoding="utf-8"))
        return [MeshRecord(**record) for record in saved["meshes"]] if saved["key"] == key else []
    except FileNotFoundError:
        return []
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise OutputUnusable(f"{path} cannot be read ({error}): remove it to start anew") from error
