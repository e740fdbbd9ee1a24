"""The command ``evolve``: the balls of a scene drift for its cycles, and the run folder keeps their path."""

from __future__ import annotations

import dataclasses
import platform
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from linear_bem.errors import UnsupportedProblem
from runs.evolution import outcome
from runs.evolution.drift import Drift
from runs.evolution.hard_balls import HardBalls
from runs.evolution.providers import DIRECT_ACCURACY, Provider, provider
from runs.evolution.record import Record, events, summary
from runs.evolution.start import start
from runs.models import Model, choose, standing
from runs.process import ranks, signals
from runs.process.json_values import as_given
from runs.scene.effects.reciprocation import ReciprocationTable
from runs.scene.scene_file import Scene
from runs.session.progress import tell
from runs.session.run_folder import RunFolder
from runs.session.session import Options

Array = NDArray[np.float64]

FORMAT = 1
"""Changes whenever a path that an older version left behind must not be continued or shown as current."""
SAVED_EVERY = 5.0
"""Seconds between two writings of a path that is under way."""
TABLES = Path("out/pair-tables")
"""Where tables of pairs are kept for every scene."""


class Evolution:
    """One run of one scene by one model, from its table of forces to its end."""

    def __init__(self, scene: Scene, asked: str | None, options: Options, tables: Path | None = None) -> None:
        if scene.reciprocation is None:
            raise UnsupportedProblem(
                f"{scene.path}: evolve needs [reciprocation] (amplitude, cycles, friction); add the table, or use solve"
            )
        self.scene, self.options, self.tables = scene, options, tables or TABLES
        self.sliding: ReciprocationTable = scene.reciprocation
        self.model: Model
        self.model, self.problem, self.notes = choose(standing(scene), asked)
        if self.problem.size < 2:
            raise UnsupportedProblem(f"{scene.path}: one ball alone feels no mutual force; evolve needs two or more")
        if scene.budget and not self.model.parallel:
            unbound = f"[accuracy] {', '.join(scene.budget)}: no bound, as {self.model.name} does not mesh"
            self.notes = (*self.notes, unbound)
        self.balls = HardBalls.of(self.problem)
        self.tolerance = self.sliding.tolerance * min(ball.radius for ball in self.problem.balls)
        self.path_per_cycle = 4.0 * self.sliding.amplitude
        self.steps = 0
        self.end = self.sliding.cycles * self.path_per_cycle / self.sliding.friction

    def cycles(self, sigma: float) -> float:
        """Return the number of cycles after which sliding path over friction is sigma [m]."""
        return sigma * self.sliding.friction / self.path_per_cycle

    def open(self) -> RunFolder:
        """Return the run's folder (rank 0)."""
        identity = {
            "command": "evolve",
            "format": FORMAT,
            "model": self.model.name,
            "problem": dataclasses.asdict(self.problem),
            "reciprocation": self.sliding.model_dump(),
            "tangential_force": self.scene.tangential_force,
        }
        if self.scene.budget and self.model.parallel:
            identity["budget"] = self.scene.budget
        path = self.options.out or Path("out") / f"{self.scene.path.stem}-evolve-{self.model.name}"
        return RunFolder(path, identity, self.scene.text, fresh=self.options.fresh)

    def forces(self) -> Provider:
        """Return the model's forces; collective over its ranks."""
        comm = ranks.world() if self.model.parallel else None
        return provider(
            self.model,
            self.problem,
            self.scene.tangential_force,
            self.sliding.forces,
            self.tables,
            comm,
            tell,
            self.scene.budget,
        )

    def run(self, folder: RunFolder, given: Provider) -> dict[str, Any]:
        """Return the finished document; what ``folder`` holds of an earlier run is not computed again."""
        began = time.process_time()
        earlier = folder.saved() or {}
        before = float(earlier.get("solved", {}).get("seconds", 0.0))
        self.steps = int(earlier.get("solved", {}).get("iterations", 0))
        members: list[dict[str, Any]] = list(earlier.get("ensemble", []))
        record = Record(list(earlier.get("path", [])), earlier.get("continuation"))
        document: dict[str, Any] = {}

        def note(converged: bool) -> dict[str, Any]:
            document.update(self._document(record, members, given, converged, before + time.process_time() - began))
            return document

        def keep() -> None:
            folder.save(note(False), [])

        self._follow(record, given, self.sliding.seed, keep)
        members[:1] = [self._member(record, 0)]
        keep()
        for number in range(len(members), self.sliding.ensemble):
            member = Record()
            self._follow(member, given, self.sliding.seed + number, lambda: None)
            members.append(self._member(member, number))
            keep()
        note(True)
        document.update(self._end(record, given))
        document["solved"]["seconds"] = before + time.process_time() - began
        return document

    def _member(self, record: Record, number: int) -> dict[str, Any]:
        at_rest = outcome.rest(record.moments)["at_rest"]
        nominal = np.array([ball.position for ball in self.problem.balls])
        found = summary(record.moments, self.balls, nominal, at_rest=at_rest)
        grouped = found.pop("sigma_one_group")
        return {
            "seed": self.sliding.seed + number,
            **found,
            "cycles_end": self.cycles(found["sigma_end"]),
            "cycles_one_group": None if grouped is None else self.cycles(grouped),
        }

    def _follow(self, record: Record, given: Provider, seed: int, keep: Any) -> None:
        if record.moments and record.continuation is None:
            return
        drift = Drift(given.forces, self.balls, self.tolerance, self.sliding.rest)
        goes_on = record.continuation
        if goes_on is None:
            path = drift.path(start(self.problem, self.balls, self.sliding.perturbation, seed), self.end)
        else:
            path = drift.path(np.array(goes_on["positions"]), self.end, goes_on["sigma"], goes_on["step"])
        written = time.monotonic()
        for moment in path:
            signals.check()
            record.take(moment, self.balls, last=moment.resting or moment.sigma >= self.end * (1.0 - 1e-12))
            if time.monotonic() - written > SAVED_EVERY:
                keep()
                written = time.monotonic()
        self.steps += drift.steps

    def _document(
        self, record: Record, members: list[dict[str, Any]], given: Provider, converged: bool, seconds: float
    ) -> dict[str, Any]:
        path = [{"cycle": self.cycles(m["sigma"]), **m} for m in record.moments]
        notes = [*self.notes, *given.notes]
        if not converged:
            notes.append("unfinished: the path has not come to its end; the same command continues it")
        return {
            "scene": as_given(self.scene.data),
            "model": self.model.name,
            "balls": outcome.without_pressures(self.problem, path[-1]) if path else [],
            "steps": [],
            "path": path,
            "continuation": record.continuation,
            "events": [{"cycle": self.cycles(e["sigma"]), **e} for e in events(path, self.balls)],
            "ensemble": members,
            "solved": {
                "converged": converged,
                "iterations": self.steps,
                "unknowns": 2 * self.problem.size,
                "seconds": seconds,
                "ranks": ranks.rank_and_size()[1],
                "versions": {
                    "python": platform.python_version(),
                    "numpy": np.__version__,
                    "scipy": scipy.__version__,
                },
                "notes": notes,
                "certificate": {},
            },
        }

    def _end(self, record: Record, given: Provider) -> dict[str, Any]:
        """Return what is worked out once the path is complete."""
        moments = record.moments
        forces, balls = given.forces, self.balls
        begin, end = (np.array(moments[k]["positions"]) for k in (0, -1))
        found: dict[str, Any] = {
            "rest": outcome.rest(moments),
            "position_error": outcome.position_error(moments, forces, balls, begin, self.tolerance, self.sliding.rest),
            "equilibrium": outcome.equilibrium(forces, balls, end, given.difference),
            "pair_equilibria": outcome.pair_equilibria(forces, balls) if given.cheap and len(end) == 2 else None,
            "momentum": _momentum(moments),
            "pair_table": given.table,
            "direct_check": None,
        }
        if self.model.name != "finite_strain":
            rows, states = outcome.direct_check(self.problem, forces, moments, DIRECT_ACCURACY)
            found["direct_check"] = rows
            if states and self.model.name == "linear_bem":
                found["balls"] = states
        return found


