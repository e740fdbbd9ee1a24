"""Computes the results that need the complete path, one after the other; saved ones are used again."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from runs.evolution import equilibria, outcome
from runs.evolution.drift import Moment
from runs.evolution.hard_balls import HardBalls
from runs.evolution.pair_forces import PairForces
from runs.evolution.providers import DIRECT_ACCURACY, MEASURED, Provider
from runs.process.json_values import Document
from runs.session.session import Session

KEYS = ("direct_check", "balls", "position_error", "equilibrium", "pair_equilibria")
"""Results that take time; an unfinished document has those that are known."""


def saved(earlier: Mapping[str, Any]) -> Document:
    """Return the saved values of `KEYS`; `balls` only after a direct check, as others have no pressures."""
    return {key: earlier[key] for key in KEYS if key in earlier and (key != "balls" or earlier.get("direct_check"))}


def results(
    session: Session, source: Provider, balls: HardBalls, moments: Sequence[Moment], found: Document,
    save: Callable[[], None],
) -> Document:  # fmt: skip
    """Return the results of a complete path; those in ``found`` are taken from there, new ones added and saved."""
    forces, problem, sliding, model = source.forces, session.problem, session.scene.reciprocation, session.model.name
    assert sliding is not None
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
        rows, full = outcome.direct_check(problem, balls, forces, moments, accuracy)
        if full and model != "linear_bem":
            full = outcome.without_pressures(problem, moments[-1], full)
        return {"direct_check": rows, **({"balls": full} if full else {})}

    def coarser() -> Document:
        return {"position_error": outcome.position_error(moments, forces, balls, begin, balls.tolerance, sliding.rest)}

    def equilibrium() -> Document:
        of_pair: list[Document] | None = None
        if source.cheap and len(end) == 2:
            distances = equilibria.of_pair(forces, balls.smallest, outcome.FURTHEST * balls.smallest)
            of_pair = [{"distance": distance, "verdict": verdict} for distance, verdict in distances]
        found_at = outcome.equilibrium(forces, balls, end, source.difference, balls.tolerance)
        return {"equilibrium": found_at, "pair_equilibria": of_pair}

    if model != "finite_strain" and problem.size <= MEASURED:
        once("direct_check", "the full linear model at start and end of the path, for the error of T", check)
    if not balls.many:  # a second path takes as long as the first, and an equilibrium needs dense matrices
        words = f"the path with a {outcome.COARSER:g} times coarser tolerance, for the error of positions"
        once("position_error", words, coarser)
        if balls.cell is None and balls.rolling == 0.0:
            once("equilibrium", "the equilibrium next to the end", equilibrium)
    return {
        "rest": outcome.rest(moments[-1]),
        "position_error": found.get("position_error"),
        "equilibrium": found.get("equilibrium"),
        "pair_equilibria": found.get("pair_equilibria"),
        "momentum": outcome.momentum(moments),
        "pair_table": source.table,
        "direct_check": found.get("direct_check"),
        "cut_error": forces.cut_error(begin) if isinstance(forces, PairForces) else None,
    }
