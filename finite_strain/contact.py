"""Frictionless contact of the layer's top with one rigid ball: augmented Lagrangian at facet quadrature points.

Per reference area the contact potential is (<l - k g>^2 - l^2) / (2 k) with gap g, penalty k, multiplier l
and <.> the positive part [Alart Curnier 1991, doi 10.1016/0045-7825(91)90022-X; frictionless]. Its
derivatives by the displacement are exact, so the tangent is symmetric and includes the sphere's
curvature. Multipliers live at quadrature points, start from zero at each load step and are augmented a few
times only: carried from step to step they over-constrain the surface and the in-plane force rattles.
The integrals run in numpy because a form compiler cannot take data at facet quadrature points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from finite_strain import compat
from finite_strain.indenter import Indenter

QUADRATURE_DEGREE = 10
"""Degree of the facet rule: the pressure has a kink inside a facet, and T is a small difference of its moments."""
DEEPEST_PENETRATION = 0.3
"""A trial state that penetrates deeper than this part of the radius is outside the model's domain."""

_FACETS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_REFERENCE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Surface:
    """The top facets near a ball on this rank: shapes (n facets, q points, 6 functions)."""

    dofs: np.ndarray
    """(n, 6) local block dofs of the quadratic displacement on each facet."""
    values: np.ndarray
    """(n, q, 6) their shape functions at the quadrature points."""
    points: np.ndarray
    """(n, q, 3) undeformed quadrature points [m]."""
    weights: np.ndarray
    """(n, q) quadrature weights times area [m^2]."""
    corners: np.ndarray
    """(n, 3) local dofs of the linear scalar space at the corners of each facet."""
    corner_values: np.ndarray
    """(q, 3) linear shape functions of the corners at the quadrature points."""
    corner_gradients: np.ndarray
    """(n, 3, 2) in-plane gradients of the linear shape functions [1/m]."""
    gradients: np.ndarray
    """(n, q, 6, 2) in-plane gradients of the quadratic shape functions [1/m]."""

    @classmethod
    def near(
        cls, space: Any, linear_space: Any, top_facets: np.ndarray, centre: tuple[float, float], reach: float
    ) -> Surface:
        """Collect the top facets whose cell this rank owns and that lie within reach of the axis."""
        mesh = space.mesh
        mesh.topology.create_connectivity(2, 3)
        mesh.topology.create_connectivity(3, 2)
        facet_cells, cell_facets = mesh.topology.connectivity(2, 3), mesh.topology.connectivity(3, 2)
        owned = mesh.topology.index_map(3).size_local
        x, geometry = mesh.geometry.x, compat.geometry_dofs(mesh)
        cell_table, positions = compat.cell_dofs(space), compat.facet_dof_positions(space)
        reference_points, reference_weights = compat.triangle_quadrature(QUADRATURE_DEGREE)
        barycentric = np.column_stack([1.0 - reference_points.sum(axis=1), reference_points])
        tables = []
        for local in range(4):
            functions = compat.tabulate_lagrange(2, barycentric @ _REFERENCE[_FACETS[local]])
            tables.append(functions[:, positions[local]])
        derivatives = [_quadratic_derivatives(reference_points, table) for table in tables]
        dofs, values, corners, slopes = [], [], [], []
        for facet in top_facets:
            cell = facet_cells.links(facet)[0]
            if cell >= owned:
                continue
            local = int(np.flatnonzero(cell_facets.links(cell) == facet)[0])
            vertices = geometry[cell][_FACETS[local]]
            if np.min(np.linalg.norm(x[vertices, :2] - np.array(centre), axis=1)) > reach:
                continue
            dofs.append(cell_table[cell][positions[local]])
            values.append(tables[local])
            slopes.append(derivatives[local])
            corners.append(vertices)
        n, q = len(dofs), len(reference_weights)
        vertex = np.array(corners, dtype=np.int64).reshape(n, 3)
        triangle = x[vertex]
        e1, e2 = triangle[:, 1, :2] - triangle[:, 0, :2], triangle[:, 2, :2] - triangle[:, 0, :2]
        twice_area = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
        second = np.column_stack([e2[:, 1], -e2[:, 0]]) / twice_area[:, None]
        third = np.column_stack([-e1[:, 1], e1[:, 0]]) / twice_area[:, None]
        to_plane = np.stack([second, third], axis=1)
        return cls(
            dofs=np.array(dofs, dtype=np.int32).reshape(n, 6),
            values=np.array(values).reshape(n, q, 6),
            points=np.einsum("qc,fci->fqi", barycentric, triangle),
            weights=np.abs(twice_area)[:, None] * reference_weights[None, :],
            corners=compat.vertex_dofs(linear_space)[vertex],
            corner_values=barycentric,
            corner_gradients=np.stack([-second - third, second, third], axis=1),
            gradients=np.einsum("fqas,fsk->fqak", np.array(slopes).reshape(n, q, 6, 2), to_plane),
        )

    def stretch(self, displacement: np.ndarray) -> np.ndarray:
        """Return deformed over undeformed area (n, q) for local nodal displacements (nodes, 3) [m]."""
        tangents = np.einsum("fqak,fai->fqki", self.gradients, displacement[self.dofs])
        tangents[..., 0, 0] += 1.0
        tangents[..., 1, 1] += 1.0
        return np.linalg.norm(np.cross(tangents[..., 0, :], tangents[..., 1, :]), axis=-1)


