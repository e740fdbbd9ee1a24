"""The contents of a report on a run: results, accuracy, versions."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from linear_bem.counts import grouped
from runs.comparison import sensitivity
from runs.display.numbers import Scale, duration, error_terms, leading_ball, line_of, number, with_error
from runs.display.rows import (
    RATIO,
    SIZE_RATIO,
    compared_line,
    comparison_rows,
    legend_of_balls,
    legend_of_line,
    path_rows,
)
from runs.display.tables import LARGEST_T, mesh_words, missing_errors, some_balls, symbol_of
from runs.process.json_values import Document
from runs.reporting.folder import Folder
from runs.scene.scene_file import Tables
from runs.scene.units import Unit
from runs.session.output_folder import FINISHED

SHOWN_ELSEWHERE = ("scene", "solved", "balls", "steps", "path", "continuation", "sentences")
"""Keys of a document that the page shows in other parts or in figures."""
SAID = ("rest", "direct_check", "equilibrium", "pair_equilibria", "pair_table")
"""Keys of a drift that its sentences explain."""
WORDS = {
    "pair": "balls", "kind": "event", "cycles_end": "cycles at the end", "groups": "balls in clusters",
    "cycles_one_group": "cycles until one cluster", "narrow_over_wide": "width / length of the arrangement",
}  # fmt: skip
PATHS = {"sigma": "sliding path over friction", "sigma_end": "sliding path over friction at the end"}
"""Names of a drift's columns, where they are not those of the document; ``PATHS`` are lengths [m]."""
MOST_ROWS, MOST_NUMBERS = 100, 10
STRENGTHS = (("S_Q", "strengthening_at_force"), ("S_D", "strengthening_at_approach"))


def scale_of(folder: Folder) -> Scale:
    """Return the scale of a run, from its identity and its scene."""
    problem = folder.identity["problem"]
    radii = [float(ball["radius"]) for ball in problem["balls"]]
    return Scale.from_numbers(radii, float(problem["layer"]["young"]), folder.document.get("scene"))


def content(folder: Folder) -> dict[str, Any]:
    """Return the page's contents for a solved or evolved scene or a comparison; empty before the first ones."""
    document = folder.document
    if not document and folder.state != FINISHED:
        return {}
    return (_comparison if folder.command == "compare" else _solution)(folder, document)


def _common(
    balls: Sequence[Mapping[str, Any]], ball: int, solved: Mapping[str, Any], scale: Scale, more: dict[str, str]
) -> Document:
    """Return the contents common to solutions and comparisons; ``more``: further facts about the ``ball`` shown."""
    rows, which = some_balls(balls, scale)
    others = dict.fromkeys(("answer", "sentences", "compared", "inputs", "path", "routes", "tables"))
    return others | {
        "ball": ball,
        "facts": _state(balls, ball, scale, solved) | more | _account(solved),
        "notes": [*solved["notes"], *missing_errors(balls)],
        "balls": rows,
        "which_balls": f"{which}; " if which else "",
        "legend": scale.legend(),
        "signs_of_balls": legend_of_balls(balls, scale),
        "accuracy": _accuracy(solved),
        "versions": [{"library": k, "version": str(v)} for k, v in (solved.get("versions") or {}).items()],
    }


def _solution(folder: Folder, document: Mapping[str, Any]) -> Document:
    scale, balls = scale_of(folder), document["balls"]
    leading, unit = leading_ball(balls), scale.units.force
    found = _common(balls, leading, document["solved"], scale, {})
    heads = unit.heading("Tx"), unit.heading("Ty")
    steps = document["steps"]
    if len(steps) > 1:
        found["path"] = path_rows(steps, leading, scale)
    _, kind = line_of(balls, leading, balls[leading]["tangential_force"], periodic=scale.periodic)
    found["signs"] = legend_of_line(balls, kind)
    found["routes"] = [
        {"route": name.replace("_", " "), **{h: v / unit.size for h, v in zip(heads, route, strict=True)}}
        for name, route in (balls[leading].get("tangential_force_routes") or {}).items()
    ]
    found["sentences"] = document.get("sentences", [])
    if folder.command == "evolve":  # coordinates are no unknowns, and its steps are no iterations
        found["facts"].pop("unknowns", None)
        found["facts"] = {"steps" if key == "iterations" else key: v for key, v in found["facts"].items()}
    omitted = (*SHOWN_ELSEWHERE, *(SAID if found["sentences"] else ()))
    return found | {"tables": _tables(document, omitted, scale.units.length)}


def _comparison(folder: Folder, document: Mapping[str, Any]) -> Document:
    scale, finite = scale_of(folder), document["finite"]
    ball = leading_ball(finite["balls"])
    rows = [row for row in document["comparison"] if row["ball"] == ball]
    strengths = {
        f"{name}, at the last load step": with_error(rows[-1][key], rows[-1][f"{key}_error"])
        for name, key in STRENGTHS
        if rows
    }
    found = _common(finite["balls"], ball, finite["solved"], scale, strengths)
    found["notes"] = list(dict.fromkeys([*found["notes"], *document["linear"]["solved"]["notes"]]))
    found["answer"] = document["answer"]
    found["compared"] = comparison_rows(document["comparison"], finite["balls"], ball, scale)
    found["signs"] = legend_of_line(finite["balls"], compared_line(rows, finite["balls"], ball)[1], "T linear")
    if document.get("sensitivity") is not None:
        problem = Tables.model_validate(tomllib.loads(folder.scene_text)).problem()
        found["inputs"], found["inputs_checked"] = sensitivity.beside(document, problem, scale)
    return found


