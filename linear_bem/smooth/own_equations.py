"""One Newton step of every ball alone under a given force, for many balls at once.

The matrix of a ball's equations changes with its pressure only a little: it is computed again where the last change was
large, and kept else (a modified Newton method), because the right side alone is several times cheaper.
"""

from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.report import Report, silent
from linear_bem.smooth.multipole import DEGREES, FULL, SAFETY, disc_nodes
from linear_bem.smooth.newton import NodeStack, Rule, solve_scaled
from linear_bem.smooth.polynomials import basis

RENEWED = 0.02
"""Relative change of P in one sweep above which a ball's matrix is computed again."""


@dataclass(frozen=True)
class Steps:
    """Changes of the coefficients (balls, terms), approaches [m], and dD/dQ [over 1/``singular``] of every ball.

    ``responses`` (balls, terms) are the derivatives of the coefficients by the ball's force.
    """

    changes: Array
    approaches: Array
    compliances: Array
    responses: Array


class OwnEquations:
    """The equations of many balls, each under its own force, without the balls' influence on each other."""

    def __init__(self, kernel: LayeredKernel, rule: Rule, precision: float) -> None:
        self.kernel, self.rule, self.precision = kernel, rule, precision
        self._matrices = np.empty((0, 0, 0))

    def step(
        self, nodes: NodeStack, outside: Array, profile: Array, forces: Array, changed: Mask, report: Report = silent
    ) -> Steps:
        """Return one Newton step; ``outside`` and ``profile`` [m] at the nodes, ``changed`` which matrices to renew."""
        count, terms = nodes.zones.coefficients.shape
        if len(self._matrices) != count:
            self._matrices, changed = np.empty((count, terms, terms)), np.ones(count, dtype=bool)
        found = np.empty((count, terms)), np.empty(count), np.empty(count), np.empty((count, terms))
        done = 0
        for renew in (True, False):
            chosen = np.flatnonzero(changed == renew)
            for part in np.array_split(chosen, chosen.size * nodes.x.shape[1] * terms // 150_000 + 1):
                if part.size:
                    arguments = outside[part] + profile[part], forces[part], self._matrices[part]
                    new, self._matrices[part] = self._some(nodes[part], *arguments, renew)
                    for all_of_them, some in zip(found, new, strict=True):
                        all_of_them[part] = some
                    done += part.size
                    report(f"{done} of {count} contacts alone")
        return Steps(*found)

    def _some(
        self, n: NodeStack, rise: Array, forces: Array, matrix: Array, renew: bool
    ) -> tuple[tuple[Array, Array, Array, Array], Array]:
        test = 0.5 * basis(n.xi, n.eta, n.zones.degree).transpose(1, 0, 2) * (n.weights / n.pressure)[:, None, :]
        potential, derivative = n.zones.half_space(n.xi, n.eta, self.rule.directions, self.rule.along, renew)
        smooth, smooth_derivative = self._smooth(n, test if renew else test[:, :0])
        if renew:
            matrix = test @ (derivative + smooth_derivative)
        total = test.sum(axis=2)
        right = np.stack([-np.einsum("ntk,nk->nt", test, potential + smooth + rise), total], axis=2)
        size = np.sqrt(np.abs(np.einsum("ntt->nt", matrix)))
        u, v = np.moveaxis(solve_scaled(matrix, right, size), 2, 0)
        # the change u + D v reaches the force where total.(u + D v) = force - present force
        reach = np.sum(total * v, axis=1)
        approach = (forces - n.forces - np.sum(total * u, axis=1)) / reach
        return (u + approach[:, None] * v, approach, 1.0 / reach, v / reach[:, None]), matrix

    def _smooth(self, n: NodeStack, test: Array) -> tuple[Array, Array]:
        """Return the displacement by the kernel's smooth part s, and its derivative by the coefficients.

        s is analytic up to a distance of 2 h i: on zones smaller than that it is a polynomial on few nodes.
        """
        if self.kernel.homogeneous:
            return np.zeros(n.x.shape), np.zeros((*n.x.shape, test.shape[1]))
        away = 2.0 * self.kernel.thickness / (1.1 * float(np.max(n.zones.reach)))
        rate = away + np.sqrt(away**2 + 1.0)
        level = next((k for k in range(FULL) if rate ** -(DEGREES[k] + 1.0) < SAFETY * self.precision), FULL)
        if level == FULL or len(disc_nodes(DEGREES[level])[0]) > n.x.shape[1] // 2:
            s = self.kernel.smooth(np.hypot(n.x[:, :, None] - n.x[:, None, :], n.y[:, :, None] - n.y[:, None, :]))
            return np.einsum("nab,nb->na", s, n.loads), s @ test.transpose(0, 2, 1)
        u, v, inverse = disc_nodes(DEGREES[level])
        x, y = n.zones.points(u, v)
        s = self.kernel.smooth(np.hypot(x[:, :, None] - x[:, None, :], y[:, :, None] - y[:, None, :]))
        to_nodes = basis(n.xi, n.eta, DEGREES[level]).transpose(1, 2, 0) @ inverse
        received = to_nodes @ s
        loads = np.einsum("nam,na->nm", to_nodes, n.loads)
        return np.einsum("nam,nm->na", received, loads), received @ (test @ to_nodes).transpose(0, 2, 1)
