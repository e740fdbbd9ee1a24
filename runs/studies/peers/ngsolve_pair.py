"""The pair in NGSolve (https://ngsolve.org): hexahedra of any order, layer and contact as symbolic energies."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from ngsolve.meshes import MakeStructured3DMesh

from runs.studies.peers.scene import (
    MIDDLE,
    POISSON,
    SOFT,
    STIFF,
    THICKNESS,
    follow,
    lines,
    moduli,
    report,
    weight_slope,
)

FIXED = {"dirichletx": "back|front|bottom", "dirichlety": "left|right|bottom", "dirichletz": "bottom"}
"""Symmetry planes, lateral boundary and base, by NGSolve's names of a cube's sides."""
GROWTH, DAMPINGS = 5.0, 5
"""Largest growth of the residual in a Newton step, and largest number of halvings of a step that exceeds it."""


def mesh_of(grid: Sequence[Any]) -> Any:
    """Return the mesh of hexahedra between grid planes in x, y and z."""

    def place(*unit: float) -> tuple[float, ...]:
        return tuple(float(np.interp(u * (len(g) - 1), range(len(g)), g)) for u, g in zip(unit, grid, strict=True))

    return MakeStructured3DMesh(True, *(len(g) - 1 for g in grid), mapping=place)


@dataclass(frozen=True)
class Pair:
    """Distance of the balls' axes, Poisson's ratio and thickness of the layer, and share C2 / (C1 + C2) of its law.

    ``deformed``: contact energy per deformed area that faces the ball; per undeformed area, the surface becomes
    unstable at pressures above 2 mu.
    """

    L: float = 2.0
    nu: float = POISSON
    h: float = THICKNESS
    share: float = 0.0
    deformed: bool = False

    def energy(self, H: Any) -> Any:
        """Return the strain energy density for a displacement gradient: `linear_bem.MooneyRivlin`, or neo-Hookean."""
        (shear, lame), s = moduli(self.nu), self.share
        C = (H + ng.Id(3)).trans * (H + ng.Id(3))
        j = ng.Det(H + ng.Id(3)) - 1
        first = ng.InnerProduct(H, H) + 2 * ng.Trace(H)  # I1 - 3
        psi = shear / 2 * (1 - s) * (first - 2 * ng.log(1 + j)) + (lame / 2 - s * shear) * j**2
        if s:
            second = ((first + 3) ** 2 - ng.InnerProduct(C, C)) / 2 - 3
            psi += shear / 2 * s * (second - 4 * ng.log(1 + j))
        return psi

    def from_centre(self, u: Any, depth: Any) -> Any:
        """Return the vector from the ball's centre to a displaced point."""
        return ng.CF((ng.x - self.L / 2, ng.y, ng.z - 1 + depth)) + u

    def pressure(self, u: Any, depth: Any, stiffness: float, multiplier: Any = 0) -> Any:
        """Return the contact pressure."""
        found = multiplier + stiffness * (1 - ng.Norm(self.from_centre(u, depth)))
        return ng.IfPos(found, found, 0)

    def facing(self, u: Any, depth: Any) -> Any:
        """Return the deformed area that faces the ball, over the undeformed one."""
        slope, away = ng.Grad(u).Trace(), self.from_centre(u, depth)
        surface = ng.Cross(ng.CF((1, 0, 0)) + slope[:, 0], ng.CF((0, 1, 0)) + slope[:, 1])
        return -surface * away / ng.Norm(away)

    def forces(self, u: Any, slope: Any, order: int) -> tuple[float, float]:
        """Return Q and T, by integrals of an order over the layer; ``slope`` is dq/dx of the weight."""
        H = ng.Grad(u).MakeVariable()
        psi = self.energy(H)
        P = psi.Diff(H)
        normal = -2 * ng.Integrate(P[2, 2], u.space.mesh, order=order) / self.h
        return normal, -2 * ng.Integrate((psi - ng.InnerProduct(H[:, 0], P[:, 0])) * slope, u.space.mesh, order=order)


class Equilibrium:
    """Newton's method for one penalty and multiplier, with condensed Cholesky factors and a check of the residual."""

    def __init__(self, pair: Pair, u: Any, depth: Any, stiffness: float, multiplier: Any = 0) -> None:
        self.u, self.space, self.depth = u, u.space, depth
        trial = self.space.TrialFunction()
        self.form = ng.BilinearForm(self.space, symmetric=True, condense=True)
        self.form += ng.Variation(pair.energy(ng.Grad(trial)).Compile() * ng.dx)
        contact = pair.pressure(trial, depth, stiffness, multiplier) ** 2 - multiplier * multiplier
        contact = contact / (2 * stiffness) * (pair.facing(trial, depth) if pair.deformed else 1)
        self.form += ng.Variation(contact.Compile() * ng.ds("top", bonus_intorder=4))
        self.free = np.array([bool(b) for b in self.space.FreeDofs()])

    def at(self, approach: float, most: int = 20, small: float = 1e-6) -> bool:
        """Solve at an approach; on failure restore the state and return False."""
        self.depth.Set(approach)
        u, form = self.u.vec, self.form
        before, left, change, trial = (u.CreateVector() for _ in range(4))
        before.data = u
        form.Apply(u, left)
        size = self._norm(left)
        for _ in range(most):
            form.AssembleLinearization(u)
            inverse = form.mat.Inverse(self.space.FreeDofs(True), inverse="sparsecholesky")
            left.data += form.harmonic_extension_trans * left
            change.data = inverse * left
            change.data += form.harmonic_extension * change
            change.data += form.inner_solve * left
            for halved in range(DAMPINGS):
                trial.data = u - 0.5**halved * change
                form.Apply(trial, left)
                if self._norm(left) < GROWTH * size + 1e-9:
                    break
            else:
                break
            u.data, size = trial, self._norm(left)
            if 0.5**halved * change.Norm() < small * u.Norm():
                return True
        u.data = before
        return False

    def _norm(self, vector: Any) -> float:
        value = float(np.linalg.norm(vector.FV().NumPy()[self.free]))
        return value if np.isfinite(value) else np.inf


def main(approach: float, size: str) -> None:
    """Solve with elements of order p on a grid of fineness n, where ``size`` is "pxn", and print the answer."""
    order, fineness = map(int, size.split("x"))
    pair, mesh, depth = Pair(), mesh_of(lines(approach, fineness)), ng.Parameter(0.0)
    coarse, first, u = (ng.GridFunction(ng.VectorH1(mesh, order=p, **FIXED)) for p in (2, order, order))
    follow(approach, Equilibrium(pair, coarse, depth, SOFT).at)  # load path with elements of order 2 and a soft penalty
    first.Set(coarse)
    solved = all(Equilibrium(pair, first, depth, stiffness).at(approach) for stiffness in (SOFT, MIDDLE))
    u.vec.data = first.vec
    # the penalty pressure becomes the multiplier; a stiffer penalty removes the remaining penetration
    if not solved or not Equilibrium(pair, u, depth, STIFF, pair.pressure(first, depth, MIDDLE)).at(approach):
        raise RuntimeError("Newton's method fails at full load")
    forces = pair.forces(u, weight_slope(ng.x, approach, ng.IfPos), 2 * order + 2)
    report("NGSolve", ng.__version__, approach, f"order {order}, grid {fineness}", u.space.ndof, *forces)
