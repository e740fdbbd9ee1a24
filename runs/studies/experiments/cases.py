"""The runs of the study: the paper's experiments, and variants of data that it does not give, with either model."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runs.evolution.evolving import TABLES, Evolution, open_session
from runs.evolution.pair_table import PairTable
from runs.evolution.providers import table_of
from runs.models import MODELS, standing
from runs.scene.effects.rolling_resistance import RollingResistanceTable
from runs.scene.scene_file import Scene, read_scene
from runs.session.session import Options

SCENES = Path(__file__).resolve().parent.parent.parent / "scenes"
QUICK_ENSEMBLE = 3
DIRECT_TOLERANCE = 1e-5
"""Tolerance of a time step [radii] with the full model, whose T is accurate to 1 %."""

Place = tuple[float, float]


@dataclass(frozen=True)
class Case:
    """A run: its scene, the scene of its finite-strain table, and ``positions`` [m] if a variant changes them.

    ``poisson`` and ``perturbation`` [m] replace the scene's; ``direct``: one member, the full model at every step;
    ``essential`` cases also run in the quick version. ``rolling``: rolling resistance over the ball's load.
    """

    name: str
    scene: str
    finite: str | None
    positions: Sequence[Place] | None = None
    poisson: float | None = None
    perturbation: float | None = None
    direct: bool = False
    essential: bool = True
    rolling: float = 0.0

    def read(self, quick: bool) -> Scene:
        """Return the scene with the changes of this variant."""
        scene = read_scene(SCENES / f"experiment_{self.scene}.toml")
        sliding = scene.sliding
        changed: dict[str, Any] = {"ensemble": min(sliding.ensemble, QUICK_ENSEMBLE)} if quick else {}
        if self.perturbation is not None:
            changed["perturbation"] = self.perturbation
        if self.direct:
            changed |= {"forces": "direct", "ensemble": 1, "tolerance": DIRECT_TOLERANCE}
        sliding = sliding.model_copy(update=changed)
        problem = scene.problem if self.positions is None else scene.problem.at(self.positions)
        if self.poisson is not None:
            problem = dataclasses.replace(problem, layer=dataclasses.replace(problem.layer, poisson=self.poisson))
        drift: dict[str, Any] = {"reciprocation": sliding}
        if self.rolling > 0.0:
            drift["rolling_resistance"] = RollingResistanceTable(share=self.rolling)
        return dataclasses.replace(scene, problem=problem, drift=drift)


def line(count: int, distance: float, out: int | None = None, aside: float = 0.0) -> list[Place]:
    """Return positions [m] in a line along x about the origin; ball ``out`` is offset by ``aside`` along y."""
    return [((i - 0.5 * (count - 1)) * distance, aside if i == out else 0.0) for i in range(count)]


THICK = "line_of_six_finite_strain"
CASES = (
    Case("line of four, 25 mm", "line_of_four_25mm", THICK),
    Case("line of four, 30 mm", "line_of_four_30mm", THICK),
    Case("line of six, 25 mm", "line_of_six", THICK),
    Case("line of six, 30 mm", "line_of_six", THICK, line(6, 0.030), essential=False),
    Case("line of six, 35 mm", "line_of_six", THICK, line(6, 0.035), essential=False),
    Case("line of six, nu = 0", "line_of_six", None, poisson=0.0, essential=False),
    Case("line of six, nu = 0.45", "line_of_six", None, poisson=0.45, essential=False),
    Case("line of seven, middle out", "line_of_seven", THICK),
    Case("line of seven, third out", "line_of_seven", THICK, line(7, 0.025, 2, 0.030), essential=False),
    Case("line of seven, 35 mm, middle out", "line_of_seven", THICK, line(7, 0.035, 3, 0.035), essential=False),
    Case("nine, 20 mm", "nine_20mm", THICK),
    Case("nine, 30 mm", "nine_30mm", THICK),
    Case("nine, 20 mm, shaken by 2 mm", "nine_20mm", THICK, perturbation=2e-3, essential=False),
    Case("nine, 30 mm, shaken by 2 mm", "nine_30mm", THICK, perturbation=2e-3, essential=False),
    Case("nine, 30 mm, full model", "nine_30mm", None, direct=True, essential=False),
    Case("pair, 16 mm balls", "pair_16mm", "pair_16mm_finite_strain"),
    Case("pair, 10 mm balls", "pair_10mm", "pair_10mm_finite_strain"),
    Case("pair, 7 mm balls", "pair_7mm", "pair_7mm_finite_strain"),
)


def chosen(quick: bool) -> list[Case]:
    """Return the cases of the quick or the full version."""
    return [case for case in CASES if case.essential or not quick]


def finite(case: Case, scene: Scene) -> Scene:
    """Return ``scene`` with finite strain, at the accuracy of the scene that computes its table."""
    written = read_scene(SCENES / f"experiment_{case.finite}.toml")
    return dataclasses.replace(
        scene,
        problem=dataclasses.replace(scene.problem, finite_strain=written.problem.finite_strain),
        effects=(*scene.effects, "finite_strain"),
        tangential_force=written.tangential_force,
        budget=written.budget,
    )


def table(model: str, scene: Scene) -> PairTable:
    """Return a model's saved pair table for a scene, complete or not; computes nothing."""
    asked = standing(scene)
    budget = asked.budget if model == "finite_strain" else None
    return table_of(MODELS[model], asked.problem, asked.tangential_force, TABLES, budget=budget)


def runs_of(case: Case, quick: bool) -> list[tuple[str, Scene]]:
    """Return the models that evolve a case, each with its scene; finite strain only if its table is complete."""
    scene = case.read(quick)
    found = [("linear_bem", scene)]
    if case.finite is not None and table("finite_strain", strained := finite(case, scene)).missing == 0:
        found.append(("finite_strain", strained))
    return found


def evolve(
    case: Case, scene: Scene, model: str, folder: Path, *, fresh: bool = False, pictures: bool = False,
    compute: bool = True,
) -> dict[str, Any] | None:  # fmt: skip
    """Return the finished document of one run, computed if it is missing; None if missing and not ``compute``."""
    resisted = f"-rolling_{case.rolling:g}" if case.rolling > 0.0 else ""
    stem = f"{case.name.replace(', ', '-').replace(' = ', '_').replace(' ', '_')}-{model}{resisted}"
    with open_session(scene, model, Options(False, folder / stem, fresh)) as session:
        if session.complete:
            return session.saved
        return Evolution(session).complete(pictures=pictures) if compute else None


def distances(document: Mapping[str, Any], i: int, j: int) -> tuple[np.ndarray, np.ndarray]:
    """Return cycles and the distance [m] of balls i and j."""
    cycle = np.array([m["cycle"] for m in document["path"]])
    x = np.array([m["positions"] for m in document["path"]])
    return cycle, np.hypot(*(x[:, j] - x[:, i]).T)