def _momentum(moments: list[dict[str, Any]]) -> float:
    """Return the largest |sum of T| over the largest |T| on the path: the weighted centroid's drift."""
    worst = 0.0
    for moment in moments:
        force = np.array(moment["tangential_force"])
        largest = float(np.max(np.hypot(*force.T)))
        worst = max(worst, float(np.hypot(*force.sum(axis=0))) / largest if largest > 0.0 else 0.0)
    return worst


def evolve_scene(scene: Scene, asked: str | None, options: Options, tables: Path | None = None) -> None:
    """Let the balls of ``scene`` drift, save the run and print its outcome."""
    evolution = Evolution(scene, asked, options, tables)
    if not evolution.model.parallel and not ranks.is_root():
        return
    folder = evolution.open() if ranks.is_root() else None
    try:
        _evolve(evolution, folder)
    finally:
        if folder is not None:
            folder.close()


def _evolve(evolution: Evolution, folder: RunFolder | None) -> None:
    from runs.evolution.showing import draw, show  # noqa: PLC0415

    finished: Mapping[str, Any] | None = folder.finished() if folder is not None else None
    if evolution.model.parallel:
        ranks.world()
        finished = ranks.share(finished)
    if finished is None:
        if folder is not None:
            folder.log(" ".join(sys.argv))
        given = evolution.forces()
        if folder is not None:
            finished = evolution.run(folder, given)
            folder.save(finished, rows(finished))
            draw(folder.path, evolution, finished)
            folder.log(f"finished in {finished['solved']['seconds']:.1f} s of processor time")
            folder.finish()
    else:
        tell("this run is complete already: its saved result is shown (--fresh computes anew)")
    if folder is not None and finished is not None:
        show(evolution, finished)
        tell(f"results are in {folder.path}")


def rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return one flat row per kept moment and ball."""
    keys = ("tangential_force", "normal_force")
    return [
        {
            "cycle": moment["cycle"],
            "sliding_path_over_friction": moment["sigma"],
            "ball": i,
            "position": tuple(x),
            **{key: moment[key][i] for key in keys},
            "contacts": len(moment["contacts"]),
        }
        for moment in document["path"]
        for i, x in enumerate(moment["positions"])
    ]
