"""The outcome of an evolution: rest or not, the nearest equilibrium, errors of positions and of forces.

`results` computes one after the other what takes time; what is saved is used again.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import NotConverged, TooLarge, UnsupportedProblem
from linear_bem.problem import Periodic, Problem
from linear_bem.touching import nearest_distances
from runs.display.numbers import count
from runs.evolution import equilibria
from runs.evolution.drift import PUSHING, Drift, Moment
from runs.evolution.forces import Forces
from runs.evolution.hard_balls import HardBalls, resistances
from runs.evolution.pair_forces import PairForces
from runs.evolution.providers import DIRECT_ACCURACY, MEASURED, Provider
from runs.process.json_values import Document
from runs.scene.units import Unit
from runs.session.session import Session

KEYS = ("direct_check", "balls", "position_error", "equilibrium", "pair_equilibria")
"""Results that take time; an unfinished document has those that are known."""
COARSER = 10.0
"""Tolerance of a second run over that of the first; their difference is the error of the positions."""
NAMED = 3
"""Sizes of clusters that are named, the largest."""
FURTHEST = 12.0
"""Distance over the touching distance up to which equilibria of a pair are sought."""


def saved(earlier: Mapping[str, Any]) -> Document:
    """Return the saved values of `KEYS`; `balls` only after a direct check, as others have no pressures."""
    return {key: earlier[key] for key in KEYS if key in earlier and (key != "balls" or earlier.get("direct_check"))}


def results(
    session: Session, source: Provider, balls: HardBalls, moments: Sequence[Moment], found: Document,
    save: Callable[[], None],
) -> Document:  # fmt: skip
    """Return the results of a complete path; those in ``found`` are taken from there, new ones added and saved."""
    forces, problem, sliding, model = source.forces, session.problem, session.scene.sliding, session.model.name
    begin, end = moments[0].positions, moments[-1].positions

    def once(key: str, words: str, compute: Callable[[], Document]) -> None:
        if key in found:
            session.report(f"{words}: saved")
            return
        session.report(words)
        found.update(compute())
        save()

    def check() -> Document:
        accuracy = session.scene.tangential_force or DIRECT_ACCURACY
        rows, full = direct_check(problem, balls, forces, moments, accuracy)
        if full and model != "linear_bem":
            full = without_pressures(problem, moments[-1], full)
        return {"direct_check": rows, **({"balls": full} if full else {})}

    def coarser() -> Document:
        return {"position_error": position_error(moments, forces, balls, begin, balls.tolerance, sliding.rest)}

    def balanced() -> Document:
        of_pair: list[Document] | None = None
        if isinstance(forces, PairForces) and len(end) == 2:
            distances = equilibria.of_pair(forces, balls.smallest, FURTHEST * balls.smallest)
            of_pair = [{"distance": distance, "verdict": verdict} for distance, verdict in distances]
        found_at = equilibrium(forces, balls, end, source.difference, balls.tolerance)
        return {"equilibrium": found_at, "pair_equilibria": of_pair}

    if model != "finite_strain" and problem.size <= MEASURED:
        once("direct_check", "the full linear model at start and end of the path, for the error of T", check)
    if not balls.many:  # a second path takes as long as the first, and an equilibrium needs dense matrices
        words = f"the path with a {COARSER:g} times coarser tolerance, for the error of positions"
        once("position_error", words, coarser)
        if balls.cell is None and balls.rolling == 0.0:
            once("equilibrium", "the equilibrium next to the end", balanced)
    return {
        **{key: found.get(key) for key in KEYS if key != "balls"},
        "rest": rest(moments[-1]),
        "momentum": momentum(moments),
        "pair_table": source.table,
        "cut_error": forces.cut_error(begin) if isinstance(forces, PairForces) else None,
    }


def rest(end: Moment) -> Document:
    """Return whether nothing moves any more, how many contacts push, and the residuals (T + pushes)/Q and |T|/Q."""
    forces = np.hypot(*end.state.tangential.T)
    left, holding = float(np.max(forces / resistances(end.state.normal))), end.pushes > PUSHING * np.max(forces)
    return {"at_rest": end.resting, "holding": int(np.sum(holding)), "speed": end.speed, "force_over_load": left}


def rest_sentence(found: Mapping[str, Any], cycles: float, rolling: float = 0.0) -> str:
    """Return the sentence that says whether the balls rest; ``rolling`` is the rolling resistance over the load."""
    left = f"largest |T|/Q left: {found['force_over_load']:.2g}"
    if not found["at_rest"]:
        return (
            f"still moving after {cycles:.4g} cycles, to go on raise [reciprocation] cycles and run the same command "
            f"again; the fastest ball is driven by {found['speed']:.2g} of its load ({left})"
        )
    holding = found["holding"]
    holds = [count(holding, "contact")] if holding else []
    if rolling > 0.0:
        holds.append(f"the rolling resistance of {rolling:g} of the load")
    if not holds:
        return f"at rest after {cycles:.4g} cycles: no tangential force above [reciprocation] rest is left ({left})"
    verb = "holds" if holding + (rolling > 0.0) == 1 else "hold"
    return f"at rest after {cycles:.4g} cycles: {' and '.join(holds)} {verb} the balls ({left})"


def arrangement_sentence(end: Mapping[str, Any], begin: Array, cell: Array | None, length: Unit) -> str:
    """Return the sentence that says which clusters the balls form at the ``end``, a `runs.evolution.record.summary`.

    ``begin`` (balls, 2) [m] are the positions as given, ``cell`` the lengths [m] of a cell, ``length`` a unit.
    """
    contacts = count(end["contacts"], "contact") if end["contacts"] else "no contacts"
    if len(end["groups"]) == 1:
        return f"{len(begin)} balls in one cluster, {contacts}"
    here, there = (length(float(np.min(nearest_distances(x, cell)))) for x in (np.array(end["positions"]), begin))
    return f"{contacts}; {clusters(end['groups'])}; nearest distance {here} ({there} in the scene)"


def clusters(groups: Sequence[int]) -> str:
    """Return the numbers of clusters of each of the largest sizes in words, from the sizes of all, largest first."""
    sizes = Counter(groups)
    words = [f"{count(number, 'cluster')} of {size}" for size, number in sizes.items()]
    if len(words) > NAMED:
        words[NAMED:] = [f"{sum(list(sizes.values())[NAMED:])} smaller ones"]
    return ", ".join(words)


def position_error(
    moments: Sequence[Moment], forces: Forces, balls: HardBalls, begin: Array, tolerance: float, rest: float
) -> float:
    """Return the largest difference [m] of any position from a run with a coarser tolerance.

    Positions of both are compared at kept moments, the last one in each coarser step; nothing is interpolated, as
    contacts are kinks of the path.
    """
    coarse = Drift(forces, balls, COARSER * tolerance, rest)
    path = list(coarse.path(begin, moments[-1].sigma))
    passed = np.searchsorted([moment.sigma for moment in path], [moment.sigma for moment in moments], side="right") - 1

    def there(last: Moment, sigma: float) -> Array:
        if last.resting:
            return last.positions
        return next(coarse.path(last, sigma, ending=True)).positions

    compared = dict(zip(passed, moments, strict=True))
    return max(float(np.max(np.abs(there(path[k], m.sigma) - m.positions))) for k, m in compared.items())


def momentum(moments: Sequence[Moment]) -> float:
    """Return the largest |sum of T| over the largest |T| on the path; 0 in an exact model."""
    forces = (moment.state.tangential for moment in moments)
    sizes = ((float(np.hypot(*force.sum(axis=0))), float(np.max(np.hypot(*force.T)))) for force in forces)
    return max((total / largest for total, largest in sizes if largest > 0.0), default=0.0)


def equilibrium(forces: Forces, balls: HardBalls, end: Array, difference: float, tolerance: float) -> Document:
    """Return the equilibrium nearest to ``end``, its stability and its distance from the end [m]; or why there is none.

    ``difference`` and ``tolerance`` as in `runs.evolution.equilibria.find`.
    """
    try:
        found = equilibria.find(forces, balls, end, difference, tolerance)
    except NotConverged as error:
        return {"verdict": "none", "reason": str(error)}
    away = found.positions - end
    return {
        "verdict": found.verdict,
        "free_motions": found.free,
        "growth": list(found.growth),
        "residual": found.residual,
        "contacts": balls.pairs(found.contacts).tolist(),
        "positions": found.positions.tolist(),
        "distance_from_end": float(np.max(np.abs(away - away.mean(axis=0)))),
    }


def direct_check(
    problem: Problem, hard: HardBalls, forces: Forces, moments: Sequence[Moment], accuracy: float
) -> tuple[list[Document], list[Document]]:
    """Return the deviation of the forces from the full linear model at start and end, and its balls at the end.

    ``share`` is the size of the largest difference of T over the largest T of the full model, None where this fails.
    """
    from linear_bem import solve  # noqa: PLC0415

    rows: list[Document] = []
    balls: list[Document] = []
    cell = None if hard.cell is None else Periodic((float(hard.cell[0]), float(hard.cell[1])))
    for name, moment in (("start", moments[0]), ("end", moments[-1])):
        state = forces(moment.positions)
        try:
            apart = problem.at(hard.parted(moment.positions, np.ones(len(moment.positions))))
            full = solve(replace(apart, periodic=cell), accuracy=accuracy)
        except (NotConverged, UnsupportedProblem, TooLarge) as error:
            rows.append({"at": name, "share": None, "reason": str(error)})
            balls = []
            continue
        balls = [ball.to_dict() for ball in full.balls]
        true = np.array([ball.tangential_force for ball in full.balls])
        largest, known = float(np.max(np.hypot(*true.T))), max(b.tangential_force_error for b in full.balls)
        if largest <= 2.0 * known:
            rows.append({"at": name, "share": None, "reason": "T is zero there to its error"})
            continue
        away = float(np.max(np.hypot(*(state.tangential - true).T)))
        rows.append({"at": name, "share": away / largest, "full_model_error": known / largest})
    return rows, balls


def without_pressures(problem: Problem, moment: Moment, full: Sequence[Mapping[str, Any]] = ()) -> list[Document]:
    """Return the balls of a state as in a result, with null for pressures and areas: only forces are known.

    The error of T is its largest difference from the ``full`` linear model's balls, where these are given.
    """
    state, error = moment.state, moment.state.error
    if full:
        away = np.hypot(*(state.tangential - [ball["tangential_force"] for ball in full]).T)
        error = np.full(len(full), np.max(away + [ball["tangential_force_error"] for ball in full]))
    return [
        {
            "position": moment.positions[i].tolist(),
            "radius": ball.radius,
            "approach": problem.load.values[i],
            "normal_force": float(state.normal[i]),
            "tangential_force": state.tangential[i].tolist(),
            "tangential_force_error": float(error[i]),
            "peak_pressure": None,
            "contact_area": None,
            "tangential_force_routes": {},
        }
        for i, ball in enumerate(problem.balls)
    ]
