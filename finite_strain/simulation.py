"""One run: companion mesh, main mesh, every load step answered, written and handed on.

T is the domain integral, extrapolated from two meshes at equal normal force. Its error adds up what the
extrapolation moved and what the traction route differs by.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from finite_strain import compat
from finite_strain.checkpoint import read_checkpoint, write_checkpoint
from finite_strain.forces import ForceMeter
from finite_strain.kinematics import Finite, Kinematics, Small
from finite_strain.loading import LoadPath, StepRecord
from finite_strain.model import Model
from finite_strain.newton import NewtonSolver
from finite_strain.output import FieldWriter, gather_surface
from finite_strain.planning import COARSENING, RunPlan, plan_run
from linear_bem.errors import OutputUnusable, ThirdBodyError
from linear_bem.problem import Problem
from linear_bem.result import BallResult, Result, Solved, Step
from meshes.box import Box
from meshes.layer import write_layer_mesh

ORDER = 2.0
"""Order of convergence in the element size that the extrapolation assumes; 2.2 to 3.5 are observed."""
FORMAT = 1
"""Changes whenever a checkpoint of an older version must not be continued."""


class Silence:
    """The observer that watches nothing."""

    def started(self, info: dict[str, Any]) -> None:
        """Hear size and setting of the run."""

    def attempt(self, info: dict[str, Any]) -> None:
        """Hear that a load step begins."""

    def newton(self, info: dict[str, Any]) -> None:
        """Hear that a Newton iteration was done."""

    def step_done(self, step: Step, fields: Any) -> None:
        """Take a finished, written load step."""


def simulate(
    problem: Problem, model: str, tangential_force: float, comm: MPI.Comm | None, folder: Path | None, observer: Any
) -> Result:
    """Run a problem; see `finite_strain.solve`."""
    began = time.monotonic()
    comm = MPI.COMM_WORLD if comm is None else comm
    observer = observer or Silence()
    plan = plan_run(problem, tangential_force, model)
    key = hashlib.sha256(repr((FORMAT, problem, model, tangential_force)).encode()).hexdigest()
    with _working_folder(folder, comm) as where:
        companion = _companion(plan, where, key, comm, observer)
        main = _Simulation(plan, plan.boxes[1], where / "mesh.msh", comm, observer, "main")
        writer = FieldWriter(main.model, where) if folder is not None else None
        history, steps = read_checkpoint(where, main.model, key)
        main.path.resume(history)
        observer.started(
            {
                "model": model,
                "unknowns": main.model.unknowns,
                "ranks": comm.size,
                "load_steps": len(plan.fractions),
                "symmetry_planes": len(plan.reduction.planes),
                "resumed_steps": len(steps),
                "versions": compat.versions(),
            }
        )
        for record in main.path.steps(list(plan.fractions)):
            step = main.answer(record, len(steps) + 1, companion)
            steps.append(step)
            if writer is not None:
                writer.write(len(steps))
                write_checkpoint(where, main.model, main.path.history, steps, key)
            observer.step_done(step, gather_surface(main.model))
    return _result(plan, tangential_force, main.model, steps, comm, time.monotonic() - began)


class _Simulation:
    """A model on one mesh with its load path and force meter."""

    def __init__(self, plan: RunPlan, box: Box, mesh_file: Path, comm: MPI.Comm, observer: Any, name: str) -> None:
        self.plan, self.comm, self.name = plan, comm, name
        _on_root(comm, lambda: write_layer_mesh(box, mesh_file))
        self.model = Model(plan.problem, plan.reduction, _kinematics(plan), mesh_file, comm)
        self.solver = NewtonSolver(self.model, lambda i, r: observer.newton({"iteration": i, "residual": r}))
        self.meter = ForceMeter(self.model, box)
        self.path = LoadPath(
            plan.problem, self.model, self.solver,
            lambda fraction, cuts: observer.attempt({"mesh": name, "fraction": fraction, "cuts": cuts}),
            self._measure_traction,
        )  # fmt: skip
        self._traction = np.zeros((len(plan.reduction.balls), 2))
        self._began = time.monotonic()

    def _measure_traction(self) -> None:
        self._traction = self.meter.traction(self.solver)

    def contact_states(self) -> list[dict[str, float]]:
        """Return penetration, peak pressure, contact area of every model ball, whole balls (collective)."""
        states = []
        for contact, ball in zip(self.model.contacts, self.plan.reduction.balls, strict=True):
            state = contact.extremes(self.model.nodal, self.comm)
            state["contact_area"] *= ball.copies
            states.append(state)
        return states

    def per_squared_force(self, states: list[dict[str, float]]) -> np.ndarray:
        """Return the domain integral's T / Q^2 (balls, 2) [1/N]."""
        radii = [math.sqrt(state["contact_area"] / math.pi) for state in states]
        forces = np.array(self.path.history[-1].forces)[:, None]
        return np.divide(self.meter.domain(radii), forces**2, out=np.zeros((len(forces), 2)), where=forces > 0.0)

    def answer(self, record: StepRecord, number: int, companion: _Companion) -> Step:
        """Return the finished step with forces, routes and errors for every ball of the scene (collective)."""
        states = self.contact_states()
        raw = self.per_squared_force(states)
        forces, approaches = np.array(record.normal_forces), self.path.history[-1].approaches
        coarse, coarse_forces = companion.at(record.fraction)
        gain = 1.0 / (COARSENING**ORDER - 1.0)
        correction = gain * (raw - coarse)
        extrapolated = raw + correction
        tractions = self._traction + correction
        error = np.abs(correction).max(axis=1) + np.abs(tractions - extrapolated).max(axis=1)
        squared = forces**2
        balls = []
        reduction = self.plan.reduction
        for index, (image, ball) in enumerate(zip(reduction.images, self.plan.problem.balls, strict=True)):
            b = image.model_ball

            def turned(values: np.ndarray, index: int = index, b: int = b) -> tuple[float, float]:
                x, y = squared[b] * values[b]
                return reduction.to_scene(index, (float(x), float(y)))

            balls.append(
                BallResult(
                    position=ball.position,
                    radius=ball.radius,
                    approach=approaches[b],
                    normal_force=float(forces[b]),
                    tangential_force=turned(extrapolated),
                    tangential_force_error=float(squared[b] * error[b] + self.solver.tolerance),
                    peak_pressure=states[b]["peak_pressure"],
                    contact_area=states[b]["contact_area"],
                    tangential_force_routes={
                        "domain_extrapolated": turned(extrapolated),
                        "traction_extrapolated": turned(tractions),
                        "domain": turned(raw),
                        "domain_companion": turned(coarse),
                    },
                )
            )
        now = time.monotonic()
        whole = 2 ** len(reduction.planes)
        reaction = self.model.base_reaction()
        pressed = sum(f / ball.copies for f, ball in zip(forces, reduction.balls, strict=True))
        details = {
            "step": number,
            "fraction": record.fraction,
            "iterations": record.newton_iterations,
            "augmentations": record.augmentations,
            "force_iterations": record.force_iterations,
            "cuts": record.cuts,
            "residual": record.residual,
            "penetration": max(s["penetration"] for s in states),
            "open_gap": max(s["open_gap"] for s in states),
            "force_balance": abs(pressed - reaction) / pressed,
            "strain_energy": whole * self.model.strain_energy(),
            "normal_force_error": [
                float(gain * abs(forces[i.model_ball] - coarse_forces[i.model_ball])) for i in reduction.images
            ],
            "seconds": now - self._began,
        }
        self._began = now
        return Step(tuple(balls), details)


