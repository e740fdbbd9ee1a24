"""The load path on one mesh: equilibria at load fractions, with predictor, cut-back and augmentation."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from finite_strain.contact.contact_energy import Penalised
from finite_strain.discretisation.nodal_values import on_top
from finite_strain.discretisation.unknowns import Values
from finite_strain.equilibrium.newton import NewtonSolver, StepRecord
from finite_strain.force.distortion import Distortion, distortion, film_left
from finite_strain.geometry.estimates import STIFFENING, alone, is_stable, penalties
from linear_bem.errors import NotConverged
from linear_bem.problem import Problem

EXACT, ROUGH, PASSING = 1e-9, 1e-4, 1e-3
"""Residual norm over the normal force at which Newton's method stops: with results, without multipliers (which they
determine), and before penalties are stiffened."""
GROWTH = 1.5
"""Growth of the load step after a converged one."""
SPURIOUS = 0.3
"""An augmentation that changes a normal force by more than this fraction has left the solution branch."""
SURPLUS = 0.3
"""The increase of the potential is at most the work of the final forces, because forces grow with approaches; this
fraction more is allowed. A crumpled surface, also an equilibrium, stores several times as much."""
FRUITLESS = 3
"""Cut-backs after which a path that began with another discretisation's states starts again from zero load: each costs
ten or more iterations, a step of the new path two to four (thin pair, 55 thousand unknowns, from D = 0.8 R on)."""
PARTS = 4
"""Equal parts in which multipliers are added gradually."""
DOUBLINGS = 4
"""Number of doublings of the penalty if multipliers were added gradually, or not at all; more if `stiffer` > 1."""
BACK = 1e-12
"""Relative roundoff of load fractions."""


@dataclass(frozen=True)
class State:
    """An equilibrium from which others are predicted: fields, approaches (balls,) [m], and its potential [J], if known.

    With a ``source``, it is so near to the predicted equilibrium that its multipliers also apply there.
    """

    fraction: float
    values: Values
    approaches: tuple[float, ...]
    source: Penalised | None = None
    energy: float = math.nan


Predictor = Callable[[float], State | None]
"""Returns a state near the equilibrium at a load fraction, or None."""


class LoadPath:
    """Loads a model step by step; iterate over `steps` to bring it into equilibrium at each load fraction.

    ``observe`` is called with the fraction and the number of cut-backs when a step begins; ``stiffer`` multiplies the
    penalties of states with multipliers; ``shortest`` is the load step over the goal below which the path ends, and
    ``longest`` the first step over full load after a predictor's state failed. The attribute ``ahead`` multiplies the
    penalties of the next step if it starts with a predictor's multipliers, and returns to 1 if that fails. The
    residual of states with multipliers is at most ``residual``; with ``is_rough`` it is `PASSING` until `stiffen`.
    """

    def __init__(
        self, problem: Problem, solver: NewtonSolver, observe: Callable[[float, int], None], stiffer: float,
        shortest: float, longest: float,
    ) -> None:  # fmt: skip
        self.problem, self.solver, self.model, self.control = problem, solver, solver.model, solver.control
        self._observe, self.stiffer, self._shortest, self._longest = observe, stiffer, shortest, longest
        self._top = on_top(self.model.space, self.model.facet_tags)
        self._undeformed = self.model.fields.like().copy()
        self.history: list[State] = []
        self._borrowed = False
        """Whether states of the path began with those of another discretisation, or of an earlier run."""
        self.source, self.ahead = self.model.contact.penalised, 1.0
        self.residual, self.is_rough = EXACT, False

    def steps(self, fractions: Sequence[float], predictor: Predictor = lambda _: None) -> Iterator[StepRecord]:
        """Yield after each converged step; all fractions are reached in turn, with smaller steps where needed.

        Fractions may also decrease (unloading). A step starts from the predictor's state with its multipliers; if
        Newton's method fails, from the source of the multipliers without them; if there is none, or this fails too,
        from the extrapolation of earlier states. A step from a near state ends with multipliers; others end in an
        approximate equilibrium without them; `augment` adds them and makes it exact. A path that began with a
        predictor's states and ends early starts again from zero load; its cost counts in the next record.
        """
        for goal in fractions:
            cuts, predicted = 0, predictor(goal)
            known, spent = 0.0, (0, 0, 0)
            step = goal - self.last.fraction
            while not self.history or abs(self.last.fraction - goal) > BACK * abs(goal):
                reached = self.last.fraction
                fraction = goal if abs(goal - reached) <= abs(step) * (1.0 + BACK) else reached + step
                self._observe(fraction, cuts)
                record = StepRecord(fraction, *spent, cuts=cuts)
                try:
                    self._solve(fraction, predicted or self._extrapolated(fraction, cuts), record)
                except NotConverged as error:
                    spent = record.newton_iterations, record.tangents, record.augmentation_iterations
                    if predicted is None:
                        cuts, step = cuts + 1, 0.5 * (fraction - reached)
                    elif predicted.source is not None and self.ahead > 1.0:
                        self.ahead = 1.0
                    elif predicted.source is not None:
                        predicted = _penalised(predicted, predicted.source)
                    else:
                        predicted, step = None, math.copysign(min(abs(step), self._longest), step)
                    if self._borrowed and (cuts >= FRUITLESS or abs(step) < self._shortest * abs(goal)):
                        self._borrowed, self.history, predicted, cuts = False, [], None, 0
                        known, step = abs(reached), math.copysign(min(self._longest, abs(goal)), goal)
                    elif abs(step) < self._shortest * abs(goal):
                        self._restore()
                        raise NotConverged(
                            f"load step to {fraction:.4g} of the full load: {error} after {cuts} cut-backs; "
                            f"the last good state is at {reached:.4g} of the full load: the film under a ball is "
                            f"{self.film():.2g} of the layer's thickness; {self.distorted().describe()}"
                        ) from error
                    continue
                approaches = tuple(self.model.contact.approaches)
                present = State(fraction, self.model.fields.copy(), approaches, energy=self.model.energy())
                self._borrowed = self._borrowed or predicted is not None
                if record.augmented:  # the next state is extrapolated without multipliers
                    present = _penalised(present, self.source)
                self.history = [*self.history[-1:], present]
                predicted, step = None, GROWTH * step
                if fraction != goal and abs(fraction) <= known:
                    spent = record.newton_iterations, record.tangents, record.augmentation_iterations
                    continue
                spent = 0, 0, 0
                yield record

    def distorted(self) -> Distortion:
        """Return the distortion of the present state (collective)."""
        model = self.model
        axes = [ball.position for ball in model.contact.balls]
        return distortion(model.space, model.nodal, self._top, axes, model.mirrors)

    def film(self) -> float:
        """Return the smallest share of the layer's thickness left under a ball in the present state (collective)."""
        model, contact = self.model, self.model.contact
        axes = [ball.position for ball in contact.balls]
        return film_left(model.space, model.nodal, axes, contact.approaches, self.problem.layer.thickness)

    @property
    def last(self) -> State:
        """The last state of the path, initially the undeformed one."""
        nowhere = (0.0,) * len(self.model.contact.balls)
        return self.history[-1] if self.history else State(0.0, self._undeformed, nowhere, energy=0.0)

    def resume(self, history: Sequence[State]) -> None:
        """Resume from the last states of an earlier run."""
        self.history = [_penalised(s, s.source) if s.source else s for s in history][-2:]
        self._borrowed = bool(self.history)
        self._restore()

    def augment(self, record: StepRecord) -> bool:
        """Add multipliers to the present equilibrium and solve again; return whether an equilibrium was found near it.

        Nothing is done if it has multipliers. They are added at once with stiffer penalties, else gradually. If neither
        finds an equilibrium, the model returns to the state without multipliers, with the stiffest penalties reached.
        """
        if not record.augmented:
            with suppress(NotConverged):
                self._multiply(self.source, record)
        doublings = DOUBLINGS + round(math.log2(self.stiffer))
        if not record.augmented:
            self._set(self.last.values, self.last.approaches)  # Newton's method may have ended elsewhere
            with suppress(NotConverged):
                self._multiply(self.source, record, gradually=True)
                self.stiffen(record, 2.0, doublings)
        if not record.augmented:
            self._restore()
            self._newton(record)
            self.stiffen(record, 2.0, doublings)
        return record.augmented

    def stiffen(self, record: StepRecord, factor: float, times: int, wanted: Callable[[], bool] = lambda: True) -> int:
        """Multiply the penalties of an equilibrium by a factor, while ``wanted``; return how often (collective).

        If Newton's method fails, the previous state is kept. The multipliers do not change. The residual ends exact.
        """
        first, taken = self._kept(record), 0
        try:
            while taken < times and wanted():
                kept = self._kept(record)
                self.model.contact.stiffen(factor)
                try:
                    self._newton(record, PASSING, keeps=True)
                except NotConverged:
                    self._return_to(kept, record, factor)
                    break
                taken += 1
            if taken or self.is_rough:
                self._newton(record, keeps=True)
        except NotConverged:
            self._return_to(first, record, factor**taken)
            if self.is_rough:
                self._newton(record)
            return 0
        return taken

    def _kept(self, record: StepRecord) -> tuple[Values, np.ndarray, float, float]:
        return self.model.fields.copy(), self.model.contact.approaches, record.residual, self.solver.tolerance

    def _return_to(self, kept: tuple[Values, np.ndarray, float, float], record: StepRecord, stiffened: float) -> None:
        values, approaches, record.residual, self.solver.tolerance = kept
        self.model.contact.stiffen(1.0 / stiffened)
        self._set(values, approaches)

    def _set(self, values: Values, approaches: Sequence[float] | np.ndarray) -> None:
        self.model.fields.restore(values)
        self.model.contact.set_approaches(np.array(approaches))

    def _solve(self, fraction: float, start: State, record: StepRecord) -> None:
        contact = self.model.contact
        contact.forget_multipliers()
        free = self.control.moves.any(axis=1)
        self._set(start.values, np.where(free, start.approaches, self.control.approaches(fraction)))
        if start.source is not None:
            self._multiply(start.source, record)
        else:
            self.ahead = 1.0
            self._set_penalties()
            self._newton(record, ROUGH)
            work = float(self.model.part_forces() @ (contact.approaches - np.array(self.last.approaches)))
            if self.model.energy() - self.last.energy > work + SURPLUS * abs(work):
                raise NotConverged("the equilibrium stores more energy than the balls' work: its surface is crumpled")
            self.source = contact.penalised

    def _multiply(self, source: Penalised, record: StepRecord, gradually: bool = False) -> None:
        """Find the equilibrium near the present state with the multipliers of another one, or of this one."""
        model, contact = self.model, self.model.contact
        start, approaches = model.fields.copy(), contact.approaches
        contact.augment(source, 1.0 if gradually else self.stiffer * self.ahead * STIFFENING)
        self._set((source.displacement, *start[1:]), source.approaches)
        before = model.forces()[:, 2]
        if source is self.source and not gradually:  # it starts there, with 1 + STIFFENING times the contact pressure
            self.solver.prepare()
        self._set(start, approaches)
        for _ in range(PARTS - 1 if gradually else 0):
            contact.close_gaps(1.0 / PARTS)
            self._newton(record, ROUGH)
        contact.close_gaps(1.0 / PARTS if gradually else 1.0)
        self._newton(record, PASSING if self.is_rough else None)
        moved = np.abs(model.forces()[:, 2] - before) / np.maximum(before, 0.1 * before.max())
        if moved.max() > SPURIOUS:
            raise NotConverged("the equilibrium found has other normal forces than the state that it started from")
        self.source, record.augmented = source, True

    def _set_penalties(self) -> None:
        contact = self.model.contact
        contact.set_penalties(penalties(self.problem, contact.balls, contact.approaches))
        contact.turning.value = float(not is_stable(self.problem, contact.balls, contact.approaches))

    def _newton(self, record: StepRecord, residual: float | None = None, keeps: bool = False) -> None:
        """Find equilibrium; ``keeps``: begin with the last tangent, which is near enough. Raises `NotConverged`."""
        pressed = zip(self.model.contact.balls, self.model.contact.approaches, strict=True)
        scale = max(alone(self.problem, ball, approach=a).normal_force for ball, a in pressed)
        self.solver.solve(residual or self.residual, scale, record, keeps)
        # the residual alone does not detect elements that are turned inside out
        turned = self.model.is_finite and self.distorted().smallest_volume_ratio <= 0.0
        if turned or not math.isfinite(self.model.energy()):
            raise NotConverged("the equilibrium found has elements turned inside out")
        if not np.max(self.model.forces()[:, 2]) > 0.0:
            raise NotConverged("no ball touches the layer in the equilibrium found")

    def _extrapolated(self, fraction: float, cuts: int) -> State:
        """Return the initial state: extrapolated from the last two; at every second cut-back, the last state."""
        last = self.last
        if not self.history:
            return replace(last, approaches=tuple(self.control.approaches(fraction)))
        if len(self.history) < 2 or cuts % 2:
            return last
        before = self.history[-2]
        ratio = (fraction - last.fraction) / (last.fraction - before.fraction)
        values = tuple(new + ratio * (new - old) for new, old in zip(last.values, before.values, strict=True))
        ahead = np.array(last.approaches) + ratio * (np.array(last.approaches) - np.array(before.approaches))
        self._set(values, ahead)
        return State(fraction, values, tuple(ahead)) if math.isfinite(self.model.energy()) else last

    def _restore(self) -> None:
        self.model.contact.forget_multipliers()
        self._set(self.last.values, self.last.approaches)
        if self.history:
            self._set_penalties()


def _penalised(state: State, source: Penalised) -> State:
    """Return the state before its multipliers were added: its penetration holds the contact pressure."""
    values = (source.displacement, *state.values[1:])
    return replace(state, values=values, approaches=tuple(source.approaches), source=None)
