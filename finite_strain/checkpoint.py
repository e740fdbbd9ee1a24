"""The last finished load step on disk: enough to go on from it on any number of ranks.

The values of every field are kept by position, so ranks and DOLFINx versions may change in between; the mesh
may not. A checkpoint is replaced as a whole, never half-written, and no rank ever holds more than its own part.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI

from finite_strain.loading import State
from finite_strain.model import Model
from finite_strain.spread_arrays import fail_together, read_at, write_in_turns
from finite_strain.together import on_root
from linear_bem.errors import OutputUnusable
from linear_bem.result import Step

NAME = "checkpoint.h5"
SAME_PLACE = 1e-8
"""Relative to the size of the mesh: how far a node may lie from where its value was saved."""


def write_checkpoint(folder: Path, model: Model, history: list[State], steps: list[Step], key: str) -> None:
    """Write the last states and all finished steps (collective); ``key`` identifies problem and settings."""
    arrays = {}
    for k, (points, owned) in enumerate(zip(model.fields.points, model.fields.owned, strict=True)):
        arrays[f"points{k}"] = points[:owned]
        for number, state in enumerate(history):
            arrays[f"state{number}/values{k}"] = state.values[k][:owned]
            arrays[f"state{number}/penalised{k}"] = state.penalised[k][:owned]

    def describe(file: h5py.File) -> None:
        file.attrs["key"] = key
        file["steps"] = json.dumps([step.to_dict() for step in steps])
        for number, state in enumerate(history):
            group = file[f"state{number}"]
            group.attrs["fraction"] = state.fraction
            group.attrs["approaches"] = state.approaches
            group.attrs["forces"] = state.forces

    write_in_turns(model.comm, folder / NAME, arrays, describe)


def read_checkpoint(folder: Path, model: Model, key: str) -> tuple[list[State], list[Step]]:
    """Return states and finished steps of a checkpoint of the same run, or nothing (collective)."""
    path = folder / NAME
    steps = on_root(model.comm, lambda: _steps(path, key))
    if steps is None:
        return [], []
    largest = max((float(np.max(np.abs(points))) for points in model.fields.points if len(points)), default=0.0)
    tolerance = SAME_PLACE * model.comm.allreduce(largest, op=MPI.MAX)
    failure, states = None, []
    try:
        with h5py.File(path, "r") as file:
            states = [_state(file, name, model, tolerance) for name in sorted(n for n in file if n.startswith("state"))]
    except OutputUnusable as error:
        failure = str(error)
    except (OSError, ValueError, KeyError) as error:
        failure = _unreadable(path, error)
    fail_together(model.comm, failure)
    return states, [Step.from_dict(step) for step in steps]


def _state(file: h5py.File, name: str, model: Model, tolerance: float) -> State:
    values, penalised = [], []
    for k, points in enumerate(model.fields.points):
        saved = file[f"points{k}"]
        names = [f"{name}/values{k}", f"{name}/penalised{k}"]
        if len(saved) != model.fields.functions[k].function_space.dofmap.index_map.size_global:
            raise OutputUnusable(f"checkpoint: {len(saved)} saved nodes; it belongs to another mesh")
        now, before = read_at(file, f"points{k}", names, points, tolerance)
        values.append(now)
        penalised.append(before)
    attributes = file[name].attrs
    approaches, forces = (tuple(map(float, attributes[key])) for key in ("approaches", "forces"))
    return State(float(attributes["fraction"]), tuple(values), tuple(penalised), approaches, forces)


def _steps(path: Path, key: str) -> list[dict[str, Any]] | None:
    """Return the finished steps of a checkpoint with this key, or None."""
    try:
        with h5py.File(path, "r") as file:
            return json.loads(file["steps"][()]) if file.attrs["key"] == key else None
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError) as error:
        raise OutputUnusable(_unreadable(path, error)) from error


def _unreadable(path: Path, error: Exception) -> str:
    return f"{path} cannot be read ({error}): remove it to start anew"
