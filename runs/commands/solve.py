"""The command ``solve``: one model on one scene."""

from typing import Any

from linear_bem.result import Result, Step
from runs.display import figures, tables
from runs.display.numbers import bodies, leading_ball, line_of
from runs.display.rows import LEGEND, legend_of_balls, legend_of_line, path_rows
from runs.process.json_values import Document, as_given
from runs.scene.scene_file import Scene
from runs.session.session import Options, Session, conduct

DRAWN = 40
"""Largest number of balls whose pressures are drawn: of more, peak pressures and T."""


def solve_scene(scene: Scene, asked: str | None, options: Options) -> None:
    """Solve ``scene``, save the run and print its result."""
    conduct(Session("solve", scene, asked, options), _compute, _show)


def _compute(session: Session) -> Document | None:
    scene = as_given(session.scene.data)
    result = session.solve(
        session.saved.get("steps", []), lambda so_far: session.save(so_far.to_dict(scene), _rows(so_far))
    )
    if not session.root:
        return None
    document = result.to_dict(scene)
    session.save(document, _rows(result))
    if result.steps:
        figures.draw_path(session.out, document["steps"], session.scale, session.model.name)
    figures.draw_surface(session.out, session.problem, document["balls"], session.scale)
    if session.solutions and session.problem.size <= DRAWN:
        figures.draw_contacts(session.out, session.solutions[-1], document["balls"], session.scale)
    elif session.solutions:
        figures.draw_many(session.out, document["balls"], session.scale)
    session.finish(document["solved"])
    return document


def _rows(result: Result) -> list[dict[str, Any]]:
    """Return one flat row per step and ball."""
    nested = ("tangential_force_routes", "errors")
    return [
        {"step": i, "ball": j}
        | {k: v for k, v in ball.to_dict().items() if k not in nested}
        | {f"{k}_error": v for k, v in ball.errors.items()}
        for i, step in enumerate(result.steps or (Step(result.balls),), start=1)
        for j, ball in enumerate(step.balls)
    ]


def _show(session: Session, document: Document) -> None:
    balls, steps = document["balls"], document["steps"]
    out = tables.console()
    tables.say(out, *tables.warnings(document["solved"]))
    tables.show_balls(out, balls, session.scale, f"{session.scene.title}: {document['model']}")
    tables.say(out, f"shape: {bodies(session.problem, session.scale)}", session.scale.legend())
    if len(steps) > 1:
        leading = leading_ball(balls)
        path = path_rows(steps, leading, session.scale)
        tables.show(out, f"load path of ball {leading}", path, session.scale)
        _, kind = line_of(balls, leading, balls[leading]["tangential_force"], periodic=session.scale.periodic)
        legend = legend_of_line(balls, kind)
        if legend != LEGEND:  # which is that of the balls
            tables.say(out, legend)
    tables.say(
        out,
        *legend_of_balls(balls, session.scale),
        *tables.error_lines(balls),
        *tables.accuracy_lines(document["solved"], balls),
        *tables.notes(document["solved"]),
    )
