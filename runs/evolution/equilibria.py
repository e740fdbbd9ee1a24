r"""Equilibria: where forces and pushes balance, and whether a small disturbance decays.

Unknowns are the positions x and the pushes N of the contacts that hold; equations

    T(x) + sum_c N_c dg_c/dx = 0,     g_c(x) = 0.

Translations and the rotation of all balls together change nothing: steps exclude them, and stability refers to the
other motions. With Z a basis of the motions that keep the contacts and contain no rigid motion
(orthogonal in the metric Q), disturbances grow as exp(lambda sigma), lambda the eigenvalues of

    (Z^T Q Z)^-1 Z^T K Z,     K = dT/dx + sum_c N_c d2g_c/dx2.

If Z is empty, the contacts block every relative motion, and the group is stable as long as all contacts push.

Balls never overlap during the iteration: a Newton step ends where a contact closes, which then stays closed, and
derivatives are secants between positions without overlap. So every model can be used, even one that has no solution
for overlapping balls.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigvals, null_space
from scipy.optimize import brentq, linprog, nnls

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged
from runs.evolution.forces import Forces, abreast
from runs.evolution.hard_balls import HardBalls, Pairs, resistances

BALANCED = 1e-7
"""Largest (T + pushes)/Q of an equilibrium."""
SETTLED = 1e-3
"""Longest move of Newton's last step, over the smallest touching distance."""
LONGEST, FURTHEST = 0.2, 3.0
"""Longest move of a ball in one step, and its largest distance from the start, over the smallest touching distance."""
DIFFERENCE = 1e-5
"""Length of differences over the smallest touching distance, for forces without noise."""
OVERLAP = 1e-9
"""Overlap over touching distance that a step may leave; it is corrected afterwards."""
HELD = 1e-6
"""Gap over touching distance up to which a pair at the start is in contact, of a path without error."""
NEUTRAL = 1e-6
"""Growth rate over the largest of all rates below which a disturbance neither grows nor decays."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Positions (balls, 2) [m], contacts and their pushes [N], residual of the balance [-], growth rates [1/m].

    ``free`` is the number of unconstrained relative motions. ``verdict``: "stable", "neutral" or "unstable".
    """

    positions: Array
    contacts: Pairs
    pushes: Array
    residual: float
    free: int
    growth: tuple[float, ...]
    verdict: str


def stiffness(forces: Forces, balls: HardBalls, x: Array, load: Array, held: Pairs, step: float) -> Array:
    """Return dT/dx [N/m], shape (2 balls, 2 balls), along the motions that keep the pairs ``held``; 0 across them.

    From secants between positions without overlap, up to ``step`` [m] to either side as far as other contacts allow.
    """
    motions = null_space(balls.jacobian(x, held).toarray(), rcond=1e-8) if len(held) else np.eye(x.size)
    moves, changes = np.zeros((x.size, motions.shape[1])), np.zeros((x.size, motions.shape[1]))
    for k, motion in enumerate(step * motions.T):
        ahead, behind = (on_contacts(balls, x + side * motion.reshape(x.shape), load, held) for side in (1.0, -1.0))
        moves[:, k] = (ahead - behind).ravel()
        changes[:, k] = (forces(ahead).tangential - forces(behind).tangential).ravel()
    return np.asarray(changes @ np.linalg.pinv(moves, rcond=1e-3))


def on_contacts(balls: HardBalls, x: Array, load: Array, held: Pairs) -> Array:
    """Return the nearest positions (metric Q) at which the pairs ``held`` touch and none overlaps.

    Raises `NotConverged` where there are none near.
    """
    weight = 1.0 / np.repeat(resistances(load), 2)
    every, scale = balls.all, 2.0 * float(np.max(balls.radii))
    shut = set(map(int, held))
    for _ in range(40):
        shut |= set(every[balls.gaps(x, every) < -1e-12 * scale].tolist())
        which = np.array(sorted(shut), dtype=np.intp)
        gaps = balls.gaps(x, which)
        if float(np.max(np.abs(gaps), initial=0.0)) <= 1e-12 * scale:
            return x
        jacobian = balls.jacobian(x, which).toarray()
        push = np.linalg.lstsq((jacobian * weight) @ jacobian.T, -gaps, rcond=1e-10)[0]
        # an overlap is pushed apart; only a pair that is held may be drawn together
        x = x + (weight * (push @ jacobian)).reshape(x.shape)
        shut = set(map(int, held)) | {k for k, p in zip(which.tolist(), push, strict=True) if p > 0.0}
    raise NotConverged(
        f"hard balls: {len(held)} contacts cannot all be kept without an overlap; "
        f"gaps of {float(np.min(balls.gaps(x))):.1e} m are left"
    )


