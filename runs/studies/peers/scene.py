"""What every code of the study solves: one quarter of the pair, as a grid of hexahedra that all can take.

Lengths in radii R, forces in E R². The ball is at x = 1, y = 0, z = 1 - D; x = 0 and y = 0 are planes of symmetry.
"""

from __future__ import annotations

import importlib
import json
import resource
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

YOUNG, POISSON, THICKNESS, EXTENT = 1.0, 0.48, 1.16, 5.0
"""Young's modulus, Poisson's ratio, thickness of the layer; how far it is meshed beyond the ball's axis."""
SHEAR = YOUNG / (2 * (1 + POISSON))
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
"""Lame's constants of the law psi = mu/2 (I1 - 3) - mu ln J + lambda/2 (J - 1)^2."""
SOFT, MIDDLE, STIFF, STEP = 100.0, 500.0, 2000.0, 0.027
"""Penalties of contact in E / R, used one after another; largest step of the approach."""


def core(approach: float) -> float:
    """Return the half width around the axis within which the domain integral's weight q is 1: all of the contact."""
    return 1.18 * float(np.sqrt(approach))


def weight_slope(x: Any, approach: float, where: Callable[..., Any] = lambda a, b, c: np.where(a > 0, b, c)) -> Any:
    """Return dq/dx: q rises from 0 at x = 0 to 1 at the core, and falls as its mirror image about x = 1.

    A q that is symmetric about the ball's axis on a mesh that is so takes out what the mesh does to a single ball.
    ``where(a, b, c)`` is the code's own "b where a > 0, else c".
    """
    away = where(x - 1, x - 1, 1 - x)
    ramp = where(away - core(approach), where(1 - away, 1 / (1 - core(approach)), 0), 0)
    return where(x - 1, -ramp, ramp)


def lines(approach: float, fineness: int) -> tuple[Array, Array, Array]:
    """Return the grid's planes in x, y and z: ``fineness`` times two elements from the axis to the core's edge."""
    c, n = core(approach), fineness
    near = np.concatenate([np.linspace(0, c, 2 * n + 1), np.linspace(c, 1, n + 1)[1:]])
    far = 1 + (EXTENT - 1) * (1.6 ** np.linspace(0, 3, 3 * n + 1) - 1) / (1.6**3 - 1)
    y, depth = np.concatenate([near, far[1:]]), np.linspace(1, 0, 4 * n + 1)
    return np.concatenate([1 - near[:0:-1], 1 + y]), y, -THICKNESS * (depth + depth**2) / 2


def follow(approach: float, attempt: Callable[[float], bool]) -> None:
    """Go to ``approach`` by steps that ``attempt`` solves; it says whether it did, and forgets a failure itself."""
    done, step = 0.0, STEP
    while done < approach:
        if attempt(min(done + step, approach)):
            done = min(done + step, approach)
        elif step < STEP / 10:
            raise RuntimeError(f"Newton's method fails between D = {done} and {done + step}")
        else:
            step /= 2


def report(code: str, version: str, approach: float, discretisation: str, unknowns: int, Q: float, T: float) -> None:
    """Print a code's line of JSON; ``T`` > 0 separates the balls. Seconds are of this process and its children."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    found = {"code": code, "version": version, "approach": approach, "discretisation": discretisation}
    found |= {"unknowns": unknowns, "seconds": sum(each.ru_utime + each.ru_stime for each in used)}
    print(json.dumps(found | {"normal_force": Q, "tangential_force": T}))


if __name__ == "__main__":
    importlib.import_module(f"runs.studies.peers.{sys.argv[1]}_pair").main(float(sys.argv[2]), sys.argv[3])
