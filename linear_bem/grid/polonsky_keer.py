r"""Non-negative pressures on a grid by preconditioned, constrained conjugate gradients.

The method of [Polonsky and Keer 1999, Wear 231, 206, doi 10.1016/S0043-1648(99)00113-1] with two
changes: the search direction is preconditioned by the periodic inverse of the influence matrix (the number of
iterations then hardly grows with the grid), and groups of balls may have a prescribed force, each group with one
unknown approach. A projection of the search direction keeps the forces; for cells of different size within a group
(one holder for unequal balls), it uses the preconditioner's metric. The iteration stops when the gap in contact and the
penetration outside, relative to the largest approach, are both below the tolerance.
"""

from collections.abc import Sequence

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from linear_bem.grid.active_set import solve_active_set
from linear_bem.grid.cells import Cells, GridState
from linear_bem.grid.patches import Patches
from linear_bem.load_control import Groups, deepest
from linear_bem.report import Report, silent

PATIENCE = 60
"""Steps without progress after which steps are shortened."""
HOPELESS, GIVEN_UP = 200, 1000
"""Steps without progress after which the active set is tried, and after which the solver stops; the hardest case solved
without the active set made no progress for 920 steps."""


class _Progress:
    """Shortens the steps, and finally stops, while the gap does not fall."""

    def __init__(self) -> None:
        self.damping, self.patience = 1.0, HOPELESS
        self._best, self._since, self._improved = np.inf, 0, 0

    def ends(self, iteration: int, gap: float, restart: bool) -> bool:
        """Return whether to stop the iteration; shorten steps if cells are gained and lost alternately."""
        if gap < 0.9 * self._best:
            self._best, self._since, self._improved = gap, 0, iteration
        self._since += 1
        if self._since > PATIENCE and restart:
            self.damping, self._since = max(0.5 * self.damping, 0.05), 0
        return iteration - self._improved > self.patience


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
    pressure concentrated at the contact's edge, needs hundreds. Where these make no progress, `solve_active_set` takes
    over.
    ``report`` receives a line per step. Raises `NotConverged`.
    """
    cells = Cells(patches, heights, groups, len(approaches))
    approaches = approaches.astype(float).copy()
    depth, owner = cells.envelope(approaches)
    p = cells.with_prescribed_forces(np.concatenate([q.ravel() for q in pressures]), owner)
    w = cells.apply(p)
    direction, old, restart = np.zeros_like(p), 1.0, True
    gap_inside = penetration = np.inf
    progress = _Progress()
    for iteration in range(3000 if p.size <= 40_000 else 600):
        contact = p > 0.0
        for _ in range(2):
            cells.rest_on_contact(approaches, w - depth, contact, owner)
            depth, owner = cells.envelope(approaches)
        gap = w - depth
        scale = deepest(approaches)
        gap_inside = float(np.max(np.abs(gap[contact]), initial=0.0)) / scale
        penetration = float(np.max(-gap[~contact], initial=0.0)) / scale
        left = f"gap {gap_inside:.1e}, penetration {penetration:.1e}, tolerance {tolerance:.1e}"
        report(f"grid of {p.size} cells, step {iteration + 1}: {left}")
        if gap_inside < tolerance and penetration < tolerance and iteration > 0:
            return GridState(cells.split(p), cells.split(w), cells.split(owner), approaches, iteration)
        if not np.any(contact):
            # all contact was lost in one step: restart from the cells that penetrate
            p, restart = np.maximum(-0.5 * gap / cells.diagonal, 0.0), True
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
        settled = gap_inside < tolerance  # the contact needs no step, cells outside it may have to be gained
        if not (curvature > 0.0 or settled):
            raise NotConverged(
                f"grid contact: after {iteration} steps no direction of descent is left, at a gap of {gap_inside:.1e} "
                f"and a penetration of {penetration:.1e} of the approach, tolerance {tolerance:.1e}: roundoff exceeds "
                "the tolerance; take a smaller load, a thicker film or a lower E1/E2"
            )
        if progress.ends(iteration, gap_inside, restart):
            found = None if progress.patience == GIVEN_UP else solve_active_set(cells, p, approaches, tolerance, report)
            if found is not None:
                return found
            if progress.patience == GIVEN_UP:
                break
            progress.patience = GIVEN_UP
        descent = float(residual @ (direction * cells.area)) / curvature if curvature > 0.0 else 0.0
        step = (progress.damping if restart else 1.0) * descent
        p = p - step * direction
        lost = contact & (p <= 0.0)
        p[p < 0.0] = 0.0
        gained = ~contact & (gap < -0.5 * tolerance * scale)
        p[gained] = -0.5 * progress.damping * gap[gained] / cells.diagonal[gained]
        restart = bool(np.any(lost) or np.any(gained))
        before = p
        p = cells.with_prescribed_forces(p, owner)
        w = cells.apply(p) if restart or p is not before else w - step * image
    found = None if progress.patience == GIVEN_UP else solve_active_set(cells, p, approaches, tolerance, report)
    if found is not None:
        return found
    raise NotConverged(
        f"grid contact: {iteration + 1} conjugate-gradient steps left a gap of {gap_inside:.1e} and a penetration of "
        f"{penetration:.1e} of the approach, tolerance {tolerance:.1e}; a film much stiffer than its base, and thin "
        "against the contact, concentrates the pressure at the edge: take a smaller load, a thicker film or a lower "
        "E1/E2"
    )
