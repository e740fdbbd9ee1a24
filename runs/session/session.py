"""One run of a command: model, output folder, saved state of an earlier run, and output of the results."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.metadata
import math
import platform
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from linear_bem.counts import grouped
from linear_bem.errors import MissingDependency, UnsupportedProblem
from linear_bem.result import Result, Solved, Step
from linear_bem.solution import Solution
from runs.display import surface
from runs.display.numbers import Scale, count, duration
from runs.models import Model, Run, choose, standing, time_on
from runs.process import ranks, signals
from runs.process.files import reading
from runs.process.json_values import Document, to_json
from runs.process.machine import memory_bytes
from runs.scene.effects.finite_strain import effect_identity
from runs.scene.scene_file import Scene
from runs.session.output_folder import RESULT, OutputFolder
from runs.session.progress import Progress
from runs.session.terminal import print_status, waiting

PACKAGES = ("thirdbody", "numpy", "scipy", "fenics-dolfinx", "petsc4py", "mpi4py")
ALWAYS_NAMED = ("substrate", "finite_strain", "elements")
"""Parts that identify a run even if absent: a new effect does not change the identity of runs without it."""


@dataclass(frozen=True)
class Options:
    """Options of the command line."""

    as_json: bool = False
    out: Path | None = None
    fresh: bool = False


class Session:
    """One run of one command with one model on one scene; only rank 0 uses the output folder.

    ``solutions``: those of the linear model at its load steps.
    ``complete``: whether an earlier run is complete; ``saved``: its document on disk, complete or not (rank 0 only).
    ``version``: format version of the saved document; runs of other versions are neither resumed nor shown.
    Input errors are raised before any slow import.
    """

    def __init__(
        self, command: str, scene: Scene, asked: str | None, options: Options, version: int | None = None
    ) -> None:
        self.command, self.scene, self.options = command, scene, options
        evolves = command == "evolve"
        self.model, self.problem, notes = choose(standing(scene) if evolves else scene, asked)
        self.notes = (*notes, *left_out(scene, self.model))
        self.scale = Scale.of(self.problem, scene.data)
        self.steps = scene.steps or (None if command == "compare" else (1.0,))
        signals.resumable = evolves or self.model.parallel or len(self.steps or (1.0,)) > 1
        self.plan: Document = {}
        if self.model.plan is not None and not evolves:  # refuses early what the model does not support
            self.plan = self.model.plan(self.problem, scene.tangential_force, scene.budget, self.steps)
            _check_memory(scene, self.plan)
        self.folder: OutputFolder | None = None
        self.solutions: list[Solution] = []
        self.saved: Document = {}
        self.complete = False
        if self.root:  # before MPI starts: an unusable folder ends the run at once
            self.folder = self._open_folder(version)
            self.saved, self.complete = self.folder.saved or {}, self.folder.complete
            if self.folder.stopped:
                self.report("this run was stopped before: killed, or its machine failed; it resumes from what is saved")
            if self.folder.lost:
                self.report(f"{self.out / RESULT} is damaged or was deleted: it is made again")
            if not self.complete:
                self.folder.log(f"{' '.join(sys.argv)}  on {ranks.rank_and_size()[1]} rank(s)\n{_versions()}")
        try:
            self.comm = _world_if_there() if self.model.parallel else None
            self.complete = ranks.share(self.complete)
        except BaseException:
            self.__exit__(*sys.exc_info())
            raise

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.folder is not None:
            if kind is not None:
                self.folder.stop(kind)
            self.folder.close()

    @property
    def root(self) -> bool:
        """Whether this rank prints and writes."""
        return ranks.is_root()

    @property
    def out(self) -> Path:
        """The output folder; on rank 0."""
        assert self.folder is not None
        return self.folder.path

    def reading_saved(self) -> contextlib.AbstractContextManager[None]:
        """Name the saved document in an error that it causes."""
        return reading(self.out / RESULT) if self.root else contextlib.nullcontext()

    def _open_folder(self, version: int | None) -> OutputFolder:
        scene, parallel = self.scene, self.model.parallel
        if version is None and parallel:
            from finite_strain import FORMAT  # noqa: PLC0415  (only where a scene calls for finite elements)

            version = FORMAT
        parts = dataclasses.asdict(self.problem).items()
        identity: Document = {
            "command": self.command,
            "format": version,
            "model": self.model.name,
            "problem": {key: part for key, part in parts if part is not None or key in ALWAYS_NAMED},
            "tangential_force": scene.tangential_force,
        }
        if self.problem.finite_strain is not None:
            identity["problem"]["finite_strain"] = effect_identity(self.problem.finite_strain)
        identity |= {name: table.model_dump() for name, table in scene.drift.items()}
        if scene.output is not None and parallel and not scene.drift:
            identity["output"] = scene.output.model_dump()
        if scene.budget and parallel:
            identity["budget"] = scene.budget
        if scene.steps is not None:
            identity["steps"] = scene.steps
        name = f"{scene.path.stem}-{self.command}"
        default = Path("out") / (name if self.command == "compare" else f"{name}-{self.model.name}")
        return OutputFolder(self.options.out or default, identity, scene.text, fresh=self.options.fresh)

    def solve(self, saved: Sequence[Mapping[str, Any]], keep: Callable[[Result], object]) -> Result:
        """Run the model over its load path and return its result with the notes of this run.

        ``saved``: JSON objects of the load steps on disk; ``keep`` receives the unfinished result after every step, on
        rank 0.
        """
        with self.reading_saved():
            steps = [Step.from_dict(step) for step in saved]

        def take(step: Step) -> None:
            steps[:] = path_so_far(steps, step)
            keep(unfinished(self.model, steps))

        def draw(step: Step, top: Any) -> None:
            if step is steps[-1]:  # no coarser mesh has reached a larger load
                surface.keep(self.out, top)  # the picture survives a killed run

        goal = max(self.problem.load.values) if self.problem.load.kind == "approach" else None
        log = self.folder.log if self.folder is not None else lambda text: None
        ranks_here = ranks.rank_and_size()[1]
        both = (self.plan.get(f"{kind}seconds_of_meshes", ()) for kind in ("", "processor_"))
        of_meshes = [time_on(ranks_here, {"seconds": s, "processor_seconds": p}) for s, p in zip(*both, strict=True)]
        progress = Progress(
            self.scale, goal, root=self.root, take=take, log=log, draw=draw, expected=of_meshes,
        )  # fmt: skip
        if self.root and self.plan:
            size = f"about {grouped(self.plan['unknowns'])} unknowns, {self.plan['load_steps']} load steps"
            where, cores = f"{self.model.name} on {ranks_here} rank(s)", count(ranks_here, "idle core")
            time = f"{duration(time_on(ranks_here, self.plan))}{' from the start' if steps else ''}"
            self.say_doubts()
            print_status(f"{where}: {size}, the elements take {time} on {cores}; into {self.out}")
            least, most = sum(of_meshes[:2]), self.scene.budget.get("seconds", math.inf)
            if least > most:
                print_status(
                    f"[accuracy] seconds = {most:g} is less than the two coarsest meshes take, which an error estimate "
                    f"needs: {duration(least)}"
                )
        fields = ranks.share(self.folder.fields if self.folder is not None else None)
        scene = self.scene
        run = Run(
            scene.tangential_force, self.comm, fields, progress, scene.output, scene.budget, self.steps,
            report=progress.note, inspect=self.solutions.append,
        )  # fmt: skip
        working = progress if self.plan else waiting(f"{self.model.name}, {self.problem.size} ball(s)")
        with working:
            result = self.model.solve(self.problem, run)
        solved = dataclasses.replace(result.solved, notes=(*self.notes, *result.solved.notes))
        return dataclasses.replace(result, solved=solved)

    def report(self, text: str) -> None:
        """Print a line and add it to run.log (rank 0)."""
        assert self.folder is not None
        print_status(text)
        self.folder.log(text)

    def say_doubts(self) -> None:
        """Print the doubts about the scene's units, before long work."""
        for doubt in self.scene.doubts:
            print_status(f"warning: {doubt}")

    def save(self, document: Document, rows: Iterable[Mapping[str, Any]]) -> None:
        """Write the document as far as it is computed (rank 0)."""
        assert self.folder is not None
        self.folder.save(document, rows)

    def finish(self, solved: Mapping[str, Any], answer: str = "") -> None:
        """Mark the run as complete, after all its files are written (rank 0); ``solved``: its JSON object."""
        assert self.folder is not None
        versions = ", ".join(f"{k} {v}" for k, v in solved["versions"].items())
        self.folder.log(f"{answer}\nfinished in {solved['seconds']:.1f} s; {versions}".lstrip())
        self.folder.finish()


