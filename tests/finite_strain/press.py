"""Solve the light pair as a program on any number of ranks, each run in its own folder: ``FOLDER NAME...``.

A run named "stopped" ends after its first step, one named "failing" does not converge.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import Any

from mpi4py import MPI

import finite_strain
from linear_bem.errors import ThirdBodyError
from tests.finite_strain.scenes import COARSER, Recorder, light_pair

ACCURACY = 0.3
STEPS = (0.5, 1.0)


class Stopped(Exception):
    """Ends the run on purpose."""


class StopAfter(Recorder):
    """Raises on every rank after a given step."""

    def __init__(self, last: int) -> None:
        super().__init__()
        self.last = last

    def step_done(self, step: Any, surface: Any) -> None:
        super().step_done(step, surface)
        if step.record["step"] == self.last:
            raise Stopped


def job(name: str, folder: str) -> Any:
    """Return what one run of the light pair said: its answer, or its error on every rank (None but on rank 0)."""
    comm = MPI.COMM_WORLD
    observer = StopAfter(1 if name == "stopped" else 0)
    hasty = replace(COARSER, shortest_step=0.4, newton_iterations=1)
    try:
        result = finite_strain.solve(
            light_pair(), accuracy=ACCURACY, folder=folder, observer=observer, steps=STEPS,
            numerics=hasty if name == "failing" else COARSER,
        )  # fmt: skip
    except (Stopped, ThirdBodyError) as error:
        return comm.gather(f"{type(error).__name__}: {error}", root=0)
    meshes = sorted({attempt["mesh"] for attempt in observer.attempts})
    return {**result.to_dict(), "resumed": observer.info["resumed_steps"], "meshes_run": meshes}


def main() -> None:
    folder, *names = sys.argv[1:]
    answers = {name: job(name, f"{folder}/{name}") for name in names}
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(answers))


if __name__ == "__main__":
    main()
