r"""The velocity of balls under forces and contacts: one convex problem, with as many contacts closing as there are.

A contact that pushes ball i with N moves it by N/(f Q_i) per unit path, as T does. With v = f dx/ds, the contact forces
N >= 0 are the multipliers of the condition that no gap g_c closes faster than allowed (b_c: 0 for a contact, -g_c/h for
a gap that may close within a step h):

    Q_i v_i = T_i + sum_c N_c dg_c/dx_i,     dg_c/ds >= b_c,   N_c >= 0,   N_c (dg_c/ds - b_c) = 0,

which is the velocity nearest the free one, T_i/Q_i, in the metric Q. [Moreau 1988, doi 10.1007/978-3-7091-2624-0_1]

Rolling resistance. A ball whose whole force T + sum N dg/dx stays below r_i does not move; otherwise what exceeds r_i
moves it along that force. So resistance is a force of size r_i against v_i, or up to r_i at rest: the derivative of
the dissipation r_i |v_i|. The velocity then minimises the convex function

    sum_i [ Q_i |v_i|^2 / 2 + r_i |v_i| - T_i v_i ]     subject to   dg_c/ds >= b_c,

a second-order cone programme for all balls and contacts at once: its minimum is unique. Without contacts it is
v_i = T_i/Q_i max(0, 1 - r_i/|T_i|).

Up to `DENSE` contacts without rolling resistance the dual is solved as least distance programming by scipy's nnls
[Lawson, Hanson, Solving Least Squares Problems, 1974, chapter 23]; anything else by Clarabel, an interior-point method
[Goulart, Chen 2024, doi 10.48550/arXiv.2405.12762].
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import nnls
from scipy.sparse import csc_matrix, diags, hstack, identity, vstack

from linear_bem.arrays import Array, Indices
from linear_bem.errors import MissingDependency, NotConverged

DENSE = 40
"""Contacts up to which nnls is quicker: 0.03 ms against 0.23 ms at 17 contacts, 46 ms against 2.8 ms at 445."""
EXACT = 1e-10
"""Tolerance of the interior-point method's gap, for velocities of order 1."""
FEASIBLE = 1e-8
"""Its tolerance of residuals: most end at 1e-14 to 1e-11, but the method stops if one grows beyond it on the way."""
REFINED = 1e-8
"""Residual from which its linear systems are refined: in 1450 contacts with rolling resistance the same iterations and
velocities to 4e-9 as with its defaults (1e-13 relative, 1e-12 absolute), in 0.74 of the time."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Pairs of balls (contacts, 2), unit vectors from the first to the second (contacts, 2), least opening rates."""

    pairs: Indices
    away: Array
    opening: Array

    def jacobian(self, count: int) -> csc_matrix:
        """Return d(gap)/dx, shape (contacts, 2 ``count``)."""
        i, j = self.pairs.T
        rows = np.repeat(np.arange(len(i)), 4)
        columns = np.stack([2 * i, 2 * i + 1, 2 * j, 2 * j + 1], axis=1).ravel()
        return csc_matrix((np.hstack([-self.away, self.away]).ravel(), (rows, columns)), shape=(len(i), 2 * count))


