"""The runs of the study: randomly placed balls in a periodic cell on layers of several thicknesses, R = 1 and E = 1."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from runs.evolution.evolving import FORMAT, TABLES, Evolution, open_session
from runs.evolution.forces import abreast
from runs.evolution.pair_forces import PairForces
from runs.evolution.providers import provider
from runs.models import MODELS
from runs.process.files import read_csv, read_json, write_text
from runs.scene.scene_file import read_scene
from runs.session.output_folder import MARK
from runs.session.session import Options
from runs.studies.collective.lattice_waves import Wave, fastest
from runs.studies.framework.pair import as_seen_by, pair

POISSON, APPROACH = 0.48, 0.1
"""Poisson's ratio of the layer; approach over R."""
DEEP, BETWEEN = 0.3, 1.8
"""Approach over R, and thickness over R, of the runs by both models."""
BOTH = ((0.3, 1), (0.3, 2), (0.3, 3), (0.15, 1), (0.5, 1))
"""Area fractions and seeds of these runs."""
SEVERAL = {0.3: (6.0, 3.0, 2.0, 1.16), 0.15: (6.0, 3.0, 2.0, 1.16), 0.5: (2.0, 1.16)}
"""Thicknesses over R with three random starts, by area fraction."""
MODEL, FINITE = "linear_bem", "finite_strain"
GATHERING, PARTING, RESISTED = 20.0, 1000.0, 1000.0
"""Longest run if touching balls attract, if they separate, and with rolling resistance: sliding path over friction,
times the largest T/Q of a pair, over R. Without resistance clusters continue to merge, more and more slowly."""
ROLLING = 0.2
"""Rolling resistance of the runs with it, over the largest T/Q of a pair."""
REST = 5e-3
"""Force over load of a ball at rest, over the largest T/Q of a pair."""
TOLERANCE = 1e-4
"""Error of one step over R."""
GATHERED, GROUPED = 4.0, 1.3
"""Mean cluster size (of the cluster of a random ball) from which a layer counts as gathered, and as grouped."""
ORDERED = 0.15
"""Growth of the mean |psi_6| from which a layer that has not gathered counts as ordered."""
DISTANCES = np.linspace(2.0, 24.0, 221)
"""Distances over R at which the pair law is computed."""


NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
"""A number with a fraction in the text of a scene."""


@dataclass(frozen=True)
class Case:
    """``count`` balls that cover the area ``fraction``, on a layer of ``thickness`` h/R; ``seed`` of the random start.

    ``rolling``: rolling resistance over the largest T/Q of a pair; ``approach``: D/R; ``finite``: forces at finite
    strain.
    """

    thickness: float
    fraction: float
    count: int
    seed: int
    rolling: float = 0.0
    approach: float = APPROACH
    finite: bool = False

    @property
    def name(self) -> str:
        """Name of the case's folder."""
        name = f"h{self.thickness:g}-phi{self.fraction:g}-n{self.count}-seed{self.seed}"
        name += f"-rolling{self.rolling:g}" if self.rolling > 0.0 else ""
        name += f"-D{self.approach:g}" if self.approach != APPROACH else ""
        return f"{name}-finite" if self.finite else name

    @property
    def length(self) -> float:
        """Side of the square cell over R."""
        return float(np.sqrt(self.count * np.pi / self.fraction))


def cases(quick: bool) -> list[Case]:
    """Return the runs of the quick or of the full version, the most important ones first."""
    count = 200 if quick else 1000
    if quick:
        return [Case(h, 0.3, count, 1) for h in (1.16, 6.0)]
    thicknesses = (1.16, 2.0, 6.0, 3.0, 1.75, 1.5, 0.8)
    grid = [Case(h, phi, count, 1) for phi in (0.3, 0.15, 0.5) for h in thicknesses]
    seeds = [Case(h, phi, count, seed) for phi, several in SEVERAL.items() for h in several for seed in (2, 3)]
    rest = Case(6.0, 0.3, count, 1, ROLLING)
    both = [Case(BETWEEN, phi, count, seed, 0.0, DEEP, by) for phi, seed in BOTH for by in (False, True)]
    return [*grid, rest, *seeds, *both]


@dataclass(frozen=True, eq=False)
class PairLaw:
    """T/Q of two balls at `DISTANCES`, its largest magnitude, and the distances over R where it changes sign."""

    ratio: Array
    largest: float
    changes: tuple[float, ...]
    forces: PairForces | None = None

    def wave(self, fraction: float) -> Wave | None:
        """Return the fastest growing wave in a triangular lattice, its rate per cycle [1/R]; None without ``forces``.

        ``fraction``: covered area fraction. In one cycle, the largest T/Q of a pair moves a ball by R.
        """
        if self.forces is None:
            return None
        wave = fastest(self.forces, float(np.sqrt(2.0 * np.pi / (np.sqrt(3.0) * fraction))))
        return Wave(wave.rate / self.largest, wave.length)

    @property
    def farthest_apart(self) -> float:
        """Distance over R at which the separating T is largest."""
        return float(DISTANCES[np.argmin(self.ratio)])

    @property
    def softens(self) -> bool:
        """Whether, for touching balls, T separates less than at larger distance, or attracts."""
        return self.farthest_apart > DISTANCES[0]