def _quadratic_derivatives(points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the derivatives (q, 6, 2) on the unit triangle of quadratic functions known by their values (q, 6)."""
    s, t = points.T
    one, zero = np.ones_like(s), np.zeros_like(s)
    monomials = np.column_stack([one, s, t, s * s, s * t, t * t])
    coefficients = np.linalg.lstsq(monomials, values, rcond=None)[0]
    by_s = np.column_stack([zero, one, zero, 2 * s, t, zero]) @ coefficients
    by_t = np.column_stack([zero, zero, one, zero, s, 2 * t]) @ coefficients
    return np.stack([by_s, by_t], axis=-1)


class Contact:
    """The contact part of one ball: energy, residual and tangent for a displacement, and forces on the ball."""

    def __init__(
        self, surface: Surface, indenter: Indenter, centre: tuple[float, float], radius: float, vertices: int
    ) -> None:
        self.surface = surface
        self.indenter = indenter
        self.radius = radius
        self.reference = surface.points - np.array([*centre, 0.0])
        self.vertices = vertices
        self.multiplier = np.zeros(surface.weights.shape)
        self.penalty: float | np.ndarray = 1.0
        self.approach = 0.0

    def _gap(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        u = np.einsum("fqa,fai->fqi", self.surface.values, displacement[self.surface.dofs])
        return self.indenter.gap(self.reference, u, self.approach)

    def gap(self, displacement: np.ndarray) -> np.ndarray:
        """Return the gap (facets, points) [m] for local nodal displacements (nodes, 3) [m]."""
        return self._gap(displacement)[0]

    def pressure(self, displacement: np.ndarray) -> np.ndarray:
        """Return the contact pressure (facets, points) per reference area [Pa], >= 0."""
        return np.maximum(self.multiplier - self.penalty * self.gap(displacement), 0.0)

    def true_pressure(self, displacement: np.ndarray) -> np.ndarray:
        """Return the contact pressure (facets, points) per deformed area [Pa]."""
        return self.pressure(displacement) / self.area_stretch(displacement)

    def nodal_pressure(self, displacement: np.ndarray) -> np.ndarray:
        """Return the pressure per deformed area [Pa] at this rank's nodes, for pictures: facet-wise fits, averaged."""
        fits = np.einsum("faq,fq->fa", np.linalg.pinv(self.surface.values), self.true_pressure(displacement))
        total, count = np.zeros(len(displacement)), np.zeros(len(displacement))
        np.add.at(total, self.surface.dofs, np.maximum(fits, 0.0))
        np.add.at(count, self.surface.dofs, 1.0)
        return total / np.maximum(count, 1.0)

    def area_stretch(self, displacement: np.ndarray) -> np.ndarray:
        """Return deformed over undeformed area (facets, points); 1 at small strain."""
        if not self.indenter.deformed:
            return np.ones(self.surface.weights.shape)
        return self.surface.stretch(displacement)

    def energy(self, displacement: np.ndarray) -> float:
        """Return this rank's share of the contact potential [J]; infinite outside the model's domain."""
        gap = self.gap(displacement)
        if gap.size and not np.min(gap) > -DEEPEST_PENETRATION * self.radius:
            return math.inf
        pressure = np.maximum(self.multiplier - self.penalty * gap, 0.0)
        density = (pressure**2 - self.multiplier**2) / (2.0 * self.penalty)
        return float(np.sum(self.surface.weights * density))

    def add_residual(self, displacement: np.ndarray, residual: np.ndarray) -> None:
        """Add the derivative of the energy to the local residual (nodes, 3) [N], ghost entries included."""
        gap, gradient, _ = self._gap(displacement)
        pressure = np.maximum(self.multiplier - self.penalty * gap, 0.0)
        load = -(self.surface.weights * pressure)[..., None] * gradient
        np.add.at(residual, self.surface.dofs, np.einsum("fqa,fqi->fai", self.surface.values, load))

    def add_tangent(self, displacement: np.ndarray, matrix: PETSc.Mat, constrained: np.ndarray) -> None:
        """Add the second derivative to the matrix; ``constrained`` (nodes, 3) marks Dirichlet rows to leave alone."""
        gap, gradient, hessian = self._gap(displacement)
        pressure = np.maximum(self.multiplier - self.penalty * gap, 0.0)
        active = np.flatnonzero(np.any(pressure > 0.0, axis=1))
        if not active.size:
            return
        pressure, gradient, hessian = pressure[active], gradient[active], hessian[active]
        weights, values = self.surface.weights[active], self.surface.values[active]
        stiffness = np.broadcast_to(self.penalty, gap.shape)[active] * (pressure > 0.0)
        point = stiffness[..., None, None] * gradient[..., :, None] * gradient[..., None, :]
        point = (point - pressure[..., None, None] * hessian) * weights[..., None, None]
        nodes = values.shape[2]
        pairs = (values[..., :, None] * values[..., None, :]).reshape(len(active), -1, nodes * nodes)
        blocks = np.matmul(pairs.transpose(0, 2, 1), point.reshape(len(active), -1, 9))
        blocks = blocks.reshape(-1, nodes, nodes, 3, 3).transpose(0, 1, 3, 2, 4).reshape(-1, 3 * nodes, 3 * nodes)
        free = ~constrained[self.surface.dofs[active]].reshape(len(active), -1)
        blocks = blocks * (free[:, :, None] & free[:, None, :])
        for dofs, block in zip(self.surface.dofs[active], blocks, strict=True):
            matrix.setValuesBlockedLocal(dofs, dofs, block, addv=PETSc.InsertMode.ADD)

    def stiffness(self, displacement: np.ndarray) -> float:
        """Return this rank's share of the derivative of Q by the approach at fixed displacement [N/m]."""
        gap, gradient, hessian = self._gap(displacement)
        pressure = np.maximum(self.multiplier - self.penalty * gap, 0.0)
        density = self.penalty * (pressure > 0.0) * gradient[..., 2] ** 2 - pressure * hessian[..., 2, 2]
        return float(np.sum(self.surface.weights * density))

    def approach_derivative(self, displacement: np.ndarray, residual: np.ndarray) -> None:
        """Add the residual's derivative by this ball's approach [N/m] to a local vector (nodes, 3)."""
        step = 1e-6 * self.radius
        approach = self.approach
        for sign in (1.0, -1.0):
            self.approach = approach + sign * step
            shifted = np.zeros_like(residual)
            self.add_residual(displacement, shifted)
            residual += sign * shifted / (2.0 * step)
        self.approach = approach

    def pressure_moment(self, displacement: np.ndarray) -> np.ndarray:
        """Return this rank's share of int p and int p (X - X_ball), int p (Y - Y_ball) over the undeformed surface."""
        pressure = self.surface.weights * self.pressure(displacement)
        return np.array([pressure.sum(), *np.einsum("fq,fqk->k", pressure, self.reference[..., :2])])

    def augment(self, displacement: np.ndarray) -> None:
        """Move the multiplier to the present pressure."""
        self.multiplier = self.pressure(displacement)

    def project(self, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return this rank's share of a density's moments (facets, points) with the linear functions, and their areas.

        Summed over ranks, moment over area is the density at the vertices: never negative where the density
        is not, and with the same integral over the surface.
        """
        moments, weights = np.zeros(self.vertices), np.zeros(self.vertices)
        linear = self.surface.corner_values
        np.add.at(moments, self.surface.corners, (self.surface.weights * density) @ linear)
        np.add.at(weights, self.surface.corners, self.surface.weights @ linear)
        return moments, weights

    def force(self, displacement: np.ndarray) -> np.ndarray:
        """Return this rank's share of (Tx, Ty, Q) [N] on the ball, Q >= 0 upwards."""
        u = np.einsum("fqa,fai->fqi", self.surface.values, displacement[self.surface.dofs])
        pressure = self.surface.weights * self.pressure(displacement)
        slope = self.indenter.shift_gradient(self.reference, u, self.approach)
        gradient = self.indenter.gap(self.reference, u, self.approach)[1]
        plane = -np.einsum("fq,fqi->i", pressure, slope)
        return np.array([plane[0], plane[1], -float(np.sum(pressure * gradient[..., 2]))])

    def configurational_terms(self, displacement: np.ndarray, weight: np.ndarray, own: bool) -> np.ndarray:
        """Return this rank's share (2,) [N] of the surface terms of the domain integral for the in-plane force.

        ``weight`` holds the values of q at the local vertices. For the ball whose force is sought
        (``own``) they are -int w q,k + int (1 - q) dw/dX_k, for another ball -int w q,k - int q dw/dX_k;
        both vanish where q is 1 (0) on the contact.
        """
        u = np.einsum("fqa,fai->fqi", self.surface.values, displacement[self.surface.dofs])
        pressure = self.pressure(displacement)
        potential = (pressure**2 - self.multiplier**2) / (2.0 * self.penalty)
        corner_weight = weight[self.surface.corners]
        q = corner_weight @ self.surface.corner_values.T
        gradient = np.einsum("fc,fck->fk", corner_weight, self.surface.corner_gradients)
        explicit = -pressure[..., None] * self.indenter.shift_gradient(self.reference, u, self.approach)
        factor = (1.0 - q) if own else -q
        density = -potential[..., None] * gradient[:, None, :] + factor[..., None] * explicit
        return np.einsum("fq,fqk->k", self.surface.weights, density)

    def extremes(self, displacement: np.ndarray, comm: MPI.Comm) -> dict[str, float]:
        """Return penetration, gap under pressure [m], peak pressure [Pa], deformed contact area [m^2] (collective)."""
        gap = self.gap(displacement)
        pressure = np.maximum(self.multiplier - self.penalty * gap, 0.0)
        pressed = pressure > 0.0
        stretch = self.area_stretch(displacement)
        true_pressure = pressure / stretch
        local = [float(np.max(-gap, initial=0.0)), float(np.max(np.where(pressed, gap, 0.0), initial=0.0)),
                 float(np.max(true_pressure, initial=0.0))]  # fmt: skip
        area = comm.allreduce(float(np.sum(self.surface.weights * stretch * pressed)), op=MPI.SUM)
        largest = [comm.allreduce(value, op=MPI.MAX) for value in local]
        return {"penetration": largest[0], "open_gap": largest[1], "peak_pressure": largest[2], "contact_area": area}
