"""Typed results of a run (one model at a load step, each discretisation, the answer) and their JSON file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.errors import OutputUnusable
from linear_bem.result import BallResult, Step

NAME, BEFORE = "discretisations.json", "discretisations.before.json"
"""File of the records, and its copy from before the last step."""


@dataclass(frozen=True, eq=False)
class ContactState:
    """Equilibrium of one model on one discretisation; arrays have one entry per ball of the model, for whole balls.

    ``penetration`` [m] is the largest one; ``mean_gap`` [m] is the pressure-weighted mean, negative if the surface lies
    inside the ball; ``peak_pressure`` [Pa] is the largest mean around a vertex, ``peak_excess`` how much the pressure
    may exceed it, over it; ``traction_force`` [N] is T from the contact traction, ``tangential_force`` [N] from the
    domain integral.
    """

    fraction: float
    approach: np.ndarray
    normal_force: np.ndarray
    tangential_force: np.ndarray
    traction_force: np.ndarray
    contact_area: np.ndarray
    peak_pressure: np.ndarray
    peak_excess: np.ndarray
    penetration: np.ndarray
    mean_gap: np.ndarray

    @property
    def per_squared_force(self) -> np.ndarray:
        """T / Q^2 (balls, 2) [1/N], zero without force."""
        squared = self.normal_force[:, None] ** 2
        return np.divide(self.tangential_force, squared, out=np.zeros_like(self.tangential_force), where=squared > 0.0)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ContactState:
        """Return the state that `save_records` wrote."""
        arrays = {name: np.array(value, dtype=float) for name, value in dict(data).items() if name != "fraction"}
        return cls(fraction=float(data["fraction"]), **arrays)


@dataclass(frozen=True)
class Row:
    """Results of one discretisation at a load step: of the problem's model and, if it converged, of small strain."""

    own: ContactState
    small: ContactState | None = None


@dataclass(frozen=True)
class Discretisation:
    """Element order, mesh fineness (see `meshes.box`), and factors on the planned extent and penalty."""

    order: int
    fineness: float
    extent: float = 1.0
    penalty: float = 1.0

    @property
    def resolution(self) -> float:
        """Nodes along an edge of the model, over those of a mesh of order 1 and fineness 1."""
        return self.order * self.fineness

    def __str__(self) -> str:
        wider = f", domain {self.extent:.2g} times as wide" if self.extent != 1.0 else ""
        stiffer = f", penalty {self.penalty:.2g} times as stiff" if self.penalty != 1.0 else ""
        return f"order {self.order}, fineness {self.fineness:g}{wider}{stiffer}"


@dataclass(frozen=True, kw_only=True)
class SolverAccount:
    """Cost and residuals of a load step with output.

    Counts are sums over the load steps since the last answer, ``cuts`` is their largest number of cut-backs.
    ``residual`` [N] is Newton's last, ``tolerance`` its bound, ``residuals`` those of its last solve; ``force_balance``
    is the relative difference of forces on balls and base; for the smallest values, ``surface_crossing`` and
    ``distorted_at`` see `finite_strain.force.distortion`; ``film`` is the smallest share of the layer's thickness left
    under a ball, None in results of earlier versions; ``strain_energy`` [J] is that of the whole scene.
    """

    fraction: float
    iterations: int
    tangents: int
    augmentation_iterations: int
    augmented: bool
    cuts: int
    residual: float
    tolerance: float
    penetration: float
    force_balance: float
    smallest_volume_ratio: float
    smallest_surface_stretch: float
    smallest_seen_area: float
    surface_crossing: float
    distorted_at: dict[str, list[float]]
    strain_energy: float
    linear_solver: str
    linear_iterations: int
    linear_fallbacks: int
    residuals: list[float]
    seconds: float
    film: float | None = None