def rigid_motions(x: Array) -> Array:
    """Return both translations and the rotation about the centre, shape (2 balls, 3)."""
    centred = x - x.mean(axis=0)
    size = max(float(np.max(np.abs(centred))), 1e-300)
    turn = np.stack([-centred[:, 1], centred[:, 0]], axis=1).ravel() / size
    return np.stack([np.tile([1.0, 0.0], len(x)), np.tile([0.0, 1.0], len(x)), turn], axis=1)


def find(
    forces: Forces, balls: HardBalls, start: Array, difference: float = DIFFERENCE, tolerance: float = 0.0
) -> Equilibrium:
    """Return the equilibrium next to ``start`` with the contacts that hold there; raises `NotConverged`.

    Pairs that touch on the way are held together; a contact whose push comes out negative is opened, and the search
    continues without it. ``difference`` of the secants is over the smallest touching distance. ``tolerance`` [m] is the
    gap that the path to ``start`` may leave at a contact.
    """
    state = forces(start)
    touch = balls.smallest
    contacts = balls.touching(start, max(HELD * touch, tolerance))
    held = _holding(balls, start, state.tangential, state.normal, contacts)
    x, residual, length = start, np.inf, np.inf
    parted: set[int] = set()
    for _ in range(60):
        x = on_contacts(balls, x, state.normal, held)
        state = forces(x)
        jacobian = balls.jacobian(x, held).toarray()
        # mutual forces have no resultant and no moment: those of a model are errors, which no motion can remove
        rigid = np.linalg.qr(rigid_motions(x))[0]
        force = state.tangential.ravel() - rigid @ (rigid.T @ state.tangential.ravel())
        pushes = np.linalg.lstsq(jacobian.T, -force, rcond=1e-10)[0]
        balance = force + pushes @ jacobian
        residual = float(np.max(np.abs(balance).reshape(x.shape) / resistances(state.normal)[:, None]))
        # forces that decay with distance fall below any bound without an equilibrium: Newton's steps must converge, too
        settled = length <= SETTLED * touch
        tangent = stiffness(forces, balls, x, state.normal, held, difference * touch)
        tangent += _curvature(balls, x, held, pushes)
        if residual <= BALANCED and settled:
            given, left = nnls(jacobian.T, -force) if len(held) else (pushes, 0.0)
            if left <= 2.0 * BALANCED * float(np.max(state.normal)):
                found = _judged(balls, x, state.normal, held, given, residual, tangent)
                if not len(held) and max(map(abs, found.growth)) * touch <= BALANCED:
                    raise NotConverged("none; the search ended where the balls are too far apart to act on each other")
                return found
            parted.update(held[pushes <= 0.0].tolist())
            held = held[pushes > 0.0]
            continue
        n, m = x.size, len(held)
        still = np.vstack([jacobian, rigid.T])
        matrix = np.block([[tangent, jacobian.T], [still, np.zeros((len(still), m))]])
        # scaled: forces by load, lengths by the touching distance
        weight = np.concatenate([np.full(n, 1.0 / float(np.max(state.normal))), np.full(len(still), 1.0 / touch)])
        right = -np.concatenate([balance, np.zeros(len(still))])
        move = np.linalg.lstsq(matrix * weight[:, None], right * weight, rcond=1e-10)[0][:n].reshape(x.shape)
        length = float(np.max(np.abs(move)))
        x, landed = _moved(balls, x, move * min(1.0, LONGEST * touch / max(length, 1e-300)), held)
        if parted.intersection(landed.tolist()):
            i, j = balls.pairs(landed[:1])[0]
            raise NotConverged(
                f"Newton's method finds none without overlapping balls; balls {i} and {j} touch on its way, "
                "and their forces separate them there"
            )
        held = np.union1d(held, landed).astype(np.intp)
        if float(np.max(np.abs(x - start))) > FURTHEST * touch:
            break
    raise NotConverged(
        f"none within {float(np.max(np.abs(x - start))):.3g} m of the final positions; where the search ended, "
        f"{residual:.1e} of its load still drives a ball"
    )


