r"""Non-negative pressures on a grid by preconditioned, constrained conjugate gradients.

The method of [Polonsky and Keer 1999, Wear 231, 206, doi 10.1016/S0043-1648(99)00113-1] with two
changes: the search direction is preconditioned by the periodic inverse of the influence matrix (the number of
iterations then hardly grows with the grid), and groups of balls may have a prescribed force, each group with one
unknown approach. A projection of the search direction keeps the forces; for cells of different size within a group
(one holder for unequal balls), it uses the preconditioner's metric. The iteration stops when the gap in contact and the
penetration outside, relative to the largest approach, are both below the tolerance.

The contact changes at every step. Where the pressure peaks at the edge, under stiff films, steps may gain and lose the
same cells indefinitely. Then steps that follow a change of the contact are shortened, and, if this does not help, the
contact is held until it is solved; cells under tension leave it, cells that penetrate enter it: a primal-dual active
set [Hintermueller, Ito and Kunisch 2002, SIAM J. Optim. 13, 865, doi 10.1137/S1052623401383558].
"""

from collections.abc import Sequence

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.errors import NotConverged
from linear_bem.grid.cells import Cells, GridState
from linear_bem.grid.patches import Patches
from linear_bem.load_control import Groups, deepest
from linear_bem.report import Report, silent

PATIENCE, HOPELESS = 20, 60
"""Steps without progress after which steps are shortened, and after which the contact is held."""
WITHIN = 0.3
"""Gap at which a held contact changes, over the tolerance or, if that is more, over the penetration."""
STEPS = 3600
"""Largest number of steps."""


def solve_bounded(
    patches: Patches,
    heights: list[Array],
    pressures: Sequence[Array],
    approaches: Array,
    groups: Groups,
    tolerance: float = 1e-8,
    report: Report = silent,
) -> GridState:
    """Return the state with p >= 0, gap >= 0, p gap = 0.

    ``heights`` holds per patch the members' f at its cells, shape (members, nx, ny) [m]; balls in no group of
    ``groups`` keep their approach. Soft layers need 10 to 30 steps on any grid; a stiff film on a soft base, with its
    pressure concentrated at the contact's edge, needs hundreds. ``report`` receives a line per step. Raises
    `NotConverged`.
    """
    cells = Cells(patches, heights, groups, len(approaches))
    approaches = approaches.astype(float).copy()
    depth, owner = cells.envelope(approaches)
    p = cells.with_prescribed_forces(np.concatenate([q.ravel() for q in pressures]), owner)
    w = cells.apply(p)
    direction, old, restart = np.zeros_like(p), 1.0, True
    held: Mask | None = None
    best, improved, shortened, length = np.inf, 0, 0, 1.0
    for iteration in range(STEPS):
        contact = p > 0.0 if held is None else held
        for _ in range(2):
            cells.rest_on_contact(approaches, w - depth, contact, owner)
            depth, owner = cells.envelope(approaches)
        gap = w - depth
        scale = deepest(approaches)
        gap_inside = float(np.max(np.abs(gap[contact]), initial=0.0)) / scale
        penetration = float(np.max(-gap[~contact], initial=0.0)) / scale
        left = f"gap {gap_inside:.1e}, penetration {penetration:.1e}, tolerance {tolerance:.1e}"
        report(f"grid of {p.size} cells, step {iteration + 1}: {left}")
        settled = gap_inside < tolerance  # the contact needs no step, cells outside it may have to be gained
        if settled and penetration < tolerance and iteration > 0 and np.all(p >= 0.0):
            return GridState(cells.split(p), cells.split(w), cells.split(owner), approaches, iteration)
        if not np.any(contact):
            # all contact was lost in one step: restart from the cells that penetrate
            p, held, restart = np.maximum(-0.5 * gap / cells.diagonal, 0.0), None, True
            w = cells.apply(p)
            continue
        if gap_inside < 0.9 * best:
            best, improved, shortened = gap_inside, iteration, iteration
        if held is None and iteration - improved > HOPELESS:
            held, restart, length = contact, True, 1.0
        elif held is None and restart and iteration - shortened > PATIENCE:
            shortened, length = iteration, max(0.5 * length, 0.05)
        if held is not None and gap_inside < WITHIN * max(tolerance, penetration):
            held = (contact & (p > 0.0)) | (~contact & (gap < -tolerance * scale))
            p, restart = cells.with_prescribed_forces(np.where(held, np.maximum(p, 0.0), 0.0), owner), True
            w = cells.apply(p)
            continue
        residual = np.where(contact, gap, 0.0)
        z, new = cells.descent(residual, contact, owner)
        direction = np.where(contact, z + (0.0 if restart else new / old) * direction, 0.0)
        old = new
        image, curvature = cells.curvature(direction)
        if curvature <= 0.0:
            direction, restart = z, True
            image, curvature = cells.curvature(direction)
        if not (curvature > 0.0 or settled):
            raise NotConverged(
                f"grid contact: after {iteration} steps no direction of descent is left, at a gap of {gap_inside:.1e} "
                f"and a penetration of {penetration:.1e} of the approach, tolerance {tolerance:.1e}: roundoff exceeds "
                "the tolerance; take a smaller load, a thicker film or a lower E1/E2"
            )
        descent = float(residual @ (direction * cells.area)) / curvature if curvature > 0.0 else 0.0
        step = (length if restart else 1.0) * descent
        p = p - step * direction
        restart = False
        if held is None:
            lost, gained = contact & (p <= 0.0), ~contact & (gap < -0.5 * tolerance * scale)
            p[p < 0.0] = 0.0
            p[gained] = -0.5 * length * gap[gained] / cells.diagonal[gained]
            restart = bool(np.any(lost) or np.any(gained))
        before = p
        p = cells.with_prescribed_forces(p, owner)
        w = cells.apply(p) if restart or p is not before else w - step * image
    raise NotConverged(
        f"grid contact: {iteration + 1} conjugate-gradient steps left a gap of {gap_inside:.1e} and a penetration of "
        f"{penetration:.1e} of the approach, tolerance {tolerance:.1e}; a film much stiffer than its base, and thin "
        "against the contact, concentrates the pressure at the edge: take a smaller load, a thicker film or a lower "
        "E1/E2"
    )
