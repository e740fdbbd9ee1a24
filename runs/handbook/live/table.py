"""The data of the handbook's live page: two equal spheres on a layer with a rigid base, at small strain.

    python -m runs.handbook.live.table            # about 25 minutes of processor time; continues after an interruption
    python -m runs.handbook.live.table errors     # compares the shipped table with the solver again

Lengths are over R, forces over E R^2, so that the table holds for all R and E. With E* = E/(1 - nu^2), it contains

- the logarithm of Q over Q of one ball on a half-space, 4/3 E* sqrt(R) D^(3/2) [Hertz 1881];
- T over T of two point loads Q on a half-space, T0 = Q^2/(pi E* L^2), less the same ratio for point loads on the
  layer, which depends on L/h and nu alone and has a finer table. The remainder, due to the contacts' size, is smooth;
- for one ball alone, the contact radius a and the surface around it, for the section.

D is tabulated as a fraction of the largest approach, the smaller of 0.5 R and 0.44 h. The table is then compared with
`linear_bem.solve` at random points and at points of a grid between the nodes. The error of T and Q on the page is
`MARGIN` times the largest difference among points of the same kind, see `kind`.
"""

import hashlib
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import linear_bem
from linear_bem import Ball, ContactSequence, Layer, LayeredKernel, Load, Problem, solve_contact
from runs.handbook.live.chebyshev import Array, Axis, interpolate
from runs.studies.framework.case import code_of

FILE = Path(__file__).with_name("table.json")
CACHE = Path("out/live-table")
DEEPEST, DEEPEST_SHARE = 0.5, 0.44
"""Largest approach over R, and over h."""
POISSON = Axis("poisson", 0.0, 0.5, "linear", 6)
DISTANCE = Axis("distance", 2.0, 8.0, "log", 10)
DEPTH = Axis("depth", 0.02, 1.0, "sqrt", 5)
BREAK = DEEPEST / DEEPEST_SHARE
THICKNESS = (Axis("thickness", 0.5, BREAK, "log", 5), Axis("thickness", BREAK, 12.0, "log", 9))
"""The largest approach has a kink at the thickness where both limits are equal: there is one table on each side."""
FINE_POISSON = Axis("poisson", 0.0, 0.5, "linear", 8)
REACH = Axis("distance over thickness", 0.15, 16.0, "log", 40)
AROUND = Axis("distance from the contact", 0.0, 8.0, "sqrt", 16)
RANDOM_POINTS, SEED = 240, 20211
CHECKED = {
    "poisson": (0.0, 0.15, 0.3, 0.38, 0.44, 0.45, 0.5),
    "thickness": (0.5, 0.52, 0.7, 1.13, 1.137, 1.16, 1.4, 2.2, 5.0, 12.0),
    "distance": (2.0, 2.05, 2.19, 2.2, 4.0, 8.0),
    "share": (1.0, 0.51, 0.5, 0.2, 0.02),
}
"""Grid of points at which T and Q are compared with the solver, with both sides of the borders of `kind`; share: of the
largest approach."""
MARGIN = 1.5
SEQUENCE_ACCURACY, CHECK_ACCURACY = 1e-3, 1e-4
"""Relative accuracy of T required of the solver for the table, and for its errors."""
Point = tuple[float, float, float, float]
"""Poisson's ratio, thickness, distance and approach."""


def deepest(thickness: float) -> float:
    """Return the largest tabulated approach over R for a thickness over R."""
    return min(DEEPEST, DEEPEST_SHARE * thickness)


def pair(poisson: float, thickness: float, distance: float, approach: float) -> Problem:
    """Return two balls of R = 1 on a layer of E = 1."""
    balls = (Ball((-0.5 * distance, 0.0), 1.0), Ball((0.5 * distance, 0.0), 1.0))
    return Problem(Layer(1.0, poisson, thickness), balls, Load("approach", (approach, approach)))


def hertz_force(poisson: float, approach: float) -> float:
    """Return Q / (E R^2) of one ball on a half-space."""
    return 4.0 / 3.0 * approach**1.5 / (1.0 - poisson**2)


def point_ratio(poisson: float, reach: float) -> float:
    """Return T of two point loads on the layer over T0, at ``reach`` = L/h."""
    kernel = LayeredKernel(Layer(1.0, poisson, 1.0))
    return float(-(reach**2) * kernel.scaled_slope(reach))


