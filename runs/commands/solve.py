"""The command ``solve``: one model on one scene."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

from linear_bem.result import Step
from runs.display import figures, tables
from runs.display.numbers import bodies, leading_ball
from runs.process.json_values import as_given, to_json
from runs.scene.scene_file import Scene
from runs.session.session import Options, Session, path_so_far, rows_of, unfinished


def solve_scene(scene: Scene, asked: str | None, options: Options) -> None:
    """Solve ``scene``, save the run and print its result."""
    session = Session("solve", scene, asked, options)
    if session.idle:
        return
    document = session.finished
    already = document is not None
    if document is None:
        document = _compute(session)
    if session.root and document is not None:
        _show(session, document)
        session.say_where(already)


def _compute(session: Session) -> dict[str, Any] | None:
    steps: list[dict[str, Any]] = list((session.earlier or {}).get("steps", []))

    def take(step: Step, fields: Any) -> None:
        steps[:] = path_so_far(steps, step)
        _save(session, unfinished(session.model, steps).to_dict(as_given(session.scene.data)))
        figures.keep_surface(session.out, fields)

    result = session.solve(take)
    if not session.root:
        return None
    document = session.with_notes(result.to_dict(as_given(session.scene.data)))
    _save(session, document)
    if result.steps:
        figures.draw_path(session.out, document["steps"], session.scale, session.model.name)
    figures.draw_surface(session.out, session.problem, document["balls"], session.scale)
    _close(session, document)
    return document


def _save(session: Session, document: Mapping[str, Any]) -> None:
    assert session.folder is not None
    session.folder.save(document, rows_of(document["steps"] or [{"balls": document["balls"]}]))


def _close(session: Session, document: Mapping[str, Any]) -> None:
    assert session.folder is not None
    solved = document["solved"]
    session.folder.log(
        f"finished in {solved['seconds']:.1f} s; " + ", ".join(f"{k} {v}" for k, v in solved["versions"].items())
    )
    session.folder.finish()


def _show(session: Session, document: Mapping[str, Any]) -> None:
    if session.options.as_json:
        sys.stdout.write(to_json(document))
        return
    out = tables.console()
    balls, steps = document["balls"], document["steps"]
    out.print(tables.ball_table(balls, session.scale, f"{session.scene.title}: {document['model']}"))
    out.print(f"shape: {bodies(session.problem)}", highlight=False, markup=False)
    if len(steps) > 1:
        leading = leading_ball(balls)
        out.print(tables.path_table(steps, leading, session.scale, f"load path of ball {leading}"))
    if len(balls) > 1:
        out.print(tables.LEGEND, highlight=False)
    for line in tables.accuracy_lines(document["solved"]):
        out.print(line, highlight=False, markup=False)
    for note in document["solved"]["notes"]:
        out.print(f"note: {note}", highlight=False, markup=False)
