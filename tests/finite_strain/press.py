"""Solve the light pair as a program on any number of ranks: ``FOLDER [last step | fail]``."""

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
STOPPED = 3


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


def main() -> None:
    folder, *rest = sys.argv[1:]
    comm = MPI.COMM_WORLD
    observer = StopAfter(int(rest[0]) if rest and rest[0].isdigit() else 0)
    hasty = replace(COARSER, shortest_step=0.4, newton_iterations=1)
    try:
        result = finite_strain.solve(
            light_pair(), tangential_force=ACCURACY, folder=folder, observer=observer, steps=STEPS,
            numerics=hasty if "fail" in rest else COARSER,
        )  # fmt: skip
    except Stopped:
        raise SystemExit(STOPPED) from None
    except ThirdBodyError as error:
        said = comm.gather(f"rank {comm.rank}: {type(error).__name__}: {error}", root=0)
        if said is not None:  # a launcher mixes the lines of several ranks
            print("\n".join(said), flush=True)
        raise SystemExit(1) from None
    if comm.rank == 0:
        meshes = sorted({attempt["mesh"] for attempt in observer.attempts})
        print(json.dumps({**result.to_dict(), "resumed": observer.info["resumed_steps"], "meshes_run": meshes}))


if __name__ == "__main__":
    main()
