"""Error bars of results against the answer of a finer mesh: how they hold, and how fast errors fall.

    python -m tests.finite_strain.bars FOLDER [unknowns]     # 40 minutes of one core with 200 000 unknowns

Five pairs, each along a load path: every discretisation's bar over its distance from the finest answer, one row per
discretisation and load; at the end the share of bars that hold, and the rms error of T / Q^2 at orders 3 and 4 over the
largest change that it is estimated from. Runs are kept in FOLDER and resumed.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

import finite_strain
from finite_strain.accuracy.pairs import MEASURED
from finite_strain.planning.records import NAME
from linear_bem import Ball, FiniteStrain, Layer, Load, Problem

APPROACHES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
"""Approaches over R with answers, up to each scene's own."""


def scene(thickness: float, distance: float, poisson: float, approach: float, radius: float = 1.0) -> Problem:
    """Return two spheres on a layer with a rigid base; R = 1 and E1 = 1, ``radius`` is that of the second."""
    balls = tuple(Ball((x, 0.0), r, "sphere") for x, r in ((-distance / 2, 1.0), (distance / 2, radius)))
    return Problem(Layer(1.0, poisson, thickness), balls, Load("approach", (approach,) * 2), None, FiniteStrain())


SCENES = {
    "thin": scene(1.16, 2.0, 0.48, 0.5), "apart": scene(1.16, 3.0, 0.48, 0.5), "thick": scene(6.0, 2.0, 0.48, 0.5),
    "compressible": scene(1.16, 2.0, 0.3, 0.3), "unlike": scene(1.16, 2.6, 0.48, 0.3, 1.5),
}  # fmt: skip


def rows(name: str, folder: Path, unknowns: float) -> list[dict[str, float | str]]:
    """Return one row per discretisation and load of a scene: errors and their bars, relative, and changes."""
    problem = SCENES[name]
    full = problem.load.values[0]
    steps = [d / full for d in APPROACHES if d <= full * (1.0 + 1e-9)]
    finite_strain.solve(problem, accuracy=1e-4, unknowns=unknowns, steps=steps, folder=folder / name)
    *levels, finest = json.loads((folder / name / NAME).read_text(encoding="utf-8"))["discretisations"]
    table: list[dict[str, float | str]] = []
    for level in levels:
        largest = 0.0
        for number, step in enumerate(level["steps"]):
            best = next(s["balls"][0] for s in finest["steps"] if s["record"]["fraction"] == step["record"]["fraction"])
            ball, record = step["balls"][0], step["record"]
            largest = max(largest, np.hypot(*level["changes"]["ratio"][number][0]))
            off = [b["tangential_force"][0] / b["normal_force"] ** 2 for b in (ball, best)]
            table.append({
                "scene": name, "order": level["level"]["order"], "fineness": level["level"]["fineness"],
                "D": ball["approach"],
                "error of T": abs(ball["tangential_force"][0] / best["tangential_force"][0] - 1.0),
                "bar of T": ball["tangential_force_error"] / abs(best["tangential_force"][0]),
                "error of Q": abs(ball["normal_force"] / best["normal_force"] - 1.0),
                "bar of Q": record["normal_force_error"][0] / best["normal_force"],
                **{f"error of {name}": abs(ball[name] / best[name] - 1.0) for name in MEASURED},
                **{f"bar of {name}": ball["errors"][name] / best[name] for name in MEASURED},
                "error of T / Q^2 over its largest change": abs(off[0] - off[1]) / largest,
            })  # fmt: skip
    return table


def main(folder: Path, unknowns: float = 200e3) -> None:
    """Print the table and what follows from it."""
    table = [row for name in SCENES for row in rows(name, folder, unknowns)]
    for row in table:
        print(", ".join(f"{key} {value:.3g}" if isinstance(value, float) else f"{value}" for key, value in row.items()))
    for name in ("T", "Q", *MEASURED):
        ratio = np.array([row[f"bar of {name}"] / row[f"error of {name}"] for row in table], dtype=float)  # type: ignore[operator]
        print(
            f"{name}: {np.mean(ratio >= 1.0):.0%} of {len(ratio)} bars hold; "
            f"bar over error: smallest {ratio.min():.2g}, median {np.median(ratio):.2g}"
        )
    for order in (3, 4):
        left = [row["error of T / Q^2 over its largest change"] for row in table if row["order"] == order]
        if left:
            print(
                f"order {order}: error of T / Q^2 over the largest change: largest {max(left):.2g}, median "
                f"{np.median(np.array(left, dtype=float)):.2g}"
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(float, sys.argv[2:]))