class _Companion:
    """T / Q^2 and Q of the coarser mesh along the load path."""

    def __init__(self, rows: list[dict[str, Any]]) -> None:
        self.rows = rows

    def at(self, fraction: float) -> tuple[np.ndarray, np.ndarray]:
        """Return T / Q^2 (balls, 2) [1/N] and Q (balls,) [N] at a load fraction, interpolated in its logarithm."""
        x = np.log([row["fraction"] for row in self.rows])
        at = math.log(fraction)

        def interpolated(name: str, logarithm: bool) -> np.ndarray:
            values = np.array([row[name] for row in self.rows])
            flat = values.reshape(len(x), -1)
            if logarithm:
                return np.exp([np.interp(at, x, np.log(column)) for column in flat.T])
            return np.array([np.interp(at, x, column) for column in flat.T]).reshape(values.shape[1:])

        return interpolated("per_squared_force", False), interpolated("normal_forces", True)


def _companion(plan: RunPlan, folder: Path, key: str, comm: MPI.Comm, observer: Any) -> _Companion:
    """Run the coarser mesh along the load path, or read what an earlier run of it left in the folder."""
    path = folder / "companion.json"
    rows = comm.bcast(_saved_rows(path, key) if comm.rank == 0 else None, root=0)
    reached = rows[-1]["fraction"] if rows else 0.0
    if reached < 1.0:
        rows = []
        run = _Simulation(plan, plan.boxes[0], folder / "companion.msh", comm, observer, "companion")
        for record in run.path.steps(list(plan.fractions)):
            values = run.per_squared_force(run.contact_states())
            rows.append(
                {
                    "fraction": record.fraction,
                    "per_squared_force": values.tolist(),
                    "normal_forces": record.normal_forces,
                    "iterations": record.newton_iterations,
                }
            )
            text = json.dumps({"key": key, "unknowns": run.model.unknowns, "rows": rows})
            _on_root(comm, lambda text=text: _replace(path, text))  # type: ignore[misc]
    return _Companion(rows)


