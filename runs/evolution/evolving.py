"""The command ``evolve``: moves the balls of a scene over its cycles, and saves their path in the run folder."""

import platform
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from linear_bem.arrays import Array
from linear_bem.doubts import large_strain_notes
from linear_bem.errors import UnsupportedProblem
from linear_bem.layer.ritz_indentation import estimates
from linear_bem.problem import Problem
from linear_bem.result import Solved
from linear_bem.touching import overlap_faults
from runs.evolution import outcome, showing, structure
from runs.evolution.drift import AT_END, Drift, Moment
from runs.evolution.hard_balls import HardBalls
from runs.evolution.layer_pictures import some
from runs.evolution.providers import Provider, provider, require_forces
from runs.evolution.record import Record, drop_from, events, summary
from runs.models import Model, choose, standing
from runs.process import ranks, signals
from runs.process.files import write_csv
from runs.process.json_values import Document, as_given
from runs.scene import messages
from runs.scene.effects.reciprocation import ReciprocationTable
from runs.scene.scene_file import InvalidScene, Scene
from runs.session.output_folder import PATH
from runs.session.progress import print_status
from runs.session.session import Options, Session, conduct

FORMAT = 3
"""Format version of saved paths: raised when those of an older version must not be resumed or shown as current."""
SAVE_INTERVAL, SAVE_RATIO, PROGRESS_INTERVAL = 5.0, 10.0, 10.0
"""Interval [s] between saves of an unfinished path; least such interval over the duration of a save; interval [s]
between progress lines."""
TABLES = Path("out/pair-tables")
"""Folder of the tables of pairs, which all scenes share."""


def evolve_scene(scene: Scene, asked: str | None, options: Options, tables: Path | None = None) -> None:
    """Compute the motion of the balls of ``scene``, save the run and print its result."""
    session, balls = open_session(scene, asked, options), balls_of(scene)
    conduct(session, lambda s: Evolution(s, tables).complete(), partial(showing.show, balls))


def open_session(scene: Scene, asked: str | None, options: Options) -> Session:
    """Return the session of an evolution; raises `InvalidScene` or `UnsupportedProblem` for balls that cannot drift."""
    if scene.reciprocation is None:
        raise UnsupportedProblem(
            f"{scene.path}: evolve needs [reciprocation] (amplitude, cycles, friction); add the table, or use solve"
        )
    require_drift(scene, *choose(standing(scene), asked)[:2])
    return Session("evolve", scene, asked, options, FORMAT)


def require_drift(scene: Scene, model: Model, problem: Problem) -> None:
    """Raise the error with which ``evolve`` and ``plan`` refuse a scene with [reciprocation], if any."""
    if problem.size < 2:
        raise UnsupportedProblem(f"{scene.path}: one ball alone has no mutual force; evolve needs two or more")
    balls = balls_of(scene)
    if balls.cell is not None:  # without one, the problem was checked
        bodies = {i: (ball.indenter, ball.radius) for i, ball in enumerate(problem.balls)}
        texts = overlap_faults(bodies, problem.positions, balls.cell)
        if texts:
            raise InvalidScene(scene.path, *(messages.of_problem(text, scene.data) for text in texts))
    require_forces(model, problem, scene.sliding.forces)


def balls_of(scene: Scene) -> HardBalls:
    """Return the hard balls of a scene; raises `InvalidScene` for approaches that do not fit one flat plate."""
    cell, rolling = scene.drift.get("periodic"), scene.drift.get("rolling_resistance")
    lengths, share = None if cell is None else cell.lengths, 0.0 if rolling is None else rolling.share
    tolerance = scene.sliding.tolerance * min(ball.radius for ball in scene.problem.balls)
    try:
        return HardBalls.of(scene.problem, lengths, share, tolerance)
    except UnsupportedProblem as error:
        raise InvalidScene(scene.path, messages.of_problem(str(error), scene.data)) from None


def start(balls: HardBalls, x: Array, sliding: ReciprocationTable, number: int) -> Array:
    """Return where a member's balls (balls, 2) [m] start: perturbed at random, then moved apart where they overlap."""
    if sliding.perturbation > 0.0:
        x = x + sliding.perturbation * np.random.default_rng(sliding.seed + number).uniform(-1.0, 1.0, x.shape)
    return balls.parted(x, np.ones(len(x)))