@dataclass(frozen=True, kw_only=True)
class Answer(SolverAccount):
    """The answer at load step number ``step``; lists have one value per ball of the scene, forces and errors in N.

    ``mesh`` is the discretisation's number in its run; ``linear_failure`` says why `linear_bem` has no answer;
    ``error_terms`` are those of T or, where only one ball presses, of the force or approach that is not prescribed;
    ``imbalance`` is the size of the sum of T on the mesh and ``imbalance_error`` the sum of its errors, before T is
    corrected by them. ``normal_force_error`` applies to a given approach or total force, ``approach_error`` [m] to a
    given force.
    """

    balls: tuple[BallResult, ...]
    step: int
    linear_failure: str
    error_terms: dict[str, list[float]]
    pair_weight: list[float]
    imbalance: float
    normal_force_error: list[float]
    approach_error: list[float]
    tangential_force_error_at_force: list[float]
    imbalance_error: float | None = None
    mesh: int | None = None

    @property
    def account(self) -> SolverAccount:
        """The account alone."""
        return SolverAccount(**{each.name: getattr(self, each.name) for each in fields(SolverAccount)})

    def to_step(self) -> Step:
        """Return the public `Step`, whose record holds all but the balls."""
        return Step(self.balls, {k: v for k, v in vars(self).items() if k != "balls" and v is not None})

    @classmethod
    def from_step(cls, step: Step) -> Answer:
        """Return the answer that `to_step` wrote; entries unknown to this version are ignored."""
        known = {each.name: step.record[each.name] for each in fields(cls) if each.name in step.record}
        return cls(balls=step.balls, **known)


@dataclass
class Record:
    """One discretisation of a run: its definition, its results at each load step, and its cost.

    ``reached`` is the largest error of T at full load over ``scale`` [N]; ``stopped`` says why it did not reach full
    load; ``changes`` are the changes from the coarser discretisation at the rows: of T / Q^2 ("ratio") and of T over
    Q^2 ("T"), both (balls, 2) [1/N], of the force or approach that is not prescribed ("follows"), of the balls' parts
    of the forces ("parts"), "contact_area" and "peak_pressure" (these relative), and the errors of the small-strain
    problem on both discretisations ("known", see `Paired`); nan where they are not known. ``stiffened`` is how often
    penalties were raised at full load; ``resolved`` is False if elements are nearly inverted there.
    """

    level: Discretisation
    unknowns: int = 0
    seconds: float = 0.0
    finished: bool = False
    rows: list[Row] = field(default_factory=list)
    steps: list[Answer] = field(default_factory=list)
    changes: dict[str, list[Any]] = field(default_factory=dict)
    terms: dict[str, float] = field(default_factory=dict)
    reached: float = math.nan
    scale: float = math.nan
    stiffened: int = 0
    resolved: bool = True
    stopped: str = ""

    def at(self, fraction: float) -> Row | None:
        """Return the results at a load fraction."""
        return next((row for row in self.rows if row.own.fraction == fraction), None)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Record:
        """Return the record that `save_records` wrote."""
        steps = [Answer.from_step(Step.from_dict(step)) for step in data["steps"]]
        rows = [Row(**{k: v and ContactState.from_dict(v) for k, v in dict(row).items()}) for row in data["rows"]]
        return cls(**{**data, "level": Discretisation(**data["level"]), "rows": rows, "steps": steps})


def save_records(folder: Path, key: str, records: list[Record]) -> None:
    """Write all discretisations of a run into its folder atomically; the previous file is kept as `BEFORE`."""
    path = folder / NAME
    draft = path.with_suffix(".part")
    draft.write_text(json.dumps({"key": key, "discretisations": records}, default=_plain), encoding="utf-8")
    if path.exists():
        path.replace(folder / BEFORE)
    draft.replace(path)


def _plain(value: object) -> object:
    if isinstance(value, Answer):
        return value.to_step().to_dict()
    return value.tolist() if isinstance(value, np.ndarray) else vars(value)


def saved_records(folder: Path, key: str) -> tuple[list[Record], str]:
    """Return the records that an earlier run of the same key saved in a folder, and a note if its last file is damaged.

    In that case the previous file is used, which lacks at most one load step. Raises `OutputUnusable` if both are
    damaged.
    """
    damage = ""
    for name in (NAME, BEFORE):
        path = folder / name
        try:
            saved = json.loads(path.read_text(encoding="utf-8"))
            records = [Record.from_dict(record) for record in saved["discretisations"]] if saved["key"] == key else []
        except FileNotFoundError:
            continue
        except (OSError, ValueError, TypeError, LookupError) as error:
            damage = damage or f"{path} cannot be read ({error})"
            continue
        if damage:  # else the next save would replace the good file by it
            (folder / NAME).unlink(missing_ok=True)
        continued = f"continued from {BEFORE}" if records else "started from the beginning"
        return records, f"{damage}: the run {continued}" if damage else ""
    if damage:
        raise OutputUnusable(f"{damage}: remove it to start from the beginning")
    return [], ""
