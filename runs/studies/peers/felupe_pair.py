"""The pair in FElupe (https://felupe.readthedocs.io): Lagrange hexahedra of any order, contact as a custom item."""

import itertools
from collections.abc import Callable
from typing import Any

import felupe as fem
import numpy as np
from pypardiso import spsolve
from scipy.interpolate import RegularGridInterpolator

from runs.studies.peers import scene
from runs.studies.peers.scene import LAME, SHEAR, THICKNESS, Array, moduli
from runs.studies.strengthening.materials import LAW_BY_NAME


class Contact:
    """Custom item: penalty k/2 <-g>^2 on the top surface, with a multiplier at its quadrature points."""

    def __init__(self, top: Any) -> None:
        region = top.region
        self.field, self.region = fem.FieldContainer([top]), region
        self.place = np.einsum("cai,aqc->iqc", region.mesh.points[region.mesh.cells], region.h)
        self.multiplier: Array | float = 0.0
        self.depth, self.stiffness = 0.0, scene.SOFT
        self.results = fem.mechanics.Results()
        self.assemble = fem.mechanics.Assemble(vector=self._vector, matrix=self._matrix)

    def pressure(self) -> tuple[Array, Array, Array]:
        """Return the pressure, the direction from the ball's centre and the distance from it."""
        away = self.field[0].interpolate().copy()
        away[:2] += self.place
        away -= np.array([1, 0, 1 - self.depth])[:, None, None]
        distance = np.linalg.norm(away, axis=0)
        pressure = self.multiplier + self.stiffness * (1 - distance)
        return np.maximum(pressure, 0), away / distance, distance

    def _vector(self, *_: Any, **__: Any) -> Any:
        pressure, n, _distance = self.pressure()
        return fem.IntegralForm([-pressure * n], self.field, self.region.dV, grad_v=[False]).assemble()

    def _matrix(self, *_: Any, **__: Any) -> Any:
        pressure, n, distance = self.pressure()
        nn, one = np.einsum("iqc,jqc->ijqc", n, n), np.eye(3)[:, :, None, None]
        slope = self.stiffness * (pressure > 0) * nn - pressure / distance * (one - nn)
        arguments = {"u": self.field, "grad_v": [False], "grad_u": [False]}
        return fem.IntegralForm([slope], self.field, self.region.dV, **arguments).assemble()


class Layer:
    """The layer and its contact, with elements of one order."""

    def __init__(self, grid: tuple[Array, ...], order: int, umat: Any) -> None:
        counts = [order * (len(g) - 1) + 1 for g in grid]
        self.axes = [np.interp(np.arange(n) / order, range(len(g)), g) for n, g in zip(counts, grid, strict=True)]
        number = np.arange(np.prod(counts)).reshape(counts, order="F")
        points = np.stack([a.ravel("F") for a in np.meshgrid(*self.axes, indexing="ij")], axis=1)
        windows = np.lib.stride_tricks.sliding_window_view(number, (order + 1,) * 3)[::order, ::order, ::order]
        cells = windows.transpose(0, 1, 2, 5, 4, 3).reshape(-1, (order + 1) ** 3)
        top = windows[:, :, -1, :, :, -1].transpose(0, 1, 3, 2).reshape(-1, (order + 1) ** 2)
        self.region = fem.RegionLagrange(fem.Mesh(points, cells, "VTK_LAGRANGE_HEXAHEDRON"), order, 3, permute=False)
        self.field = fem.FieldContainer([fem.Field(self.region, dim=3)])
        rule = fem.GaussLegendre(order + 2, 2, permute=False)
        face = fem.Mesh(points[:, :2], top, "VTK_LAGRANGE_QUADRILATERAL")
        self.contact = Contact(fem.Field(fem.RegionLagrange(face, order, 2, rule, permute=False), dim=3))
        self.solid = fem.SolidBody(umat, self.field)
        u = self.field[0]
        sides = {
            "x": fem.Boundary(u, fx=lambda x: np.isin(x, grid[0][[0, -1]]), skip=(0, 1, 1)),
            "y": fem.Boundary(u, fy=lambda y: np.isin(y, grid[1][[0, -1]]), skip=(1, 0, 1)),
            "z": fem.Boundary(u, fz=-THICKNESS),
        }
        self.dof0, self.dof1 = fem.dof.partition(self.field, sides)

    def attempt(self, approach: float, damping: float = 1.0) -> bool:
        """Solve at an approach and return success; Newton step n is scaled by min(1, n ``damping``)."""
        number = itertools.count(1)

        def update(field: Any, change: Any) -> Any:
            field += min(1, damping * next(number)) * change
            return field

        before, self.contact.depth = self.field[0].values.copy(), approach
        numerics = {"ext0": 0.0 * self.dof0, "solver": spsolve, "tol": 1e-6, "verbose": 0, "update": update}
        try:
            items = [self.solid, self.contact]
            fem.newtonraphson(self.field, items=items, dof0=self.dof0, dof1=self.dof1, **numerics)
        except ValueError:
            self.field[0].values[:] = before
            return False
        return True


