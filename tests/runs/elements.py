"""A stand-in for ``finite_strain`` with its interface and none of its cost: the linear model times 1 + D / R.

Run as a script, it is the command line with this stand-in; ``ELEMENTS`` in the environment says what goes wrong:
"stop" (not converged on all ranks), "lost" (rank 1 alone fails), "blocked" (the result
can no longer be written), "kill" (the process ends without a word),
"swallow" (a solver that takes an interruption for a failed iteration), each after two steps.
"""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from linear_bem import NotConverged, Problem, UnsupportedProblem
from linear_bem import solve as solve_linear
from linear_bem.result import Result, Solved, Step

FRACTIONS = (0.25, 0.5, 0.75, 1.0)


def plan(
    problem: Problem, tangential_force: float = 0.01, model: str = "finite_strain", **_budget: float
) -> dict[str, Any]:
    if problem.load.kind != "approach":
        raise UnsupportedProblem(f"{model}: load.{problem.load.kind}: the stand-in knows load.approach")
    return {
        "symmetries": ["mirror plane x = 0"], "unknowns": 1234, "memory_bytes": 5e8, "seconds": 65.0,
        "domain": [4.0, 4.0, 1.0], "element_sizes": {"finest": 0.05}, "load_steps": len(FRACTIONS),
    }  # fmt: skip


def solve(
    problem: Problem,
    *,
    model: str = "finite_strain",
    tangential_force: float = 0.01,
    comm: Any = None,
    folder: Path | None = None,
    observer: Any = None,
    **_budget: float,
) -> Result:
    assert comm is not None
    assert folder is not None
    assert observer is not None
    checkpoint = folder / "checkpoint.json"
    saved = json.loads(checkpoint.read_text()) if comm.rank == 0 and checkpoint.exists() else []
    steps = [Step.from_dict(step) for step in comm.bcast(saved, root=0)]
    observer.started({"unknowns": 1234, "versions": {"numpy": np.__version__}})
    for number, fraction in enumerate(FRACTIONS):
        if number < len(steps):
            continue
        observer.attempt({"step": number + 1, "approach": fraction * max(problem.load.values)})
        if number == 2:
            _go_wrong(comm, observer, folder.parent)
        observer.newton({"iteration": 1})
        step = _state(problem, fraction, number, model, tangential_force)
        steps.append(step)
        if comm.rank == 0:
            folder.mkdir(parents=True, exist_ok=True)
            checkpoint.write_text(json.dumps([s.to_dict() for s in steps]))
        observer.step_done(step, _surface(problem, step) if comm.rank == 0 else None)
    solved = Solved(True, 20, 1234, 1.0, comm.size, {"numpy": np.__version__})
    return Result(model, steps[-1].balls, solved, tuple(steps))


def _go_wrong(comm: Any, observer: Any, out: Path) -> None:
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
            observer.newton({"iteration": 2})


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
    return Step(tuple(balls), {"step": number + 1, "iterations": 5, "seconds": 0.1})


def _surface(problem: Problem, step: Step) -> SimpleNamespace:
    """Return the surface that the balls press down to their lower halves."""
    side = 3.0 * problem.balls[0].radius
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-side, side, 81), np.linspace(-side, side, 81)))
    sunk = [b.approach - ((x - b.position[0]) ** 2 + (y - b.position[1]) ** 2) / (2.0 * b.radius) for b in step.balls]
    depth = np.maximum(np.max(sunk, axis=0), 0.0)
    corner = (np.arange(80)[:, None] * 81 + np.arange(80)).ravel()
    triangles = np.concatenate([np.stack([corner, corner + i, corner + j], 1) for i, j in ((1, 82), (82, 81))])
    ball = step.balls[0]
    pressure = depth * ball.peak_pressure / ball.approach
    return SimpleNamespace(points=np.stack([x, y, -depth], 1), triangles=triangles, pressure=pressure)


def install() -> None:
    """Put this stand-in where ``import finite_strain`` finds it."""
    module = ModuleType("finite_strain")
    module.solve, module.plan, module.FORMAT = solve, plan, 0  # type: ignore[attr-defined]
    sys.modules["finite_strain"] = module


if __name__ == "__main__":
    from runs.cli import main

    install()
    main()
