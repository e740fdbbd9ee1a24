"""Non-negative pressures on a grid by a primal-dual active set, for contacts on which conjugate gradients stall.

Each step solves K p = D - f exactly on the present contact, by preconditioned conjugate gradients; cells under tension
then leave the contact, cells that penetrate enter it [Hintermueller, Ito and Kunisch 2002, SIAM J. Optim. 13, 865, doi
10.1137/S1052623401383558]. Constrained conjugate gradients (`polonsky_keer.py`) change the contact at every step. They
need fewer steps where the pressure vanishes at the edge; where it peaks there, under stiff films, they may gain and
lose the same cells indefinitely.
"""

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.grid.cells import Cells, GridState
from linear_bem.load_control import deepest
from linear_bem.report import Report, silent

CHANGES, STEPS = 100, 3000
"""Largest number of contacts tried, and of steps of conjugate gradients in all."""
WITHIN = 0.1
"""Residual of the linear systems over the tolerance."""


def solve_active_set(
    cells: Cells, pressures: Array, approaches: Array, tolerance: float, report: Report = silent
) -> GridState | None:
    """Return the state with p >= 0, gap >= 0, p gap = 0, from any pressures; None if the contact does not settle."""
    approaches, p = approaches.copy(), pressures
    depth, owner = cells.envelope(approaches)
    contact, steps = p > 0.0, 0
    for change in range(CHANGES):
        if steps > STEPS or not np.any(contact):
            return None
        scale = deepest(approaches)
        within = WITHIN * tolerance * scale
        p, taken = _equilibrium(cells, depth, contact, p, within, report)
        steps += taken
        masks = cells.groups_within(contact, owner)
        if masks:
            if not all(np.any(mine) for mine in masks):
                return None
            none, fine = np.zeros_like(p), within / scale
            shifts = [_equilibrium(cells, mine.astype(float), contact, none, fine, report) for mine in masks]
            forces = np.array([[np.sum((q * cells.area)[mine]) for q, _ in shifts] for mine in masks])
            wanted = np.array([force for _, force in cells.groups])
            try:
                moves = np.linalg.solve(forces, wanted - [np.sum((p * cells.area)[mine]) for mine in masks])
            except np.linalg.LinAlgError:  # complete contact of a periodic surface: its mean pressure is free
                return None
            for move, (q, taken), (members, _) in zip(moves, shifts, cells.groups, strict=True):
                p, steps = p + move * q, steps + taken
                approaches[members] += move
            depth, owner = cells.envelope(approaches)
        w = cells.apply(p)
        gap = w - depth
        lost, gained = contact & (p <= 0.0), ~contact & (gap < -tolerance * scale)
        report(f"contact {change + 1}: {np.count_nonzero(lost)} cells leave it, {np.count_nonzero(gained)} enter it")
        if not (np.any(lost) or np.any(gained)):
            if float(np.max(np.abs(gap[contact]))) > tolerance * scale:
                return None
            return GridState(cells.split(p), cells.split(w), cells.split(owner), approaches, steps)
        contact = (contact & ~lost) | gained
    return None


def _equilibrium(
    cells: Cells, wanted: Array, contact: Mask, start: Array, within: float, report: Report
) -> tuple[Array, int]:
    """Return pressures on the contact with displacements ``wanted`` [m] there, and the number of steps."""
    p = np.where(contact, start, 0.0)
    residual = np.where(contact, wanted - cells.apply(p), 0.0)
    direction, old = np.zeros_like(p), 1.0
    for step in range(STEPS):
        left = float(np.max(np.abs(residual)))
        if not left > within:
            return p, step
        report(f"{np.count_nonzero(contact)} cells in contact, step {step}: gap {left:.1e} m")
        z = cells.precondition(residual, contact)
        new = float(residual @ (z * cells.area))
        direction = z + (new / old if step else 0.0) * direction
        old = new
        image, curvature = cells.curvature(direction)
        if curvature <= 0.0:
            return p, step
        length = float(residual @ (direction * cells.area)) / curvature
        p = p + length * direction
        residual = np.where(contact, residual - length * image, 0.0)
    return p, STEPS
