"""The problem that every code solves: a quarter of the pair on a common grid of hexahedra.

Lengths in radii R, forces in E R². The ball is at x = 1, y = 0, z = 1 - D; x = 0 and y = 0 are symmetry planes.
"""

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
"""Young's modulus, Poisson's ratio and thickness of the layer; distance meshed from the ball's axis."""


def moduli(poisson: float) -> tuple[float, float]:
    """Return Lame's constants mu and lambda of the layer for a Poisson's ratio."""
    shear = YOUNG / (2 * (1 + poisson))
    return shear, 2 * shear * poisson / (1 - 2 * poisson)


SHEAR, LAME = moduli(POISSON)
"""Lame's constants of the law psi = mu/2 (I1 - 3) - mu ln J + lambda/2 (J - 1)^2."""
SOFT, MIDDLE, STIFF, STEP = 100.0, 500.0, 2000.0, 0.027
"""Contact penalties in E / R, applied in this order; largest step of the approach."""


def core(approach: float) -> float:
    """Return the half-width about the axis within which the weight q is 1; it covers the contact."""
    return 1.18 * float(np.sqrt(approach))


def weight_slope(x: Any, approach: float, where: Callable[..., Any] = lambda a, b, c: np.where(a > 0, b, c)) -> Any:
    """Return dq/dx: q rises from 0 at x = 0 to 1 at the core, mirrored about x = 1.

    With q and mesh symmetric about the ball's axis, the mesh error of a single ball cancels.
    ``where(a, b, c)`` is the code's own "b if a > 0, else c".
    """
    away = where(x - 1, x - 1, 1 - x)
    ramp = where(away - core(approach), where(1 - away, 1 / (1 - core(approach)), 0), 0)
    return where(x - 1, -ramp, ramp)


def lines(approach: float, fineness: int) -> tuple[Array, Array, Array]:
    """Return the grid planes in x, y and z, with 2 ``fineness`` elements from the axis to the edge of the core."""
    c, n = core(approach), fineness
    near = np.concatenate([np.linspace(0, c, 2 * n + 1), np.linspace(c, 1, n + 1)[1:]])
    far = 1 + (EXTENT - 1) * (1.6 ** np.linspace(0, 3, 3 * n + 1) - 1) / (1.6**3 - 1)
    y, depth = np.concatenate([near, far[1:]]), np.linspace(1, 0, 4 * n + 1)
    return np.concatenate([1 - near[:0:-1], 1 + y]), y, -THICKNESS * (depth + depth**2) / 2


def follow(approach: float, attempt: Callable[[float], bool]) -> None:
    """Step to ``approach``, halving failed steps; ``attempt`` returns success and restores its state on failure."""
    done, step = 0.0, STEP
    while done < approach:
        if attempt(min(done + step, approach)):
            done = min(done + step, approach)
        elif step < STEP / 10:
            raise RuntimeError(f"Newton's method fails between D = {done} and {done + step}")
        else:
            step /= 2


def report(
    code: str, version: str, approach: float, discretisation: str, unknowns: int, Q: float, T: float, **errors: float
) -> None:
    """Print the answer as a line of JSON; ``T`` > 0 separates. Seconds are processor time, children included."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    found = {"code": code, "version": version, "approach": approach, "discretisation": discretisation}
    found |= {"unknowns": unknowns, "seconds": sum(each.ru_utime + each.ru_stime for each in used)}
    print(json.dumps(found | {"normal_force": Q, "tangential_force": T} | errors))


if __name__ == "__main__":
    importlib.import_module(f"runs.studies.peers.{sys.argv[1]}_pair").main(float(sys.argv[2]), *sys.argv[3:])
