"""A stand-in for ``finite_strain`` with its interface and none of its cost: the linear model times 1 + D / R.

Run as a script, it is the command line with this stand-in; ``ELEMENTS`` in the environment says what goes wrong:
"stop" (not converged on all ranks), "lost" (rank 1 alone fails), "blocked" (the result
can no longer be written), "kill" (the process ends without a word),
"swallow" (a solver that takes an interruption for a failed iteration), each after two steps.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from finite_strain.numerics import DEFAULT, Numerics
from finite_strain.observer import Observer
from finite_strain.planning.records import Answer
from finite_strain.planning.run_plan import model_of
from linear_bem import NotConverged, Problem, UnsupportedProblem
from linear_bem import solve as solve_linear
from linear_bem.result import Result, Solved, Step

FRACTIONS = (0.25, 0.5, 0.75, 1.0)
"""The load path, which is answered where no steps are asked for."""
TERMS = ("discretisation", "enforcement", "transfer", "solver")
"""Terms of the error budget, each a half of the whole: they add up as a root of squares."""


def plan(
    problem: Problem,
    accuracy: float = 0.01,
    model: str = "finite_strain",
    *,
    seconds: float | None = None,
    unknowns: float | None = None,
    steps: Sequence[float] | None = (1.0,),
) -> dict[str, Any]:
    if problem.load.kind != "approach":
        raise UnsupportedProblem(f"{model}: load.{problem.load.kind}: the stand-in knows load.approach")
    return {
        "forms": {"layer": "mixed"}, "linear_solver": "cholesky (mumps): up to 200000 unknowns",
        "symmetries": ["mirror plane x = 0"], "unknowns": 1234, "meshes": ["order 3, fineness 1: about 1234 unknowns"],
        "memory_bytes": 5e8, "memory_bytes_at_most": 6e8, "seconds": 65.0, "seconds_of_meshes": [5.0, 60.0],
        "processor_seconds_of_meshes": [8.0, 96.0],
        "processor_seconds": 104.0, "processor_memory_bytes": 3e8,
        "domain": {"x": [0.0, 4.0], "y": [0.0, 4.0], "layer": 1.0, "substrate": 0.0},
        "load_steps": len(FRACTIONS if steps is None else steps),
        "accuracy": {"asked": accuracy, "unknowns_at_most": unknowns or 120e3, "seconds_at_most": seconds},
    }  # fmt: skip


def solve(
    problem: Problem,
    *,
    model: str = "finite_strain",
    accuracy: float = 0.01,
    comm: Any = None,
    folder: Path | None = None,
    observer: Observer | None = None,
    fields: Any = None,
    seconds: float | None = None,
    unknowns: float | None = None,
    steps: Sequence[float] | None = (1.0,),
    numerics: Numerics = DEFAULT,
) -> Result:
    assert comm is not None
    assert folder is not None
    assert observer is not None
    assert model == model_of(problem)
    checkpoint = folder / "checkpoint.json"
    saved = json.loads(checkpoint.read_text()) if comm.rank == 0 and checkpoint.exists() else []
    done = [Step.from_dict(step) for step in comm.bcast(saved, root=0)]
    path = FRACTIONS if steps is None else steps
    if not done:
        _iterate(observer, model, "coarse", 1.0)
    if len(done) < len(path):
        observer.started({
            "model": model, "mesh": "main", "forms": {"layer": "mixed"}, "unknowns": 1234, "ranks": comm.size,
            "load_steps": len(path), "states": (1 + (model == "finite_strain")) * len(path), "symmetry_planes": 1,
            "resumed_steps": len(done), "versions": {"numpy": np.__version__},
        })  # fmt: skip
    for number, fraction in enumerate(path):
        if number < len(done):
            continue
        if number == 2:
            _go_wrong(comm, observer, folder.parent)
        _iterate(observer, model, "main", fraction)
        step = _state(problem, fraction, number, model, accuracy)
        done.append(step)
        if comm.rank == 0:
            folder.mkdir(parents=True, exist_ok=True)
            checkpoint.write_text(json.dumps([s.to_dict() for s in done]))
        observer.step_done(step, lambda: _surface(problem, done[-1]) if comm.rank == 0 else None)
    reached = _accuracy(done[-1], accuracy, seconds, unknowns)
    solved = Solved(True, 20, 1234, 1.0, comm.size, {"numpy": np.__version__}, accuracy=reached)
    return Result(model, done[-1].balls, solved, tuple(done))


def _iterate(observer: Observer, model: str, mesh: str, fraction: float) -> None:
    for name in (mesh, f"{mesh}, small strain")[: 1 + (model == "finite_strain")]:
        observer.attempt(name, fraction, 0)
        observer.newton(1, 1e-9)


def _accuracy(step: Step, asked: float, seconds: float | None, unknowns: float | None) -> dict[str, Any]:
    largest = max(math.hypot(*ball.tangential_force) for ball in step.balls)
    mesh = {
        "order": 3, "fineness": 1.0, "extent": 1.0, "penalty": 1.0, "unknowns": 1234, "seconds": 1.0, "reached": asked,
        "normal_forces": [ball.normal_force for ball in step.balls],
    }  # fmt: skip
    return {
        "asked": asked, "reached": asked, "met": True, "terms": dict.fromkeys(TERMS, 0.5 * asked),
        "relative_to": {"what": "the largest tangential force", "force": largest},
        "stopped": "the accuracy asked for is met",
        "budget": {"seconds": seconds, "unknowns": unknowns or 120e3}, "meshes": [mesh],
    }  # fmt: skip


def _go_wrong(comm: Any, observer: Observer, out: Path) -> None:
    comm.barrier()  # as a solver's collective calls do: no rank goes wrong before rank 0 has written the steps so far
    match os.environ.get("ELEMENTS"):
        case "stop":
            raise NotConverged("step 2: DIVERGED_LINE_SEARCH, residual 1e-2")
        case "lost":
            if comm.rank == 1:
                raise RuntimeError("rank 1 has lost its way")
            comm.bcast(None, root=1)
        case "blocked":
            if comm.rank == 0:
                (out / "result.json").unlink()
                (out / "result.json").mkdir()
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "swallow":
            try:
                print("waiting", file=sys.stderr, flush=True)
                time.sleep(30.0)
            except KeyboardInterrupt:
                print("taken for a failed iteration", file=sys.stderr, flush=True)
            observer.newton(2, 1e-9)


def _state(problem: Problem, fraction: float, number: int, model: str, accuracy: float) -> Step:
    small = dataclasses.replace(problem, finite_strain=None)
    linear = solve_linear(small.with_load("approach", [v * fraction for v in problem.load.values]))
    balls = []
    for ball in linear.balls:
        factor = 1.0 + ball.approach / ball.radius if model == "finite_strain" else 1.0
        x, y = ball.tangential_force
        force = (x * factor, y * factor)
        error = accuracy * float(np.hypot(*force))
        balls.append(dataclasses.replace(ball, tangential_force=force, tangential_force_error=error))
    errors, none = [ball.tangential_force_error for ball in balls], [0.0] * len(balls)
    return Answer(
        balls=tuple(balls), step=number + 1, mesh=1, fraction=fraction, iterations=5, tangents=3,
        augmentation_iterations=2, augmented=True, cuts=0, residual=1e-12, tolerance=1e-11,
        penetration=1e-6, force_balance=1e-9, smallest_volume_ratio=0.9,
        smallest_surface_stretch=0.9, smallest_seen_area=0.9, surface_crossing=0.0, distorted_at={}, strain_energy=1.0,
        linear_solver="cholesky (mumps)", film=0.9,
        linear_iterations=9, linear_fallbacks=0, residuals=[1e-3, 1e-12],
        seconds=0.1, linear_failure="", pair_weight=[1.0] * len(balls), imbalance=0.0, imbalance_error=0.0,
        error_terms={name: [0.5 * error for error in errors] for name in TERMS},
        normal_force_error=none, approach_error=none, tangential_force_error_at_force=errors,
    ).to_step()  # fmt: skip


def _surface(problem: Problem, step: Step) -> SimpleNamespace:
    """Return the surface of the balls' paraboloids, under the pressure of Hertz on each contact's area."""
    at, radius = np.array([ball.position for ball in step.balls]), problem.balls[0].radius
    around = radius * np.array([1.0, 0.6])
    (x0, y0), (x1, y1) = at.min(axis=0) - around, at.max(axis=0) + around
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(x0, x1, 81), np.linspace(y0, y1, 41)))
    away = [(x - b.position[0]) ** 2 + (y - b.position[1]) ** 2 for b in step.balls]
    sunk = [b.approach - r2 / (2.0 * b.radius) for b, r2 in zip(step.balls, away, strict=True)]
    corner = (np.arange(40)[:, None] * 81 + np.arange(80)).ravel()
    triangles = np.concatenate([np.stack([corner, corner + i, corner + j], 1) for i, j in ((1, 82), (82, 81))])
    pressure = [
        b.peak_pressure * np.sqrt(np.maximum(1.0 - math.pi * r2 / b.contact_area, 0.0))
        for b, r2 in zip(step.balls, away, strict=True)
    ]
    depth = np.maximum(np.max(sunk, axis=0), 0.0)
    return SimpleNamespace(points=np.stack([x, y, -depth], 1), triangles=triangles, pressure=np.max(pressure, axis=0))


def install() -> None:
    """Put this stand-in where ``import finite_strain`` finds it."""
    module = ModuleType("finite_strain")
    module.solve, module.plan, module.Numerics, module.FORMAT = solve, plan, Numerics, 0  # type: ignore[attr-defined]
    sys.modules["finite_strain"] = module


def main() -> None:
    """Run the command line with this stand-in, which plans the same times on every machine."""
    from runs import cli, models  # noqa: PLC0415
    from runs.evolution import expectation  # noqa: PLC0415
    from runs.process import ranks  # noqa: PLC0415

    install()
    if os.environ.get("ELEMENTS") in ("lost", "blocked"):  # the other rank never fails with this one
        ranks.PATIENCE = 0.5
    with patch.object(models, "slowness", lambda: 1.0), patch.object(expectation, "slowness", lambda: 1.0):
        cli.main()


if __name__ == "__main__":
    main()
