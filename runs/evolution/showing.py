"""What ``evolve`` prints and draws when it ends."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from runs.display import tables
from runs.display.numbers import bodies, count, duration, number
from runs.display.rows import legend_of_balls
from runs.evolution import drawing, layer_pictures, outcome
from runs.evolution.drift import Moment
from runs.evolution.hard_balls import HardBalls
from runs.process.json_values import Document
from runs.scene.scene_file import Scene
from runs.scene.units import Unit, in_unit
from runs.session.session import Session

LISTED = 20
"""Largest number of balls whose final state is printed."""
AT = 1e-6
"""Distance of the end from an equilibrium, over the radius, that counts as none."""
LONG = 1e4
"""Path in the scene's unit of length from which it is printed in metres."""


def draw(
    session: Session, document: Document, moments: Sequence[Moment], balls: HardBalls, layer: Sequence[Document]
) -> None:
    """Write every picture of the run; ``layer`` holds the rows of `runs.evolution.structure`, if any."""
    folder, sliding, length = session.out, session.scene.sliding, session.scale.units.length
    layer_pictures.draw_ensemble(folder, document["ensemble"], balls, length)
    if layer:
        layer_pictures.draw_top_views(folder, moments, balls, sliding.cycles_after, length)
        layer_pictures.draw_structure(folder, layer)
        return
    drawing.draw_top_views(folder, document, balls, sliding.direction, length)
    drawing.draw_distances(folder, document, balls, length)
    drawing.draw_animation(folder, document, balls, sliding.direction, length)


def show(balls: HardBalls, session: Session, document: Document) -> None:
    """Print the end of the path as a table and sentences."""
    out = tables.console()
    end = document["path"][-1]
    title = f"{session.scene.title}: {document['model']}, after {number(end['cycle'])} cycles"
    shape = f"shape: {bodies(session.problem, session.scale)}"
    tables.say(out, *tables.warnings(document["solved"]))
    if len(document["balls"]) <= LISTED:
        tables.show_balls(out, document["balls"], session.scale, title)
        tables.say(out, shape, session.scale.legend(), *legend_of_balls(document["balls"], session.scale))
    else:
        tables.say(
            out, f"{title}; result.json has the final state of each of the {len(document['balls'])} balls", shape
        )
    tables.say(out, *sentences(session.scene, document, balls, session.scale.units.length), _cost(document))
    tables.say(out, *tables.notes(document["solved"]))


def sentences(scene: Scene, document: Document, balls: HardBalls, length: Unit) -> list[str]:
    """Return the outcome of the run, one sentence each, in the scene's unit of length."""
    sliding, problem, end, members = scene.sliding, scene.problem, document["path"][-1], document["ensemble"]
    rest = outcome.rest_sentence(document["rest"], end["cycle"], balls.rolling)
    lines = [f"the first of {len(members)} members (seed {sliding.seed}): {rest}" if len(members) > 1 else rest]
    if len(members) == 1:
        lines.append(outcome.arrangement_sentence(members[0], problem.positions, balls.cell, length))
    if balls.cell is not None:
        lines.append("positions are not wrapped into the cell: those of balls that have left it lie beyond its edges")
    path = Unit("m", 1.0) if length.name != "R" and end["sigma"] >= LONG * length.size else length
    lines.append(
        f"friction {sliding.friction:g} changes only the time scale: sliding path / friction = {path(end['sigma'])}, "
        f"{length(sliding.path_per_cycle)} of path a cycle"
    )
    if document["position_error"] is not None:
        lines.append(
            f"error of the positions by the steps alone: {length(document['position_error'], 2)}, by "
            f"comparison with a {outcome.COARSER:g} times coarser tolerance; the error of the forces adds to it"
        )
    lines.append(f"|sum of T| is {document['momentum']:.1e} of the largest T")
    if document["cut_error"]:
        lines.append(
            f"forces between distant balls are neglected; neglecting ten times less changes T at the start by "
            f"{100.0 * document['cut_error']:.1g} % of the largest"
        )
    lines += _compared(document)
    if document["equilibrium"] is not None:
        lines.append(_balance(document["equilibrium"], float(np.min(balls.radii)), length))
    for pair in document["pair_equilibria"] or []:
        lines.append(f"two balls rest {length(pair['distance'])} apart: {pair['verdict']}")
    if document["pair_equilibria"] == []:
        lines.append(
            f"two balls rest at no distance up to {outcome.FURTHEST:g} times the touching one: T separates throughout"
        )
    if len(members) > 1:
        ends = Counter((m["contacts"], tuple(m["groups"])) for m in members)
        for (contacts, groups), ending in sorted(ends.items(), reverse=True):
            ended = f"{count(contacts, 'contact')} in {outcome.clusters(groups)}"
            lines.append(f"{ending} of {len(members)} members end with {ended}")
        at_rest = [m["cycles_end"] for m in members if m["at_rest"]]
        gathered = [m["cycles_one_group"] for m in members if m["cycles_one_group"] is not None]
        for words, cycles in (("are in one cluster", gathered), ("are at rest", at_rest)):
            if len(cycles) > 1:
                spread = f"{number(np.mean(cycles), 3)} ± {number(np.std(cycles, ddof=1), 2)} cycles"
                span = f"{number(min(cycles), 3)} to {number(max(cycles), 3)}"
                lines.append(f"{len(cycles)} of {len(members)} members {words} after {spread} ({span})")
    elif cycles := members[0]["cycles_one_group"]:
        slid = path(cycles * sliding.path_per_cycle)
        lines.append(f"the balls first form one cluster after {number(cycles, 3)} cycles, {slid} of sliding path")
    return lines


def _cost(document: Document) -> str:
    """Return the number of steps with the time that they and the table of pairs took."""
    solved, table = document["solved"], document["pair_table"]
    made = [] if table is None else [table["single"], *table["pairs"], *table["additivity"]]
    beside = (
        f"; the table of pairs took {duration(sum(row['seconds'] for row in made))} when it was made" if made else ""
    )
    took = f"{number(solved['seconds'], 3)} s of processor time with what follows the path, without pictures"
    return f"{count(solved['iterations'], 'step')}: {took}{beside}"


def _compared(document: Document) -> list[str]:
    """Return how much T differs from that of the full linear model, where that was asked."""
    lines = []
    for row in document["direct_check"] or []:
        if row["share"] is None:
            lines.append(f"T at the {row['at']} is not compared with the full linear model: {row['reason']}")
        else:
            share = f"{100.0 * row['share']:.2g} % of the largest"
            lines.append(f"T at the {row['at']} differs from the full linear model by {share}")
    if document["model"] == "linear_bem" and document["balls"][0]["peak_pressure"] is not None:
        lines.append(
            "the final state of the balls is the full linear model's, T on the path that of the drift's forces"
        )
    return lines


def _balance(found: Mapping[str, Any], smallest: float, length: Unit) -> str:
    if found["verdict"] == "none":
        return f"no equilibrium found: {in_unit(found['reason'], length)}"
    rates = ""
    if found["growth"]:
        rates = f", fastest growth rate {found['growth'][0]:.3g} per metre of path over friction"
    free = (
        f"{count(found['free_motions'], 'free relative motion')}{rates}" if found["free_motions"] else "no free motion"
    )
    where = "at" if found["distance_from_end"] < AT * smallest else f"{length(found['distance_from_end'], 2)} from"
    return f"the path ends {where} an equilibrium: {found['verdict']} ({free})"
