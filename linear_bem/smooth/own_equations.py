"""One Newton step of every ball alone under a given force, for many balls at once.

The matrix of a ball's equations depends weakly on its pressure: it is recomputed only after a large change (a modified
Newton method), because the right side alone is several times cheaper.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from linear_bem.arrays import Array, Mask, hypotenuse
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.report import Report, silent
from linear_bem.smooth.multipole import SAFETY
from linear_bem.smooth.newton import Nodes, Rule, solve_scaled
from linear_bem.smooth.polynomials import basis, disc_nodes

RENEWED = 0.02
"""Relative change of P in one sweep above which a ball's matrix is recomputed."""
FELT, SHARP = 4, 1e-6
"""Degree, less that of P, of the polynomial through values at `disc_nodes` for the half-space's displacement in a
contact, and the precision down to which it is used: its error was 1e-6 of P, 3e-6 at degree 4, on contacts up to
1.5 layers wide. More precise equations, and contacts whose edge passes between these nodes, use all quadrature points.
"""
SHARPEST = 10
"""Highest degree of nodes at which the kernel's smooth part is felt: beyond, roundoff (the inverse of the basis grows
fivefold per step) disturbs pressures of degree 8 and more by more than 1e-9."""


@dataclass(frozen=True, eq=False)
class Steps:
    """Changes of the coefficients (balls, terms), approaches [m], and dD/dQ over ``singular`` [1/m] of every ball.

    ``responses`` (balls, terms) are the derivatives of the coefficients with respect to the ball's force times
    ``singular`` [1/m^2].
    """

    changes: Array
    approaches: Array
    compliances: Array
    responses: Array


class OwnEquations:
    """The equations of many balls, each under its own force, without the balls' influence on each other."""

    def __init__(self, kernel: LayeredKernel, rule: Rule, precision: float, images: float = 0.0) -> None:
        self.kernel, self.rule, self.precision, self.images = kernel, rule, precision, images
        self._matrices = np.empty((0, 0, 0))

    def step(
        self, nodes: Nodes, outside: Array, profile: Array, forces: Array, changed: Mask, report: Report = silent
    ) -> Steps:
        """Return one Newton step; ``outside``, ``profile`` [m] at the nodes; ``changed``: matrices to recompute."""
        count, terms = nodes.zone.coefficients.shape
        if len(self._matrices) != count:
            self._matrices, changed = np.empty((count, terms, terms)), np.ones(count, dtype=bool)
        found = np.empty((count, terms)), np.empty(count), np.empty(count), np.empty((count, terms))
        u, v, _ = disc_nodes(nodes.zone.degree + FELT)
        few = np.all(nodes.zone.coefficients @ basis(u, v, nodes.zone.degree) > 0.0, axis=1)
        few, done = few & (self.precision > SHARP), 0
        for renew, at_few in product((True, False), (True, False)):
            chosen = np.flatnonzero((changed == renew) & (few == at_few))
            for part in np.array_split(chosen, chosen.size * nodes.x.shape[1] * terms // 150_000 + 1):
                if part.size:
                    arguments = outside[part] + profile[part], forces[part], self._matrices[part]
                    new, self._matrices[part] = self._some(nodes[part], *arguments, renew, at_few)
                    for all_of_them, some in zip(found, new, strict=True):
                        all_of_them[part] = some
                    done += part.size
                    report(f"{done} of {count} contacts alone")
        return Steps(*found)

    def _some(
        self, n: Nodes, rise: Array, forces: Array, matrix: Array, renew: bool, few: bool
    ) -> tuple[tuple[Array, Array, Array, Array], Array]:
        zones, terms = n.zone, n.zone.coefficients.shape[1]
        felt, smooth = zones.degree + FELT if few else None, self._smooth_degree(n)
        phi = basis(n.xi, n.eta, max(zones.degree, felt or 0, smooth or 0)).transpose(1, 0, 2)
        test = 0.5 * phi[:, :terms] * (n.weights / n.pressure)[:, None, :]
        total = test.sum(axis=2)
        u, v, received, _ = _at_nodes(n, phi, test, felt)
        potential, derivative = zones.half_space(u, v, self.rule.directions, self.rule.along, renew)
        own = np.einsum("ntk,nk->nt", received, potential)
        if renew:
            matrix = received @ derivative
        if not self.kernel.homogeneous:
            u, v, received, loads = _at_nodes(n, phi, test, smooth)
            x, y = zones.points(u, v)
            r = hypotenuse(x[:, :, None] - x[:, None, :], y[:, :, None] - y[:, None, :])
            s = self.kernel.smooth(r) + self.images
            own += np.einsum("ntk,nk->nt", received, np.einsum("nab,nb->na", s, loads))
            if renew:
                matrix += received @ s @ received.transpose(0, 2, 1)
        right = np.stack([-own - np.einsum("ntk,nk->nt", test, rise), total], axis=2)
        size = np.sqrt(np.abs(np.einsum("ntt->nt", matrix)))
        u, v = np.moveaxis(solve_scaled(matrix, right, size), 2, 0)
        # the change u + D v reaches the force where total.(u + D v) = force - present force
        reach = np.sum(total * v, axis=1)
        approach = (forces - n.forces - np.sum(total * u, axis=1)) / reach
        return (u + approach[:, None] * v, approach, 1.0 / reach, v / reach[:, None]), matrix

    def _smooth_degree(self, n: Nodes) -> int | None:
        """Return the degree of nodes that represent the displacement by the kernel's smooth part s; None: too many.

        s is analytic up to a distance of 2 h i: on zones smaller than that, few nodes suffice.
        """
        if self.kernel.homogeneous:
            return None
        away = 2.0 * self.kernel.thickness / (1.1 * float(np.max(n.zone.reach)))
        degree = 2 * int(np.ceil(-np.log(SAFETY * self.precision) / np.arcsinh(away) / 2.0 - 0.5))
        return max(degree, 2) if degree <= SHARPEST and (degree + 1) * (degree + 2) < n.x.shape[1] else None


def _at_nodes(n: Nodes, phi: Array, test: Array, degree: int | None) -> tuple[Array, Array, Array, Array]:
    """Return nodes xi, eta (balls, nodes), the matrices from values there to integrals of ``test``, equivalent loads.

    ``phi`` (balls, terms, points) is a basis of at least this degree; degree None stands for the quadrature points.
    """
    if degree is None:
        return n.xi, n.eta, test, n.loads
    u, v, inverse = disc_nodes(degree)
    shape, phi = (len(n), len(u)), phi[:, : len(u)]
    loads = np.einsum("ntk,nk->nt", phi, n.loads) @ inverse
    return np.broadcast_to(u, shape), np.broadcast_to(v, shape), test @ phi.transpose(0, 2, 1) @ inverse, loads