def conduct(
    session: Session, compute: Callable[[Session], Document | None], show: Callable[[Session, Document], None]
) -> None:
    """Complete the run, then show its result or print its JSON.

    ``compute`` runs on all ranks that take part and returns the finished document on rank 0.
    """
    with session:
        if not (session.model.parallel or session.root):  # rank 0 alone solves models without finite elements
            return
        already = session.complete
        document = session.saved if already else compute(session)
        if not session.root or document is None:
            return
        if session.options.as_json:
            sys.stdout.write(to_json(document))
        else:
            with session.reading_saved() if already else contextlib.nullcontext():
                show(session, document)
        assert session.folder is not None
        gone = ", ".join(session.folder.gone)
        again = f"--fresh computes again{', also what was deleted: ' if gone else ''}{gone}"
        shown = f"this run is complete already: its saved result is shown ({again}); it is"
        print_status(f"{shown if already else 'results are'} in {session.out}")


def _check_memory(scene: Scene, plan: Mapping[str, Any]) -> None:
    """Raise `UnsupportedProblem` if the first meshes, or the largest one that the scene permits, exceed the memory."""
    here = memory_bytes() * ranks.hosts()
    stated = scene.budget.get("unknowns")
    unknowns, needed = plan["unknowns"], plan["memory_bytes"]
    if stated is not None and plan["memory_bytes_at_most"] > here:
        unknowns, needed = stated, plan["memory_bytes_at_most"]
    if needed > here:
        raise UnsupportedProblem(
            f"{scene.path}: [accuracy] unknowns: {grouped(unknowns)} unknowns need about {needed / 1e9:.3g} GB of "
            f"memory, got {here / 1e9:.3g} GB on {ranks.hosts()} machine(s); lower it, raise tangential_force, or "
            "take more"
        )