def moved(force: Array, weight: Array, contacts: Contacts, rolling: Array | float = 0.0) -> tuple[Array, Array]:
    """Return velocities (balls, 2) [-] and contact forces (contacts,) [N]; raises `NotConverged`.

    ``force`` T (balls, 2) [N], ``weight`` Q (balls,) [N], ``rolling`` r (balls,) [N].
    """
    size, rolling = np.hypot(*force.T), np.broadcast_to(rolling, len(force))
    free = force / weight[:, None] * np.maximum(0.0, 1.0 - rolling / np.where(size > 0.0, size, np.inf))[:, None]
    count = len(contacts.pairs)
    pushes = np.zeros(count)
    i, j = contacts.pairs.T
    if count == 0 or not np.any(np.sum(contacts.away * (free[j] - free[i]), axis=1) < contacts.opening):
        return free, pushes
    velocity = free.copy()
    members, inverse = np.unique(contacts.pairs, return_inverse=True)  # balls without contacts move freely
    inner = Contacts(inverse.reshape(-1, 2), contacts.away, contacts.opening)
    # lengths and forces of order 1
    heavy, free_speed = float(np.max(weight[members])), np.max(size[members] / weight[members])
    fast = float(max(free_speed, np.max(np.abs(contacts.opening)))) or 1.0
    jacobian = inner.jacobian(len(members))
    root: Array = np.repeat(np.sqrt(weight[members] / heavy), 2)
    driven = force[members].ravel() / (heavy * fast)
    if count <= DENSE and not np.any(rolling > 0.0):
        found, pushes = _by_least_squares(jacobian, root, driven, inner.opening / fast)
    else:
        resisted = rolling[members] / (heavy * fast)
        found, pushes = _by_cones(jacobian, root**2, driven, inner.opening / fast, resisted)
    velocity[members] = fast * found.reshape(-1, 2)
    return velocity, heavy * fast * pushes


def _by_least_squares(jacobian: csc_matrix, root: Array, driven: Array, opening: Array) -> tuple[Array, Array]:
    """Return velocities and contact forces: the least z = root (v - free) with G z >= h, from nnls of its dual."""
    free = driven / root**2
    g = jacobian.toarray() / root
    h = opening - jacobian @ free
    scale = float(np.max(np.abs(h)))
    matrix = np.vstack([g.T, h / scale])
    right = np.zeros(len(matrix))
    right[-1] = 1.0
    u, _ = nnls(matrix, right, maxiter=50 * len(h) + 100)
    room = 1.0 - float(u @ h) / scale
    if room <= 0.0:
        raise NotConverged(
            f"hard balls: no velocity keeps {len(h)} contacts from overlapping; give the balls more room"
        )
    pushes = u / room * scale
    return free + (pushes @ g) / root, pushes


def _by_cones(
    jacobian: csc_matrix, weight: Array, driven: Array, opening: Array, rolling: Array
) -> tuple[Array, Array]:
    """Return velocities and contact forces by Clarabel: min x.Px/2 + q.x with b - A x in cones."""
    try:
        import clarabel  # noqa: PLC0415  (only many contacts, and rolling resistance, need it)
    except ImportError:
        raise MissingDependency(
            f"clarabel is missing: more than {DENSE} contacts at once, and [rolling_resistance], need it; "
            "pip install 'thirdbody[cli]'"
        ) from None
    count, size = jacobian.shape
    quadratic, linear = diags(weight).tocsc(), -driven
    matrix, right = -jacobian, -opening
    cones: list[Any] = [clarabel.NonnegativeConeT(count)]
    if np.any(rolling > 0.0):
        # one more unknown per ball, t >= |v|, in the cone (t, v)
        balls = size // 2
        quadratic = diags(np.concatenate([weight, np.zeros(balls)])).tocsc()
        linear = np.concatenate([linear, rolling])
        order = np.stack([size + np.arange(balls), np.arange(0, size, 2), np.arange(1, size, 2)], axis=1).ravel()
        matrix = vstack([hstack([matrix, csc_matrix((count, balls))]), -identity(size + balls, format="csr")[order]])
        right = np.concatenate([right, np.zeros(size + balls)])
        cones += [clarabel.SecondOrderConeT(3)] * balls
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.tol_gap_abs = settings.tol_gap_rel = EXACT
    settings.tol_feas = FEASIBLE
    settings.iterative_refinement_reltol = settings.iterative_refinement_abstol = REFINED
    found = clarabel.DefaultSolver(quadratic, linear, matrix.tocsc(), right, cones, settings).solve()
    if str(found.status) not in ("Solved", "AlmostSolved"):
        raise NotConverged(f"hard balls: the velocity at {count} contacts was not found, Clarabel says {found.status}")
    return np.array(found.x)[:size], np.maximum(np.array(found.z)[:count], 0.0)
