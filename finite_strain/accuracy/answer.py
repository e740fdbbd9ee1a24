"""The answer at a load step: from the finest discretisation, its small-strain pair, and the error budget.

The answer at the last load step gives the accuracy that the discretisation has reached.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from finite_strain.accuracy.error_budget import TERMS, discretisation, enforcement, remaining, transfer
from finite_strain.accuracy.pairs import MEASURED, LinearTruth, Paired, missed, paired, pressed, ratio, unpaired, unsure
from finite_strain.force.distortion import is_resolved
from finite_strain.geometry.estimates import body_of, steepest
from finite_strain.geometry.extent import scale_of_force
from finite_strain.geometry.load_control import prescribed
from finite_strain.planning.records import Answer, ContactState, Record, Row, SolverAccount
from finite_strain.planning.run_plan import ENOUGH, RunPlan
from linear_bem.errors import ThirdBodyError
from linear_bem.problem import Load, Problem
from linear_bem.result import BallResult
from linear_bem.solver import solve

UNSURE = ("transfer", "force_transfer", *MEASURED.values())
LINEAR_ACCURACY = 0.03
"""Accuracy requested from linear_bem over that requested from the run."""
FAINT = 1e-3
"""Q over the largest, below which a ball has no rate dD / dQ of its own."""
LEAST, MOST = 1.5, 3.0
"""d ln Q / d ln D of a Hertzian contact, and of an incompressible film much thinner than the ball is wide."""


class Answers:
    """Turns results of discretisations into answers for the balls of the scene, step by step along a load path.

    ``records`` are two discretisations, the finer one last.
    """

    def __init__(self, plan: RunPlan, records: Sequence[Record]) -> None:
        self.plan, self.fine, self.coarse = plan, records[-1], records[-2]
        load = prescribed(plan.problem)
        self.forces_given, self.follows = load.forces_given, load.follows

    def truth(self, fraction: float) -> LinearTruth | str:
        """Return the result of `linear_bem` at a load fraction, or the message why there is none (one rank).

        The message is empty for a body with free sides, which `linear_bem` does not support.
        """
        plan, problem = self.plan, self.plan.problem
        if plan.has_free_sides:
            return ""
        part = Load(problem.load.kind, tuple(fraction * value for value in problem.load.values))
        linear = Problem(problem.layer, problem.balls, part, problem.substrate)
        try:
            balls = solve(linear, max(min(LINEAR_ACCURACY * plan.accuracy, 1e-3), 1e-6)).balls
        except ThirdBodyError as error:
            return str(error)
        chosen = [(ball.index, balls[ball.index]) for ball in plan.reduction.balls]
        names = ("normal_force", "approach", *MEASURED)
        return LinearTruth(
            tangential_force=np.array([plan.reduction.to_model(i, ball.tangential_force) for i, ball in chosen]),
            error=np.array([ball.tangential_force_error for _, ball in chosen]),
            **{name: np.array([getattr(ball, name) for _, ball in chosen]) for name in names},
            **{f"{name}_error": np.array([ball.errors[name] for _, ball in chosen]) for name in MEASURED},
        )

    def answer(self, step: int, account: SolverAccount, said: LinearTruth | str) -> Answer:
        """Return the answer at load step number ``step``; ``said`` is the value returned by `truth`."""
        truth = None if isinstance(said, str) else said
        fine, now, before = self._at(account.fraction, truth)
        share = enforcement(fine.own, fine.small, now.weight, account.augmented)
        solver = np.full(len(share), account.tolerance) + (0.0 if truth is None else truth.error)
        size, squared = np.linalg.norm(now.tangential_force, axis=1), pressed(now, before, "normal_force") ** 2
        none, follows = np.zeros_like(size), pressed(now, before, self.follows)
        apart, moved, pulled, parted, remains = self._changed(account.fraction, now, before, truth)
        now = replace(now, force_transfer=np.maximum(now.force_transfer, remains))
        unsure_pull, unsure_force = squared * now.transfer, self._unsure_force(fine, now, truth)
        at_force = np.array([squared * apart, none, unsure_pull, solver])
        both = np.hypot(unsure_pull, 2.0 * size * unsure_force)
        if not self.plan.is_paired:  # known errors of T / Q^2 and Q, which may have one sign
            both = (size + unsure_pull) * (1.0 + unsure_force) ** 2 - size
        missed_force, missed_pull = missed(fine, truth)
        enforced = none if self.forces_given else 2.0 * MOST * size * share
        terms = np.array([squared * pulled, enforced, both + missed_pull, solver])
        if self.forces_given:
            left, load = share, now.normal_force
            rate = follows / (LEAST * np.maximum(load, max(FAINT * load.max(), 1e-300)))
        else:
            left, rate = MOST * share, np.ones_like(size)
        uncertain = np.abs(follows) * now.force_transfer + (none if self.forces_given else missed_force)
        other = np.array([follows * moved, np.abs(follows) * left, uncertain, account.tolerance * rate])
        pull, raw = now.tangential_force.copy(), _total(terms)
        imbalance, doubt = self._imbalance(pull, raw)
        worst = self._worst(raw)
        if worst is not None:
            pull[worst] -= pull.sum(axis=0)
            terms, at_force = _others_at(worst, terms), _others_at(worst, at_force)
        counts = _scale(self.plan, self._per_ball(now.normal_force), self._per_ball(np.linalg.norm(pull, axis=1))) > 0.0
        shown, through = doubt * terms if counts else other, {self.follows: _total(other)}
        if self.plan.problem.load.kind == "total_force":
            parts = pressed(now, before, "normal_force") * np.hypot(parted, unsure_force)
            through["normal_force"] = parts + missed_force
        through |= self._errors_of_contact(account.fraction, now, before, truth)
        return Answer(
            **vars(account), balls=self._balls(fine.own, now, pull, doubt * _total(terms), through), step=step,
            linear_failure=said if isinstance(said, str) else "",
            error_terms={n: self._per_ball(term) for n, term in zip(TERMS, shown, strict=True)},
            pair_weight=self._per_ball(now.weight), imbalance=imbalance,
            imbalance_error=sum(self._per_ball(raw)),
            normal_force_error=self._per_ball(through.get("normal_force", none)),
            approach_error=self._per_ball(through.get("approach", none)),
            tangential_force_error_at_force=self._per_ball(doubt * _total(at_force)),
        )  # fmt: skip

    def _unsure_force(self, fine: Row, now: Paired, truth: LinearTruth | None) -> np.ndarray:
        """Return the uncertain part of Q (balls,), relative; under forces the known error of Q at small strain."""
        small = fine.small if self.plan.is_paired else fine.own
        if not self.forces_given:
            return now.force_transfer
        if truth is None or small is None:
            return np.zeros_like(now.normal_force)
        return np.abs(ratio(truth.normal_force, small.normal_force, empty=1.0) - 1.0)

    def _at(self, fraction: float, truth: LinearTruth | None) -> tuple[Row, Paired, Paired]:
        """Return the row of the finer discretisation, and the paired answers of the finer and of the coarser one."""
        fine, coarse = self.fine.at(fraction), self.coarse.at(fraction)
        assert fine is not None and coarse is not None  # noqa: PT018
        now, before = self._paired(fine, truth), self._paired(coarse, truth)
        if self.plan.is_paired:
            levels = self.fine.level, self.coarse.level
            now = replace(now, **{n: transfer(getattr(now, n), getattr(before, n), *levels) for n in UNSURE})
        return fine, now, before

    def _balls(
        self, own: ContactState, now: Paired, pull: np.ndarray, error: np.ndarray, through: Mapping[str, np.ndarray]
    ) -> tuple[BallResult, ...]:
        """Return the state of every ball of the scene.

        ``pull`` (balls, 2) [N] is T, ``error`` (balls,) [N] its error; ``through`` has the errors (balls,) of other
        results, first that of the force [N] or approach [m] that is not prescribed.
        """
        reduction = self.plan.reduction
        routes = {
            "domain": now.tangential_force, "domain_without_pair": own.tangential_force,
            "traction": own.traction_force,
        }  # fmt: skip
        balls = []
        for index, (image, ball) in enumerate(zip(reduction.images, self.plan.problem.balls, strict=True)):
            b = image.model_ball
            force, *others = (
                reduction.to_scene(index, (float(v[b, 0]), float(v[b, 1]))) for v in (pull, *routes.values())
            )
            x, y, radius = map(float, (*ball.position, ball.radius))  # whole numbers of numpy are not written as JSON
            balls.append(BallResult(
                (x, y), radius, float(now.approach[b]), float(now.normal_force[b]), force, float(error[b]),
                float(now.peak_pressure[b]), float(now.contact_area[b]), dict(zip(routes, others, strict=True)),
                {name: float(off[b]) for name, off in through.items()},
            ))  # fmt: skip
        return tuple(balls)

    def _paired(self, row: Row, truth: LinearTruth | None) -> Paired:
        if truth is None or (self.plan.is_paired and row.small is None):
            return unpaired(row.own)
        attraction = scale_of_force(self.plan.problem, np.array(self._per_ball(row.own.normal_force)))
        near_zero = attraction or math.inf  # where one ball alone presses, T is an error and must not weigh the pair
        scale = near_zero / np.maximum(row.own.normal_force**2, 1e-300)
        if row.small is not None:
            return paired(row.own, row.small, truth, scale, self.forces_given, unsure(self._steepest(row.own)))
        # the small-strain model itself: its error is known
        known = paired(row.own, row.own, truth, scale, self.forces_given, 1.0)
        return replace(unpaired(row.own), **{name: getattr(known, name) for name in UNSURE})

    def _steepest(self, own: ContactState) -> float:
        """Return the largest slope of an indenter at the edge of its contact; at least the root of D / h."""
        layer, found = self.plan.problem.layer, 0.0
        for place, each in enumerate(self.plan.reduction.balls):
            aside = steepest(body_of(each), math.sqrt(own.contact_area[place] / math.pi))
            found = max(found, aside, math.sqrt(max(own.approach[place], 0.0) / layer.thickness))
        return found

    def compare(self, fraction: float, said: LinearTruth | str) -> None:
        """Store the changes from the coarser discretisation at a load without an answer; see `answer`."""
        truth = None if isinstance(said, str) else said
        for changes in (self._changed, self._errors_of_contact):
            changes(fraction, *self._at(fraction, truth)[1:], truth)

    def _changed(
        self, fraction: float, now: Paired, before: Paired, truth: LinearTruth | None
    ) -> tuple[np.ndarray, ...]:
        """Return the discretisation errors (balls,) of T / Q^2 [1/N], of the force or approach, of T over Q^2, of Q.

        The last are the errors of the force or approach that may remain after pairing. Those of forces and approaches
        are relative. T has a change of its own, because T / Q^2 and Q change together.
        """
        force, follows = (pressed(now, before, name) for name in ("normal_force", self.follows))
        values = {
            "ratio": now.per_squared_force - before.per_squared_force,
            "T": ratio(now.tangential_force - before.tangential_force, force[:, None] ** 2),
            "follows": ratio(getattr(now, self.follows) - getattr(before, self.follows), follows),
            "parts": ratio(now.normal_force - before.normal_force, force),
        }
        if truth is not None and not self.plan.is_paired:  # the error is known
            values = {name: np.zeros_like(value) for name, value in values.items()}
        known = self._nearby("known", fraction, np.array([now.known, before.known]), with_line=False)
        near = self._nearby("follows", fraction, values["follows"], with_line=False)
        known = known if len(known) == len(near) else []  # where no pair is missing
        of_ratio, of_follows = ([errors[..., part] for errors in known] for part in (slice(2), slice(2, None)))
        apart, pulled = (self._change(name, fraction, values[name], of_ratio) for name in ("ratio", "T"))
        moved = self._change("follows", fraction, values["follows"], of_follows)
        parted = self._change("parts", fraction, values["parts"]) if self.forces_given else moved
        if len(known) < ENOUGH:  # T may have changed little by chance, where its factors changed oppositely
            pulled = np.maximum(pulled, np.hypot(apart, 2.0 * np.linalg.norm(now.per_squared_force, axis=1) * parted))
        return apart, moved, pulled, parted, remaining(near, of_follows) if known else np.zeros_like(moved)

    def _errors_of_contact(
        self, fraction: float, now: Paired, before: Paired, truth: LinearTruth | None
    ) -> dict[str, np.ndarray]:
        """Return the errors (balls,) of contact areas [m^2] and peak pressures [Pa]; store changes like `_changed`."""
        errors = {}
        for name, left in MEASURED.items():
            value, (known, unseen) = pressed(now, before, name), np.zeros((2, len(now.approach)))
            change = ratio(np.abs(getattr(now, name) - getattr(before, name)), value)
            if truth is not None:
                change = change * self.plan.is_paired  # else the error is known
                known = ratio(getattr(truth, f"{name}_error"), getattr(truth, name))
                unseen = getattr(truth, name) * (value <= 0.0)
            errors[name] = value * (np.hypot(self._change(name, fraction, change), getattr(now, left)) + known) + unseen
        return errors

    def _change(self, name: str, fraction: float, change: np.ndarray, known: Sequence[np.ndarray] = ()) -> np.ndarray:
        """Return the discretisation error (balls,) from the changes at nearby loads; store this one for the others."""
        return discretisation(self._nearby(name, fraction, change), self.fine.level, self.coarse.level, known)

    def _nearby(self, name: str, fraction: float, value: np.ndarray, with_line: bool = True) -> list[np.ndarray]:
        """Return the values at those nearby loads where they are known; store this one for the others.

        Nearby are smaller loads and, if these are fewer than `ENOUGH`, the next larger ones already solved. If not, the
        line through the values at the loads on both sides of this one counts too: changes oscillate along the load, so
        smaller loads alone do not show an amplitude that grows.
        """
        path = self.fine.changes.setdefault(name, [])
        loads = [row.own.fraction for row in self.fine.rows]
        place, nearby = loads.index(fraction), self.plan.nearby
        path += [(np.nan * value).tolist()] * (place + 1 - len(path))
        if not np.isfinite(path[place]).all():  # also where a load was saved without this one
            path[place] = value.tolist()
        first = next(i for i, load in enumerate(loads) if load >= nearby * fraction)
        later = [i for i in range(place + 1, len(path)) if nearby * loads[i] <= fraction]
        near = [*range(first, place + 1), *later[: max(0, ENOUGH - (place + 1 - first))]]
        values = [np.array(path[i]) for i in near]
        if with_line and later and later[0] not in near:
            share = (fraction - loads[place - 1]) / (loads[later[0]] - loads[place - 1])
            values.append((1.0 - share) * np.array(path[place - 1]) + share * np.array(path[later[0]]))
        return [each for each in values if np.isfinite(each).all()]

    def _imbalance(self, forces: np.ndarray, error: np.ndarray) -> tuple[float, float]:
        """Return the size of the sum of T (balls, 2) [N] over the scene, and the factor on all errors (balls,) from it.

        An infinite layer is homogeneous, so the exact sum is zero; in many scenes symmetry enforces this. Free sides
        may push the balls: then the factor is 1.
        """
        reduction = self.plan.reduction
        turned = [reduction.to_scene(i, tuple(forces[im.model_ball])) for i, im in enumerate(reduction.images)]
        imbalance, allowed = math.hypot(*np.sum(turned, axis=0)), sum(self._per_ball(error))
        is_known = allowed > 0.0 and not self.plan.has_free_sides
        return imbalance, math.hypot(1.0, imbalance / allowed) if is_known else 1.0

    def _worst(self, error: np.ndarray) -> int | None:
        """Return the ball whose T is more accurate as minus the sum of the others', by the errors (balls,), or None."""
        if self.plan.has_free_sides:
            return None
        mirrored = len(self.plan.problem.balls) > len(error)
        worst = int(np.argmax(error))
        return worst if len(error) > 1 and not mirrored and 2.0 * error[worst] > error.sum() else None

    def _per_ball(self, values: np.ndarray) -> list[float]:
        return [float(values[image.model_ball]) for image in self.plan.reduction.images]


