"""Time, memory and error of many random balls, by hand; `linear_bem/README.md` has the tables that this prints.

    python -m tests.linear_bem.random_balls time [COUNT ...]         one approach on a rigid base, and fitted powers
    python -m tests.linear_bem.random_balls loads COUNT [LOAD [BASE]]  other loads, rigid and elastic base
    python -m tests.linear_bem.random_balls layouts COUNT            far groups, thin layer, unlike radii; elastic base
    python -m tests.linear_bem.random_balls direct COUNT LOAD BASE   against all pairs; BASE may be one of these layouts

Every row is computed in a process of its own.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time

import numpy as np

from linear_bem import Ball, Elastic, Layer, Load, Problem, solve
from linear_bem.far_field import pairs_and_mesh
from linear_bem.result import Result

COVERED, LOW, HIGH = 0.4, 0.6, 1.0
"""Share of the area that balls cover, and their radii [m]."""
DEPTH, THICKNESS = 0.1, 8.0
BASES = {"rigid": None, "elastic": Elastic(10.0, 0.3)}
LAYOUTS = {"far groups": (DEPTH, 1.2), "thin layer": (0.03, 0.25), "unlike radii": (DEPTH, 1.2)}
"""Depth over radius and thickness [m]."""
GROUPS, APART = 10, 1000.0
"""Number of far groups, and the distance [m] of their corners."""
LOADS = ("approach", "force", "total_force")
COUNTS = (300, 1000, 3000, 10_000)
ACCURACY, SHARPER = 1e-3, 1e-4


def scattered(count: int, seed: int = 1, low: float = LOW) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (count, 2) and radii of balls at random that do not overlap (random sequential addition).

    Radii from ``low`` to `HIGH`; below `LOW` their logarithms are spread evenly.
    """
    rng = np.random.default_rng(seed)
    radii = rng.uniform(low, HIGH, count) if low >= LOW else low ** rng.uniform(0.0, 1.0, count)
    radii = np.sort(radii)[::-1]
    side = float(np.sqrt(np.pi * np.sum(radii**2) / COVERED))
    boxes = int(side / (2.0 * HIGH))
    members: dict[tuple[int, int], list[int]] = {}
    places = np.empty((count, 2))
    for k, radius in enumerate(radii):
        while True:
            place = rng.uniform(0.0, side, 2)
            i, j = (int(v * boxes / side) for v in place)
            near = [m for a in (-1, 0, 1) for b in (-1, 0, 1) for m in members.get((i + a, j + b), ())]
            if np.all(np.hypot(*(places[near] - place).T) >= 1.0001 * (radii[near] + radius)):
                break
        places[k] = place
        members.setdefault((i, j), []).append(k)
    return places, radii


