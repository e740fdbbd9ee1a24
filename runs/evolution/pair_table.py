"""A table of the states of one ball and of pairs, computed once by any model, kept in a file and resumable.

The file belongs to a material, a ball, an approach, a model and its accuracy, not to a scene: every scene with the same
layer, ball and approach shares it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged, UnsupportedProblem
from linear_bem.problem import Ball, Load, Problem
from linear_bem.result import Result
from runs.display.numbers import count, duration
from runs.evolution.forces import abreast
from runs.evolution.pair_forces import PairForces, PairLaw, SingleBall
from runs.process import ranks
from runs.process.files import write_text
from runs.process.json_values import Document, plain, to_json
from runs.process.locks import alone
from runs.scene.effects.finite_strain import effect_identity

Solve = Callable[[Problem, Path | None, Sequence[float]], Result]
"""Arguments: problem, folder for the restart files of a long run, load fractions to be solved."""

FORMAT = 1
"""Format version of tables: raised when older tables must not be used any more."""
NAMED = ("layer", "balls", "load", "substrate", "finite_strain", "elements")
"""Parts of a problem whose names and values in the identity of a table are fixed; any other part is added as it is."""
FEW = (1.0, 1.06, 1.14, 1.25, 1.4, 1.6, 1.9, 2.3, 2.9, 3.7)
"""Distances over the touching distance for models that take minutes per pair."""
MANY = tuple(float(v) for v in np.geomspace(1.0, 12.0, 24))
"""Distances over the touching distance for models that take a tenth of a second per pair."""
DEPTHS = (0.08, 0.12, 0.18, 0.27, 0.4, 0.55, 0.7, 0.85, 1.0, 1.05)
"""Approaches of the single ball over the prescribed one."""
ARRANGEMENTS = {
    "three in a line": ((-1.0, 0.0), (0.0, 0.0), (1.0, 0.0)),
    "four in a square": ((-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)),
}
"""Touching balls, in sums of their radii, on which additivity is measured."""


@dataclass(frozen=True)
class SingleStates:
    """One ball alone: approaches [m], normal forces [N], and the time [s] that they took."""

    approaches: tuple[float, ...]
    normal_forces: tuple[float, ...]
    seconds: float


@dataclass(frozen=True)
class PairState:
    """Two balls at a distance [m]: Q of each, T towards the other and its error [N]."""

    distance: float
    normal_force: float
    tangential_force: float
    tangential_force_error: float
    seconds: float


@dataclass(frozen=True)
class Additivity:
    """Three or four balls: the largest T and its error [N], and the errors of simpler laws relative to that T.

    ``coupled``: T by the coupled pairs of `runs.evolution.pair_forces`; ``bare_sum``: T by the sum of pair forces.
    """

    arrangement: str
    tangential_force: float
    tangential_force_error: float
    coupled: float
    bare_sum: float
    seconds: float


@dataclass
class States:
    """The states that a table contains so far."""

    single: SingleStates | None = None
    pairs: list[PairState] = field(default_factory=list)
    additivity: list[Additivity] = field(default_factory=list)


class PairTable:
    """The states of one ball, of pairs, and of three and four balls; complete or not.

    Collective if the model is: every rank calls `complete`, rank 0 reads and writes. ``slow``: each pair takes minutes.
    """

    def __init__(
        self,
        problem: Problem,
        model: str,
        solve: Solve,
        folder: Path,
        settings: Mapping[str, Any],
        *,
        slow: bool = False,
    ) -> None:
        self.ball, self.approach = common_ball(problem)
        self.problem, self.solve, self.slow = problem, solve, slow
        self.touch = 2.0 * self.ball.radius
        self.distances = tuple(self.touch * v for v in (FEW if self.slow else MANY))
        identity = {
            "format": FORMAT,
            "model": model,
            "layer": asdict(problem.layer),
            "substrate": asdict(problem.substrate) if problem.substrate else None,
            "finite_strain": effect_identity(problem.finite_strain) if problem.finite_strain else None,
            "radius": self.ball.radius,
            "shape": self.ball.shape,
            "approach": self.approach,
            "distances": self.distances,
            **{key: asdict(part) for key, part in vars(problem).items() if part is not None and key not in NAMED},
            **settings,
        }
        self.identity = plain(identity, infinity="inf")
        digest = hashlib.sha256(json.dumps(self.identity, sort_keys=True).encode()).hexdigest()[:12]
        self.path = folder / f"{model}-{digest}.json"
        self.damage = ""
        self.states = self._read()

    def _read(self) -> States:
        """Return the saved states; none if the file is of another table or damaged (then ``damage`` is set)."""
        try:
            data = json.loads(self.path.read_text(encoding="utf-8"))
            return TypeAdapter(States).validate_python(data) if data["identity"] == self.identity else States()
        except (FileNotFoundError, NotADirectoryError):
            return States()
        except ValidationError as error:
            first = error.errors()[0]
            fault = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        except (OSError, ValueError, KeyError, TypeError) as error:
            fault = str(error)
        self.damage = f"{self.path}: cannot be read ({fault}); its runs are computed again"
        return States()

    @property
    def data(self) -> Document:
        """The JSON object of the table."""
        return {"identity": self.identity, **asdict(self.states)}

    @property
    def missing(self) -> int:
        """Number of runs that are still to be done."""
        return len(self.missing_problems())

    def missing_problems(self) -> list[Problem]:
        """Return the problems that are still to be solved."""
        single = [] if self.states.single else [self._placed(np.zeros((1, 2)), DEPTHS[-1] * self.approach)]
        places = [abreast(d) for d in self._missing_distances()]
        places += [self._scaled(name) for name in self._missing_arrangements()]
        return [*single, *(self._placed(each, self.approach) for each in places)]

    def _missing_distances(self) -> list[float]:
        return [d for d in self.distances if d not in {pair.distance for pair in self.states.pairs}]

    def _missing_arrangements(self) -> list[str]:
        return [name for name in ARRANGEMENTS if name not in {found.arrangement for found in self.states.additivity}]

    def complete(self, print_status: Callable[[str], None] = lambda text: None) -> None:
        """Run the missing cases one by one and save each (collective over the model's ranks)."""
        self.states = ranks.share(self.states)
        if not self.missing:
            return
        lock = self.path.with_name(f".{self.path.stem}.lock")
        busy = partial(print_status, f"pair table {self.path}: another run makes it now; waiting for that run")
        with alone(lock, busy, "--tables") if ranks.is_root() else contextlib.nullcontext():
            self.states = states = ranks.share(self._read())

            def keep(words: str, seconds: float) -> None:
                if ranks.is_root():
                    write_text(self.path, to_json(self.data))
                    # one ball alone is solved at all depths: its time says nothing about that of a pair
                    left = f", about {duration(seconds * self.missing)} left" if self.missing and states.pairs else ""
                    print_status(f"pair table: {words} ({seconds:.1f} s); {count(self.missing, 'run')} to do{left}")

            if states.single is None:
                states.single = self._single()
                keep("one ball alone", states.single.seconds)
            for distance in self._missing_distances():
                states.pairs.append(self._pair(distance))
                keep(f"centre distance {distance / self.touch:.3g} (R1 + R2)", states.pairs[-1].seconds)
            for name in self._missing_arrangements():
                states.additivity.append(self._additivity(name))
                keep(name, states.additivity[-1].seconds)

    def _scaled(self, arrangement: str) -> Array:
        return np.array(ARRANGEMENTS[arrangement]) * self.touch

    def _placed(self, places: Array, approach: float) -> Problem:
        """Return the problem of such balls at ``places``, shape (balls, 2) [m]."""
        balls = tuple(replace(self.ball, position=(float(x), float(y))) for x, y in places)
        return replace(self.problem, balls=balls, load=Load("approach", (approach,) * len(balls)))

    def _solved(self, places: Array, approach: float, steps: Sequence[float] = (1.0,)) -> Result:
        """Return the model's result; the workspace of a run of minutes is deleted once the run is complete."""
        problem = self._placed(places, approach)
        if not self.slow:
            return self.solve(problem, None, steps)
        workspace = self.path.with_suffix(".unfinished")
        result = self.solve(problem, workspace, steps)
        if ranks.is_root():
            shutil.rmtree(workspace, ignore_errors=True)
        return result

    def _single(self) -> SingleStates:
        begun = time.perf_counter()
        path = self._solved(np.zeros((1, 2)), DEPTHS[-1] * self.approach, [d / DEPTHS[-1] for d in DEPTHS]).steps
        states = sorted((s.balls[0].approach, s.balls[0].normal_force) for s in path if s.balls[0].normal_force > 0.0)
        if len(states) < 4:
            raise NotConverged(f"pair table: the single ball's load path has only {len(states)} states")
        approaches, forces = zip(*states, strict=True)
        return SingleStates(approaches, forces, time.perf_counter() - begun)

    def _pair(self, distance: float) -> PairState:
        begun = time.perf_counter()
        balls = self._solved(abreast(distance), self.approach).balls
        return PairState(
            distance,
            normal_force=0.5 * (balls[0].normal_force + balls[1].normal_force),
            tangential_force=0.5 * (balls[0].tangential_force[0] - balls[1].tangential_force[0]),
            tangential_force_error=max(ball.tangential_force_error for ball in balls),
            seconds=time.perf_counter() - begun,
        )

    def _additivity(self, name: str) -> Additivity:
        begun = time.perf_counter()
        scaled = self._scaled(name)
        problem = self._placed(scaled, self.approach)
        balls = self._solved(scaled, self.approach).balls
        positions = np.array([ball.position for ball in balls])
        true = np.array([ball.tangential_force for ball in balls])
        largest = float(np.max(np.hypot(*true.T)))
        coupled = PairForces(problem, [self.single()] * len(balls), self.law())(positions)
        return Additivity(
            name,
            tangential_force=largest,
            tangential_force_error=max(ball.tangential_force_error for ball in balls),
            coupled=float(np.max(np.hypot(*(coupled.tangential - true).T))) / largest,
            bare_sum=float(np.max(np.hypot(*(self._bare_sum(positions) - true).T))) / largest,
            seconds=time.perf_counter() - begun,
        )

    def _bare_sum(self, positions: Array) -> Array:
        """Return the sum of pair forces (balls, 2) [N], each as if the other balls were not there."""
        pair = self.of_two()
        total = np.zeros(positions.shape)
        for i in range(len(positions)):
            for j in range(i):
                total[[i, j]] += pair(positions[[i, j]]).tangential
        return total

    def single(self) -> SingleBall:
        """Return the relation of force and approach of one ball."""
        assert self.states.single is not None
        return SingleBall(self.states.single.approaches, self.states.single.normal_forces)

    def law(self) -> PairLaw:
        """Return influence, pull and its error over distance."""
        pairs = sorted(self.states.pairs, key=lambda pair: pair.distance)
        distances = np.array([pair.distance for pair in pairs])
        load = np.array([pair.normal_force for pair in pairs])
        pull = np.array([pair.tangential_force for pair in pairs]) / load**2
        influence = (self.approach - self.single().approach(load)) / load
        errors = np.array([pair.tangential_force_error for pair in pairs]) / load**2
        return PairLaw(self.problem, (distances, influence, pull, errors))

    def forces(self, cell: Array | None = None) -> PairForces:
        """Return the forces of the problem's balls at any positions, in a periodic ``cell`` [m] if there is one.

        The error of adding pairs counts for two balls, too: interpolation between distances has no error of its own.
        """
        return PairForces(self.problem, [self.single()] * self.problem.size, self.law(), self.worst().coupled, cell)

    def of_two(self) -> PairForces:
        """Return the forces of two balls alone."""
        return PairForces(self._placed(abreast(self.touch), self.approach), [self.single()] * 2, self.law())

    def worst(self) -> Additivity:
        """Return the arrangement with the largest deviation of the forces from the model."""
        return max(self.states.additivity, key=lambda found: found.coupled)


def common_ball(problem: Problem) -> tuple[Ball, float]:
    """Return the one kind of ball and the one approach; raises `UnsupportedProblem` where there are several."""
    kinds = {(ball.radius, ball.shape) for ball in problem.balls}
    approaches = set(problem.load.values)
    if len(kinds) > 1 or len(approaches) > 1:
        raise UnsupportedProblem(
            f"[reciprocation] forces: a table of pairs needs equal balls under one approach, got {len(kinds)} kind(s) "
            f'and {len(approaches)} approach(es); use forces = "direct" with --model linear_bem or, with [periodic], '
            "where that is not possible, --model point_load"
        )
    return replace(problem.balls[0], position=(0.0, 0.0)), problem.load.values[0]
