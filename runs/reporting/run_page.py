"""Sections of the report on a run: results, accuracy, versions."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from runs.comparison import sensitivity
from runs.display.numbers import Scale, attraction, duration, error_terms, leading_ball, number, with_error
from runs.display.rows import LEGEND, RATIO, SIZE_RATIO, ball_rows, comparison_rows, path_rows
from runs.display.tables import mesh_words
from runs.reporting.folder import Folder
from runs.reporting.markup import facts, paragraph, section, table
from runs.scene.scene_file import Tables

SHOWN_ELSEWHERE = ("scene", "solved", "balls", "steps", "path", "continuation")
"""Keys of a document that other sections or the figures show."""
MOST_ROWS = 100
STRENGTHS = (("S_Q", "strengthening_at_force"), ("S_D", "strengthening_at_approach"))


def scale_of(folder: Folder) -> Scale:
    """Return the scale of a run, from its identity and its scene."""
    problem = folder.identity["problem"]
    radii = [float(ball["radius"]) for ball in problem["balls"]]
    return Scale.from_numbers(radii, float(problem["layer"]["young"]), folder.document.get("scene"))


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
    leading = leading_ball(balls)
    periodic = "periodic" in (document.get("scene") or {})
    state = _state(balls, leading, scale, document["solved"], periodic=periodic)
    parts = [facts(state | _account(document["solved"])), _notes(document["solved"]["notes"])]
    parts.append(_balls(balls, scale, periodic=periodic))
    if len(document["steps"]) > 1:
        path = path_rows(document["steps"], leading, scale)
        parts.append(section("Load path", table(path, f"Ball {leading}; {LEGEND}; {scale.legend()}")))
    routes = balls[leading].get("tangential_force_routes") or {}
    if routes:
        unit = scale.units.force
        heads = unit.heading("Tx"), unit.heading("Ty")
        rows = [
            {"route": name.replace("_", " "), **{h: v / unit.size for h, v in zip(heads, route, strict=True)}}
            for name, route in routes.items()
        ]
        parts.append(section("T by several formulas", table(rows, "The same force by other routes")))
    parts += [_accuracy(document["solved"]), _versions(document["solved"])]
    return parts


def _comparison(folder: Folder, document: Mapping[str, Any]) -> list[str]:
    scale, finite = scale_of(folder), document["finite"]
    balls = finite["balls"]
    ball = leading_ball(balls)
    state = _state(balls, ball, scale, finite["solved"])
    rows = [row for row in document["comparison"] if row["ball"] == ball]
    if rows:
        for name, key in STRENGTHS:
            state[f"{name}, at full load"] = with_error(rows[-1][key], rows[-1][f"{key}_error"])
    shown = comparison_rows(document["comparison"], balls, ball, scale)
    notes = dict.fromkeys([*finite["solved"]["notes"], *document["linear"]["solved"]["notes"]])
    return [
        paragraph(document["answer"], class_="answer"),
        facts(state | _account(finite["solved"])),
        _notes(list(notes)),
        section("Finite against small strain", table(shown, f"Ball {ball}; {LEGEND}; S: finite over linear T")),
        paragraph(scale.legend()),
        _sensitivity(folder, document, balls[ball], scale),
        _balls(balls, scale),
        _accuracy(finite["solved"]),
        _versions(finite["solved"]),
    ]


def _sensitivity(folder: Folder, document: Mapping[str, Any], ball: Mapping[str, Any], scale: Scale) -> str:
    found, size = document.get("sensitivity"), math.hypot(*ball["tangential_force"])
    if found is None or size == 0.0:
        return ""
    problem = Tables.model_validate(tomllib.loads(folder.scene_text)).problem()
    rows = sensitivity.rows(found, problem, scale, ball["tangential_force_error"] / size)
    return section("What the inputs do to T", table(rows, sensitivity.check(found)))


def _anything(document: Mapping[str, Any]) -> list[str]:
    """Return sections for the document of any other command: single values as facts, lists of rows as tables."""
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
    """Return a table for each list of rows that no other section shows."""
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


def _state(
    balls: Sequence[Mapping[str, Any]],
    index: int,
    scale: Scale,
    solved: Mapping[str, Any],
    *,
    periodic: bool = False,
) -> dict[str, str]:
    ball, units = balls[index], scale.units
    load, force = ball["normal_force"], attraction(balls, index, ball["tangential_force"])
    if periodic:  # no direction is towards the other balls
        force = math.hypot(*ball["tangential_force"])
    error, unit = ball["tangential_force_error"], units.force
    shown = {
        "ball": f"{index} (the largest T)" if len(balls) > 2 else str(index),
        "approach D": scale.both(ball["approach"]),
        "normal force Q": unit(load),
    }
    if scale.unlike:
        shown["its radius"] = units.length(ball["radius"])
    if ball["contact_area"] is not None:  # models without pressures do not compute it
        shown["contact radius"] = units.length(math.sqrt(ball["contact_area"] / math.pi), 3)
    if len(balls) > 1:
        symbol = "|T|" if periodic else "T (attraction)" if force > 0.0 else "T (separation)"
        shown |= {
            f"tangential force {symbol}": f"{with_error(force / unit.size, error / unit.size)} {unit.name}",
            SIZE_RATIO if periodic else RATIO: number(force / load, 3) if load > 0.0 else "-",
        }
        known = (solved.get("accuracy") or {}).get("reached")
        if known is not None:  # of all balls, like the required accuracy
            shown["T known to"] = f"{100.0 * known:.2g} %"
        else:
            shown["T known to"] = f"{100.0 * error / abs(force):.2g} %" if force else "-"
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


def _balls(balls: Sequence[Mapping[str, Any]], scale: Scale, *, periodic: bool = False) -> str:
    words = f"State at full load; forces are those on the ball; {scale.legend()}"
    return section("Balls", table(ball_rows(balls, scale, periodic=periodic), words))


def _accuracy(solved: Mapping[str, Any]) -> str:
    """Return the required and the reached accuracy and the meshes; empty for models that do not refine."""
    accuracy = solved.get("accuracy") or {}
    if not accuracy:
        return ""
    asked, reached = (f"{100.0 * accuracy[key]:.2g} %" for key in ("asked", "reached"))
    met = "met" if accuracy.get("met") else "not met"
    words = paragraph(
        f"Asked for T: {asked}; reached: {reached} ({met}). It ended there because: {accuracy['stopped']}."
    )
    terms = error_terms(accuracy)
    if terms:
        words += paragraph(f"The error of T at full load, the root of the sum of squares: {terms}.")
    rows = [
        {
            "mesh": mesh_words(mesh),
            "unknowns": mesh["unknowns"],
            "error of T [%]": None if mesh["reached"] is None else 100.0 * mesh["reached"],
            "seconds": mesh["seconds"],
        }
        for mesh in accuracy.get("meshes", [])
    ]
    return section("Accuracy", words, table(rows, "Meshes used") if rows else "")


def _versions(solved: Mapping[str, Any]) -> str:
    rows = [{"library": name, "version": str(version)} for name, version in (solved.get("versions") or {}).items()]
    return section("Versions", table(rows, "Libraries that the answer was made with")) if rows else ""
