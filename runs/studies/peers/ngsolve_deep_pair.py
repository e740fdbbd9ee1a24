"""A deep pair in NGSolve: contact energy per deformed area, and a load path at every order, unlike `ngsolve_pair`.

Per undeformed area that faces the ball, the surface would become unstable at pressures above 2 mu.
"""

from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np

from runs.studies.peers.ngsolve_pair import FIXED, mesh_of
from runs.studies.peers.scene import EXTENT, POISSON, SOFT, THICKNESS, Array, moduli, report

RAMP = 0.05
"""Length over which the weight q falls from 1 to 0 at the plane of symmetry; the contact must not extend into it."""
START, STEP, SHORTEST = 0.3, 0.05, 2e-3
"""Approach from which the load path continues at the requested order; its largest and its shortest step."""
GROWTH, DAMPINGS = 5.0, 5
"""Largest growth of the residual in a Newton step, and largest number of halvings of a step that exceeds it."""


@dataclass(frozen=True)
class Pair:
    """Distance of the balls' axes, Poisson's ratio and thickness of the layer, and share C2 / (C1 + C2) of its law."""

    L: float = 2.0
    nu: float = POISSON
    h: float = THICKNESS
    share: float = 0.0

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

    def lines(self, fineness: int) -> tuple[Array, Array, Array]:
        """Return the grid planes in x, y and z; planes in x and y are symmetric about the ball's axis."""
        half = self.L / 2
        edge = np.linspace(half - RAMP, half, max(fineness // 2, 1) + 1)
        near = np.concatenate([np.linspace(0.0, edge[0], 2 * fineness + 1), edge[1:]])
        far = half + (EXTENT - half) * (1.6 ** np.linspace(0, 3, 2 * fineness + 2) - 1) / (1.6**3 - 1)
        depth = np.linspace(1, 0, 5)
        y = np.concatenate([near, far[1:]])
        return np.concatenate([half - near[:0:-1], half + y]), y, -self.h * (depth + depth**2) / 2

    def space(self, order: int, fineness: int) -> Any:
        """Return the displacements of an order on the grid of a fineness."""
        return ng.VectorH1(mesh_of(self.lines(fineness)), order=order, **FIXED)

    def from_centre(self, u: Any, depth: Any) -> Any:
        """Return the vector from the ball's centre to a displaced point."""
        return ng.CF((ng.x - self.L / 2, ng.y, ng.z - 1 + depth)) + u

    def pressure(self, u: Any, depth: Any, stiffness: float, multiplier: Any = 0) -> Any:
        """Return the contact pressure."""
        found = multiplier + stiffness * (1 - ng.Norm(self.from_centre(u, depth)))
        return ng.IfPos(found, found, 0)

    def forces(self, u: Any, order: int) -> tuple[float, float]:
        """Return Q and T, by integrals over the layer."""
        H = ng.Grad(u).MakeVariable()
        psi = self.energy(H)
        P = psi.Diff(H)
        half, rule = self.L / 2, 2 * order + 4
        away = ng.IfPos(ng.x - half, ng.x - half, half - ng.x)
        ramp = ng.IfPos(away - half + RAMP, ng.IfPos(half - away, 1 / RAMP, 0), 0) * ng.IfPos(ng.x - half, -1, 1)
        normal = -2 * ng.Integrate(P[2, 2], u.space.mesh, order=rule) / self.h
        return normal, -2 * ng.Integrate((psi - ng.InnerProduct(H[:, 0], P[:, 0])) * ramp, u.space.mesh, order=rule)


class Equilibrium:
    """Newton's method for one penalty and multiplier, with condensed Cholesky factors and a check of the residual."""

    def __init__(self, pair: Pair, u: Any, depth: Any, stiffness: float, multiplier: Any = 0) -> None:
        self.u, self.space, self.depth = u, u.space, depth
        trial = self.space.TrialFunction()
        self.form = ng.BilinearForm(self.space, symmetric=True, condense=True)
        self.form += ng.Variation(pair.energy(ng.Grad(trial)).Compile() * ng.dx)
        slope = ng.Grad(trial).Trace()
        surface = ng.Cross(ng.CF((1, 0, 0)) + slope[:, 0], ng.CF((0, 1, 0)) + slope[:, 1])
        away = pair.from_centre(trial, depth)
        facing = -surface * away / ng.Norm(away)
        square = pair.pressure(trial, depth, stiffness, multiplier) ** 2 - multiplier * multiplier
        contact = square / (2 * stiffness) * facing
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

    def follow(self, start: float, approach: float) -> None:
        """Step from one approach to another, extrapolating the last step and halving failed ones."""
        done, step = start, STEP
        earlier: tuple[float, Any] | None = None
        while done < approach - 1e-12:
            goal = min(done + step, approach)
            kept = self.u.vec.CreateVector()
            kept.data = self.u.vec
            if earlier is not None:
                self.u.vec.data += (goal - done) / (done - earlier[0]) * (kept - earlier[1])
            if self.at(goal, most=12, small=1e-3):
                earlier, done, step = (done, kept), goal, min(1.3 * step, STEP)
                continue
            self.u.vec.data = kept
            earlier, step = None, step / 2
            if step < SHORTEST:
                raise RuntimeError(f"Newton's method fails between D = {done} and {goal}")

    def _norm(self, vector: Any) -> float:
        value = float(np.linalg.norm(vector.FV().NumPy()[self.free]))
        return value if np.isfinite(value) else np.inf


def main(approach: float, size: str, *settings: str) -> None:
    """Solve with elements of order p on a grid of fineness n, where ``size`` is "pxn", and print the answer.

    The load path is followed on grid 1. ``settings`` are fields of `Pair`, as "nu=0.4".
    """
    pair = Pair(**{name: float(value) for name, value in (text.split("=") for text in settings)})
    order, fineness = map(int, size.split("x"))
    depth = ng.Parameter(0.0)
    u = path(pair, depth, approach, order)
    if fineness > 1:
        coarse, u = u, ng.GridFunction(pair.space(order, fineness))
        u.Set(coarse)
        if not Equilibrium(pair, u, depth, SOFT).at(approach, most=30):
            raise RuntimeError("Newton's method fails on the finer grid")
    close(pair, u, depth, approach)
    report("NGSolve", ng.__version__, approach, f"order {order}, grid {fineness}", u.space.ndof, *pair.forces(u, order))


def path(pair: Pair, depth: Any, approach: float, order: int) -> Any:
    """Return the displacement on grid 1 at an approach, with the softest penalty."""
    first, u = (ng.GridFunction(pair.space(p, 1)) for p in (2, order))
    Equilibrium(pair, first, depth, SOFT).follow(0.0, min(START, approach))
    u.Set(first)
    soft = Equilibrium(pair, u, depth, SOFT)
    if not soft.at(min(START, approach)):
        raise RuntimeError("Newton's method fails after the change of order")
    soft.follow(min(START, approach), approach)
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