def _tables(document: Mapping[str, Any], omitted: Sequence[str], length: Unit) -> list[tuple[str, list[Document], str]]:
    """Return title, rows and caption for each list of rows, except under ``omitted`` keys."""
    found = []
    for key, value in document.items():
        rows = value if isinstance(value, list) else [value] if isinstance(value, dict) else []
        flat = [flat for row in rows if isinstance(row, dict) and (flat := _flat(row, length))]
        if flat and key not in omitted:
            title = key.replace("_", " ").capitalize()
            limited = f" (the first {MOST_ROWS} of {len(flat)})" if len(flat) > MOST_ROWS else ""
            found.append((title, flat[:MOST_ROWS], title + limited))
    return found


def _flat(row: Mapping[str, Any], length: Unit) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        key = WORDS.get(name, name)
        if name in PATHS:
            flat[length.heading(PATHS[name])] = value / length.size
        elif isinstance(value, str | int | float | bool) or value is None:
            flat[key] = value
        elif isinstance(value, list) and 0 < len(value) < MOST_NUMBERS and all(isinstance(v, int) for v in value):
            flat[key] = ", ".join(map(str, value))
        elif isinstance(value, list) and len(value) == 2 and all(isinstance(v, int | float) for v in value):
            flat |= {f"{key} x": float(value[0]), f"{key} y": float(value[1])}
    return flat


def _state(balls: Sequence[Mapping[str, Any]], index: int, scale: Scale, solved: Mapping[str, Any]) -> dict[str, str]:
    ball, units = balls[index], scale.units
    load, (x, y) = ball["normal_force"], ball["tangential_force"]
    line, kind = line_of(balls, index, (x, y), periodic=scale.periodic)
    sized = kind == "tangential" or len(balls) > 2  # no line to the others, or T need not be along it
    force = math.hypot(x, y) if sized else line[0] * x + line[1] * y
    error, unit = ball["tangential_force_error"], units.force
    shown = {
        "ball": f"{index} (the largest T)" if len(balls) > 2 else str(index),
        "approach D": scale.both(ball["approach"]),
        "normal force Q": unit(load),
    }
    if scale.unlike:
        shown["its radius"] = units.length(ball["radius"])
    if ball["contact_area"] is not None:  # models without pressures do not compute it
        area, peak, errors = ball["contact_area"], ball["peak_pressure"], ball.get("errors", {})
        size, pressure = units.length, units.pressure
        radius, share = math.sqrt(area / math.pi) / size.size, errors.get("contact_area", 0.0) / area if area else 0.0
        shown["contact radius"] = f"{with_error(radius, 0.5 * share * radius)} {size.name}"
        off = errors.get("peak_pressure", 0.0) / pressure.size
        shown["peak pressure"] = f"{with_error(peak / pressure.size, off)} {pressure.name}"
    if len(balls) > 1:
        symbol = ("|T|" if sized else "T") + ("" if kind == "tangential" else f" ({kind})")
        shown |= {
            f"tangential force {symbol}": f"{with_error(force / unit.size, error / unit.size)} {unit.name}",
            SIZE_RATIO if sized else RATIO: number(force / load, 3) if load > 0.0 else "-",
        }
        accuracy = solved.get("accuracy") or {}
        known = accuracy.get("reached")
        if known is not None and _reference(accuracy) == LARGEST_T:  # of all balls, like the required accuracy
            shown["T known to"] = f"{100.0 * known:.2g} %"
        else:
            shown["T known to"] = f"{100.0 * error / abs(force):.2g} %" if force else "-"
    return shown


def _reference(accuracy: Mapping[str, Any]) -> str:
    """Return what the errors are relative to: of a small T another force, of a single ball its Q or D."""
    return str(accuracy.get("relative_to", {}).get("what", LARGEST_T))


def _account(solved: Mapping[str, Any]) -> dict[str, str]:
    shown = {}
    if solved.get("unknowns"):
        shown["unknowns"] = grouped(solved["unknowns"])
    if solved.get("iterations"):
        shown["iterations"] = str(solved["iterations"])
    if solved.get("seconds") is not None:
        shown["time"] = duration(float(solved["seconds"]))
    if "ranks" in solved:
        shown["ranks"] = str(solved["ranks"])
    return shown


def _accuracy(solved: Mapping[str, Any]) -> Document:
    """Return required and reached accuracy, and the meshes or the balls of a sample; empty for other models."""
    accuracy = solved.get("accuracy") or {}
    if not accuracy:
        return {}
    symbol = symbol_of(_reference(accuracy))
    asked, reached = accuracy["asked"], accuracy["reached"]
    return {
        "asked": f"{100.0 * asked:.2g} %",
        "reached": f"{100.0 * reached:.2g} %",
        "relative_to": _reference(accuracy),
        "symbol": symbol,
        "met": "met" if accuracy.get("met", reached <= asked) else "not met",
        "stopped": accuracy.get("stopped"),
        "sample": len(accuracy.get("sample", ())),
        "terms": error_terms(accuracy),
        "meshes": [
            {
                "mesh": mesh_words(mesh),
                "unknowns": grouped(mesh["unknowns"]),
                f"error of {symbol} [%]": None if mesh["reached"] is None else 100.0 * mesh["reached"],
                "seconds": mesh["seconds"],
            }
            for mesh in accuracy.get("meshes", [])
        ],
    }
