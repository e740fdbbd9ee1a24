"""The command ``compare``: the finite-strain load path against the linear model, step by step."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

from linear_bem.errors import UnsupportedProblem
from linear_bem.result import Step
from runs.comparison import interpolant
from runs.comparison.linear_states import LinearStates
from runs.comparison.strengthening_factors import answer, compare_steps
from runs.display import figures, tables
from runs.display.numbers import leading_ball
from runs.process.json_values import as_given, to_json
from runs.scene.scene_file import Scene
from runs.session.session import Options, Session, path_so_far, unfinished


def compare_scene(scene: Scene, options: Options) -> None:
    """Compare both models on ``scene``, save the run and print the answer."""
    if "finite_strain" not in scene.effects and "reciprocation" not in scene.effects:
        raise UnsupportedProblem(
            f"{scene.path}: compare sets finite against small strain and needs [finite_strain]; "
            'add the table (law = "neo_hookean"), or use solve'
        )
    session = Session("compare", scene, None, options)
    document = session.finished
    already = document is not None
    if document is None:
        document = _compute(session)
    if session.root and document is not None:
        _show(session, document)
        session.say_where(already)


def _compute(session: Session) -> dict[str, Any] | None:
    earlier = session.earlier or {}
    steps: list[dict[str, Any]] = list((earlier.get("finite") or {}).get("steps", []))
    linear = LinearStates(session.problem, session.scene.tangential_force, earlier)

    def document_of(finite: dict[str, Any]) -> dict[str, Any]:
        finite_steps = finite["steps"]
        at_force, at_approach = linear.at_force(finite_steps), linear.at_approach(finite_steps)
        rows = compare_steps(finite_steps, at_force["steps"], at_approach["steps"])
        scene = as_given(session.scene.data)
        return {
            "scene": scene,
            "linear": {**at_force, "scene": scene},
            "linear_at_approach": {**at_approach, "scene": scene},
            "finite": {**finite, "scene": scene},
            "comparison": rows,
            "answer": answer(rows, finite["balls"], session.scale),
        }

    def take(step: Step, fields: Any) -> None:
        steps[:] = path_so_far(steps, step)
        _save(session, document_of(unfinished(session.model, steps).to_dict()))
        figures.keep_surface(session.out, fields)

    result = session.solve(take)
    if not session.root:
        return None
    document = document_of(session.with_notes(result.to_dict()))
    _save(session, document)
    assert session.folder is not None
    between = interpolant.table(document["comparison"], leading_ball(document["finite"]["balls"]))
    if between:
        session.folder.save_table("strengthening.csv", between)
    figures.draw_comparison(session.out, document["comparison"], document["finite"]["balls"], session.scale, between)
    figures.draw_surface(session.out, session.problem, document["finite"]["balls"], session.scale)
    _close(session, document)
    return document


def _save(session: Session, document: Mapping[str, Any]) -> None:
    assert session.folder is not None
    session.folder.save(document, document["comparison"])


def _close(session: Session, document: Mapping[str, Any]) -> None:
    assert session.folder is not None
    solved = document["finite"]["solved"]
    versions = ", ".join(f"{k} {v}" for k, v in solved["versions"].items())
    session.folder.log(f"{document['answer']}\nfinished in {solved['seconds']:.1f} s; {versions}")
    session.folder.finish()


def _show(session: Session, document: Mapping[str, Any]) -> None:
    if session.options.as_json:
        sys.stdout.write(to_json(document))
        return
    out = tables.console()
    balls = document["finite"]["balls"]
    leading = leading_ball(balls)
    out.print(f"{session.scene.title}", highlight=False, markup=False)
    compact = out.width < tables.WIDE
    out.print(tables.comparison_table(document["comparison"], balls, leading, session.scale, compact=compact))
    if len(balls) > 1:
        out.print(f"{tables.LEGEND}; T and Q over E R\u00b2 (E: Young's modulus of the layer)", highlight=False)
        mark = "digits in parentheses" if compact else "\u00b1"
        out.print(
            "S_Q, S_D: T finite over T linear at the same normal force and at the same approach; "
            f"{mark}: both models' own error estimates, added",
            highlight=False,
        )
    for line in tables.accuracy_lines(document["finite"]["solved"]):
        out.print(line, highlight=False, markup=False)
    notes = dict.fromkeys([*document["finite"]["solved"]["notes"], *document["linear"]["solved"]["notes"]])
    for note in notes:
        out.print(f"note: {note}", highlight=False, markup=False)
    out.print()
    out.print(document["answer"], style="bold", highlight=False, markup=False)