@cache
def pair_law(thickness: float, approach: float, *, finite: bool) -> PairLaw:
    """Return the pair law of two balls on a layer; T > 0 attracts."""
    model = FINITE if finite else MODEL
    problem = as_seen_by(model, pair(approach, thickness, poisson=POISSON, substrate=None))
    forces = provider(MODELS[model], problem, None, "pairs", TABLES).forces
    assert isinstance(forces, PairForces)
    states = [forces(abreast(d)) for d in DISTANCES]
    ratio = np.array([s.tangential[0, 0] / s.normal[0] for s in states])
    largest = float(np.max(np.abs(ratio)))
    seen = np.abs(ratio) > 1e-3 * largest
    at, value = DISTANCES[seen], ratio[seen]
    turns = np.flatnonzero(np.sign(value[1:]) != np.sign(value[:-1]))
    roots = tuple(float(at[k] - value[k] * (at[k + 1] - at[k]) / (value[k + 1] - value[k])) for k in turns)
    return PairLaw(ratio, largest, roots, forces)


@cache
def random_start(count: int, side: float, seed: int) -> Array:
    """Return positions (count, 2) over R by random sequential addition: each at random where it overlaps none."""
    draw = np.random.default_rng(seed)
    x = np.zeros((count, 2))
    placed = 0
    while placed < count:
        place = draw.uniform(0.0, side, 2)
        between = x[:placed] - place
        between -= side * np.round(between / side)
        if not np.any(np.sum(between**2, axis=1) < 4.0):
            x[placed] = place
            placed += 1
    return x


def scene_text(case: Case, law: PairLaw) -> str:
    """Return the scene of a case; a "cycle" is the path in which the largest T/Q of a pair moves a ball by R.

    ``law`` is the pair law at small strain: the runs of both models have equal sliding paths and rest thresholds.
    """
    longest = RESISTED if case.rolling > 0.0 else GATHERING if law.ratio[0] > 0.0 else PARTING
    resisted = f"[rolling_resistance]\nshare = {case.rolling * law.largest}\n" if case.rolling > 0.0 else ""
    start = random_start(case.count, case.length, case.seed)
    positions = ",\n  ".join(f"[{x!r}, {y!r}]" for x, y in start.tolist())
    return f"""title = "{case.count} balls on {case.fraction:g} of the plane, layer of {case.thickness:g} R"
[layer]
thickness = {case.thickness}
young = 1.0
poisson = {POISSON}
[balls]
radius = 1.0
positions = [
  {positions},
]
[load]
approach = {case.approach}
[reciprocation]
amplitude = {0.25 / law.largest}
cycles = {longest}
friction = 1.0
tolerance = {TOLERANCE}
rest = {REST * law.largest}
[periodic]
lengths = [{case.length!r}, {case.length!r}]
{resisted}{"[finite_strain]" if case.finite else ""}
"""


def _text_of(case: Case) -> str:
    return scene_text(case, pair_law(case.thickness, case.approach, finite=False))


def _is_scene(file: Path, text: str) -> bool:
    """Return whether a file holds this scene, to six digits: a table of pairs that is made again changes the last."""
    saved = file.read_text(encoding="utf-8") if file.exists() else ""
    one, other = (NUMBER.sub(lambda found: f"{float(found[0]):.6g}", each) for each in (saved, text))
    return one == other


def evolve(case: Case, folder: Path, *, fresh: bool = False) -> None:
    """Complete a run; resumable. A run under other settings is refused, or replaced if ``fresh``."""
    file = folder / f"{case.name}.toml"
    text = _text_of(case)
    if not _is_scene(file, text):
        write_text(file, text)
    with open_session(
        read_scene(file), FINITE if case.finite else MODEL, Options(False, folder / case.name, fresh)
    ) as session:
        if not session.complete:
            Evolution(session, TABLES).complete(pictures=False)


@dataclass(frozen=True)
class Finished:
    """A run with its row of the study's table and its arrangement along the path."""

    case: Case
    row: Mapping[str, Any]
    rows: Sequence[Mapping[str, float]]

    @property
    def outcome(self) -> str:
        """Outcome, so far if the run is interrupted: "gathers", "small groups", "orders" or "stays"."""
        if self.row["cluster_mean"] >= GATHERED:
            return "gathers"
        if self.row["cluster_mean"] >= GROUPED:
            return "small groups"
        return "orders" if self.row["hexatic_end"] - self.row["hexatic_start"] >= ORDERED else "stays"


def read(case: Case, folder: Path) -> Finished | None:
    """Return a run, complete or not; None if it has not begun under the present settings and format."""
    mark, document = (read_json(folder / case.name / name) for name in (MARK, "result.json"))
    if document is None or mark is None or mark["identity"]["format"] != FORMAT:
        return None
    if not _is_scene(folder / case.name / "scene.toml", _text_of(case)):
        return None
    rows = read_csv(folder / case.name / "structure.csv", float)
    first, last, solved = rows[0], rows[-1], document["solved"]
    ended = "at rest" if document.get("rest", {}).get("at_rest") else "path spent"
    row = {
        "h/R": case.thickness,
        "area_fraction": case.fraction,
        "balls": case.count,
        "seed": case.seed,
        "rolling": case.rolling,
        "path": last["cycle"],
        "ended": ended if solved["converged"] else "interrupted",
        "cluster_mean": last["cluster_mean"],
        "coordination": last["coordination"],
        "hexatic_start": first["hexatic_local"],
        "hexatic_end": last["hexatic_local"],
        "nearest_distance": last["nearest_distance_mean"],
        "force_over_load": first["largest_force_over_largest_load"],
        "steps": solved["iterations"] or None,
        "seconds": solved["seconds"],
    }
    return Finished(case, row, rows)
