"""The saved path: the moments that are kept, as JSON or in files, and when contacts closed and opened.

Each moment of many balls has a file of its own: thousands of balls would make a single JSON document too large.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import OutputUnusable
from runs.evolution.drift import AT_END, Continuation, Moment
from runs.evolution.forces import State
from runs.evolution.hard_balls import HardBalls, Pairs
from runs.process.files import DAMAGED, replacing
from runs.process.json_values import Document, plain

WORTH_KEEPING, OF_MANY = 0.02, 0.25
"""Displacement since the last kept moment, over the smallest touching distance, after which the next one is kept: for
few balls, for which every change of a contact is kept too, and for many balls."""
FURTHER = 1.1
"""Sliding path over that of the last kept moment from which the next one of few balls is kept although they have hardly
moved: motion that starts slowly and becomes fast is drawn as it is."""
NEIGHBOURS = 1.2
"""Starting distance over the smallest one up to which two balls are neighbours."""


@dataclass
class Record:
    """The kept moments of one path; ``continuation`` is where it resumes, None at its start.

    At the end of a path it is the state before the last step, where a longer path goes on. ``damage`` says which saved
    moment could not be read, if any.
    """

    moments: list[Moment] = field(default_factory=list)
    continuation: Continuation | Moment | None = None
    written: int = 0
    damage: str = ""

    @classmethod
    def from_dict(cls, document: Mapping[str, Any], balls: HardBalls, folder: Path, below: float = np.inf) -> Record:
        """Return the record of a saved document, with its keys "path" and "continuation"; empty where they are not.

        ``folder`` holds the moments of many balls; a path with a damaged one ends before it, and continues there.
        Of a path that was to end elsewhere, moments from sigma = ``below`` [m] on are left out.
        """
        kept = [moment for moment in document.get("path", []) if moment["sigma"] < below]
        restart, moments, damage = document.get("continuation"), list[Moment](), ""
        try:
            for number, moment in enumerate(kept):
                moments.append(read(folder, number) if balls.many else _from_dict(moment, balls))
                if moments[-1].sigma != moment["sigma"]:
                    moments.pop()
                    raise OutputUnusable(f"{folder / file_name(number)}: is of another path")
        except OutputUnusable as error:
            damage = f"{error}: the path from there on was computed again"
        if restart is not None and restart["sigma"] < below and not damage:
            known = Continuation(**{**restart, "positions": np.array(restart["positions"])})
            return cls(moments, known, len(moments))
        if restart is None and len(moments) == len(document.get("path", [])):
            return cls(moments, None, len(moments))
        return cls(moments, moments[-1] if moments else None, len(moments), damage)

    def to_dict(self, balls: HardBalls, folder: Path) -> Document:
        """Return the JSON object that `from_dict` reads; moments of many balls are written to ``folder``."""
        restart = self.continuation
        if balls.many:
            for number in range(self.written, len(self.moments)):
                write(folder, number, self.moments[number])
            self.written = len(self.moments)
        return {
            "path": [in_brief(moment) if balls.many else to_dict(moment, balls) for moment in self.moments],
            "continuation": restart and {key: plain(getattr(restart, key)) for key in Continuation.__annotations__},
        }

    def ended(self, end: float) -> bool:
        """Whether the path is complete: at rest, or at sigma = ``end`` [m]."""
        return bool(self.moments) and (self.moments[-1].resting or self.moments[-1].sigma >= AT_END * end)

    @property
    def steps(self) -> int:
        """`Moment.steps` of the last known moment."""
        known = [state.steps for state in (*self.moments[-1:], self.continuation) if state is not None]
        return max(known, default=0)

    def take(self, moment: Moment, balls: HardBalls, *, last: bool) -> None:
        """Keep the moment if the balls have moved enough, and always store the restart state."""
        if not last:
            self.continuation = moment
        if self.moments and not last:
            before = self.moments[-1]
            moved = float(np.max(np.abs(moment.positions - before.positions)))
            if balls.many and moved < OF_MANY * balls.smallest:
                return
            is_near = moved < WORTH_KEEPING * balls.smallest and moment.sigma <= FURTHER * before.sigma
            if is_near and np.array_equal(moment.contacts, before.contacts):
                return
        if self.moments and moment.sigma <= self.moments[-1].sigma:
            self.moments.pop()
            self.written = min(self.written, len(self.moments))
        self.moments.append(moment)


def to_dict(moment: Moment, balls: HardBalls) -> Document:
    """Return the JSON object of a moment."""
    return {
        "sigma": moment.sigma,
        "positions": moment.positions.tolist(),
        "tangential_force": moment.state.tangential.tolist(),
        "tangential_force_error": moment.state.error.tolist(),
        "normal_force": moment.state.normal.tolist(),
        "contacts": balls.pairs(moment.contacts).tolist(),
        "pushes": moment.pushes.tolist(),
        "speed": moment.speed,
        "resting": moment.resting,
        "step": moment.step,
        "spare": moment.spare,
        "steps": moment.steps,
    }


def in_brief(moment: Moment) -> Document:
    """Return the JSON object of a moment of many balls, whose positions and forces are in a file of its own."""
    return {"sigma": moment.sigma, "contacts": len(moment.contacts), "speed": moment.speed, "resting": moment.resting}


def file_name(number: int) -> str:
    """Return the file name of moment ``number``."""
    return f"moment_{number:06d}.npz"


def write(folder: Path, number: int, moment: Moment) -> None:
    """Write one moment; raises `OutputUnusable`."""
    folder.mkdir(exist_ok=True)
    with replacing(folder / file_name(number)) as draft, open(draft, "wb") as file:
        np.savez(
            file, positions=moment.positions, tangential=moment.state.tangential, normal=moment.state.normal,
            error=moment.state.error, contacts=moment.contacts, pushes=moment.pushes,
            scalars=np.array([moment.sigma, moment.speed, moment.resting, moment.step, moment.spare, moment.steps]),
        )  # fmt: skip


def drop_from(folder: Path, number: int) -> None:
    """Delete the moments from ``number`` on, which an earlier, longer path left."""
    while (file := folder / file_name(number)).exists():
        file.unlink()
        number += 1


def read(folder: Path, number: int) -> Moment:
    """Return a moment written by `write`; raises `OutputUnusable`."""
    file = folder / file_name(number)
    try:
        with open(file, "rb") as opened, np.load(opened) as data:  # numpy leaves a damaged file open
            state = State(data["tangential"], data["normal"], data["error"])
            sigma, speed, resting, step, spare, steps = data["scalars"].tolist()
            return Moment(
                sigma, data["positions"], state, data["contacts"], data["pushes"], speed, step, spare, bool(resting),
                int(steps),
            )  # fmt: skip
    except DAMAGED as error:
        raise OutputUnusable(f"{file}: cannot be read ({error})") from None


def _from_dict(data: Mapping[str, Any], balls: HardBalls) -> Moment:
    state = State(*(np.array(data[key]) for key in ("tangential_force", "normal_force", "tangential_force_error")))
    contacts = np.array([balls.number(i, j) for i, j in data["contacts"]], dtype=np.intp)
    return Moment(
        data["sigma"], np.array(data["positions"]), state, contacts, np.array(data["pushes"]), data["speed"],
        data["step"], data["spare"], data["resting"], data["steps"],
    )  # fmt: skip


def positions_at(sigma: Array, at: Array, x: Array) -> Array:
    """Return positions (times, balls, 2) [m] at any sigma, linear between moments ``at``, at rest after the last.

    ``x`` (moments, balls, 2) [m] are the positions at the moments.
    """
    columns = x.reshape(len(x), -1).T
    return np.stack([np.interp(sigma, at, column) for column in columns], axis=1).reshape(len(sigma), *x.shape[1:])


@dataclass(frozen=True)
class Event:
    """A pair of balls that comes into contact or parts at ``sigma`` [m]."""

    sigma: float
    pair: tuple[int, int]
    kind: Literal["touch", "part"]


def events(moments: Sequence[Moment], balls: HardBalls) -> list[Event]:
    """Return when pairs came into contact and parted, contacts at the start too.

    A pair has parted when it is no longer `HardBalls.connected`.
    """
    together = np.array([], dtype=np.intp)
    out: list[Event] = []
    for moment in moments:
        new = np.setdiff1d(moment.contacts, together)
        gone = together[~balls.connected(moment.positions, together)]
        out += [Event(moment.sigma, (i, j), "touch") for i, j in balls.pairs(new).tolist()]
        out += [Event(moment.sigma, (i, j), "part") for i, j in balls.pairs(gone).tolist()]
        together = np.setdiff1d(np.union1d(together, new), gone)
    return out


def starting_neighbours(x: Array, balls: HardBalls, share: float) -> Pairs:
    """Return the numbers of the pairs that are at most ``share`` times as far apart as the nearest."""
    which = balls.near(x, 4.0 * balls.smallest)
    if len(which) == 0:
        which = balls.all
    distances = balls.gaps(x, which) + balls.distances(which)
    return which[distances <= share * np.min(distances)]


def summary(moments: Sequence[Moment], balls: HardBalls, nominal: Array) -> Document:
    """Return the end of a path in a few numbers, for comparing members of an ensemble.

    Neighbours are those of the ``nominal`` positions (balls, 2) [m], before any perturbation.
    """
    end = moments[-1]
    x = end.positions
    touches = [event for event in events(moments, balls) if event.kind == "touch"]
    sizes = [sorted((len(group) for group in balls.groups(m.positions)), reverse=True) for m in moments]
    beside = starting_neighbours(nominal, balls, NEIGHBOURS)
    shape = {}
    if balls.cell is None:  # positions in a cell depend on the images that give them
        centred = x - x.mean(axis=0)
        spread = np.sqrt(np.maximum(np.linalg.eigvalsh(centred.T @ centred / len(x)), 0.0))
        shape = {"narrow_over_wide": float(spread[0] / spread[1]) if spread[1] > 0.0 else 1.0}
    return {
        "at_rest": end.resting,
        "sigma_end": end.sigma,
        "group_sizes": [] if balls.many else [now for k, now in enumerate(sizes) if k == 0 or now != sizes[k - 1]],
        "neighbours": len(beside),
        "neighbours_kept": int(np.sum(balls.connected(x, beside))),
        "first_pairs": [list(event.pair) for event in touches[:4]],
        "contacts": len(end.contacts),
        "groups": sizes[-1],
        **shape,
        "positions": x.tolist(),
    }
