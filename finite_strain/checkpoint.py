"""The last finished load step on disk: enough to go on from it on any number of ranks.

Displacements and pressures are kept by node position, so ranks and DOLFINx versions may change in between; the mesh
may not. A checkpoint is replaced as a whole, never half-written.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from finite_strain.fields import Values
from finite_strain.gather import gather_rows, match_rows
from finite_strain.loading import State
from finite_strain.model import Model
from finite_strain.together import on_root
from linear_bem.errors import OutputUnusable
from linear_bem.result import Step

NAME = "checkpoint.h5"
_VALUES = ("values", "penalised")
"""Names of what a state holds of every field: the displacement is number 0, pressures follow."""


def write_checkpoint(folder: Path, model: Model, history: list[State], steps: list[Step], key: str) -> None:
    """Write the last states and all finished steps (collective); ``key`` identifies problem and settings."""
    comm = model.comm
    owned = model.fields.owned

    def gathered(values: Values) -> list[np.ndarray | None]:
        return [gather_rows(rows[:count], comm) for rows, count in zip(values, owned, strict=True)]

    points = gathered(model.fields.points)
    states = [{name: gathered(getattr(state, name)) for name in _VALUES} for state in history]
    failure = None
    if comm.rank == 0:
        try:
            draft = folder / f"{NAME}.part"
            with h5py.File(draft, "w") as file:
                file.attrs["key"] = key
                file.attrs["steps"] = json.dumps([step.to_dict() for step in steps])
                _store(file, "points", points)
                for number, (state, values) in enumerate(zip(history, states, strict=True)):
                    group = file.create_group(f"state{number}")
                    for name in _VALUES:
                        _store(group, name, values[name])
                    group.attrs["fraction"] = state.fraction
                    group.attrs["approaches"] = state.approaches
                    group.attrs["forces"] = state.forces
            draft.replace(folder / NAME)
        except OSError as error:
            failure = f"checkpoint in {folder} cannot be written: {error}"
    _raise_together(failure, model)


def read_checkpoint(folder: Path, model: Model, key: str) -> tuple[list[State], list[Step]]:
    """Return states and finished steps of a checkpoint of the same run, or nothing (collective)."""
    found = on_root(model.comm, lambda: _load(folder / NAME, key))
    if found is None:
        return [], []
    failure, states = None, []
    try:
        tolerance = 1e-8 * float(np.ptp(found["points"][0]))
        pairs = zip(model.fields.points, found["points"], strict=True)
        rows = [match_rows(here, known, tolerance) for here, known in pairs]

        def taken(saved: list[np.ndarray]) -> Values:
            return tuple(values[row] for values, row in zip(saved, rows, strict=True))

        states = [
            State(fraction, taken(values), taken(penalised), approaches, forces)
            for fraction, values, penalised, approaches, forces in found["states"]
        ]
    except OutputUnusable as error:
        failure = str(error)
    _raise_together(failure, model)
    return states, [Step.from_dict(step) for step in found["steps"]]


def _load(path: Path, key: str) -> dict[str, Any] | None:
    try:
        with h5py.File(path, "r") as file:
            if file.attrs["key"] != key:
                return None
            groups = [file[name] for name in sorted(name for name in file if name.startswith("state"))]
            return {
                "points": _stored(file, "points"),
                "steps": json.loads(file.attrs["steps"]),
                "states": [
                    (
                        float(g.attrs["fraction"]),
                        *(_stored(g, name) for name in _VALUES),
                        *(tuple(map(float, g.attrs[name])) for name in ("approaches", "forces")),
                    )
                    for g in groups
                ],
            }
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError) as error:
        raise OutputUnusable(f"{path} cannot be read ({error}): remove it to start anew") from error


def _store(group: h5py.Group, name: str, fields: list[np.ndarray | None]) -> None:
    for number, rows in enumerate(fields):
        group[f"{name}/{number}"] = rows


def _stored(group: h5py.Group, name: str) -> list[np.ndarray]:
    return [group[name][str(number)][:] for number in range(len(group[name]))]


def _raise_together(failure: str | None, model: Model) -> None:
    failures = [text for text in model.comm.allgather(failure) if text]
    if failures:
        raise OutputUnusable(failures[0])
