"""One file for each moment of a path: thousands of balls would make a single JSON document too large."""

from pathlib import Path

import numpy as np

from linear_bem.errors import OutputUnusable
from runs.evolution.drift import Moment
from runs.evolution.forces import State
from runs.process.files import DAMAGED, replacing


def name(number: int) -> str:
    """Return the file name of moment ``number``."""
    return f"moment_{number:06d}.npz"


def write(folder: Path, number: int, moment: Moment) -> None:
    """Write one moment; raises `OutputUnusable`."""
    folder.mkdir(exist_ok=True)
    with replacing(folder / name(number)) as draft, open(draft, "wb") as file:
        np.savez(
            file, positions=moment.positions, tangential=moment.state.tangential, normal=moment.state.normal,
            error=moment.state.error, contacts=moment.contacts, pushes=moment.pushes,
            scalars=np.array([moment.sigma, moment.speed, moment.resting, moment.step, moment.spare, moment.steps]),
        )  # fmt: skip


def drop_from(folder: Path, number: int) -> None:
    """Delete the moments from ``number`` on, which an earlier, longer path left."""
    while (file := folder / name(number)).exists():
        file.unlink()
        number += 1


def read(folder: Path, number: int) -> Moment:
    """Return a saved moment; files of older versions lack its next step and `steps`. Raises `OutputUnusable`."""
    file = folder / name(number)
    try:
        with open(file, "rb") as opened, np.load(opened) as data:  # numpy leaves a damaged file open
            state = State(data["tangential"], data["normal"], data["error"])
            sigma, speed, resting, *later = data["scalars"].tolist()
            step, spare, steps = later or (np.nan, np.nan, 0)
            return Moment(
                sigma, data["positions"], state, data["contacts"], data["pushes"], speed, step, spare, bool(resting),
                int(steps),
            )  # fmt: skip
    except DAMAGED as error:
        raise OutputUnusable(f"{file}: cannot be read ({error})") from None
