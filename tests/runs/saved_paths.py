"""Load paths as a study saves them, made up: a ball, a path by a power law, and cases that are done."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from runs.studies.framework.saved_cases import Found


def ball(depth: float, force: float, pull: float = -1e-3, error: float | None = 1e-5) -> dict[str, Any]:
    return {
        "position": [-1.0, 0.0], "radius": 1.0, "approach": depth, "normal_force": force, "contact_area": depth,
        "peak_pressure": 1.0, "tangential_force": [pull, 0.0], "tangential_force_error": error,
        "tangential_force_routes": {},
    }  # fmt: skip


def path(power: float, *depths: float, stored: float = 1.0, **record: Any) -> list[dict[str, Any]]:
    """Return a load path with Q = D^power whose last stored energy is ``stored`` times the work."""
    done = depths[-1] ** (power + 1.0) / (power + 1.0)
    return [
        {"balls": [ball(d, d**power)], "record": {"force_balance": 1e-9, "strain_energy": stored * done, **record}}
        for d in depths
    ]


def found(**records: Mapping[str, Any]) -> Found:
    return Found((), {name: {"state": "done", **record} for name, record in records.items()})