def main(approach: float, size: str, law: str = "") -> None:
    """Solve with elements of order p on the grid of fineness n, ``size`` being "pxn", and print the answer.

    ``law`` is a name in `LAW_BY_NAME`; by default the benchmark's own, whose derivatives FElupe has.
    """
    order, fineness = map(int, size.split("x"))
    grid = scene.lines(approach, fineness)
    psi: Callable[[Array], Array] = neo_hookean
    umat = fem.NeoHookeCompressible(mu=SHEAR) & fem.Volumetric(bulk=LAME)
    if law:
        import tensortrax  # noqa: PLC0415  (an extra of FElupe's, which the benchmark does not need)
        import tensortrax.math  # noqa: PLC0415

        from runs.studies.peers.energies import energy  # noqa: PLC0415

        chosen, poisson = LAW_BY_NAME[law]
        of_C = energy(chosen, *moduli(poisson), tensortrax.math)
        at, umat = tensortrax.function(of_C, ntrax=2), fem.Hyperelastic(of_C)

        def psi(F: Array) -> Array:
            return np.asarray(at(np.einsum("ki...,kj...->ij...", F, F)))

    coarse, layer = Layer(grid, 2, umat), Layer(grid, order, umat)
    scene.follow(approach, coarse.attempt)  # load path with elements of order 2 and a soft penalty
    values = coarse.field[0].values.reshape(*map(len, coarse.axes[::-1]), 3)
    layer.field[0].values[:] = RegularGridInterpolator(coarse.axes[::-1], values)(layer.region.mesh.points[:, ::-1])
    solved = layer.attempt(approach, 0.25)
    layer.contact.stiffness = scene.MIDDLE
    solved = solved and layer.attempt(approach, 0.25)
    layer.contact.multiplier = layer.contact.pressure()[0]  # removes the remaining penetration
    layer.contact.stiffness = scene.STIFF
    if not solved or not layer.attempt(approach, 0.25):
        raise RuntimeError("Newton's method fails at full load")

    F = layer.field.extract()[0]
    P = umat.gradient([F, None])[0]
    H = F - np.eye(3)[:, :, None, None]
    mesh, dV = layer.region.mesh, layer.region.dV
    x = np.einsum("ca,aqc->qc", mesh.points[mesh.cells, 0], layer.region.h)
    slope = scene.weight_slope(x, approach)
    normal = -2 * np.sum(P[2, 2] * dV) / THICKNESS
    tangential = -2 * np.sum((psi(F) - np.sum(H[:, 0] * P[:, 0], axis=0)) * slope * dV)
    scene.report("FElupe", fem.__version__, approach, f"order {order}, grid {fineness}", mesh.ndof, normal, tangential)


def neo_hookean(F: Array) -> Array:
    """Return the energy density of the benchmark's law for deformation gradients (3, 3, ...)."""
    J = fem.math.det(F)
    return np.asarray(SHEAR * ((np.sum(F**2, axis=(0, 1)) - 3) / 2 - np.log(J)) + LAME / 2 * (J - 1) ** 2)
