"""Time to reach a given accuracy of T for the paper's pair (kernel table excluded); growth with the number of balls."""

import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np

from linear_bem import Ball, LayeredKernel, Load, Problem, solve
from runs.process.machine import own_memory
from runs.studies.framework.case import LINEAR
from runs.studies.framework.pair import PAPER_LOAD, as_seen_by, pair


def lattice(count: int) -> Problem:
    """Return ``count`` touching balls on a square lattice under one rigid holder, at the paper's load per ball."""
    base = paper_pair()
    side = int(np.ceil(np.sqrt(count)))
    middle = 0.5 * (side - 1)
    places = [(2.0 * (i % side - middle), 2.0 * (i // side - middle)) for i in range(count)]
    balls = tuple(Ball(place, 1.0, "paraboloid") for place in places)
    return Problem(base.layer, balls, Load("total_force", (PAPER_LOAD * count,)), base.substrate)


def paper_pair() -> Problem:
    """Return the paper's pair under its load."""
    return as_seen_by(LINEAR, pair(1.0, shape="paraboloid")).with_load("force", (PAPER_LOAD,) * 2)


def times_to_accuracy(repeats: int) -> list[dict[str, Any]]:
    """Return the best time to T within 1e-2 to 1e-5, and the error against an answer to 1e-9."""
    problem = paper_pair()
    exact = solve(problem, 1e-9).balls[0].tangential_force[0]
    rows = []
    for wanted in (1e-2, 1e-3, 1e-4, 1e-5):
        seconds = []
        for _ in range(repeats):
            begun = time.perf_counter()
            found = solve(problem, wanted).balls[0]
            seconds.append(time.perf_counter() - begun)
        error = abs(found.tangential_force[0] / exact - 1.0)
        estimate = found.tangential_force_error / abs(exact)
        rows.append({"wanted": wanted, "seconds": min(seconds), "error": error, "estimate": estimate})
    return rows


def growth(counts: list[int]) -> list[dict[str, Any]]:
    """Return time and memory for lattices of balls, T to 1e-3; each count in a separate process.

    ``GiB``: peak memory of that process; ``GiB_of_it_before``: part of it for Python, numpy and the kernel table;
    ``time_goes_like``: exponent of the growth of time with the count since the previous row.
    """
    rows: list[dict[str, Any]] = []
    for count in counts:
        # spawned, because a fork would start with this process's memory
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
            row = process.submit(_measured, count).result()
        power = np.nan
        if rows:
            power = float(np.log(row["seconds"] / rows[-1]["seconds"]) / np.log(count / rows[-1]["balls"]))
        rows.append({**row, "time_goes_like": power})
    return rows


def _measured(count: int) -> dict[str, Any]:
    LayeredKernel.of(paper_pair())
    before = _peak()
    begun = time.perf_counter()
    found = solve(lattice(count), 1e-3)
    seconds = time.perf_counter() - begun
    size = max(float(np.hypot(*ball.tangential_force)) for ball in found.balls)
    return {
        "balls": count,
        "seconds": seconds,
        "GiB": _peak(),
        "GiB_of_it_before": before,
        "estimate": max(ball.tangential_force_error for ball in found.balls) / size,
        "largest_residual": max(found.solved.certificate.values()),
    }


def _peak() -> float:
    if sys.platform == "darwin":
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2.0**30
    # on Linux ru_maxrss of a process starts at the size of the process that started it
    return own_memory("VmHWM") / 2.0**30