def scene(count: int, load: str, base: str) -> Problem:
    """Return spheres and paraboloids by turns at random places, their loads about those of Hertz at `DEPTH`.

    A ``base`` of `LAYOUTS` stands for an elastic one with another layout.
    """
    depth, thickness = LAYOUTS.get(base, (DEPTH, THICKNESS))
    places, radii = scattered(count, low=0.03 if base == "unlike radii" else LOW)
    if base == "far groups":
        groups = [scattered(count // GROUPS, seed) for seed in range(GROUPS)]
        places = np.concatenate([p + APART * np.array([k % 4, k // 4]) for k, (p, _) in enumerate(groups)])
        radii = np.concatenate([r for _, r in groups])
    shapes = ("sphere", "paraboloid")
    balls = tuple(
        Ball((float(x), float(y)), float(r), shapes[k % 2])
        for k, ((x, y), r) in enumerate(zip(places, radii, strict=True))
    )
    depths = depth * (radii if base in LAYOUTS else np.ones(len(radii)))
    forces = np.sqrt(radii * depths**3) * np.random.default_rng(2).uniform(0.5, 1.5, len(radii))
    values = {"approach": depths.tolist(), "force": forces.tolist(), "total_force": [float(np.sum(forces))]}
    substrate = BASES["elastic" if base in LAYOUTS else base]
    return Problem(Layer(1.0, 0.48, thickness), balls, Load(load, tuple(values[load])), substrate)


def forces_of(result: Result) -> np.ndarray:
    """Return T of all balls (balls, 2)."""
    return np.array([ball.tangential_force for ball in result.balls])


def row(count: int, load: str, base: str) -> dict[str, float | str]:
    """Return processor time [s], memory [MB] and errors over the largest T of one solution."""
    problem = scene(count, load, base)
    began = time.process_time()
    result = solve(problem, ACCURACY)
    spent, memory = time.process_time() - began, 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    pull, accuracy = forces_of(result), result.solved.accuracy
    largest = float(np.max(np.hypot(*pull.T)))
    return {
        "balls": count, "load": load, "base": base, "seconds": spent, "megabytes": memory / 1e6,
        "stated error": accuracy["reached"], "error in the sample": accuracy["sample_error"],
        "sum of T": float(np.hypot(*pull.sum(axis=0))) / largest,
    }  # fmt: skip


def direct(count: int, load: str, base: str) -> dict[str, float | str]:
    """Return how far a solution is from the one that sums all pairs without a mesh, to a tenth of its error.

    Differences are over the largest T and Q; ``over the bar`` is the largest difference of a T over its stated error.
    """
    problem = scene(count, load, base)
    quick = solve(problem, ACCURACY)
    began = time.process_time()
    with_mesh, pairs_and_mesh.RULES = pairs_and_mesh.RULES, ()
    try:
        sharp = solve(problem, SHARPER)
    finally:
        pairs_and_mesh.RULES = with_mesh
    spent = time.process_time() - began
    difference = np.hypot(*(forces_of(quick) - forces_of(sharp)).T)
    bars = np.array(
        [a.tangential_force_error + b.tangential_force_error for a, b in zip(quick.balls, sharp.balls, strict=True)]
    )
    loads = np.array([[ball.normal_force for ball in result.balls] for result in (quick, sharp)])
    return {
        "balls": count, "load": load, "base": base, "seconds": spent,
        "T": float(np.max(difference)) / float(np.max(np.hypot(*forces_of(sharp).T))),
        "over the bar": float(np.max(difference / bars)),
        "Q": float(np.max(np.abs(loads[0] - loads[1]))) / float(np.max(loads)),
    }  # fmt: skip


def main() -> None:
    """Print the table that the command line asks for."""
    what, *rest = sys.argv[1:]
    if what == "--row":
        kind, count, load, base = rest
        print(json.dumps({"row": row, "direct": direct}[kind](int(count), load, base)))
        return
    kind = "direct" if what == "direct" else "row"
    if what == "time":
        wanted = [(count, "approach", "rigid") for count in map(int, rest or COUNTS)]
    elif what == "layouts":
        wanted = [(int(rest[0]), "force", layout) for layout in LAYOUTS]
    else:
        loads, bases = rest[1:2] or LOADS, rest[2:3] or BASES
        wanted = [(int(rest[0]), load, base) for load in loads for base in bases]
    rows = []
    for case in wanted:
        command = [sys.executable, "-m", "tests.linear_bem.random_balls", "--row", kind, *map(str, case)]
        rows.append(json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout))
        if len(rows) == 1:
            print("|", " | ".join(rows[0]), "|\n|", "---|" * len(rows[0]))
        print(
            "|", " | ".join(f"{v:.3g}" if isinstance(v, float) else str(v) for v in rows[-1].values()), "|", flush=True
        )
    if what == "time" and len(rows) > 2:
        counts = np.array([r["balls"] for r in rows])
        power = np.polyfit(np.log(counts), np.log([r["seconds"] for r in rows]), 1)[0]
        slope, start = np.polyfit(counts, [r["megabytes"] for r in rows], 1)
        print(f"time as n^{power:.2f}, memory {start:.0f} MB and {1e3 * slope:.0f} kB a ball")


if __name__ == "__main__":
    main()
