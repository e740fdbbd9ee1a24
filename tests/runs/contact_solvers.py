"""The contact problems of drifting balls by several solvers.

    python -m tests.runs.contact_solvers [COUNT ...]     # 9, 200, 1000 and 10 000 balls: six minutes of one core

A solver that is not installed is named and left out: `pip install --no-deps osqp piqp` into a folder on PYTHONPATH;
Siconos is a package of Debian (python3-siconos).

Balls start about a square lattice and gather in a periodic cell on a layer of 6 R. The last problems of their drift
that need contact forces are kept, every fifth one: velocities of all stages of a step, and the parting of overlaps.
Velocities are over the largest one that the balls have or that a contact asks for, forces over the largest load times
this. The violation is the largest of |min(N, closing rate less the one allowed)| over the contacts and of what is left
of the balance of forces over the balls.
"""

from __future__ import annotations

import importlib
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.sparse import csc_matrix, diags

from linear_bem import Ball, Layer, Load, Problem
from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from runs.evolution import motion
from runs.evolution.drift import Drift
from runs.evolution.evolving import TABLES
from runs.evolution.hard_balls import HardBalls
from runs.evolution.providers import provider
from runs.models import MODELS
from runs.studies.collective.cases import APPROACH, POISSON, REST, pair_law
from runs.studies.framework.page import markdown
from tests.runs.lattices import lattice

THICKNESS, SPACING, SHAKEN, TOLERANCE = 6.0, 2.6, 0.28, 1e-3
"""Thickness of the layer, distance in the lattice, largest displacement at first, and tolerance of a step, over R."""
PATHS = {9: 20.0, 200: 20.0, 1000: 5.0, 10_000: 0.8}
"""Sliding path over friction times the largest T/Q of a pair, over R."""
KEPT, EVERY = 12, 5
REPEATED = 0.05
"""Small problems are solved again until this processor time [s] is spent."""
SMALL = 2000
"""Contacts up to which solvers with dense matrices are asked."""


@dataclass(frozen=True)
class Contact:
    """min v.Mv/2 - f.v with J v >= b, of order 1: J, the diagonal of M, f, b."""

    jacobian: csc_matrix
    weight: Array
    driven: Array
    opening: Array

    def violation(self, velocity: Array, pushes: Array) -> float:
        """Return by how much velocities and contact forces miss the conditions of the minimum."""
        slack = self.jacobian @ velocity - self.opening
        left = self.weight * velocity - self.driven - self.jacobian.T @ pushes
        return float(max(np.max(np.abs(np.minimum(slack, pushes))), np.max(np.abs(left))))


Answer = tuple[Array, Array, int | None]
"""Velocities, contact forces, iterations."""


def drifted(count: int) -> tuple[list[Contact], dict[str, Any]]:
    """Return the last contact problems of a drift, and a row on it."""
    columns = next(k for k in range(int(np.sqrt(count)), 0, -1) if count % k == 0)
    rows, rng = count // columns, np.random.default_rng(1)
    x = lattice(columns, rows, SPACING) + rng.uniform(-SHAKEN, SHAKEN, (count, 2))
    cell, law = SPACING * np.array([columns, rows]), pair_law(THICKNESS, APPROACH, finite=False)
    problem = Problem(
        Layer(1.0, POISSON, THICKNESS), tuple(Ball(tuple(p), 1.0) for p in x), Load("approach", (APPROACH,) * count)
    )
    forces = provider(MODELS["linear_bem"], problem, None, "pairs", TABLES, cell=cell).forces
    kept: deque[Contact] = deque(maxlen=KEPT)
    calls, spent, solve, by_cones = 0, 0.0, motion.moved, motion._by_cones

    def moved(*given: Any) -> tuple[Array, Array]:
        nonlocal spent
        begun = time.process_time()
        found = solve(*given)
        spent += time.process_time() - begun
        return found

    def recorded(jacobian: csc_matrix, weight: Array, driven: Array, opening: Array, rolling: Array) -> Any:
        nonlocal calls
        calls += 1
        if calls % EVERY == 0:
            kept.append(Contact(jacobian, weight, driven, opening))
        return by_cones(jacobian, weight, driven, opening, rolling)

    drift, begun = Drift(forces, HardBalls(np.ones(count), cell), TOLERANCE, REST * law.largest), time.process_time()
    with patch("runs.evolution.hard_balls.moved", moved), patch.multiple(motion, DENSE=0, _by_cones=recorded):
        for moment in drift.path(x, PATHS.get(count, 1.0) / law.largest):
            last = moment
    seconds = time.process_time() - begun
    return list(kept), {
        "balls": count, "path": last.sigma * law.largest, "contacts at the end": len(last.contacts),
        "steps": last.steps, "seconds": seconds, "of them contacts [%]": 100.0 * spent / seconds,
    }  # fmt: skip


