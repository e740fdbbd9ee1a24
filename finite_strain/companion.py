"""The meshes that ran before along the same load path: their differences from the present one are the mesh error."""

from __future__ import annotations

import json
import math
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
    the largest error of T at full load over ``scale`` [N].
    """

    size: float
    unknowns: int = 0
    seconds: float = 0.0
    finished: bool = False
    rows: list[dict[str, Any]] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)
    reached: float = math.nan
    scale: float = math.nan

    def at(self, fraction: float) -> CoarseState:
        """Return the mesh's answer at a load fraction, interpolated in its logarithm between load steps.

        Q and D follow powers of the fraction, so their logarithms are interpolated where they have one.
        """
        x = np.log([row["fraction"] for row in self.rows])

        def interpolated(name: str) -> np.ndarray:
            values = np.array([row[name] for row in self.rows])
            columns = []
            for column in values.reshape(len(x), -1).T:
                if name != "per_squared_force" and np.all(column > 0.0):
                    columns.append(math.exp(np.interp(math.log(fraction), x, np.log(column))))
                else:
                    columns.append(float(np.interp(math.log(fraction), x, column)))
            return np.array(columns).reshape(values.shape[1:])

        return CoarseState(*(interpolated(name) for name in ("per_squared_force", "normal_forces", "approaches")))


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
