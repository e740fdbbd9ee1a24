"""A deep pair in NGSolve: contact energy per deformed area, and a load path at every order, unlike `ngsolve_pair`."""

from typing import Any

import ngsolve as ng
import numpy as np

from runs.studies.peers.ngsolve_pair import FIXED, Equilibrium, Pair, mesh_of
from runs.studies.peers.scene import EXTENT, SOFT, Array, report

RAMP = 0.05
"""Length over which the weight q falls from 1 to 0 at the plane of symmetry; the contact must not extend into it."""
START, STEP, SHORTEST = 0.3, 0.05, 2e-3
"""Approach from which the load path continues at the requested order; its largest and its shortest step."""


def lines(pair: Pair, fineness: int) -> tuple[Array, Array, Array]:
    """Return the grid planes in x, y and z; planes in x and y are symmetric about the ball's axis."""
    half = pair.L / 2
    edge = np.linspace(half - RAMP, half, max(fineness // 2, 1) + 1)
    near = np.concatenate([np.linspace(0.0, edge[0], 2 * fineness + 1), edge[1:]])
    far = half + (EXTENT - half) * (1.6 ** np.linspace(0, 3, 2 * fineness + 2) - 1) / (1.6**3 - 1)
    depth = np.linspace(1, 0, 5)
    y = np.concatenate([near, far[1:]])
    return np.concatenate([half - near[:0:-1], half + y]), y, -pair.h * (depth + depth**2) / 2


def space(pair: Pair, order: int, fineness: int) -> Any:
    """Return the displacements of an order on the grid of a fineness."""
    return ng.VectorH1(mesh_of(lines(pair, fineness)), order=order, **FIXED)


def follow(equilibrium: Equilibrium, start: float, approach: float) -> None:
    """Step from one approach to another, extrapolating the last step and halving failed ones."""
    done, step = start, STEP
    earlier: tuple[float, Any] | None = None
    while done < approach - 1e-12:
        goal = min(done + step, approach)
        kept = equilibrium.u.vec.CreateVector()
        kept.data = equilibrium.u.vec
        if earlier is not None:
            equilibrium.u.vec.data += (goal - done) / (done - earlier[0]) * (kept - earlier[1])
        if equilibrium.at(goal, most=12, small=1e-3):
            earlier, done, step = (done, kept), goal, min(1.3 * step, STEP)
            continue
        equilibrium.u.vec.data = kept
        earlier, step = None, step / 2
        if step < SHORTEST:
            raise RuntimeError(f"Newton's method fails between D = {done} and {goal}")


def main(approach: float, size: str, *settings: str) -> None:
    """Solve with elements of order p on a grid of fineness n, where ``size`` is "pxn", and print the answer.

    The load path is followed on grid 1. ``settings`` are fields of `Pair`, as "nu=0.4".
    """
    pair = Pair(deformed=True, **{name: float(value) for name, value in (text.split("=") for text in settings)})
    order, fineness = map(int, size.split("x"))
    depth = ng.Parameter(0.0)
    u = path(pair, depth, approach, order)
    if fineness > 1:
        coarse, u = u, ng.GridFunction(space(pair, order, fineness))
        u.Set(coarse)
        if not Equilibrium(pair, u, depth, SOFT).at(approach, most=30):
            raise RuntimeError("Newton's method fails on the finer grid")
    close(pair, u, depth, approach)
    half = pair.L / 2
    away = ng.IfPos(ng.x - half, ng.x - half, half - ng.x)
    slope = ng.IfPos(away - half + RAMP, ng.IfPos(half - away, 1 / RAMP, 0), 0) * ng.IfPos(ng.x - half, -1, 1)
    forces = pair.forces(u, slope, 2 * order + 4)
    report("NGSolve", ng.__version__, approach, f"order {order}, grid {fineness}", u.space.ndof, *forces)


def path(pair: Pair, depth: Any, approach: float, order: int) -> Any:
    """Return the displacement on grid 1 at an approach, with the softest penalty."""
    first, u = (ng.GridFunction(space(pair, p, 1)) for p in (2, order))
    follow(Equilibrium(pair, first, depth, SOFT), 0.0, min(START, approach))
    u.Set(first)
    soft = Equilibrium(pair, u, depth, SOFT)
    if not soft.at(min(START, approach)):
        raise RuntimeError("Newton's method fails after the change of order")
    follow(soft, min(START, approach), approach)
    return u


def close(pair: Pair, u: Any, depth: Any, approach: float) -> None:
    """Remove the penetration of a state with the softest penalty, in parts."""
    multiplier, stiffness = 0, SOFT
    for stiffer, shares in ((SOFT, (0.25, 0.5, 0.75, 1.0)), (2 * SOFT, (1.0,))):
        source = ng.GridFunction(u.space)
        source.vec.data = u.vec
        found = pair.pressure(source, depth, stiffness, multiplier)
        for share in shares:
            part = multiplier + share * (found - multiplier)
            if not Equilibrium(pair, u, depth, stiffer, part).at(approach):
                raise RuntimeError("Newton's method fails at full load")
        multiplier, stiffness = found, stiffer