def _saved_rows(path: Path, key: str) -> list[dict[str, Any]]:
    try:
        saved = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return []
    return saved["rows"] if saved["key"] == key else []


def _replace(path: Path, text: str) -> None:
    draft = path.with_suffix(".part")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)


def _kinematics(plan: RunPlan) -> Kinematics:
    if plan.model == "small_strain":
        return Small()
    effect = plan.problem.finite_strain
    return Finite() if effect is None else Finite(effect.law)


def _on_root(comm: MPI.Comm, action: Callable[[], object]) -> None:
    """Do something on rank 0; if it fails, raise on every rank."""
    failure: ThirdBodyError | None = None
    if comm.rank == 0:
        try:
            action()
        except ThirdBodyError as error:
            failure = error
        except OSError as error:
            failure = OutputUnusable(f"output folder cannot be written: {error}")
    failure = comm.bcast(failure, root=0)
    if failure is not None:
        raise failure


@contextmanager
def _working_folder(folder: Path | None, comm: MPI.Comm) -> Iterator[Path]:
    if folder is not None:
        _on_root(comm, lambda: folder.mkdir(parents=True, exist_ok=True))
        yield folder
        return
    scratch = tempfile.TemporaryDirectory(prefix="thirdbody-") if comm.rank == 0 else None
    try:
        yield Path(comm.bcast(scratch.name if scratch else None, root=0))
        comm.barrier()
    finally:
        if scratch:
            scratch.cleanup()


def _result(plan: RunPlan, asked: float, model: Model, steps: list[Step], comm: MPI.Comm, seconds: float) -> Result:
    last = steps[-1]
    size = max(math.hypot(*ball.tangential_force) for ball in last.balls)
    reached = max(ball.tangential_force_error for ball in last.balls)
    notes = []
    if size > 0.0 and reached > asked * size:
        notes.append(
            f"tangential force known to {100 * reached / size:.2g} % at full load; "
            f"{100 * asked:.2g} % was asked for: ask for less than that to get a finer mesh"
        )
    return Result(
        model=plan.model,
        balls=last.balls,
        steps=tuple(steps),
        solved=Solved(
            converged=True,
            iterations=sum(step.record["iterations"] for step in steps),
            unknowns=model.unknowns,
            seconds=seconds,
            ranks=comm.size,
            versions=compat.versions(),
            notes=tuple(notes),
            certificate={
                name: max(step.record[name] for step in steps) for name in ("penetration", "force_balance", "residual")
            },
        ),
    )