class Evolution:
    """The balls of one session: from the forces between them to the end of their path."""

    def __init__(self, session: Session, tables: Path | None = None) -> None:
        self.session, self.problem, self.tables = session, session.problem, tables or TABLES
        self.sliding = session.scene.sliding
        self.balls = balls_of(session.scene)
        self._arrangements: list[Document] = []
        self._nominal = self.problem.positions
        self._is_layer = self.balls.many or self.balls.cell is not None  # the structure of all balls is recorded
        self.end = self.sliding.end

    def complete(self, *, pictures: bool = True) -> Document | None:
        """Compute the path to its end and return the finished document on rank 0 (collective)."""
        session = self.session
        if session.root:
            session.say_doubts()
        source = provider(
            session.model, self.problem, session.scene.tangential_force, self.sliding.forces, self.tables,
            session.comm, print_status, session.scene.budget, self.balls.cell,
        )  # fmt: skip
        if not session.root:
            return None
        document, record = self._run(source)
        document["sentences"] = showing.sentences(session.scene, document, self.balls, session.scale.units.length)
        session.save(document, rows(document))
        drop_from(self._folder, len(record.moments))
        if pictures:
            showing.draw(session, document, record.moments, self.balls, self._arrangements if self._is_layer else [])
        session.finish(document["solved"])
        return document

    def _run(self, source: Provider) -> tuple[Document, Record]:
        """Return the finished document and the path; what an earlier run has saved is not computed again."""
        start_time = time.process_time()
        earlier = self.session.saved
        with self.session.reading_saved():
            earlier_seconds = float(earlier.get("solved", {}).get("seconds", 0.0))
            limit = self._limit_of_saved(earlier)
            record = Record.from_dict(earlier, self.balls, self._folder, limit)
            complete = record.ended(self.end)
            found = outcome.saved(earlier) if complete else {}
            members = {
                member["seed"]: member
                for member in earlier.get("ensemble", [])
                if member["seed"] < self.sliding.seed + self.sliding.ensemble
                and (limit == np.inf or (member["at_rest"] and member["sigma_end"] < limit))
            }
        if earlier.get("path"):
            self.session.report(self._resume_message(record, complete=complete))

        def document(converged: bool) -> Document:
            known = [members[seed] for seed in sorted(members)]
            seconds = earlier_seconds + time.process_time() - start_time
            return self._document(record, known, source, converged, seconds) | found

        def save() -> None:
            unfinished = document(False)
            self.session.save(unfinished, rows(unfinished))

        try:
            for number in range(self.sliding.ensemble):
                seed = self.sliding.seed + number
                if number > 0 and seed in members:
                    continue
                path = Record() if number > 0 else record
                self._follow(path, source, number, (lambda: None) if number > 0 else save, members)
                with signals.held():
                    members[seed] = self._member(path, number)
                save()
            ends = outcome.results(self.session, source, self.balls, record.moments, found, save)
            if self._is_layer:
                write_csv(
                    self.session.out / "structure_factor.csv", structure.waves_of(some(record.moments), self.balls)
                )
        except KeyboardInterrupt:
            if record.moments:
                save()
            raise
        return document(True) | ends, record

    def _limit_of_saved(self, earlier: Mapping[str, Any]) -> float:
        """Return sigma [m] up to which the saved path can be used; infinity if it is for the same number of cycles.

        Else its last step is left out, because the number of cycles cuts that step short.
        """
        cycles = earlier.get("cycles", self.sliding.cycles)
        return np.inf if cycles == self.sliding.cycles else AT_END * self.end * min(1.0, cycles / self.sliding.cycles)

    def _resume_message(self, record: Record, *, complete: bool) -> str:
        """Return a sentence on where a saved path continues."""
        if complete:
            cycle = self.sliding.cycles_after(record.moments[-1].sigma)
            return f"the saved path is complete, to cycle {cycle:.4g}"
        if record.continuation is None:
            return "the saved path has no restart state: it begins again at cycle 0"
        cycle = self.sliding.cycles_after(record.continuation.sigma)
        return f"the saved path continues at cycle {cycle:.4g} of {self.sliding.cycles:g}, after {record.steps} steps"

    @property
    def _folder(self) -> Path:
        return self.session.out / PATH

    def _write_structure(self, moments: Sequence[Moment]) -> None:
        """Write the arrangement of three or more balls at every kept moment; only new moments are computed."""
        if self.problem.size < 3 and not self._is_layer:
            return
        known = {line[structure.SIGMA]: line for line in self._arrangements}
        self._arrangements = [
            known.get(m.sigma) or {"cycle": self.sliding.cycles_after(m.sigma), **structure.row(m, self.balls)}
            for m in moments
        ]
        write_csv(self.session.out / "structure.csv", self._arrangements)

    def _member(self, record: Record, number: int) -> Document:
        found = summary(record.moments, self.balls, self._nominal)
        one_group = next((m.sigma for m in record.moments if len(self.balls.groups(m.positions)) == 1), None)
        return {
            "seed": self.sliding.seed + number,
            "steps": record.steps,
            **found,
            "cycles_end": self.sliding.cycles_after(found["sigma_end"]),
            "cycles_one_group": None if one_group is None else self.sliding.cycles_after(one_group),
        }

    def _follow(
        self, record: Record, source: Provider, number: int, save: Callable[[], None], members: Mapping[int, Document]
    ) -> None:
        """Compute the rest of the path of a member (0: the first), and call ``save`` at intervals."""
        if record.ended(self.end):
            return
        steps_before = sum(m["steps"] for m in members.values())
        drift = Drift(source.forces, self.balls, self.balls.tolerance, self.sliding.rest)
        path = drift.path(record.continuation or start(self.balls, self._nominal, self.sliding, number), self.end)
        saved = reported = time.monotonic()
        duration = 0.0
        for moment in path:
            with signals.held():
                record.take(moment, self.balls, last=moment.resting or moment.sigma >= AT_END * self.end)
            now = time.monotonic()
            if now - saved > max(SAVE_INTERVAL, SAVE_RATIO * duration):
                save()
                saved = time.monotonic()
                duration = saved - now
            if now - reported > PROGRESS_INTERVAL:
                reported = now
                member = f"member {number + 1} of {self.sliding.ensemble}: " if self.sliding.ensemble > 1 else ""
                self.session.report(
                    f"{member}cycle {self.sliding.cycles_after(moment.sigma):.4g} of {self.sliding.cycles:g}, "
                    f"{steps_before + moment.steps} steps, {len(moment.contacts)} contacts, "
                    f"driving force of the fastest ball: {moment.speed:.1e} of its load (rest: {self.sliding.rest:.1e})"
                )

    def _large_strain_notes(self, record: Record) -> tuple[str, ...]:
        """Return the notes where small strain does not hold, of a model of small strain."""
        if self.problem.finite_strain is not None:
            return ()
        layer, forces = self.problem.layer, record.moments[0].state.normal
        radii = np.array([ball.radius for ball in self.problem.balls])
        widths = estimates(layer, self.problem.substrate, radii, "normal_force", forces)[2]
        return large_strain_notes(self.problem, np.array(self.problem.load.values), forces, np.pi * widths**2)

    def _document(
        self, record: Record, members: list[Document], source: Provider, converged: bool, seconds: float
    ) -> Document:
        cycles, kept = self.sliding.cycles_after, record.to_dict(self.balls, self._folder)
        self._write_structure(record.moments)
        notes = [*self.session.notes, *self._large_strain_notes(record), *source.notes]
        if record.damage:
            notes.append(record.damage)
        if not converged:
            what = "what follows the path" if record.ended(self.end) else "the path"
            notes.append(f"unfinished: {what} is not complete; the same command continues it")
        versions = {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}
        steps = record.steps + sum(m["steps"] for m in members if m["seed"] != self.sliding.seed)
        size, processes = self.problem.size, ranks.rank_and_size()[1]
        return {
            "scene": as_given(self.session.scene.data),
            "model": self.session.model.name,
            "balls": outcome.without_pressures(self.problem, record.moments[-1]),
            "steps": [],
            "cycles": self.sliding.cycles,
            "path": [{"cycle": cycles(moment["sigma"]), **moment} for moment in kept["path"]],
            "continuation": kept["continuation"],
            "events": [{"cycle": cycles(e.sigma), **vars(e)} for e in events(record.moments, self.balls)],
            "ensemble": members,
            "solved": Solved(converged, steps, 2 * size, seconds, processes, versions, tuple(notes)).to_dict(),
        }


def rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return one flat row per kept moment and ball; per moment alone where the balls are too many for one file."""
    if document["path"] and "positions" not in document["path"][0]:
        return [{structure.SIGMA if k == "sigma" else k: v for k, v in moment.items()} for moment in document["path"]]
    keys = ("tangential_force", "tangential_force_error", "normal_force")
    return [
        {
            "cycle": moment["cycle"],
            structure.SIGMA: moment["sigma"],
            "ball": i,
            "position": tuple(x),
            **{key: moment[key][i] for key in keys},
            "contacts": len(moment["contacts"]),
        }
        for moment in document["path"]
        for i, x in enumerate(moment["positions"])
    ]
