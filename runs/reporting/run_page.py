"""The page of one run: what was asked, what came out, how well it is known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from runs.display.numbers import Scale, attraction, duration, error_terms, leading_ball, number, with_error
from runs.display.tables import LEGEND, ROUNDOFF, mesh_words
from runs.reporting.folder import Folder
from runs.reporting.markup import facts, paragraph, section, table

SHOWN_ELSEWHERE = ("scene", "solved", "balls", "steps", "path", "continuation")
"""Parts of a document that have sections of their own, or belong to the figures."""
MOST_ROWS = 100
STRENGTHS = (("S_Q", "strengthening_at_force"), ("S_D", "strengthening_at_approach"))


def scale_of(folder: Folder) -> Scale:
    """Return the radius of the first ball and the layer's modulus, from the run's identity."""
    problem = folder.identity["problem"]
    return Scale(float(problem["balls"][0]["radius"]), float(problem["layer"]["young"]))


def content(folder: Folder) -> list[str]:
    """Return the sections of a solved scene, of a comparison, or of any other run."""
    document = folder.document
    if not document:
        return [paragraph("Nothing is saved yet: the run has not come to its first result.", class_="note")]
    if folder.command == "compare":
        return _comparison(folder, document)
    if document.get("balls") and "tangential_force" in document["balls"][0]:
        return [*_solution(folder, document), *_tables(document)]
    return _anything(document)


def _solution(folder: Folder, document: Mapping[str, Any]) -> list[str]:
    scale, balls = scale_of(folder), document["balls"]
    ball = balls[leading_ball(balls)]
    parts = [facts(_state(balls, leading_ball(balls), scale) | _account(document["solved"]))]
    parts += [_notes(document["solved"]["notes"])]
    parts.append(section("Balls", _balls(balls, scale)))
    if len(document["steps"]) > 1:
        parts.append(section("Load path", _path(document["steps"], leading_ball(balls), scale)))
    routes = ball.get("tangential_force_routes") or {}
    if routes:
        rows = [{"route": name.replace("_", " "), "Tx [N]": v[0], "Ty [N]": v[1]} for name, v in routes.items()]
        parts.append(section("T by several formulas", table(rows, "The same force by other routes")))
    parts += [_accuracy(document["solved"]), _versions(document["solved"])]
    return parts


def _comparison(folder: Folder, document: Mapping[str, Any]) -> list[str]:
    scale, finite = scale_of(folder), document["finite"]
    balls = finite["balls"]
    ball = leading_ball(balls)
    state = _state(balls, ball, scale)
    rows = [row for row in document["comparison"] if row["ball"] == ball]
    if rows:
        for name, key in STRENGTHS:
            state[f"{name}, at full load"] = with_error(rows[-1][key], rows[-1][f"{key}_error"])
    shown = [
        {
            "step": row["step"],
            "D / R": row["approach"] / scale.radius,
            "Q / E R²": row["normal_force"] / scale.force,
            "T linear / E R²": _along(row["tangential_linear"], balls, ball, scale),
            "T finite / E R²": with_error(
                _along(row["tangential_finite"], balls, ball, scale), row["tangential_finite_error"] / scale.force
            ),
            "T / Q": row["tangential_ratio"],
            **{name: with_error(row[key], row[f"{key}_error"]) for name, key in STRENGTHS},
        }
        for row in rows
    ]
    notes = dict.fromkeys([*finite["solved"]["notes"], *document["linear"]["solved"]["notes"]])
    return [
        paragraph(document["answer"], class_="answer"),
        facts(state | _account(finite["solved"])),
        _notes(list(notes)),
        section("Finite against small strain", table(shown, f"Ball {ball}; {LEGEND}; S: finite over linear T")),
        section("Balls", _balls(balls, scale)),
        _accuracy(finite["solved"]),
        _versions(finite["solved"]),
    ]


def _anything(document: Mapping[str, Any]) -> list[str]:
    """Show a document of another command: single values as facts, lists of rows as tables."""
    single = {
        key.replace("_", " "): number(value) if isinstance(value, float) else str(value)
        for key, value in document.items()
        if isinstance(value, str | int | float | bool) and key != "format"
    }
    parts = [facts({k: v for k, v in single.items() if len(v) < 40})]
    parts += [paragraph(v, class_="answer") for v in single.values() if len(v) >= 40]
    parts += _tables(document)
    solved = document.get("solved") or {}
    if solved:
        parts.insert(1, facts(_account(solved)))
        parts.append(_notes(solved.get("notes", [])))
        parts.append(_versions(solved))
    return parts


def _tables(document: Mapping[str, Any]) -> list[str]:
    """Return what a document holds beside scene, balls and load steps: its lists of rows as tables."""
    parts = []
    for key, value in document.items():
        rows = value if isinstance(value, list) else [value] if isinstance(value, dict) else []
        flat = [flat for row in rows if isinstance(row, dict) and (flat := _flat(row))]
        if flat and key not in SHOWN_ELSEWHERE:
            title = key.replace("_", " ").capitalize()
            limited = f" (the first {MOST_ROWS} of {len(flat)})" if len(flat) > MOST_ROWS else ""
            parts.append(section(title, table(flat[:MOST_ROWS], title + limited)))
    return parts


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, str | int | float | bool) or value is None:
            flat[key] = value
        elif isinstance(value, list) and len(value) == 2 and all(isinstance(v, int | float) for v in value):
            flat |= {f"{key} x": float(value[0]), f"{key} y": float(value[1])}
    return flat


def _state(balls: Sequence[Mapping[str, Any]], index: int, scale: Scale) -> dict[str, str]:
    ball = balls[index]
    load, force = ball["normal_force"], attraction(balls, index, ball["tangential_force"])
    error = ball["tangential_force_error"]
    shown = {
        "approach D": f"{number(ball['approach'] / scale.radius)} R",
        "normal force Q": f"{number(load / scale.force)} E R²",
        "contact radius": f"{number(math.sqrt(ball['contact_area'] / math.pi) / scale.radius, 3)} R",
    }
    if len(balls) > 1:
        kind = "attraction" if force > 0.0 else "separation"
        shown |= {
            f"tangential force T ({kind})": f"{with_error(force / scale.force, error / scale.force)} E R²",
            "T / Q": number(force / load, 3) if load > 0.0 else "-",
            "T known to": f"{100.0 * error / abs(force):.2g} %" if force else "-",
        }
    return shown


def _account(solved: Mapping[str, Any]) -> dict[str, str]:
    shown = {}
    if solved.get("unknowns"):
        shown["unknowns"] = f"{solved['unknowns']:,}".replace(",", " ")
    if solved.get("iterations"):
        shown["iterations"] = str(solved["iterations"])
    if solved.get("seconds") is not None:
        shown["time"] = duration(float(solved["seconds"]))
    if "ranks" in solved:
        shown["ranks"] = str(solved["ranks"])
    return shown


def _notes(notes: Sequence[str]) -> str:
    return "".join(paragraph(f"Note: {note}", class_="note") for note in notes)


def _balls(balls: Sequence[Mapping[str, Any]], scale: Scale) -> str:
    rows = [
        {
            "ball": i,
            "x / R": ball["position"][0] / scale.radius,
            "y / R": ball["position"][1] / scale.radius,
            "D / R": ball["approach"] / scale.radius,
            "Q [N]": ball["normal_force"],
            "Q / E R²": ball["normal_force"] / scale.force,
            **{
                f"T{c} [N]": _seen(v, ball["tangential_force"])
                for c, v in zip("xy", ball["tangential_force"], strict=True)
            },
            "± [N]": ball["tangential_force_error"],
            "peak pressure / E": ball["peak_pressure"] / scale.young,
        }
        for i, ball in enumerate(balls)
    ]
    return table(rows, "State at full load; forces are those on the ball")


def _seen(component: float, force: Sequence[float]) -> float:
    return component if abs(component) > ROUNDOFF * math.hypot(*force) else 0.0


def _path(steps: Sequence[Mapping[str, Any]], ball: int, scale: Scale) -> str:
    rows = []
    for index, step in enumerate(steps, start=1):
        state = step["balls"][ball]
        force = attraction(step["balls"], ball, state["tangential_force"])
        rows.append(
            {
                "step": index,
                "D / R": state["approach"] / scale.radius,
                "Q / E R²": state["normal_force"] / scale.force,
                "T / E R²": with_error(force / scale.force, state["tangential_force_error"] / scale.force),
                "T / Q": force / state["normal_force"] if state["normal_force"] > 0.0 else None,
                "iterations": step.get("record", {}).get("iterations"),
                "cut-backs": step.get("record", {}).get("cuts"),
            }
        )
    return table(rows, f"Ball {ball}; {LEGEND}")


def _along(force: Sequence[float] | None, balls: Sequence[Mapping[str, Any]], ball: int, scale: Scale) -> float | None:
    if force is None or any(c is None for c in force):
        return None
    return attraction(balls, ball, force) / scale.force


def _accuracy(solved: Mapping[str, Any]) -> str:
    """Return what accuracy was asked and reached, and on which meshes; nothing where the model does not tell."""
    told = solved.get("accuracy") or {}
    if not told:
        return ""
    asked, reached = (f"{100.0 * told[key]:.2g} %" for key in ("asked", "reached"))
    met = "met" if told.get("met") else "not met"
    words = paragraph(f"Asked for T: {asked}; reached: {reached} ({met}). It ended there because: {told['stopped']}.")
    terms = error_terms(told)
    if terms:
        words += paragraph(f"The error of T at full load, the root of the sum of squares: {terms}.")
    rows = [
        {
            "mesh": mesh_words(mesh),
            "unknowns": mesh["unknowns"],
            "error of T [%]": None if mesh["reached"] is None else 100.0 * mesh["reached"],
            "seconds": mesh["seconds"],
        }
        for mesh in told.get("meshes", [])
    ]
    return section("Accuracy", words, table(rows, "Meshes used") if rows else "")


def _versions(solved: Mapping[str, Any]) -> str:
    rows = [{"library": name, "version": str(version)} for name, version in (solved.get("versions") or {}).items()]
    return section("Versions", table(rows, "Libraries that the answer was made with")) if rows else ""