def by_clarabel() -> Callable[[Contact], Answer]:
    """Return what `runs.evolution.motion` does beyond `motion.DENSE` contacts."""
    library, ended = importlib.import_module("clarabel"), []

    def solver(*given: Any) -> Any:
        made = library.DefaultSolver(*given)
        return SimpleNamespace(solve=lambda: ended.append(made.solve()) or ended[-1])

    noting = SimpleNamespace(
        DefaultSolver=solver, DefaultSettings=library.DefaultSettings, NonnegativeConeT=library.NonnegativeConeT
    )

    def solve(p: Contact) -> Answer:
        with patch.dict(sys.modules, clarabel=noting):
            velocity, pushes = motion._by_cones(p.jacobian, p.weight, p.driven, p.opening, np.zeros(len(p.driven) // 2))
        return velocity, pushes, ended.pop().iterations

    return solve


def by_nnls() -> Callable[[Contact], Answer]:
    """Return what `runs.evolution.motion` does up to `motion.DENSE` contacts."""
    return lambda p: (*motion._by_least_squares(p.jacobian, np.sqrt(p.weight), p.driven, p.opening), None)


def by_piqp() -> Callable[[Contact], Answer]:
    """Return the interior-point method PIQP at the tolerance that Clarabel has."""
    import piqp  # noqa: PLC0415

    def solve(p: Contact) -> Answer:
        solver = piqp.SparseSolver()
        for name in ("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel"):
            setattr(solver.settings, name, motion.EXACT)
        solver.settings.check_duality_gap = True
        without = np.full(len(p.opening), np.inf)
        solver.setup(diags(p.weight).tocsc(), -p.driven, None, None, p.jacobian, p.opening, without)
        if "SOLVED" not in str(solver.solve()):
            raise NotConverged("PIQP")
        return np.array(solver.result.x), np.array(solver.result.z_l), solver.result.info.iter

    return solve


def by_osqp() -> Callable[[Contact], Answer]:
    """Return the first-order method OSQP to 1e-6, and the equations of the contacts that it finds active ("polish")."""
    import osqp  # noqa: PLC0415

    def solve(p: Contact) -> Answer:
        solver = osqp.OSQP()
        solver.setup(
            diags(p.weight).tocsc(), -p.driven, p.jacobian, p.opening, np.full(len(p.opening), np.inf), eps_abs=1e-6,
            eps_rel=1e-6, max_iter=100_000, polishing=True, verbose=False,
        )  # fmt: skip
        found = solver.solve(raise_error=False)
        if found.info.status != "solved":
            raise NotConverged("OSQP")
        return np.array(found.x), -np.array(found.y), found.info.iter

    return solve


def by_siconos(method: str, tolerance: float) -> Callable[[], Callable[[Contact], Answer]]:
    """Return a method of Siconos for w = J (M^-1 f + M^-1 J' N) - b >= 0, N >= 0, w N = 0."""

    def made() -> Callable[[Contact], Answer]:
        import siconos.numerics as siconos  # noqa: PLC0415

        def solve(p: Contact) -> Answer:
            matrix = (p.jacobian @ diags(1.0 / p.weight) @ p.jacobian.T).tocsc()
            free = p.driven / p.weight
            given = np.asfortranarray(matrix.toarray()) if method == "LEMKE" else matrix
            options = siconos.SolverOptions(getattr(siconos, f"SICONOS_LCP_{method}"))
            options.iparam[0], options.dparam[0] = 100_000, tolerance
            pushes, slack = np.zeros(len(p.opening)), np.zeros(len(p.opening))
            problem = siconos.LCP(given, p.jacobian @ free - p.opening)
            if siconos.linearComplementarity_driver(problem, pushes, slack, options):
                raise NotConverged("Siconos")
            return free + p.jacobian.T @ pushes / p.weight, pushes, int(options.iparam[1])

        return solve

    return made


SOLVERS: dict[str, Callable[[], Callable[[Contact], Answer]]] = {
    "nnls of scipy (dense)": by_nnls, "Clarabel": by_clarabel, "PIQP": by_piqp, "OSQP, polished": by_osqp,
    "Siconos, Lemke (dense)": by_siconos("LEMKE", 1e-10), "Siconos, Gauss-Seidel": by_siconos("PGS", 1e-8),
}  # fmt: skip


def timed(solve: Callable[[Contact], Answer], problem: Contact) -> tuple[float, Answer]:
    """Return the processor time [s] of one solution, a mean of several if it is short, and the answer."""
    begun, times = time.process_time(), 0
    while True:
        answer, times = solve(problem), times + 1
        spent = time.process_time() - begun
        if spent > REPEATED:
            return spent / times, answer


def compared(count: int, problems: list[Contact], solvers: dict[str, Callable[[Contact], Answer]]) -> list[Any]:
    """Return one row per solver on the problems of ``count`` balls."""
    sizes = [len(p.opening) for p in problems]
    answers: dict[str, dict[int, tuple[float, Answer]]] = {}
    for name, solve in solvers.items():
        answers[name] = {}
        for k, problem in enumerate(problems if max(sizes) <= SMALL or "dense" not in name else ()):
            with suppress(NotConverged):
                answers[name][k] = timed(solve, problem)
    off = {
        name: {k: problems[k].violation(velocity, pushes) for k, (_, (velocity, pushes, _)) in found.items()}
        for name, found in answers.items()
    }
    exact = [
        answers[min((name for name in off if k in off[name]), key=lambda name: off[name][k])][k][1][0]
        for k in range(len(problems))
    ]
    return [
        {
            "balls": count, "contacts": f"{min(sizes)} to {max(sizes)}", "solver": name,
            "solved": f"{len(found)} of {len(problems)}",
            "ms": 1e3 * float(np.mean([one[0] for one in found.values()])),
            "iterations, most": max((one[1][2] for one in found.values()), key=lambda n: n or 0),
            "violation": f"{max(off[name].values()):.0e}",
            "velocities off by": f"{max(np.max(np.abs(one[1][0] - exact[k])) for k, one in found.items()):.0e}",
        }
        for name, found in answers.items() if found
    ]  # fmt: skip


def main() -> None:
    """Print a row per number of balls on its drift, and one per solver."""
    warnings.simplefilter("ignore", UserWarning)  # Siconos converts indices
    solvers = {}
    for name, make in SOLVERS.items():
        try:
            solvers[name] = make()
        except ImportError as error:
            print(f"{name}: left out ({error})", file=sys.stderr)
    drifts, rows = [], []
    for count in map(int, sys.argv[1:] or PATHS):
        problems, row = drifted(count)
        drifts.append(row)
        rows += compared(count, problems, solvers)
    print(*markdown(drifts, digits=3), "", *markdown(rows, digits=3), sep="\n")


if __name__ == "__main__":
    main()