@dataclass(frozen=True)
class LiveTable:
    """The tables of the live page, with its formulas `pair_forces` and `section`."""

    data: dict[str, Any]

    def patch(self, thickness: float) -> tuple[Axis, dict[str, Any]]:
        """Return the axis of thickness and the tables that cover ``thickness``."""
        number = int(thickness > BREAK)
        return THICKNESS[number], self.data["patches"][number]

    def pair_forces(self, poisson: float, thickness: float, distance: float, approach: float) -> tuple[float, float]:
        """Return Q and T (> 0: attraction) over E R^2."""
        axis, tables = self.patch(thickness)
        axes = (POISSON, axis, DEPTH, DISTANCE)
        at = (poisson, thickness, approach / deepest(thickness), distance)
        normal = hertz_force(poisson, approach) * math.exp(float(interpolate(axes, tables["normal"], at)))
        ratio = float(interpolate(axes, tables["remainder"], at))
        reach = min(max(distance / thickness, REACH.low), REACH.high)
        ratio += float(interpolate((FINE_POISSON, REACH), self.data["point_ratio"], (poisson, reach)))
        return normal, ratio * reference(poisson, distance, normal)

    def dent(self, poisson: float, thickness: float, approach: float, r: float) -> float:
        """Return w / R at the distance ``r`` from the axis of one ball alone."""
        axis, tables = self.patch(thickness)
        axes, at = (POISSON, axis, DEPTH), (poisson, thickness, approach / deepest(thickness))
        # a / R, and w / D at the points `AROUND` outside of the contact
        radius, around = float(interpolate(axes, tables["radius"], at)), interpolate(axes, tables["around"], at)
        if r <= radius:
            return approach - 1.0 + math.sqrt(1.0 - r * r)
        return approach * float(interpolate((AROUND,), around, (min(r - radius, AROUND.high),)))

    def section(self, poisson: float, thickness: float, distance: float, approach: float) -> Callable[[float], float]:
        """Return w(x) / R under both balls, by superposition of single balls.

        The approach of each is reduced by the surface displacement due to the other at its axis.
        """
        alone = approach
        for _ in range(30):
            alone = approach - self.dent(poisson, thickness, alone, distance)
        half = 0.5 * distance

        def surface(x: float) -> float:
            w = sum(self.dent(poisson, thickness, alone, abs(x - side * half)) for side in (-1.0, 1.0))
            under = [approach - 1.0 + math.sqrt(1.0 - d * d) for s in (-1, 1) if (d := abs(x - s * half)) < 1.0]
            return max([w, *under])

        return surface


def reference(poisson: float, distance: float, normal: float) -> float:
    """Return T0 = Q^2 / (pi E* L^2) over E R^2."""
    return normal**2 * (1.0 - poisson**2) / (math.pi * distance**2)


def compute() -> LiveTable:
    """Return the table with its errors; parts that are complete are read from `CACHE`."""
    CACHE.mkdir(parents=True, exist_ok=True)
    axes = {"poisson": POISSON, "distance": DISTANCE, "depth": DEPTH, "around": AROUND, "reach": REACH}
    fine = [[point_ratio(nu, reach) for reach in REACH.nodes()] for nu in FINE_POISSON.nodes()]
    data = {
        "axes": {name: vars(axis) for name, axis in {**axes, "fine_poisson": FINE_POISSON}.items()},
        "thickness": [vars(axis) for axis in THICKNESS],
        "deepest": [DEEPEST, DEEPEST_SHARE],
        "point_ratio": _rounded(fine),
        "patches": [_patch(axis) for axis in THICKNESS],
    }
    return with_errors(LiveTable(data))


def with_errors(table: LiveTable) -> LiveTable:
    """Return the table with its differences from the solver at the random points and on the grid `CHECKED`."""
    points = list(random_points(RANDOM_POINTS))
    points += [(nu, h, apart, share * deepest(h)) for nu, h, apart, share in product(*CHECKED.values())]
    off = []
    with ProcessPoolExecutor() as pool:
        for each in pool.map(partial(difference, table), points, chunksize=5):
            off.append(each)
            if len(off) % 200 == 0:
                print(f"compared with the solver at {len(off)} of {len(points)} points")
    found = errors(points[:RANDOM_POINTS], off[:RANDOM_POINTS])
    return LiveTable({**table.data, "errors": found, "error_of_kind": errors_of_kinds(points, off)})


def random_points(count: int, seed: int = SEED) -> Iterator[Point]:
    """Yield (poisson, thickness, distance, approach) spread over the whole table, reproducibly.

    One eighth of the coordinates lie at the ends of their axes, where interpolation is least accurate.
    """
    random = np.random.default_rng(seed)
    shares = np.clip(random.uniform(-1.0 / 14.0, 15.0 / 14.0, (count, 4)), 0.0, 1.0)
    for s in shares:
        thickness = THICKNESS[0].low * (THICKNESS[1].high / THICKNESS[0].low) ** float(s[1])
        distance = DISTANCE.low * (DISTANCE.high / DISTANCE.low) ** float(s[2])
        share = DEPTH.low * (DEPTH.high / DEPTH.low) ** float(s[3])
        yield POISSON.high * float(s[0]), thickness, distance, share * deepest(thickness)


def errors(points: Sequence[Point], off: Sequence[Array]) -> list[dict[str, Any]]:
    """Return the largest and the median of the differences ``off`` at ``points``, for each part of the table."""
    parts = [np.array([each for at, each in zip(points, off, strict=True) if (at[1] > BREAK) == p]) for p in (0, 1)]

    def named(values: Array) -> dict[str, float]:
        return dict(zip(("tangential", "normal", "section"), _rounded(values), strict=True))

    return [
        {"points": len(part), "largest": named(np.max(part, axis=0)), "median": named(np.median(part, axis=0))}
        for part in parts
    ]