def _moved(balls: HardBalls, x: Array, move: Array, held: Pairs) -> tuple[Array, Pairs]:
    """Return the positions after ``move``, or where the first pair lands on it, and that pair."""
    free = np.setdiff1d(balls.all, held)
    i, j = balls.pairs(free).T
    between, change = x[j] - x[i], move[j] - move[i]
    # |between + part change| = touching distance less the overlap corrected anyway: the smaller root for part
    square = np.sum(change**2, axis=1)
    closing = np.sum(between * change, axis=1)
    room = np.sum(between**2, axis=1) - (balls.distances(free) * (1.0 - OVERLAP)) ** 2
    inside = closing**2 - square * room
    lands = (closing < 0.0) & (inside > 0.0)
    part = np.full(len(free), np.inf)
    part[lands] = np.maximum(room[lands], 0.0) / (np.sqrt(inside[lands]) - closing[lands])
    if not np.any(part < 1.0):
        return x + move, free[:0]
    first = int(np.argmin(part))
    return x + part[first] * move, free[[first]]


def _holding(balls: HardBalls, x: Array, force: Array, load: Array, contacts: Pairs) -> Pairs:
    """Return the ``contacts`` that hold: all of them if all can push at once, else those of one choice of pushes.

    More contacts than motions leave the pushes undetermined; non-negative least squares then sets some to zero.
    """
    if len(contacts) == 0:
        return contacts
    jacobian = balls.jacobian(x, contacts).toarray()
    size = float(np.max(np.abs(force)))
    # largest t with all pushes at least t, in balance within a thousandth of the largest force
    none, above = np.zeros((x.size, 1)), np.ones((len(contacts), 1))
    right = -force.ravel() / size
    found = linprog(
        np.append(np.zeros(len(contacts)), -1.0),
        A_ub=np.block([[jacobian.T, none], [-jacobian.T, none], [-np.eye(len(contacts)), above]]),
        b_ub=np.concatenate([right + 1e-3, -right + 1e-3, np.zeros(len(contacts))]),
        bounds=[(0.0, None)] * len(contacts) + [(None, 1e3)],
    )
    if found.status == 0 and found.x[-1] > 1e-4:
        return contacts
    return contacts[balls.admissible(x, force, load, contacts)[1] > 1e-9 * size]


def _curvature(balls: HardBalls, x: Array, held: Pairs, pushes: Array) -> Array:
    """Return sum_c N_c d2g_c/dx2 [N/m]: a push turns with its pair."""
    out = np.zeros((x.size, x.size))
    for push, (i, j) in zip(pushes, balls.pairs(held), strict=True):
        between = x[j] - x[i]
        distance = float(np.hypot(*between))
        ends = np.zeros(len(x))
        ends[[i, j]] = -1.0, 1.0
        across = np.eye(2) - np.outer(between, between) / distance**2
        out += push / distance * np.kron(np.outer(ends, ends), across)
    return out


def _judged(
    balls: HardBalls, x: Array, load: Array, held: Pairs, pushes: Array, residual: float, tangent: Array
) -> Equilibrium:
    metric = np.repeat(resistances(load), 2)
    fixed = np.vstack([balls.jacobian(x, held).toarray(), (rigid_motions(x) * metric[:, None]).T / np.max(metric)])
    basis = null_space(fixed, rcond=1e-8)
    growth: tuple[float, ...] = ()
    if basis.shape[1]:
        reduced = basis.T @ tangent @ basis
        rates = eigvals(reduced, basis.T @ (metric[:, None] * basis))
        growth = tuple(sorted((float(r) for r in np.real(rates)), reverse=True))
    largest = max((abs(g) for g in growth), default=0.0)
    worst = growth[0] if growth else -np.inf
    verdict = "neutral" if abs(worst) <= NEUTRAL * largest else "stable" if worst < 0.0 else "unstable"
    return Equilibrium(x, held, pushes, residual, basis.shape[1], growth, verdict)


def of_pair(forces: Forces, touch: float, furthest: float) -> list[tuple[float, str]]:
    """Return the distances [m] at which two balls rest, with "stable" or "unstable", from contact to ``furthest``.

    T > 0 on the left ball attracts; a pair in contact that attracts rests there.
    """

    def pull(distance: float) -> float:
        return float(forces(abreast(distance)).tangential[0, 0])

    at = np.geomspace(touch, furthest, 240)
    values = np.array([pull(d) for d in at])
    found = [(touch, "stable")] if values[0] > 0.0 else []
    for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0):
        # attraction beyond the root and repulsion within: stable
        found.append((float(brentq(pull, at[k], at[k + 1])), "stable" if values[k] < 0.0 else "unstable"))
    return found
