"""What solving and comparing share: the scene, its model, its folder, and the load path as it grows."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linear_bem.errors import MissingDependency
from linear_bem.result import Result, Solved, Step
from runs.display.numbers import Scale, duration
from runs.models import Model, Run, choose
from runs.process import ranks
from runs.scene.scene_file import Scene
from runs.session.progress import Progress, tell
from runs.session.run_folder import RunFolder

PACKAGES = ("thirdbody", "numpy", "scipy", "fenics-dolfinx", "petsc4py", "mpi4py")


@dataclass(frozen=True)
class Options:
    """What the command line asks for beside the scene."""

    as_json: bool = False
    out: Path | None = None
    fresh: bool = False


class Session:
    """One run of one model on one scene, with its output folder on rank 0.

    Raises what bad input raises before anything slow is loaded.
    """

    def __init__(self, command: str, scene: Scene, asked: str | None, options: Options) -> None:
        self.command, self.scene, self.options = command, scene, options
        self.model, self.problem, self.notes = choose(scene, asked)
        self.scale = Scale.of(self.problem)
        self.steps = scene.steps or (None if command == "compare" else (1.0,))
        self.plan: dict[str, Any] = {}
        if self.model.plan is not None:  # names what the model lacks, cheaply
            self.plan = self.model.plan(self.problem, scene.tangential_force, scene.budget, self.steps)
        if self.problem.elements is not None and not self.model.parallel:
            self.notes = (*self.notes, f"[elements] left out: {self.model.name} has no finite elements")
        if scene.output is not None and not self.model.parallel:
            self.notes = (*self.notes, f"[output] left out: {self.model.name} has no fields inside the layer to write")
        if scene.budget and not self.model.parallel:
            self.notes = (
                *self.notes,
                f"[accuracy] {', '.join(scene.budget)}: no bound, as {self.model.name} does not mesh",
            )
        self.idle = not self.model.parallel and not ranks.is_root()
        self.folder: RunFolder | None = None
        self.finished: dict[str, Any] | None = None
        self.earlier: dict[str, Any] | None = None
        if self.root:  # before MPI starts: a folder that cannot be used ends the run at once
            self.finished, self.earlier = self._open_folder()
        self.comm = _world_if_there() if self.model.parallel else None
        self.finished, self.earlier = ranks.share((self.finished, self.earlier))

    @property
    def root(self) -> bool:
        """Whether this rank speaks and writes."""
        return ranks.is_root()

    def _open_folder(self) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
        identity: dict[str, Any] = {
            "command": self.command,
            "format": _element_format() if self.model.parallel else None,
            "model": self.model.name,
            "problem": dataclasses.asdict(self.problem),
            "tangential_force": self.scene.tangential_force,
        }
        if self.scene.output is not None and self.model.parallel:
            identity["output"] = self.scene.output.model_dump()
        if self.scene.budget and self.model.parallel:
            identity["budget"] = self.scene.budget
        if self.scene.steps is not None:
            identity["steps"] = self.scene.steps
        path = self.options.out or self._default_folder()
        self.folder = RunFolder(path, identity, self.scene.text, fresh=self.options.fresh)
        finished = self.folder.finished()
        if finished is None:
            self.folder.log(f"{' '.join(sys.argv)}  on {ranks.rank_and_size()[1]} rank(s)\n{_versions()}")
        return finished, self.folder.saved()

    def _default_folder(self) -> Path:
        name = f"{self.scene.path.stem}-{self.command}"
        return Path("out") / (name if self.command == "compare" else f"{name}-{self.model.name}")

    @property
    def out(self) -> Path:
        """The output folder; on rank 0."""
        assert self.folder is not None
        return self.folder.path

    def solve(self, take: Callable[[Step, Any], None]) -> Result:
        """Run the model over its load path; ``take`` gets every finished step on rank 0."""
        goal = max(self.problem.load.values) if self.problem.load.kind == "approach" else None
        log = self.folder.log if self.folder is not None else lambda text: None
        progress = Progress(self.scale, goal, root=self.root, take=take, log=log)
        if self.root and self.plan:
            size, time = f"about {self.plan['unknowns']} unknowns", duration(self.plan["seconds"])
            where = f"{self.model.name} on {ranks.rank_and_size()[1]} rank(s)"
            tell(f"{where}: {size}, {self.plan['load_steps']} load steps, {time} on two idle cores; into {self.out}")
        fields = ranks.share(self.folder.fields if self.folder is not None else None)
        scene = self.scene
        run = Run(scene.tangential_force, self.comm, fields, progress, scene.output, scene.budget, self.steps)
        return self.model.solve(self.problem, run)

    def with_notes(self, document: dict[str, Any]) -> dict[str, Any]:
        """Return a result's JSON object with what this run's reader must know among its notes."""
        document["solved"]["notes"] = [*self.notes, *document["solved"]["notes"]]
        return document

    def say_where(self, already: bool) -> None:
        """Tell where the results are."""
        if already:
            tell(
                f"this run is complete already: its saved result is shown (--fresh computes anew); it is in {self.out}"
            )
        else:
            tell(f"results are in {self.out}")


def _world_if_there() -> Any:
    try:
        return ranks.world()
    except MissingDependency:
        if ranks.rank_and_size()[1] > 1:
            raise
        return None  # the model itself names everything that is missing


def path_so_far(saved: Sequence[Mapping[str, Any]], step: Step) -> list[dict[str, Any]]:
    """Return the saved steps, with ``step`` in the place of the old one there and of what follows on its mesh.

    What a coarser mesh answered deeper down stays until a finer one gets there.
    """

    def depth(data: Mapping[str, Any]) -> float:
        return float(data["record"].get("fraction") or max(float(ball["approach"]) for ball in data["balls"]))

    def mesh(data: Mapping[str, Any]) -> int:
        return int(data["record"].get("mesh", 0))

    new = step.to_dict()
    before = [dict(old) for old in saved if depth(old) < depth(new) * (1.0 - 1e-9)]
    coarser = [dict(old) for old in saved if depth(old) > depth(new) * (1.0 + 1e-9) and mesh(old) < mesh(new)]
    return [*before, new, *coarser]


def unfinished(model: Model, steps: Sequence[Mapping[str, Any]]) -> Result:
    """Return the result of a load path that has not come to its end."""
    states = tuple(Step.from_dict(step) for step in steps)
    note = "unfinished: the load path has not come to its end; the same command continues it"
    iterations = sum(int(step.record.get("iterations", 0)) for step in states)
    seconds = sum(float(step.record.get("seconds", 0.0)) for step in states)
    solved = Solved(False, iterations, 0, seconds, ranks.rank_and_size()[1], notes=(note,))
    return Result(model.name, states[-1].balls, solved, states)


def rows_of(steps: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one flat row per step and ball."""
    return [
        {"step": i, "ball": j, **{k: v for k, v in ball.items() if k != "tangential_force_routes"}}
        for i, step in enumerate(steps, start=1)
        for j, ball in enumerate(step["balls"])
    ]


def _versions() -> str:
    found = [f"Python {platform.python_version()}"]
    for name in PACKAGES:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"{name} -")
    return ", ".join([*found, platform.platform()])


def _element_format() -> int:
    from finite_strain import FORMAT  # noqa: PLC0415  (only where a scene calls for finite elements)

    return FORMAT
