"""The path as it is kept: moments worth keeping, in JSON's shape, and what happened on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runs.evolution.drift import Moment
from runs.evolution.hard_balls import HardBalls

Array = NDArray[np.float64]

WORTH_KEEPING = 0.02
"""Displacement since the last kept moment, over the smallest touching distance, that makes another worth keeping."""
APART = 1e-3
"""Gap over touching distance at which a pair that touched counts as parted."""
NEIGHBOURS = 1.2
"""Starting distance over the smallest one up to which two balls are neighbours."""


@dataclass
class Record:
    """The kept moments of one path; ``continuation`` is where it goes on."""

    moments: list[dict[str, Any]] = field(default_factory=list)
    continuation: dict[str, Any] | None = None

    def take(self, moment: Moment, balls: HardBalls, *, last: bool) -> None:
        """Keep the moment if it is worth it, and where the path goes on in any case."""
        x = moment.positions
        self.continuation = None if last else {"sigma": moment.sigma, "positions": x.tolist(), "step": moment.step}
        contacts = balls.pairs[moment.contacts].tolist()
        if self.moments and not last:
            before = self.moments[-1]
            moved = float(np.max(np.abs(x - np.array(before["positions"]))))
            if moved < WORTH_KEEPING * float(np.min(balls.distances, initial=1.0)) and contacts == before["contacts"]:
                return
        if self.moments and moment.sigma <= self.moments[-1]["sigma"]:
            self.moments.pop()
        self.moments.append(
            {
                "sigma": moment.sigma,
                "positions": x.tolist(),
                "tangential_force": moment.state.tangential.tolist(),
                "tangential_force_error": moment.state.error.tolist(),
                "normal_force": moment.state.normal.tolist(),
                "contacts": contacts,
                "pushes": moment.pushes.tolist(),
                "speed": moment.speed,
                "resting": moment.resting,
            }
        )


def positions_at(moments: Sequence[Mapping[str, Any]], sigma: Array) -> Array:
    """Return positions (times, balls, 2) [m] at any sigma, linear between kept moments, at rest after the last."""
    at = np.array([m["sigma"] for m in moments])
    x = np.array([m["positions"] for m in moments])
    flat = x.reshape(len(x), -1)
    return np.stack([np.interp(sigma, at, column) for column in flat.T], axis=1).reshape(len(sigma), *x.shape[1:])


def events(moments: Sequence[Mapping[str, Any]], balls: HardBalls) -> list[dict[str, Any]]:
    """Return when pairs came into contact and parted: sigma [m], pair, "touch" or "part"; contacts at the start too.

    A pair has parted when its gap exceeds a thousandth of the touching distance.
    """
    together: set[tuple[int, int]] = set()
    out: list[dict[str, Any]] = []
    for moment in moments:
        now = {(int(i), int(j)) for i, j in moment["contacts"]}
        gaps = balls.gaps(np.array(moment["positions"]))
        apart = {(int(i), int(j)) for i, j in balls.pairs[gaps > APART * balls.distances]}
        out += [{"sigma": moment["sigma"], "pair": list(pair), "kind": "touch"} for pair in sorted(now - together)]
        out += [{"sigma": moment["sigma"], "pair": list(pair), "kind": "part"} for pair in sorted(together & apart)]
        together = (together | now) - apart
    return out


def summary(moments: Sequence[Mapping[str, Any]], balls: HardBalls, nominal: Array, *, at_rest: bool) -> dict[str, Any]:
    """Return the end of a path in a few numbers, for comparing members of an ensemble.

    Neighbours are those of the ``nominal`` positions (balls, 2) [m], before any perturbation.
    """
    x = np.array(moments[-1]["positions"])
    contacts = moments[-1]["contacts"]
    touches = [e for e in events(moments, balls) if e["kind"] == "touch"]
    grouped = next((m["sigma"] for m in moments if len(balls.groups(np.array(m["positions"]))) == 1), None)
    sizes = [sorted((len(g) for g in balls.groups(np.array(m["positions"]))), reverse=True) for m in moments]
    first = balls.gaps(nominal) + balls.distances
    beside = np.flatnonzero(first <= NEIGHBOURS * np.min(first))
    centred = x - x.mean(axis=0)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(centred.T @ centred / len(x)), 0.0))
    return {
        "at_rest": at_rest,
        "sigma_end": moments[-1]["sigma"],
        "sigma_one_group": grouped,
        "group_sizes": [now for k, now in enumerate(sizes) if k == 0 or now != sizes[k - 1]],
        "neighbours": len(beside),
        "neighbours_kept": int(np.sum(balls.gaps(x, beside) <= APART * balls.distances[beside])),
        "first_pairs": [e["pair"] for e in touches[:4]],
        "contacts": len(contacts),
        "groups": sorted((len(g) for g in balls.groups(x)), reverse=True),
        "narrow_over_wide": float(spread[0] / spread[1]) if spread[1] > 0.0 else 1.0,
        "positions": x.tolist(),
    }
