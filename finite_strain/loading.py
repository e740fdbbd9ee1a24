"""The load path: steps from first touch to full load, with predictor, cut-back, augmentation and force control."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from finite_strain.domain import LEAST_SHARE
from finite_strain.fields import Values
from finite_strain.model import Model
from finite_strain.newton import NewtonSolver
from finite_strain.penalty import Penalties
from linear_bem.closed_forms import Indentation, indentation_of_layer
from linear_bem.errors import NotConverged
from linear_bem.problem import Problem

RESIDUAL = 1e-9
"""Residual norm over the normal force at which Newton's method stops."""
INDENTATION_CHANGE = 0.05
"""Relative change of force times approach by an augmentation at which the contact counts as resolved.

The next augmentation would change it by about a fortieth of that.
"""
MAX_AUGMENTATIONS = 3
STIFFER = 4.0
"""How much stiffer the penalty is made where no equilibrium is found with multipliers."""
MAX_FORCE_ITERATIONS = 12
MAX_CUTS = 8
SPURIOUS = 0.3
"""An augmentation that changes a normal force by more than this part has left the solution branch."""


@dataclass
class StepRecord:
    """What one load step took: fraction of the full load, Newton iterations, augmentations, cut-backs.

    ``unresolved`` is by how much of its size the force (or the approach) was extrapolated to a rigid contact
    because no equilibrium was found with multipliers; 0 elsewhere.
    """

    fraction: float
    newton_iterations: int = 0
    augmentations: int = 0
    force_iterations: int = 0
    cuts: int = 0
    residual: float = math.nan
    unresolved: float = 0.0
    normal_forces: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class State:
    """A converged state that can be returned to: values of the model's fields, approaches [m], forces [N].

    ``penalised`` are the fields before the first augmentation, from which the next are predicted.
    """

    fraction: float
    values: Values
    penalised: Values
    approaches: tuple[float, ...]
    forces: tuple[float, ...]


