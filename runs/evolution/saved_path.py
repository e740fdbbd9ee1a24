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
            scalars=np.array([moment.sigma, moment.speed, float(moment.resting)]),
        )  # fmt: skip


def read(folder: Path, number: int) -> Moment:
    """Return a saved moment; its next step is not saved. Raises `OutputUnusable`."""
    file = folder / name(number)
    try:
        with open(file, "rb") as opened, np.load(opened) as data:  # numpy leaves a damaged file open
            state = State(data["tangential"], data["normal"], data["error"])
            sigma, speed, resting = data["scalars"].tolist()
            return Moment(
                sigma, data["positions"], state, data["contacts"], data["pushes"], speed, np.nan, np.nan, bool(resting)
            )
    except DAMAGED as error:
        raise OutputUnusable(f"{file}: cannot be read ({error})") from None