def left_out(scene: Scene, model: Model) -> list[str]:
    """Return a note for every table and key of a scene that the model ignores."""
    if model.parallel:
        return ["[output] left out: a drift keeps no fields"] if scene.output is not None and scene.drift else []
    notes = []
    if scene.problem.elements is not None:
        notes.append(f"[elements] left out: {model.name} has no finite elements")
    if scene.output is not None:
        notes.append(f"[output] left out: {model.name} has no fields inside the layer to write")
    if scene.budget:
        notes.append(f"[accuracy] {', '.join(scene.budget)} left out: {model.name} has no mesh")
    sliding, checked = scene.reciprocation, "serves the comparison with the full linear model alone"
    if model.name == "point_load" and scene.tangential_force is not None:
        use = "left out" if sliding is None else checked
        notes.append(f"[accuracy] tangential_force {use}: {model.name} has the accuracy of its law")
    if model.name == "point_load" and sliding is not None and sliding.forces == "direct":
        notes.append(f'[reciprocation] forces = "direct" left out: {model.name} has one law, of pairs')
    return notes


def _world_if_there() -> Any:
    try:
        return ranks.world()
    except MissingDependency:
        if ranks.rank_and_size()[1] > 1:
            raise
        return None  # the model itself names everything that is missing


def path_so_far(saved: Sequence[Step], step: Step) -> list[Step]:
    """Return the saved steps; ``step`` replaces the old one at its load and all later ones of its mesh.

    Later steps of a coarser mesh stay until a finer mesh reaches their load.
    """

    def depth(state: Step) -> float:
        return float(state.record.get("fraction") or max(ball.approach for ball in state.balls))

    def mesh(state: Step) -> int:
        return int(state.record.get("mesh", 0))

    before = [old for old in saved if depth(old) < depth(step) * (1.0 - 1e-9)]
    coarser = [old for old in saved if depth(old) > depth(step) * (1.0 + 1e-9) and mesh(old) < mesh(step)]
    return [*before, step, *coarser]


def unfinished(model: Model, steps: Sequence[Step]) -> Result:
    """Return the result of an incomplete load path."""
    note = "unfinished: the load path is incomplete; the same command continues it"
    iterations = sum(int(step.record.get("iterations", 0)) for step in steps)
    seconds = sum(float(step.record.get("seconds", 0.0)) for step in steps)
    solved = Solved(False, iterations, 0, seconds, ranks.rank_and_size()[1], notes=(note,))
    return Result(model.name, steps[-1].balls, solved, tuple(steps))


def _versions() -> str:
    found = [f"Python {platform.python_version()}"]
    for name in PACKAGES:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"{name} -")
    return ", ".join([*found, platform.platform()])
