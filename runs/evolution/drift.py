r"""The path of the balls: adaptive steps of the drift, with contacts that close, hold and open, many in one step.

Independent variable sigma = s/f [m], sliding path over friction coefficient; velocities dx/dsigma are those of
`runs.evolution.motion`. Bogacki and Shampine's pair of orders 3 and 2 [Appl. Math. Lett. 2 (1989) 321,
doi 10.1016/0893-9659(89)90079-7].

Contacts. In a step of length h no gap g may close faster than g/h, at every stage: a pair that would close within the
step closes at its end, and nothing overlaps by more than `hard_balls.UNSETTLED`. For constant forces the end of the
step is exact, no matter when the pair touches: both are the projection of the free motion (Moreau's catching-up
algorithm, source as in `runs.evolution.motion`). Forces that change within the step cause the error

    e = (h - h_1) |df| / 2,

with h_1 the first closing and df the change of the free velocity of the landing balls over the step: up to h_1 both
paths differ only in the speed at which the gap closes, and after it they differ by less than (h - h_1) times
the closing velocity. A pair that is slowed down but then passes without contact leaves a gap, which is the error of
slowing it down. Both errors and the embedded one are kept below the tolerance; so a step contains as many new contacts
as the tolerance allows, only one if it is fine.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from linear_bem.arrays import Array, Mask
from linear_bem.errors import NotConverged, ThirdBodyError
from runs.evolution.forces import Forces, State
from runs.evolution.hard_balls import HardBalls, Pairs, resistances

LONGEST = 0.25
"""Largest displacement in one step, over the smallest touching distance."""
AT_END = 1.0 - 1e-12
"""Share of a path's end from which it counts as reached."""
PUSHING = 1e-6
"""A contact counts as pushing from this contact force over the largest force."""


@dataclass(frozen=True, eq=False)
class Moment:
    """One state on the path: sigma [m], positions (balls, 2) [m], forces, contacts and the largest speed [-].

    ``contacts``: numbers of the pairs in contact; ``pushes`` [N]: their contact forces. ``resting``: nothing moves any
    more. ``step`` [m]: length of the next step, ``spare`` [m]: how far beyond the first new contact it may go. With
    both, a restart reproduces the uninterrupted path exactly. ``steps``: number of steps taken from the start.
    """

    sigma: float
    positions: Array
    state: State
    contacts: Pairs
    pushes: Array
    speed: float
    step: float
    spare: float
    resting: bool
    steps: int = 0


@dataclass(frozen=True, eq=False)
class Continuation:
    """The part of a `Moment` from which the path goes on exactly as without an interruption."""

    sigma: float
    positions: Array
    step: float | None = None
    spare: float = 0.0
    steps: int = 0


@dataclass(frozen=True, eq=False)
class _Neighbours:
    """Pairs that may close in a step: numbers, gaps at its start [m], h of each if nothing changes (inf: opens)."""

    which: Pairs
    gaps: Array
    open: Mask
    first: float


