"""The deep pair in NGSolve: contact energy per deformed area, which `ngsolve_pair` lacks; the load path at every order.

The contact's potential is per area of the deformed top that faces the ball: per undeformed area, pressures above 2 mu
make the surface unstable.
"""

from typing import Any

import ngsolve as ng
import numpy as np
from ngsolve.meshes import MakeStructured3DMesh

from runs.studies.peers.ngsolve_pair import FIXED, energy
from runs.studies.peers.scene import EXTENT, SOFT, THICKNESS, Array, report

CORE = 0.95
"""Half-width about the axis in which the weight q is 1; the contact's edge must stay within it."""
START, STEP, SHORTEST = 0.3, 0.05, 2e-3
"""Approach from which the load path goes on at the order requested; its largest and shortest step."""
GROWTH, DAMPINGS = 5.0, 5
"""Largest growth of the residual in a Newton step, and how often a step is halved for it."""


def lines(fineness: int) -> tuple[Array, Array, Array]:
    """Return the grid planes in x, y and z; planes in x and y are symmetric about the ball's axis."""
    edge = np.linspace(CORE, 1.0, max(fineness // 2, 1) + 1)
    near = np.concatenate([np.linspace(0.0, CORE, 2 * fineness + 1), edge[1:]])
    far = 1 + (EXTENT - 1) * (1.6 ** np.linspace(0, 3, 2 * fineness + 2) - 1) / (1.6**3 - 1)
    depth = np.linspace(1, 0, 5)
    y = np.concatenate([near, far[1:]])
    return np.concatenate([1 - near[:0:-1], 1 + y]), y, -THICKNESS * (depth + depth**2) / 2


class Equilibrium:
    """Newton's method for one penalty and multiplier, by condensed Cholesky factors with a check of the residual."""

    def __init__(self, u: Any, depth: Any, stiffness: float, multiplier: Any = 0) -> None:
        self.u, self.space, self.depth = u, u.space, depth
        trial = self.space.TrialFunction()
        self.form = ng.BilinearForm(self.space, symmetric=True, condense=True)
        self.form += ng.Variation(energy(ng.Grad(trial)).Compile() * ng.dx)
        slope = ng.Grad(trial).Trace()
        surface = ng.Cross(ng.CF((1, 0, 0)) + slope[:, 0], ng.CF((0, 1, 0)) + slope[:, 1])
        facing = -surface * from_centre(trial, depth) / ng.Norm(from_centre(trial, depth))
        square = pressure(trial, depth, stiffness, multiplier) ** 2 - multiplier * multiplier
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


def from_centre(u: Any, depth: Any) -> Any:
    """Return the vector from the ball's centre to a displaced point."""
    return ng.CF((ng.x - 1, ng.y, ng.z - 1 + depth)) + u


def pressure(u: Any, depth: Any, stiffness: float, multiplier: Any = 0) -> Any:
    """Return the contact pressure."""
    found = multiplier + stiffness * (1 - ng.Norm(from_centre(u, depth)))
    return ng.IfPos(found, found, 0)


def main(approach: float, size: str) -> None:
    """Solve with elements of order p on a grid of fineness n, where ``size`` is "pxn", and print the answer."""
    order, fineness = map(int, size.split("x"))
    grid = lines(fineness)

    def place(*unit: float) -> tuple[float, ...]:
        return tuple(float(np.interp(u * (len(g) - 1), range(len(g)), g)) for u, g in zip(unit, grid, strict=True))

    mesh = MakeStructured3DMesh(True, *(len(g) - 1 for g in grid), mapping=place)
    depth = ng.Parameter(0.0)
    coarse, u = (ng.GridFunction(ng.VectorH1(mesh, order=p, **FIXED)) for p in (2, order))
    Equilibrium(coarse, depth, SOFT).follow(0.0, min(START, approach))
    u.Set(coarse)
    soft = Equilibrium(u, depth, SOFT)
    solved = soft.at(min(START, approach))
    soft.follow(min(START, approach), approach)
    multiplier, stiffness = 0, SOFT
    for stiffer, shares in ((SOFT, (0.25, 0.5, 0.75, 1.0)), (2 * SOFT, (1.0,))):
        source = ng.GridFunction(u.space)
        source.vec.data = u.vec
        found = pressure(source, depth, stiffness, multiplier)
        for share in shares:  # the penetration is closed in parts
            part = multiplier + share * (found - multiplier)
            solved = solved and Equilibrium(u, depth, stiffer, part).at(approach)
        multiplier, stiffness = found, stiffer
    if not solved:
        raise RuntimeError("Newton's method fails at full load")

    H = ng.Grad(u).MakeVariable()
    psi = energy(H)
    P = psi.Diff(H)
    away = ng.IfPos(ng.x - 1, ng.x - 1, 1 - ng.x)
    ramp = ng.IfPos(away - CORE, ng.IfPos(1 - away, 1 / (1 - CORE), 0), 0) * ng.IfPos(ng.x - 1, -1, 1)
    rule = 2 * order + 4
    normal = -2 * ng.Integrate(P[2, 2], mesh, order=rule) / THICKNESS
    tangential = -2 * ng.Integrate((psi - ng.InnerProduct(H[:, 0], P[:, 0])) * ramp, mesh, order=rule)
    report("NGSolve", ng.__version__, approach, f"order {order}, grid {fineness}", u.space.ndof, normal, tangential)
