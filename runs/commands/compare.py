"""The command ``compare``: the finite-strain load path against the linear model, step by step."""

from linear_bem.depth import LARGE_STRAIN
from linear_bem.errors import UnsupportedProblem
from linear_bem.result import Result
from runs.comparison import interpolant, sensitivity
from runs.comparison.linear_states import LinearStates
from runs.comparison.strengthening_factors import answer, compare_steps, last_row, of_ball
from runs.display import figures, tables
from runs.display.numbers import leading_ball
from runs.display.rows import (
    OF_VECTORS,
    compared_ball_rows,
    compared_line,
    comparison_rows,
    legend_of_line,
    may_turn,
)
from runs.process import ranks
from runs.process.files import write_csv
from runs.process.json_values import Document, as_given
from runs.scene.scene_file import Scene
from runs.session.session import Options, Session, conduct


def compare_scene(scene: Scene, options: Options) -> None:
    """Compare both models on ``scene``, save the run and print the answer."""
    if "periodic" in scene.effects and "reciprocation" not in scene.effects:
        raise UnsupportedProblem(
            f"{scene.path}: compare needs both models, and finite strain does not support [periodic]; drop it, "
            "or use solve"
        )
    if "finite_strain" not in scene.effects and "reciprocation" not in scene.effects:
        raise UnsupportedProblem(
            f"{scene.path}: compare runs finite and small strain and needs [finite_strain]; "
            'add the table (law = "neo_hookean"), or use solve'
        )
    conduct(Session("compare", scene, None, options), _compute, _show)


def _compute(session: Session) -> Document | None:
    scene = as_given(session.scene.data)
    with session.reading_saved():
        linear = LinearStates(session.problem, session.scene.tangential_force, session.saved)
        steps = session.saved.get("finite", {}).get("steps", [])

    def save(result: Result) -> Document:
        finite = result.to_dict(scene)
        at_force, at_approach = linear.along("force", finite["steps"]), linear.along("approach", finite["steps"])
        rows = compare_steps(finite["steps"], at_force["steps"], at_approach["steps"])
        document = {
            "scene": scene,
            "linear": {**at_force, "scene": scene},
            "linear_at_approach": {**at_approach, "scene": scene},
            "finite": finite,
            "comparison": rows,
            "answer": answer(rows, finite["balls"], session.scale),
        }
        session.save(document, rows)
        return document

    result = session.solve(steps, save)
    rank, size = ranks.rank_and_size()
    document: Document | None = None
    if session.root:
        document = save(result)
        balls = document["finite"]["balls"]
        rows, scale = document["comparison"], session.scale
        row = last_row(rows, balls) if len(balls) > 1 else None
        if row is not None:
            leaves = interpolant.leaves_one(rows, row["ball"], scale, of_ball(row, balls))
            document["answer"] = f"{document['answer']} {leaves}".rstrip()
        between = interpolant.table(rows, leading_ball(balls))
        if between:
            write_csv(session.out / "strengthening.csv", between)
        figures.draw_comparison(session.out, rows, balls, scale, between)
        figures.draw_surface(session.out, session.problem, balls, scale)
    last = size - 1  # computes beside rank 0, which solves the linear states and draws
    inputs = ranks.share(sensitivity.record(session.problem) if rank == last else None, root=last)
    if document is not None:
        document["sensitivity"] = inputs
        session.save(document, document["comparison"])
        session.finish(document["finite"]["solved"], document["answer"])
    return document


def _show(session: Session, document: Document) -> None:
    out = tables.console()
    balls = document["finite"]["balls"]
    tables.say(out, session.scene.title)
    rows, leading = document["comparison"], leading_ball(balls)
    finite, linear = document["finite"]["solved"], document["linear"]["solved"]
    linear = {**linear, "notes": [note for note in linear["notes"] if not note.startswith(LARGE_STRAIN)]}  # seen below
    tables.say(out, *tables.warnings(finite, linear))
    path = comparison_rows(rows, balls, leading, session.scale)
    tables.show(out, f"ball {leading}: finite against small strain", path, session.scale, tables.COMPARED)
    of_balls = compared_ball_rows(rows, session.scale)
    are_vectors = may_turn(of_balls)
    if are_vectors:
        tables.show_compared_balls(out, of_balls, session.scale)
    if len(balls) > 1:
        _, kind = compared_line([row for row in rows if row["ball"] == leading], balls, leading)
        mark = "digits in parentheses" if tables.is_narrow(out) else "\u00b1"
        tables.say(
            out,
            legend_of_line(balls, kind, "T linear"),
            session.scale.legend(),
            "S_Q, S_D: T finite over T linear at the same normal force (the T linear shown) and at the same approach"
            f"{OF_VECTORS if are_vectors else ''}; "
            f"{mark}: both models' own error estimates, added; at the same force without that due to the error of Q",
        )
    known = tables.error_lines([balls[leading]]) if len(balls) > 1 else []  # of a single ball the next line says it
    tables.say(out, *known, *tables.accuracy_lines(finite, balls), *tables.notes(finite, linear), "")
    tables.say(out, document["answer"], style="bold")
    if document.get("sensitivity") is not None:
        inputs, caption = sensitivity.beside(document, session.problem, session.scale)
        tables.show_words(out, sensitivity.TITLE, inputs)
        tables.say(out, caption)