def kind(poisson: float, thickness: float, distance: float, approach: float) -> int:
    """Return the number of a point's kind: thickness, Poisson's ratio, distance and depth where errors differ most."""
    deep = approach > 0.5 * deepest(thickness)
    return 8 * int(thickness > BREAK) + 4 * int(poisson > 0.44) + 2 * int(distance < 2.2) + int(deep)


def errors_of_kinds(points: Sequence[Point], off: Sequence[Array]) -> list[list[float]]:
    """Return the errors of T over T0 and of Q over Q of every `kind`, from the differences ``off`` at ``points``."""
    largest = np.zeros((16, 2))
    for at, each in zip(points, off, strict=True):
        largest[kind(*at)] = np.maximum(largest[kind(*at)], each[:2])
    return list(_rounded(MARGIN * largest))


def difference(table: LiveTable, at: Point) -> Array:
    """Return the sizes of the differences from the solver at one point: T over T0, Q over Q, w over D."""
    poisson, _, distance, approach = at
    solution = solve_contact(pair(*at), CHECK_ACCURACY)
    ball, (normal, tangential) = solution.result().balls[0], table.pair_forces(*at)
    unit = reference(poisson, distance, ball.normal_force)
    x = np.linspace(-0.5 * distance - 3.0, 0.5 * distance + 3.0, 61)
    section = table.section(*at)
    w = np.array([section(float(place)) for place in x])
    of_section = np.max(np.abs(w - solution.displacement(x, np.zeros_like(x)))) / approach
    return np.abs([(tangential - ball.tangential_force[0]) / unit, normal / ball.normal_force - 1.0, of_section])


def _patch(thicknesses: Axis) -> dict[str, Any]:
    """Return the tables over (poisson, thickness, depth, ...) of one part."""
    shape = (POISSON.count, thicknesses.count, DEPTH.count)
    normal, remainder = np.empty((*shape, DISTANCE.count)), np.empty((*shape, DISTANCE.count))
    radius, around = np.empty(shape), np.empty((*shape, AROUND.count))
    indices = list(product(*map(range, shape)))
    for number, index in enumerate(indices):
        poisson, thickness, share = (a.nodes()[i] for a, i in zip((POISSON, thicknesses, DEPTH), index, strict=True))
        found = _of_depth(float(poisson), float(thickness), float(share))
        normal[index], remainder[index] = found["normal"], found["remainder"]
        radius[index], around[index] = found["radius"], found["around"]
        if number % 10 == 9:
            print(f"h = {thicknesses.low:.3g} to {thicknesses.high:.3g} R: {number + 1} of {len(indices)}")
    tables = {"normal": normal, "remainder": remainder, "radius": radius, "around": around}
    return {name: _rounded(values) for name, values in tables.items()}


def _of_depth(poisson: float, thickness: float, share: float) -> dict[str, Any]:
    """Return the values over the distance, and those of one ball alone, from `CACHE` if they are there."""
    approach = share * deepest(thickness)
    settings = (DISTANCE, AROUND, SEQUENCE_ACCURACY, CHECK_ACCURACY, code_of(Path(linear_bem.__file__).parent))
    digest = hashlib.sha256(repr(settings).encode()).hexdigest()[:12]
    file = CACHE / f"{poisson:.12f}-{thickness:.12f}-{approach:.12f}-{digest}.json"
    if file.exists():
        return dict(json.loads(file.read_text()))
    sequence, normal, remainder = ContactSequence(SEQUENCE_ACCURACY), [], []
    for distance in map(float, DISTANCE.nodes()):
        state = sequence.solve(pair(poisson, thickness, distance, approach))
        force = float(state.normal_forces[0])
        ratio = float(state.tangential_force[0, 0]) / reference(poisson, distance, force)
        normal.append(math.log(force / hertz_force(poisson, approach)))
        remainder.append(ratio - point_ratio(poisson, distance / thickness))
    layer = Layer(1.0, poisson, thickness)
    alone = solve_contact(Problem(layer, (Ball((0.0, 0.0), 1.0),), Load("approach", (approach,))), CHECK_ACCURACY)
    radius = math.sqrt(alone.result().balls[0].contact_area / math.pi)
    r = radius + AROUND.nodes()
    around = alone.displacement(r, np.zeros_like(r)) / approach
    found = {"normal": normal, "remainder": remainder, "radius": radius, "around": around.tolist()}
    file.write_text(json.dumps(found))
    return found


def _rounded(values: Any) -> Any:
    """Return nested lists of numbers with six significant digits."""
    return np.vectorize(lambda v: float(f"{v:.6g}"))(np.asarray(values, dtype=float)).tolist()


def read() -> LiveTable:
    """Return the shipped table."""
    return LiveTable(json.loads(FILE.read_text(encoding="utf-8")))


if __name__ == "__main__":
    made = with_errors(read()) if sys.argv[1:] == ["errors"] else compute()
    FILE.write_text(json.dumps(made.data, separators=(",", ":")) + "\n", encoding="utf-8")
    print(f"{FILE}: {FILE.stat().st_size / 1e3:.0f} kB; {made.data['errors']}, {made.data['error_of_kind']}")