class LoadPath:
    """Drives a model along its load; iterate over `steps` to get it in equilibrium at each load fraction."""

    def __init__(
        self,
        problem: Problem,
        model: Model,
        solver: NewtonSolver,
        attempt: Callable[[float, int], None] = lambda _fraction, _cuts: None,
        before_augmentation: Callable[[], None] = lambda: None,
    ) -> None:
        self.problem = problem
        self.model = model
        self.solver = solver
        self._attempt, self._before_augmentation = attempt, before_augmentation
        self.balls = model.reduction.balls
        self.penalties = Penalties(problem, model)
        values = problem.load.values
        self.targets = [values[0] if len(values) == 1 else values[ball.index] for ball in self.balls]
        counts = [sum(image.model_ball == b for image in model.reduction.images) for b in range(len(self.balls))]
        self.counts = np.array(counts)
        self.history: list[State] = []
        self._penalised = model.fields.copy()

    def steps(self, fractions: list[float]) -> Iterator[StepRecord]:
        """Yield after each converged step; all fractions are met in turn, with smaller steps where needed.

        They may fall as well as rise: unloading. Those that an earlier run has passed are not met again.
        """
        cuts = 0
        for goal in self._ahead(fractions):
            while not self.history or abs(self.history[-1].fraction - goal) > 1e-12 * goal:
                reached = self.history[-1].fraction if self.history else 0.0
                fraction = goal if cuts == 0 else reached + (goal - reached) * 0.5**cuts
                self._attempt(fraction, cuts)
                record = StepRecord(fraction, cuts=cuts)
                try:
                    self._solve(fraction, record, predict=cuts == 0)
                except NotConverged as error:
                    cuts += 1
                    self._restore()
                    if cuts > MAX_CUTS:
                        raise NotConverged(
                            f"load step to {fraction:.4g} of the full load: {error} after {MAX_CUTS} cut-backs; "
                            f"the last good state is at {reached:.4g} of the full load"
                        ) from error
                    continue
                self._remember(fraction, record)
                cuts = max(cuts - 1, 0)
                yield record

    def _ahead(self, fractions: list[float]) -> list[float]:
        if not self.history:
            return fractions
        reached = self.history[-1].fraction
        return fractions[next((i for i, f in enumerate(fractions) if f > reached * (1.0 + 1e-12)), len(fractions)) :]

    def resume(self, history: list[State]) -> None:
        """Go on from the last states of an earlier run."""
        self.history = list(history)
        self._restore()

    def _solve(self, fraction: float, record: StepRecord, predict: bool) -> None:
        for contact in self.model.contacts:
            contact.multiplier[:] = 0.0
        self._set_approaches(self._first_guess(fraction))
        if predict:
            self._extrapolate(fraction)
        self._newton(record)
        before = np.full(len(self.balls), math.inf)
        while True:
            forces = self._control_force(fraction, record)
            # what is prescribed does not change, so forces tell under a given approach, approaches under a given force
            now = forces * np.array([contact.approach for contact in self.model.contacts])
            changed = np.max(np.abs(now - before) / np.maximum(now, 1e-3 * now.max()))
            if changed < INDENTATION_CHANGE or record.augmentations == MAX_AUGMENTATIONS:
                record.normal_forces = [float(f) for f in forces]
                return
            before = now
            if record.augmentations == 0:
                self._penalised = self.model.fields.copy()
                self._before_augmentation()
                softer = forces, self._approaches()
            if not self._augment(record, forces):
                self._stiffen(fraction, record, *softer)
                return

    def _augment(self, record: StepRecord, forces: np.ndarray) -> bool:
        """Move the multipliers and find equilibrium again; tell if one was found next to the one before."""
        for contact in self.model.contacts:
            contact.augment(self.model.nodal)
        record.augmentations += 1
        try:
            moved = np.abs(self._newton(record) - forces) / np.maximum(forces, 0.1 * forces.max())
        except NotConverged:
            return False
        return bool(np.max(moved) <= SPURIOUS)

    def _stiffen(self, fraction: float, record: StepRecord, forces: np.ndarray, approaches: np.ndarray) -> None:
        """Resolve the contact by a stiffer penalty instead of multipliers, and extrapolate what is not prescribed.

        The penetration, and with it the error of forces and approaches, is inversely proportional to the penalty.
        """
        for contact in self.model.contacts:
            contact.multiplier[:] = 0.0
            contact.penalty *= STIFFER
        self.model.fields.restore(self._penalised)
        self._newton(record)
        forces = np.array([self._control_force(fraction, record), forces])
        approaches = np.array([self._approaches(), approaches])
        shares = []
        for stiffer, softer in (forces, approaches):
            change = (stiffer - softer) / (STIFFER - 1.0)
            shares.append(np.max(np.abs(change) / np.maximum(np.abs(stiffer), 1e-3 * np.abs(stiffer).max())))
            stiffer[:] += change
        record.augmentations, record.unresolved = 0, float(max(shares))
        record.normal_forces = forces[0].tolist()
        for contact, approach in zip(self.model.contacts, approaches[0], strict=True):
            contact.approach = float(approach)

    def _approaches(self) -> np.ndarray:
        return np.array([contact.approach for contact in self.model.contacts])

    def _newton(self, record: StepRecord) -> np.ndarray:
        scale = max(self._expected_force(contact.approach, b) for b, contact in enumerate(self.model.contacts))
        done = self.solver.solve(RESIDUAL * scale)
        record.newton_iterations += done.iterations
        record.residual = done.residual
        if not math.isfinite(self.model.energy()):  # the residual alone does not see it
            raise NotConverged("the equilibrium found has elements turned inside out")
        forces = self.normal_forces()
        if not np.max(forces) > 0.0:
            raise NotConverged("no ball touches the layer in the equilibrium found")
        return forces

    def normal_forces(self) -> np.ndarray:
        """Return the normal force [N] on every ball of the model, whole balls (collective)."""
        local = [
            c.force(self.model.nodal)[2] * ball.copies for c, ball in zip(self.model.contacts, self.balls, strict=True)
        ]
        return np.array(self.model.comm.allreduce(np.array(local), op=MPI.SUM))

    def _control_force(self, fraction: float, record: StepRecord) -> np.ndarray:
        """Move the approaches until the prescribed forces are met; return the forces."""
        forces = self.normal_forces()
        kind = self.problem.load.kind
        if kind == "approach":
            return forces
        target = fraction * np.array(self.targets)
        for _ in range(MAX_FORCE_ITERATIONS):
            excess = np.array([forces @ self.counts - target[0]]) if kind == "total_force" else forces - target
            if np.max(np.abs(excess)) <= 1e-7 * np.max(target):
                return forces
            stiffness = self._stiffness()
            approaches = np.array([c.approach for c in self.model.contacts])
            if kind == "total_force":
                move = np.full(len(forces), -excess[0] / (self.counts @ stiffness.sum(axis=1)))
            else:
                move = np.linalg.solve(stiffness, -excess)
            limit = 0.3 * np.max(approaches)
            self._set_approaches(approaches + np.clip(move, -limit, limit))
            record.force_iterations += 1
            forces = self._newton(record)
        raise NotConverged(f"prescribed force not met after {MAX_FORCE_ITERATIONS} iterations on the approach")

    def _stiffness(self) -> np.ndarray:
        """Return dQ_i/dD_j [N/m] of the model's balls at the present equilibrium, by linearisation."""
        model, count = self.model, len(self.balls)
        copies = np.array([ball.copies for ball in self.balls])
        columns, responses = list[PETSc.Vec](), list[PETSc.Vec]()
        for contact in model.contacts:
            column, response = self.solver.new_vector(), self.solver.new_vector()
            model.approach_derivative([contact], column)
            self.solver.solve_linear(column, response, refactor=not responses)
            columns.append(column)
            responses.append(response)
        local = [contact.stiffness(model.nodal) for contact in model.contacts]
        own = np.array(model.comm.allreduce(np.array(local), op=MPI.SUM))
        coupled = np.array([[columns[i].dot(responses[j]) for j in range(count)] for i in range(count)])
        for vector in (*columns, *responses):
            vector.destroy()
        return copies[:, None] * (np.diag(own) - coupled)

    def _set_approaches(self, approaches: np.ndarray | list[float]) -> None:
        """Move the balls and fit each penalty to its contact, but for no ball to a mere touch."""
        deepest = max(approaches)
        for ball, (contact, approach) in enumerate(zip(self.model.contacts, approaches, strict=True)):
            contact.approach = float(approach)
            contact.penalty = self.penalties.at(ball, max(contact.approach, LEAST_SHARE * deepest))

    def _indentation(self, approach: float, radius: float) -> Indentation:
        return indentation_of_layer(self.problem.layer, self.problem.substrate, radius, approach=approach)

    def _expected_force(self, approach: float, ball: int) -> float:
        return self._indentation(approach, self.balls[ball].radius).normal_force if approach > 0.0 else 0.0

    def _first_guess(self, fraction: float) -> list[float]:
        """Return the approaches to try at a load fraction: prescribed, or extrapolated from the path so far."""
        if self.problem.load.kind == "approach":
            return [fraction * target for target in self.targets]
        if not self.history:
            share = fraction / self.counts.sum() if self.problem.load.kind == "total_force" else fraction
            layer, substrate = self.problem.layer, self.problem.substrate
            guesses = [
                indentation_of_layer(layer, substrate, ball.radius, normal_force=share * target).approach
                for ball, target in zip(self.balls, self.targets, strict=True)
            ]
            common = sum(guesses) / len(guesses)
            return [common] * len(guesses) if self.problem.load.kind == "total_force" else guesses
        last = self.history[-1]
        if len(self.history) < 2:
            return [d * (fraction / last.fraction) ** (2.0 / 3.0) for d in last.approaches]
        before = self.history[-2]
        guesses = []
        for d0, d1 in zip(before.approaches, last.approaches, strict=True):
            if min(d0, d1) > 0.0:
                exponent = math.log(d1 / d0) / math.log(last.fraction / before.fraction)
                guesses.append(d1 * (fraction / last.fraction) ** exponent)
            else:  # a neighbour's bulge lifts this ball
                slope = (d1 - d0) / (last.fraction - before.fraction)
                guesses.append(d1 + slope * (fraction - last.fraction))
        return guesses

    def _extrapolate(self, fraction: float) -> None:
        if len(self.history) < 2:
            return
        before, last = self.history[-2:]
        ratio = (fraction - last.fraction) / (last.fraction - before.fraction)
        pairs = zip(last.penalised, before.penalised, strict=True)
        self.model.fields.restore(tuple(new + ratio * (new - old) for new, old in pairs))
        if not math.isfinite(self.model.energy()):
            self.model.fields.restore(last.penalised)

    def _remember(self, fraction: float, record: StepRecord) -> None:
        state = State(
            fraction,
            self.model.fields.copy(),
            self._penalised,
            tuple(contact.approach for contact in self.model.contacts),
            tuple(record.normal_forces),
        )
        self.history = [*self.history[-1:], state]

    def _restore(self) -> None:
        if not self.history:
            self.model.fields.clear()
            return
        last = self.history[-1]
        # the next try begins without multipliers, and so must its start
        self.model.fields.restore(last.penalised)
        self._set_approaches(list(last.approaches))
