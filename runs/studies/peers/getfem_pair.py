"""The pair in GetFEM (https://getfem.org): hexahedra of any order, layer and contact as potentials."""

import getfem as gf
import numpy as np

from runs.studies.peers import scene
from runs.studies.peers.scene import LAME, MIDDLE, SHEAR, SOFT, STIFF, THICKNESS, Array

F = "(Grad_u + Id(3))"
ENERGY = f"({SHEAR!r}*(Norm_sqr(Grad_u)/2 + Trace(Grad_u) - log(Det{F})) + {LAME / 2!r}*sqr(Det{F} - 1))"
STRESS = f"({SHEAR!r}*({F} - Inv({F})') + {LAME!r}*(Det{F} - 1)*Det{F}*Inv({F})')"
TOP = 1
gf.util_trace_level(0)


class Layer:
    """The layer and its contact, with elements of one order."""

    def __init__(self, grid: tuple[Array, ...], order: int) -> None:
        self.mesh = gf.Mesh("cartesian", *grid)
        self.mesh.set_region(TOP, self.mesh.outer_faces_with_direction([0, 0, 1], 0.01))
        self.full = gf.MeshFem(self.mesh, 3)
        self.full.set_fem(gf.Fem(f"FEM_QK(3,{order})"))
        place, component = self.full.basic_dof_nodes(), np.arange(self.full.nbdof()) % 3
        fixed = np.isclose(place[2], -THICKNESS)
        for k in (0, 1):  # symmetry planes and lateral boundary
            fixed |= (component == k) & np.any(np.isclose(place[k][:, None], grid[k][[0, -1]]), axis=1)
        self.kept = np.flatnonzero(~fixed)
        self.space = gf.MeshFem("partial", self.full, self.kept)
        rules = [f"IM_GAUSS_PARALLELEPIPED(3,{degree})" for degree in (2 * order, 2 * order + 4)]
        self.inside, surface = (gf.MeshIm(self.mesh, gf.Integ(rule)) for rule in rules)
        self.model = gf.Model("real")
        self.model.add_fem_variable("u", self.space)
        self.model.add_initialized_fem_data("before", self.space, np.zeros(self.space.nbdof()))
        for name, value in (("D", 0.0), ("k", SOFT), ("multiplier", 0.0)):
            self.model.add_initialized_data(name, [value])
        self.model.add_nonlinear_term(self.inside, ENERGY)
        gap = "(1 - Norm(X + {} - [1; 0; 1 - D]))"
        pressed = f"multiplier/k*pos_part{gap.format('before')} + {gap.format('u')}"
        self.model.add_nonlinear_term(surface, f"k*half_sqr_pos_part({pressed})", TOP)

    def attempt(self, approach: float, damping: float = 1.0) -> bool:
        """Solve at an approach and return success; Newton step n is scaled by min(1, n ``damping``)."""
        before = u = self.model.variable("u")
        self.model.set_variable("D", [approach])
        for number in range(1, 17):
            self.model.assembly("build_all")
            change = gf.linsolve_mumps(self.model.tangent_matrix(), self.model.rhs()).ravel()
            if not np.isfinite(change).all():
                break
            u = u + min(1, damping * number) * change
            self.model.set_variable("u", u)
            if np.linalg.norm(change) < 1e-7:
                return True
        self.model.set_variable("u", before)
        return False

    def integral(self, expression: str) -> float:
        """Return the integral of an expression over the layer."""
        return float(gf.asm("generic", self.inside, 0, expression, -1, self.model))


def main(approach: float, size: str) -> None:
    """Solve with elements of order p on a grid of fineness n, where ``size`` is "pxn", and print the answer."""
    order, fineness = map(int, size.split("x"))
    grid = scene.lines(approach, fineness)
    coarse, layer = Layer(grid, 2), Layer(grid, order)
    scene.follow(approach, coarse.attempt)  # load path with elements of order 2 and a soft penalty
    start = gf.compute_interpolate_on(coarse.space, coarse.model.variable("u"), layer.full)
    layer.model.set_variable("u", start[layer.kept])
    solved = layer.attempt(approach, 0.25)
    layer.model.set_variable("k", [MIDDLE])
    solved = solved and layer.attempt(approach, 0.25)
    layer.model.set_variable("before", layer.model.variable("u"))
    layer.model.set_variable("multiplier", [MIDDLE])  # the penalty pressure; removes the remaining penetration
    layer.model.set_variable("k", [STIFF])
    if not solved or not layer.attempt(approach, 0.25):
        raise RuntimeError("Newton's method fails at full load")

    away, half = "abs(X(1) - 1)", scene.core(approach)
    slope = f"(-sign(X(1) - 1)*Heaviside({away} - {half!r})*Heaviside(1 - {away})/{1 - half!r})"
    normal = -2 * layer.integral(f"{STRESS}(3,3)") / THICKNESS
    tangential = -2 * layer.integral(f"({ENERGY} - (Grad_u'*{STRESS})(1,1))*{slope}")
    text = f"order {order}, grid {fineness}"
    scene.report("GetFEM", "5.4.2", approach, text, layer.full.nbdof(), normal, tangential)
