"""Random pairs and triples on grids: error of T over its estimate, and over the change between two grids alone.

python -m tests.linear_bem.grid_bars SECONDS SEED

The reference is extrapolated from the two finest grids. The shares of `linear_bem.error_estimate.ON_GRID` come from it.
"""

import itertools
import math
import random
import sys
import time

import numpy as np

from linear_bem import Ball, Cone, Elastic, Ellipsoid, InvalidProblem, Layer, LayeredKernel, Load, Problem, Punch
from linear_bem.error_estimate import change, error_by_change
from linear_bem.errors import ThirdBodyError
from linear_bem.grid.contacts import GridContacts, grid_levels
from linear_bem.smooth.initial_guess import first_guess

KINDS = ("deep", "thin", "merged", "cones", "punches", "mixed", "ellipsoids", "film", "three")


def scene(kind: str, rng: random.Random) -> Problem:
    young, nu, h = 1.0, rng.choice((0.0, 0.3, 0.45, 0.48, 0.5)), rng.uniform(0.9, 4.0)
    depth, apart = rng.uniform(0.1, 0.6) * min(1.0, h / 1.2), rng.uniform(2.0, 2.8)
    base = None if rng.random() < 0.6 else Elastic(10.0 ** rng.uniform(-1.0, 2.0), 0.3)
    cone = Cone(math.radians(rng.uniform(20.0, 45.0)), rng.uniform(0.01, 0.1))
    punch = Punch(rng.uniform(0.3, 0.5), rng.uniform(0.05, 0.15))
    size = tuple(rng.uniform(0.6, 1.1) for _ in range(3))
    bodies = [Ball((0.0, 0.0), 1.0), Ball((apart, 0.0), 1.0)]
    if kind == "merged":
        bodies = [Ball((x, 0.0), 1.0, "paraboloid", asperity=True) for x in (0.0, 0.5 * apart)]
    elif kind == "cones":
        bodies = [Ball((x, 0.0), shape=cone) for x in (0.0, 1.4 * apart)]
    elif kind == "punches":
        bodies, depth = [Ball((x, 0.0), shape=punch) for x in (0.0, apart)], rng.uniform(0.03, 0.1)
    elif kind == "mixed":
        bodies, depth = [Ball((0.0, 0.0), shape=punch), Ball((apart, 0.1), shape=cone)], rng.uniform(0.03, 0.1)
    elif kind == "ellipsoids":
        bodies = [Ball((x, 0.0), shape=Ellipsoid(size)) for x in (0.0, 1.2 * apart)]
    elif kind == "film":
        young, base, h = 10.0 ** rng.uniform(1.0, 2.5), Elastic(1.0, 0.3), rng.uniform(0.05, 0.4)
        depth = rng.uniform(0.1, 0.3)
    elif kind == "thin":
        h, base = rng.uniform(0.08, 0.6), None
        depth = rng.uniform(0.1, 0.5) * h
        apart = rng.uniform(0.7, 1.3) * 2.0 * math.sqrt(2.0 * depth)
        bodies = [Ball((x, 0.0), 1.0, "paraboloid", asperity=True) for x in (0.0, apart)]
    elif kind == "three":
        bodies = [Ball((0.0, 0.0), 1.0), Ball((apart, 0.3), 0.7), Ball((0.4, apart + 0.4), 1.2)]
    return Problem(Layer(young, nu, h), tuple(bodies), Load("approach", (depth,) * len(bodies)), base)


def levels(problem: Problem, seconds: float) -> list[GridContacts]:
    kernel, until, found = LayeredKernel.of(problem), time.monotonic() + seconds, []
    for contacts in grid_levels(first_guess(problem, kernel)):
        found.append(contacts)
        if time.monotonic() > until:
            break
    return found


def main(seconds: float, seed: int) -> None:
    rng, until, worst = random.Random(seed), time.monotonic() + seconds, {kind: (0, 0.0, 0.0) for kind in KINDS}
    while time.monotonic() < until:
        kind = rng.choice(KINDS)
        try:
            grids = levels(scene(kind, rng), 2.5)
        except InvalidProblem:  # overlap
            continue
        except ThirdBodyError as error:
            print(f"{kind}: {error}")
            continue
        if len(grids) < 4:
            continue
        exact = grids[-1].mutual_force + (grids[-1].mutual_force - grids[-2].mutual_force) / 3.0
        before = None
        for coarse, fine in itertools.pairwise(grids[:-1]):
            alone, _ = change(coarse, fine)
            bar = error_by_change(fine, alone, before)
            off, before = np.max(np.abs(fine.mutual_force - exact), axis=1), bar
            count, by_bar, by_change = worst[kind]
            worst[kind] = count + 1, max(by_bar, float(np.max(off / bar))), max(by_change, float(np.max(off / alone)))
    print("kind        grids  error/estimate  error/change")
    for kind, (count, by_bar, by_change) in worst.items():
        print(f"{kind:10} {count:6} {by_bar:15.2f} {by_change:13.2f}")


if __name__ == "__main__":
    main(float(sys.argv[1]), int(sys.argv[2]))