class Drift:
    """Balls under ``forces``; ``tolerance`` [m] bounds the error of one step.

    ``rest``: all balls count as at rest once (T + pushes)/Q of every ball is at most this.
    """

    def __init__(self, forces: Forces, balls: HardBalls, tolerance: float, rest: float) -> None:
        self.forces, self.balls, self.tolerance, self.rest = forces, balls, tolerance, rest

    def path(self, start: Array | Moment | Continuation, end: float, *, ending: bool = False) -> Iterator[Moment]:
        """Yield every moment from ``start`` until sigma = ``end`` or until nothing moves, both included.

        ``start``: positions (balls, 2) [m], or where another path was left. Only the last moment depends on ``end``: if
        a step would pass it, shorter ones to ``end`` yield no others, even where nothing moves any more. Forces that
        fail beyond ``end`` do not matter. ``ending``: it is known that the first step would pass ``end``.
        """
        begin = Continuation(0.0, start) if isinstance(start, np.ndarray) else start
        x, sigma, step, spare, steps = begin.positions, begin.sigma, begin.step, begin.spare, begin.steps
        state = self.forces(x)
        while True:
            contacts = self.balls.touching(x, self.tolerance)
            opening = -np.maximum(self.balls.gaps(x, contacts), 0.0) / step if step else None
            velocity, pushes = self.balls.admissible(x, state.tangential, state.normal, contacts, opening)
            speed = float(np.max(np.hypot(*velocity.T)))
            if step is None:
                step = 0.02 * self._longest(speed)
            resting = speed <= self.rest
            moment = Moment(sigma, x, state, contacts, pushes, speed, step, spare, resting, steps)
            ended = (resting and not ending) or sigma >= AT_END * end
            if ended or not ending:
                yield moment
            if ended:
                return
            if not ending:
                try:
                    advanced = self._advance(moment, velocity, np.inf)
                    ending = sigma + advanced[0] > end
                except ThirdBodyError:
                    if sigma + step <= end:
                        raise
                    ending = True  # the forces may fail beyond the end only
            if ending:
                advanced = self._advance(moment, velocity, end)
            taken, x, state, step, spare = advanced
            steps += 1
            sigma += taken

    def _longest(self, speed: float) -> float:
        return LONGEST * self.balls.smallest / max(speed, self.rest)

    def _advance(self, now: Moment, velocity: Array, end: float) -> tuple[float, Array, State, float, float]:
        """Return the step taken, the new positions, their state, and the next step with its spare."""
        wish = min(now.step, self._longest(now.speed))
        least, spare = 1e-13 * self._longest(now.speed), now.spare
        near = self._neighbours(now, velocity, wish)
        limit = min(wish, end - now.sigma)
        step = min(limit, max(near.first + spare, least))
        for _ in range(200):
            after, state, smooth, landing, landed = self._tried(now, velocity, near, step)
            if max(smooth, landing) <= 1.0 or step <= least:
                break
            if landing > smooth:
                beyond = max(step - near.first, 0.0)
                order = 1.0 if near.first > 0.5 * step else 0.5
                spare = beyond * max(0.05, 0.8 * landing**-order)
                shorter = min(near.first, step) + spare if near.first < step else 0.3 * step
            else:
                shorter = step * max(0.2, 0.9 * smooth ** (-1.0 / 3.0))
            step = max(min(shorter, 0.95 * step), least)
        else:
            raise NotConverged(f"drift: no step from sigma = {now.sigma:.6g} m was accepted, last tried {step:.1e} m")
        if landed and near.first < step:
            spare = (step - near.first) * min(3.0, 0.8 / max(landing, 1e-6))
        x = self.balls.parted(after, now.state.normal, near.which)
        state = state if x is after else self.forces(x)
        grown = step * min(5.0, 0.9 * max(smooth, 1e-6) ** (-1.0 / 3.0))
        following = min(max(grown, 0.3 * wish) if step < wish else grown, 5.0 * wish)
        return step, x, state, following, max(spare, 0.01 * self.tolerance / max(now.speed, self.rest))

    def _neighbours(self, now: Moment, velocity: Array, wish: float) -> _Neighbours:
        x = now.positions
        which = self.balls.near(x, 3.0 * wish * now.speed + self.tolerance)
        gaps = self.balls.gaps(x, which)
        still = gaps > self.tolerance
        rate = self.balls.jacobian(x, which) @ velocity.ravel()
        closing = still & (rate < 0.0)
        first = float(np.min(gaps[closing] / -rate[closing], initial=np.inf))
        return _Neighbours(which, np.maximum(gaps, 0.0), still, first)

    def _tried(
        self, now: Moment, velocity: Array, near: _Neighbours, step: float
    ) -> tuple[Array, State, float, float, bool]:
        """Return the end of a step of Bogacki and Shampine's pair under the conditions on the gaps, and its state.

        Then its errors over the tolerance, smooth and by new contacts, and whether there are any.
        """
        opening = -near.gaps / step
        x = now.positions
        scale = PUSHING * float(np.max(np.abs(now.state.tangential), initial=0.0))

        def rate(at: Array, state: State) -> tuple[Array, Array]:
            return self.balls.admissible(at, state.tangential, state.normal, near.which, opening)

        one, pushed = velocity, np.zeros(len(near.which), dtype=bool)
        if near.first < step:
            one, pushes = rate(x, now.state)
            pushed = pushes > scale
        second = x + 0.5 * step * one
        two, _ = rate(second, self.forces(second))
        third = x + 0.75 * step * two
        three, _ = rate(third, self.forces(third))
        after = x + step * (2.0 * one + 3.0 * two + 4.0 * three) / 9.0
        state = self.forces(after)
        four, pushes = rate(after, state)
        error = step * (-5.0 * one + 6.0 * two + 8.0 * three - 9.0 * four) / 72.0
        pushed = (pushed | (pushes > scale)) & near.open
        gaps = self.balls.gaps(after, near.which)
        smooth = max(float(np.max(np.abs(error))), float(np.max(-gaps, initial=0.0)))
        landing = 0.0
        if np.any(pushed):
            before, then = (s.tangential / resistances(s.normal)[:, None] for s in (now.state, state))
            change = np.hypot(*(then - before).T)
            balls = self.balls.pairs(near.which[pushed])
            late = 0.5 * max(step - near.first, 0.0) * float(np.max(change[balls]))
            landing = max(late, float(np.max(gaps[pushed])))
        return after, state, smooth / self.tolerance, landing / self.tolerance, bool(np.any(pushed))
