"""One run: companion mesh, main mesh, every load step answered, written and handed on.

T / Q^2 is the domain integral's, extrapolated from the two meshes, and so is Q where the approach is
prescribed (D where the force is). The error of T adds up the mesh error, estimated more cautiously than the
extrapolation, and what the traction route differs by.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from finite_strain import FORMAT, compat
from finite_strain.catalogue import FieldChoice
from finite_strain.checkpoint import read_checkpoint, write_checkpoint
from finite_strain.companion import Companion, saved_rows
from finite_strain.mesh_run import MeshRun
from finite_strain.model import Model
from finite_strain.output import FieldWriter
from finite_strain.planning import RunPlan, plan_run
from finite_strain.together import on_root, replace_text, working_folder
from finite_strain.top_surface import gather_surface
from finite_strain.volumetric import describe_forms, form_notes
from linear_bem.problem import Problem
from linear_bem.result import Result, Solved, Step


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
    problem: Problem,
    model: str,
    tangential_force: float,
    comm: MPI.Comm | None,
    folder: Path | None,
    observer: Any,
    fields: FieldChoice | None = None,
) -> Result:
    """Run a problem; see `finite_strain.solve`."""
    began = time.monotonic()
    comm = MPI.COMM_WORLD if comm is None else comm
    observer = observer or Silence()
    plan = plan_run(problem, tangential_force, model)
    key = hashlib.sha256(repr((FORMAT, problem, model, tangential_force)).encode()).hexdigest()
    with working_folder(folder, comm) as where:
        companion = _companion(plan, where, key, comm, observer)
        main = MeshRun(plan, plan.boxes[1], where / "mesh.msh", comm, observer, "main")
        writer = FieldWriter(main.model, where, fields) if folder is not None else None
        history, steps = read_checkpoint(where, main.model, key)
        main.path.resume(history)
        if writer is not None:
            writer.forget_after(len(steps))
        observer.started(
            {
                "model": model,
                "forms": describe_forms(problem),
                "unknowns": main.model.unknowns,
                "ranks": comm.size,
                "load_steps": len(plan.fractions),
                "symmetry_planes": len(plan.reduction.planes),
                "resumed_steps": len(steps),
                "versions": compat.versions(),
            }
        )
        for record in main.path.steps(list(plan.fractions)):
            step = main.answer(record, steps, companion)
            if writer is not None:
                taken = writer.write(len(steps) + 1, record.fraction)
                step = replace(step, record={**step.record, "seconds_output": taken})
            steps.append(step)
            if writer is not None:
                write_checkpoint(where, main.model, main.path.history, steps, key)
            observer.step_done(step, gather_surface(main.model))
    result = _result(plan, tangential_force, main.model, steps, comm, time.monotonic() - began)
    main.close()
    return result


def _companion(plan: RunPlan, folder: Path, key: str, comm: MPI.Comm, observer: Any) -> Companion:
    """Run the coarser mesh along the load path, or read what an earlier run of it left in the folder."""
    path = folder / "companion.json"
    rows = on_root(comm, lambda: saved_rows(path, key))
    reached = rows[-1]["fraction"] if rows else 0.0
    if reached < 1.0:
        rows = []
        run = MeshRun(plan, plan.boxes[0], folder / "companion.msh", comm, observer, "companion")
        for record in run.path.steps(list(plan.fractions)):
            values = run.per_squared_force(run.contact_states())
            rows.append(
                {
                    "fraction": record.fraction,
                    "per_squared_force": values.tolist(),
                    "normal_forces": record.normal_forces,
                    "approaches": run.path.history[-1].approaches,
                    "iterations": record.newton_iterations,
                }
            )
            text = json.dumps({"key": key, "unknowns": run.model.unknowns, "rows": rows})
            on_root(comm, lambda text=text: replace_text(path, text))  # type: ignore[misc]
        run.close()
    return Companion(rows)


def _result(plan: RunPlan, asked: float, model: Model, steps: list[Step], comm: MPI.Comm, seconds: float) -> Result:
    last = steps[-1]
    size = max(math.hypot(*ball.tangential_force) for ball in last.balls)
    reached = max(ball.tangential_force_error for ball in last.balls)
    notes = [*form_notes(plan.problem), *plan.notes()]
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
