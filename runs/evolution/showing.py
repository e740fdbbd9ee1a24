"""What ``evolve`` prints and draws at its end."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from runs.display import tables
from runs.display.numbers import Scale, number
from runs.evolution import drawing, outcome
from runs.process.json_values import to_json


def draw(folder: Path, evolution: Any, document: Mapping[str, Any]) -> None:
    """Write every picture of the run."""
    radii = [ball.radius for ball in evolution.problem.balls]
    drawing.draw_top_views(folder, document, evolution.balls, radii, evolution.sliding.direction)
    drawing.draw_distances(folder, document, evolution.balls)
    drawing.draw_animation(folder, document, radii, evolution.sliding.direction)
    drawing.draw_ensemble(folder, document, radii)


def show(evolution: Any, document: Mapping[str, Any]) -> None:
    """Print the end of the path as a table and sentences, or the whole document as JSON."""
    if evolution.options.as_json:
        sys.stdout.write(to_json(document))
        return
    out = tables.console()
    end = document["path"][-1]
    title = f"{evolution.scene.title}: {document['model']}, after {number(end['cycle'])} cycles"
    out.print(tables.ball_table(document["balls"], Scale.of(evolution.problem), title))
    for sentence in sentences(evolution, document):
        out.print(sentence, highlight=False, markup=False)
    for note in document["solved"]["notes"]:
        out.print(f"note: {note}", highlight=False, markup=False)


def sentences(evolution: Any, document: Mapping[str, Any]) -> list[str]:
    """Return what came of the run, one sentence each."""
    end, sliding = document["path"][-1], evolution.sliding
    lines = [outcome.rest_sentence(document["rest"], len(end["contacts"]), end["cycle"])]
    smallest = min(ball.radius for ball in evolution.problem.balls)
    lines.append(
        f"friction {sliding.friction:g} sets the clock alone: {number(end['sigma'])} m of sliding path over friction, "
        f"{number(1e3 * evolution.path_per_cycle)} mm of path a cycle"
    )
    lines.append(
        f"positions are known to {number(document['position_error'] / smallest, 2)} R (against a tolerance ten times "
        f"coarser); |sum of T| is {document['momentum']:.1e} of the largest T"
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
        lines.append(f"two balls rest {number(1e3 * pair['distance'])} mm apart: {pair['verdict']}")
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
        return f"no equilibrium next to the end: {found['reason']}"
    away = number(found["distance_from_end"] / smallest, 2)
    rates = ""
    if found["growth"]:
        rates = f", fastest growth rate {found['growth'][0]:.3g} per metre of path over friction"
    free = f"{found['free_motions']} relative motions are free{rates}" if found["free_motions"] else "no motion is free"
    return f"the path ends {away} R from an equilibrium: {found['verdict']} ({free})"
