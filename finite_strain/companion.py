"""The coarser mesh that runs ahead along the same load path: its difference from the main mesh is the mesh error."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from finite_strain.planning import COARSENING
from linear_bem.errors import OutputUnusable

FORCE_RATIO_ORDER = 4.0
"""Order of convergence of T / Q^2 in the element size that its extrapolation assumes; 3.5 to 5 are observed."""
CAUTIOUS_ORDER = 2.0
"""The order that the error of T / Q^2 is estimated with."""
INDENTATION_ORDER = 3.0
"""The same for Q at given approach and D at given force, which feel the contact's edge; 2.7 to 3.2 are observed."""


def gain(order: float) -> float:
    """Return what the difference of the two meshes must be multiplied with to remove the finer one's error."""
    return 1.0 / (COARSENING**order - 1.0)


def extrapolated(fine: np.ndarray, coarse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return forces or approaches extrapolated from both meshes, and their errors; none changes its sign."""
    change = gain(INDENTATION_ORDER) * (fine - coarse)
    return np.where(fine * (fine + change) > 0.0, fine + change, fine), np.abs(change)


@dataclass(frozen=True)
class CoarseState:
    """What the companion mesh answers at a load fraction: T / Q^2 (balls, 2) [1/N], Q [N] and D [m] (balls,)."""

    per_squared_force: np.ndarray
    normal_forces: np.ndarray
    approaches: np.ndarray


class Companion:
    """The answers of the companion mesh along the load path."""

    def __init__(self, rows: list[dict[str, Any]]) -> None:
        self.rows = rows

    def at(self, fraction: float) -> CoarseState:
        """Return the companion's answer at a load fraction, interpolated in its logarithm between load steps."""
        x = np.log([row["fraction"] for row in self.rows])
        at = math.log(fraction)

        def interpolated(name: str) -> np.ndarray:
            values = np.array([row[name] for row in self.rows])
            # Q and D follow powers of the fraction, so they are interpolated relative to it
            power = np.array([row["fraction"] for row in self.rows]) if name != "per_squared_force" else np.ones(len(x))
            flat = values.reshape(len(x), -1) / power[:, None]
            scale = fraction if name != "per_squared_force" else 1.0
            return scale * np.array([np.interp(at, x, column) for column in flat.T]).reshape(values.shape[1:])

        return CoarseState(*(interpolated(name) for name in ("per_squared_force", "normal_forces", "approaches")))


def saved_rows(path: Path, key: str) -> list[dict[str, Any]]:
    """Return the load steps that an earlier run of the same key left in a file."""
    try:
        saved = json.loads(path.read_text(encoding="utf-8"))
        return saved["rows"] if saved["key"] == key else []
    except FileNotFoundError:
        return []
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise OutputUnusable(f"{path} cannot be read ({error}): remove it to start anew") from error