def judge(plan: RunPlan, record: Record) -> None:
    """Record the accuracy at the last step: the largest error of a ball's T over the scale, and its terms."""
    if not record.steps:
        return
    last = record.steps[-1]
    if plan.is_hyperelastic:
        record.resolved = is_resolved(last.smallest_volume_ratio, last.film)
    pulls = [math.hypot(*ball.tangential_force) for ball in last.balls]
    record.scale = _scale(plan, [ball.normal_force for ball in last.balls], pulls)
    known = [(ball.tangential_force_error, record.scale) for ball in last.balls]
    if record.scale == 0.0:  # without mutual forces the force or approach that was not given counts
        name = prescribed(plan.problem).follows
        known = [(ball.errors[name], getattr(ball, name)) for ball in last.balls]
    shares = [error / size if size > 0.0 else 0.0 for error, size in known]
    worst = int(np.argmax(shares))
    record.reached, size = shares[worst], known[worst][1]
    record.terms = {name: values[worst] / size for name, values in last.error_terms.items() if size > 0.0}
    if last.fraction < plan.goals[-1]:
        record.reached = math.inf


def _scale(plan: RunPlan, forces: Sequence[float], pulls: Sequence[float]) -> float:
    """Return the force [N] to which errors of T refer, from Q and |T| (balls,) [N].

    It is 0 where T can only be an error: for a single ball and, unless sides are free, where only one ball presses.
    """
    attraction = scale_of_force(plan.problem, np.array(forces))
    counts = attraction > 0.0 or (plan.has_free_sides and plan.problem.size > 1)
    return max(*pulls, attraction) if counts else 0.0


def _total(terms: np.ndarray) -> np.ndarray:
    """Return the root of the sum of squares (balls,) of error terms (terms, balls)."""
    return np.asarray(np.linalg.norm(terms, axis=0))


def _others_at(worst: int, terms: np.ndarray) -> np.ndarray:
    """Return error terms (terms, balls) of T in which those of one ball are the sums of the others'."""
    return np.where(np.arange(terms.shape[1]) == worst, terms.sum(axis=1, keepdims=True) - terms, terms)
