"""What ``evolve`` prints and draws when it ends."""

from collections.abc import Mapping, Sequence
from typing import Any

from linear_bem.problem import Problem
from runs.display import tables
from runs.display.numbers import number
from runs.display.rows import LEGEND
from runs.evolution import drawing, layer_pictures, outcome, structure
from runs.evolution.drift import Moment
from runs.evolution.hard_balls import IN_ONE_FILE, HardBalls
from runs.process.json_values import Document
from runs.scene.effects.reciprocation import ReciprocationTable
from runs.scene.units import Unit
from runs.session.session import Session


def draw(session: Session, document: Document, moments: Sequence[Moment], balls: HardBalls) -> None:
    """Write every picture of the run."""
    assert session.scene.reciprocation is not None
    folder, direction = session.out, session.scene.reciprocation.direction
    radii = [ball.radius for ball in session.problem.balls]
    if balls.many or balls.cell is not None:
        cycles = session.scene.reciprocation.cycles_after
        layer_pictures.draw_top_views(folder, moments, balls, cycles, "top_views")
        layer_pictures.draw_structure(folder, [{"cycle": cycles(m.sigma), **structure.row(m, balls)} for m in moments])
        return
    drawing.draw_top_views(folder, document, balls, radii, direction)
    drawing.draw_distances(folder, document, balls)
    drawing.draw_animation(folder, document, radii, direction)
    drawing.draw_ensemble(folder, document, radii)


def show(session: Session, document: Document) -> None:
    """Print the end of the path as a table and sentences."""
    assert session.scene.reciprocation is not None
    out = tables.console()
    end = document["path"][-1]
    title = f"{session.scene.title}: {document['model']}, after {number(end['cycle'])} cycles"
    if len(document["balls"]) <= IN_ONE_FILE:
        periodic = "periodic" in session.scene.drift
        tables.show_balls(out, document["balls"], session.scale, title, periodic=periodic)
        tables.say(out, session.scale.legend(), *(() if periodic else (LEGEND,)))
    else:
        tables.say(out, title)
    tables.say(out, *_sentences(session.problem, session.scene.reciprocation, document, session.scale.units.length))
    tables.say(out, *tables.notes(document["solved"]))


def _sentences(problem: Problem, sliding: ReciprocationTable, document: Document, length: Unit) -> list[str]:
    """Return the outcome of the run, one sentence each, in the scene's unit of length."""
    end = document["path"][-1]
    contacts = end["contacts"] if isinstance(end["contacts"], int) else len(end["contacts"])
    lines = [outcome.rest_sentence(document["rest"], contacts, end["cycle"])]
    smallest = min(ball.radius for ball in problem.balls)
    lines.append(
        f"friction {sliding.friction:g} changes only the time scale: {length(end['sigma'])} of sliding path over "
        f"friction, {length(sliding.path_per_cycle)} of path a cycle"
    )
    if document["position_error"] is not None:
        lines.append(
            f"positions are known to {number(document['position_error'] / smallest, 2)} R (against a tolerance ten "
            "times coarser)"
        )
    lines.append(f"|sum of T| is {document['momentum']:.1e} of the largest T")
    if document["cut_error"]:
        lines.append(
            f"forces between balls far apart are left out; with ten times less left out, T at the start changes by "
            f"{100.0 * document['cut_error']:.1g} % of the largest"
        )
    for row in document["direct_check"] or []:
        if row["share"] is None or row["share"] != row["share"]:
            lines.append(f"the full linear model has no answer at the {row['at']}: {row['reason']}")
        else:
            lines.append(f"T at the {row['at']} differs from the full linear model by {100.0 * row['share']:.2g} %")
    solved = document["solved"]
    lines.append(f"{solved['iterations']} steps in {number(solved['seconds'], 3)} s of processor time")
    if document["equilibrium"] is not None:
        lines.append(_balance(document["equilibrium"], smallest))
    for pair in document["pair_equilibria"] or []:
        lines.append(f"two balls rest {length(pair['distance'])} apart: {pair['verdict']}")
    if document["pair_equilibria"] == []:
        lines.append(
            f"two balls rest at no distance up to {outcome.FURTHEST:g} times the touching one: T separates throughout"
        )
    members = document["ensemble"]
    if len(members) > 1:
        ends = sorted({(m["contacts"], tuple(m["groups"])) for m in members}, reverse=True)
        for contacts, groups in ends:
            count = sum((m["contacts"], tuple(m["groups"])) == (contacts, groups) for m in members)
            lines.append(f"{count} of {len(members)} members end with {contacts} contacts in groups of {list(groups)}")
    return lines


def _balance(found: Mapping[str, Any], smallest: float) -> str:
    if found["verdict"] == "none":
        return f"no equilibrium found near the final positions: {found['reason']}"
    away = number(found["distance_from_end"] / smallest, 2)
    rates = ""
    if found["growth"]:
        rates = f", fastest growth rate {found['growth'][0]:.3g} per metre of path over friction"
    free = f"{found['free_motions']} relative motions are free{rates}" if found["free_motions"] else "no motion is free"
    return f"the path ends {away} R from an equilibrium: {found['verdict']} ({free})"
