"""The path of the balls: adaptive steps of the projected drift, with contacts that close, hold and open.

Independent variable sigma = s/f [m], sliding path over friction coefficient; velocities dx/dsigma are (T + pushes)/Q.
Bogacki and Shampine's pair of orders 3 and 2 [Appl. Math. Lett. 2 (1989) 321, doi 10.1016/0893-9659(89)90079-7].
At every stage the velocity is the admissible one of `runs.evolution.hard_balls`. The velocity is continuous when a
contact opens, so step-size control resolves it; if a pair would overlap at the end of a step, the step is shortened to
the point where the contact closes, because the velocity jumps there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from linear_bem.errors import NotConverged
from runs.evolution.forces import Forces, State
from runs.evolution.hard_balls import HardBalls, Pairs

Array = NDArray[np.float64]

LONGEST = 0.25
"""Largest displacement in one step, over the smallest touching distance."""
LANDED = 1e-7
"""Gap over touching distance at which a closing pair is set in contact."""


@dataclass(frozen=True)
class Moment:
    """One state on the path: sigma [m], positions (balls, 2) [m], forces, contacts and the largest speed [-].

    ``contacts``: numbers of the pairs in contact; ``pushes`` [N]: their contact forces. ``resting``: nothing moves any
    more. ``step`` [m]: length of the next step, with which a restart reproduces the uninterrupted path exactly.
    """

    sigma: float
    positions: Array
    state: State
    contacts: Pairs
    pushes: Array
    speed: float
    step: float
    resting: bool


class Drift:
    """Balls under ``forces``; ``tolerance`` [m] bounds the error of one step; ``steps`` counts those taken.

    ``rest`` is the largest (T + pushes)/Q of any ball at which nothing is taken to move any more.
    """

    def __init__(self, forces: Forces, balls: HardBalls, tolerance: float, rest: float) -> None:
        self.forces, self.balls, self.tolerance, self.rest = forces, balls, tolerance, rest
        self.steps = 0

    def path(self, start: Array, end: float, sigma: float = 0.0, step: float | None = None) -> Iterator[Moment]:
        """Yield every moment from ``start`` until sigma = ``end`` or until nothing moves, both included."""
        x, state = start, self.forces(start)
        while True:
            contacts = self.balls.touching(x)
            velocity, pushes = self.balls.admissible(x, state.tangential, state.normal, contacts)
            speed = float(np.max(np.hypot(*velocity.T)))
            if step is None:
                step = 0.02 * self._longest(speed)
            moment = Moment(sigma, x, state, contacts, pushes, speed, step, speed <= self.rest)
            yield moment
            if moment.resting or sigma >= end * (1.0 - 1e-12):
                return
            taken, x, state, step = self._advance(moment, velocity, end)
            self.steps += 1
            sigma += taken

    def _longest(self, speed: float) -> float:
        smallest = float(np.min(self.balls.distances, initial=1.0))
        return LONGEST * smallest / max(speed, self.rest)

    def _advance(self, now: Moment, velocity: Array, end: float) -> tuple[float, Array, State, float]:
        """Return the step taken, the new positions, their state, and the next step."""
        wish = min(now.step, self._longest(now.speed))
        step, rejected = min(wish, end - now.sigma), False
        least = 1e-13 * self._longest(now.speed)
        for _ in range(200):
            after, error = self._step(now, velocity, step)
            size = float(np.max(np.abs(error))) / self.tolerance
            if size > 1.0:
                step, rejected = step * max(0.2, 0.9 * size ** (-1.0 / 3.0)), True
                continue
            landing = self._first_landing(now, velocity, after, step)
            if landing is None or step * landing <= least:
                break
            step, rejected = step * landing, True
            wish = max(wish, step)
        else:
            raise NotConverged(f"drift: no step from sigma = {now.sigma:.6g} m was accepted, last tried {step:.1e} m")
        x = self._held(now, after)
        grown = step * min(5.0, 0.9 * max(size, 1e-6) ** (-1.0 / 3.0))
        following = grown if not rejected else max(grown, 0.1 * wish)
        return step, x, self.forces(x), min(following, 5.0 * wish)

    def _rate(self, now: Moment, x: Array) -> Array:
        state = self.forces(self.balls.restored(x, now.state.normal, np.zeros(0, dtype=np.intp)))
        return self.balls.admissible(x, state.tangential, state.normal, now.contacts)[0]

    def _step(self, now: Moment, first: Array, step: float) -> tuple[Array, Array]:
        second = self._rate(now, now.positions + 0.5 * step * first)
        third = self._rate(now, now.positions + 0.75 * step * second)
        after = now.positions + step * (2.0 * first + 3.0 * second + 4.0 * third) / 9.0
        fourth = self._rate(now, after)
        return after, step * (-5.0 * first + 6.0 * second + 8.0 * third - 9.0 * fourth) / 72.0

    def _first_landing(self, now: Moment, velocity: Array, after: Array, step: float) -> float | None:
        """Return the fraction of the step at which the first open contact closes; None if none closes."""
        free = np.setdiff1d(np.arange(len(self.balls.pairs)), now.contacts)
        gaps = self.balls.gaps(after, free)
        landing = free[gaps < -LANDED * self.balls.distances[free]]
        if landing.size == 0:
            return None
        # quadratic through both ends with the initial velocity: repeated until the closing point is found
        bend = after - now.positions - step * velocity

        def gap(part: float, pair: Pairs) -> float:
            return float(self.balls.gaps(now.positions + part * step * velocity + part**2 * bend, pair)[0])

        first = 1.0
        for k in landing:
            pair = np.array([k])
            at = 0.0 if gap(0.0, pair) <= 0.0 else brentq(gap, 0.0, 1.0, args=(pair,), xtol=1e-14, rtol=1e-13)
            first = min(first, float(at))
        return first

    def _held(self, now: Moment, after: Array) -> Array:
        """Return the positions with zero gap at the contacts that held and at those that have closed."""
        gaps, distances = self.balls.gaps(after), self.balls.distances
        pushing = now.contacts[now.pushes > 0.0]
        still = pushing[np.abs(gaps[pushing]) <= self.tolerance]
        landed = np.flatnonzero(np.abs(gaps) <= LANDED * distances)
        landed = np.setdiff1d(landed, now.contacts)
        return self.balls.restored(after, now.state.normal, np.union1d(still, landed).astype(np.intp))
