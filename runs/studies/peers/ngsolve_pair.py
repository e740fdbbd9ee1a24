"""The pair in NGSolve (https://ngsolve.org): hexahedra of any order, layer and contact as symbolic energies."""

from collections.abc import Callable, Sequence
from typing import Any

import ngsolve as ng
import numpy as np
from ngsolve.meshes import MakeStructured3DMesh
from ngsolve.nonlinearsolvers import NewtonSolver

from runs.studies.peers.scene import LAME, MIDDLE, SHEAR, SOFT, STIFF, THICKNESS, follow, lines, report, weight_slope

FIXED = {"dirichletx": "back|front|bottom", "dirichlety": "left|right|bottom", "dirichletz": "bottom"}
"""Symmetry planes, lateral boundary and base, by NGSolve's names of a cube's sides."""


def energy(H: Any) -> Any:
    """Return the strain energy density for a displacement gradient."""
    j = ng.Det(H + ng.Id(3)) - 1
    return SHEAR * (ng.InnerProduct(H, H) / 2 + ng.Trace(H) - ng.log(1 + j)) + LAME / 2 * j**2


def mesh_of(grid: Sequence[Any]) -> Any:
    """Return the mesh of hexahedra between grid planes in x, y and z."""

    def place(*unit: float) -> tuple[float, ...]:
        return tuple(float(np.interp(u * (len(g) - 1), range(len(g)), g)) for u, g in zip(unit, grid, strict=True))

    return MakeStructured3DMesh(True, *(len(g) - 1 for g in grid), mapping=place)


def main(approach: float, size: str) -> None:
    """Solve with elements of order p on a grid of fineness n, where ``size`` is "pxn", and print the answer."""
    order, fineness = map(int, size.split("x"))
    mesh, depth = mesh_of(lines(approach, fineness)), ng.Parameter(0.0)

    def pressure(u: Any, stiffness: float, multiplier: Any = 0) -> Any:
        found = multiplier + stiffness * (1 - ng.Norm(ng.CF((ng.x - 1, ng.y, ng.z - 1 + depth)) + u))
        return ng.IfPos(found, found, 0)

    def solver(u: Any, stiffness: float, multiplier: Any = 0, damping: float = 0.25) -> Callable[[float], bool]:
        trial = u.space.TrialFunction()
        total = ng.BilinearForm(u.space, condense=True)
        total += ng.Variation(energy(ng.Grad(trial)).Compile() * ng.dx)
        contact = pressure(trial, stiffness, multiplier) ** 2 / (2 * stiffness)
        total += ng.Variation(contact.Compile() * ng.ds("top", bonus_intorder=4))
        newton, before = NewtonSolver(total, u, inverse="sparsecholesky"), u.vec.CreateVector()

        def attempt(approach: float) -> bool:
            depth.Set(approach)
            before.data = u.vec
            failed, _ = newton.Solve(maxerr=1e-8, maxit=15, dampfactor=damping)
            if failed:
                u.vec.data = before
            return not failed

        return attempt

    coarse, first, u = (ng.GridFunction(ng.VectorH1(mesh, order=p, **FIXED)) for p in (2, order, order))
    follow(approach, solver(coarse, SOFT, damping=1))  # load path with elements of order 2 and a soft penalty
    first.Set(coarse)
    solved = solver(first, SOFT)(approach) and solver(first, MIDDLE)(approach)
    u.vec.data = first.vec
    # the penalty pressure becomes the multiplier; a stiffer penalty removes the remaining penetration
    if not solved or not solver(u, STIFF, pressure(first, MIDDLE))(approach):
        raise RuntimeError("Newton's method fails at full load")

    H = ng.Grad(u).MakeVariable()
    psi = energy(H)
    P = psi.Diff(H)
    normal = -2 * ng.Integrate(P[2, 2], mesh, order=2 * order + 2) / THICKNESS
    eshelby = psi - ng.InnerProduct(H[:, 0], P[:, 0])
    slope = weight_slope(ng.x, approach, ng.IfPos)
    tangential = -2 * ng.Integrate(eshelby * slope, mesh, order=2 * order + 2)
    report("NGSolve", ng.__version__, approach, f"order {order}, grid {fineness}", u.space.ndof, normal, tangential)
