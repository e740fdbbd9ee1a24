"""Balls pressed in until the layer is a thin film, on several meshes: load curves, S_Q, energy balance, distortion."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import linear_bem
from linear_bem.errors import ThirdBodyError
from linear_bem.problem import Ball, Problem
from runs.display.style import BLUE, GREEN, GREY, ORANGE, PURPLE, error_bars, look, panels, save_figure
from runs.process.files import write_csv
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.page import render
from runs.studies.framework.pair import THICK, as_seen_by, pair, pressed
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import Found, pull
from runs.studies.stability.judging import work

LEVELS = (Level(2, 1.0), Level(2, 1.5), Level(3, 1.0), Level(3, 1.5))
"""Coarse to fine; the states on each are the initial guesses on the next."""
EVIDENCE = (Level(2, 1.0), Level(2, 1.5), Level(2, 2.0), Level(3, 1.0), Level(3, 1.5), Level(3, 2.0))
"""Discretisations of the thin pair: the end of its load path must not depend on mesh or order."""


def cases(quick: bool) -> list[LevelCase]:
    """Return one case per scene; R = 1 and E1 = 1, rigid base."""
    if quick:
        return [_case("thin pair", pair(0.03, substrate=None), (0.015, 0.03), (Level(2, 1.0), Level(3, 1.0)))]
    ball = pressed([Ball((0.0, 0.0), 1.0)], 2.0, THICK)
    return [
        _case("thin pair", pair(1.0, substrate=None), (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0), EVIDENCE),
        _case("pair on 2 R", pair(1.6, 2.0, substrate=None), (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6)),
        _case("pair on 6 R", pair(1.6, THICK, substrate=None), (0.2, 0.4, 0.8, 1.2, 1.6)),
        _case("one ball on 6 R", ball, (0.25, 0.5, 1.0, 1.5, 2.0)),
    ]


def _case(scene: str, problem: Problem, approaches: Sequence[float], levels: tuple[Level, ...] = LEVELS) -> LevelCase:
    """Return the case of a scene, with output at ``approaches`` over R."""
    return LevelCase(
        scene.replace(" ", "-"), problem, "finite_strain", 0.05, labels={"scene": scene},
        steps=[depth / max(problem.load.values) for depth in approaches], levels=levels, incomplete=True,
    )  # fmt: skip


CREASE, NEAR = 0.65, 0.1
"""Surface stretch below which a free surface creases (`finite_strain.force.distortion`), and a margin above it."""
COLORS = (GREY, GREEN, PURPLE, "#56b4e9", BLUE, ORANGE)
"""One colour per discretisation of the thin pair."""
SHOWN = ("D / R", "Q", "T", "S_Q", "smallest J", "at r, depth", "smallest surface stretch", "at r",
         "smallest area from above", "energy balance [%]", "iterations")  # fmt: skip
PLACES = (("s", "inside the layer"), ("o", "surface, under a ball"), ("^", "surface, beside it"))
"""Markers of the places of the smallest values."""
UNDER = 0.95
"""Distance from a ball's axis over R up to which a surface point is under the ball: touching balls meet at 1."""
TALLEST = 5.0
"""Largest S_Q in the figure."""


def present(found: Found, folder: Path) -> str:
    """Write deep.csv and the figure; return the tables of the finest discretisations as Markdown."""
    rows = {case.labels["scene"]: _rows(found, case) for case in found.cases if found.steps(case.name)}
    kept = [{k: v for k, v in row.items() if k != "places"} for scene in rows.values() for row in scene]
    write_csv(folder / "deep.csv", kept)
    with look():
        save_figure(_figure(rows), folder, "deep")
    return render(
        __file__, shown=SHOWN, of_ends=[key for key in SHOWN if key not in ("iterations", "S_Q")], crease=CREASE,
        scenes={scene: _summary(path) for scene, path in rows.items()},
    )  # fmt: skip


def _summary(path: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the rows of the finest discretisation, the last rows of all, where the surface creases and overhangs."""
    ends = list({row["level"]: row for row in path}.values())
    finest = [row for row in path if row["level"] == ends[-1]["level"]]
    least = min(finest, key=lambda row: row["smallest surface stretch"])
    creased, near = (
        [row["D / R"] for row in finest if row["smallest surface stretch"] < s] for s in (CREASE, CREASE + NEAR)
    )
    seen = [row["smallest area from above"] for row in finest]
    return {
        "finest": finest, "ends": ends, "creased": creased, "near": near, "narrowest": least,
        "reached": min(row["D / R"] for row in ends), "alone": ends[-1]["T"] is None,
        "seen": min(seen), "crossing": max(row["crossing"] for row in finest),
        "overhanging": [row["D / R"] for row, area in zip(finest, seen, strict=True) if area <= 0.0],
    }  # fmt: skip


def _rows(found: Found, case: Case) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    before: list[Mapping[str, Any]] = []
    for step in found.steps(case.name):
        record, ball = step["record"], step["balls"][0]
        if before and before[-1]["record"]["fraction"] >= record["fraction"]:
            before = []
        before.append(step)
        force = pull(step["balls"]) if len(step["balls"]) > 1 else None
        bent = record["distorted_at"]
        rows.append({
            "scene": case.labels["scene"], "level": f"order {record['order']}, fineness {record['fineness']:g}",
            "unknowns": record["unknowns"], "D / R": ball["approach"], "Q": ball["normal_force"], "T": force,
            "S_Q": None,
            "smallest J": record["smallest_volume_ratio"],
            "at r, depth": "{:.2f}, {:.2f}".format(*bent["volume_ratio"]),
            "smallest surface stretch": record["smallest_surface_stretch"],
            "at r": f"{bent['surface_stretch'][0]:.2f}",
            "smallest area from above": record["smallest_seen_area"], "crossing": record["surface_crossing"],
            "energy balance [%]": 100.0 * _balance(before), "iterations": record["iterations"],
            "stopped": record.get("stopped", ""),
            "places": {"smallest J": bent["volume_ratio"], "smallest surface stretch": bent["surface_stretch"]},
        })  # fmt: skip
    for row in rows:
        if row["level"] == rows[-1]["level"]:
            row["S_Q"] = _strengthening(case, row["Q"], row["T"])
    return rows


def _strengthening(case: Case, load: float, force: tuple[float, float] | None) -> tuple[float, float] | None:
    """Return T over the small-strain T of linear_bem at the same normal force, and its error."""
    if force is None:
        return None
    problem = as_seen_by("linear_bem", case.problem).with_load("force", (load, load))
    try:
        small, _ = pull(linear_bem.solve(problem).to_dict()["balls"])
    except ThirdBodyError:  # the linear contacts have no solution at this load
        return None
    return force[0] / small, force[1] / abs(small)


def _balance(steps: Sequence[Mapping[str, Any]]) -> float:
    """Return strain energy over work, minus one, at the last step, both on the mesh; nan for fewer than three steps."""
    if len(steps) < 3:
        return math.nan
    whole = [
        {"balls": [{"approach": s["balls"][0]["approach"], "normal_force": s["record"]["force_on_mesh"]}]}
        for s in steps
    ]
    return float(steps[-1]["record"]["strain_energy"]) / work(whole) - 1.0


def _figure(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> Any:
    """Return the figure: one row of panels over D for the thin pair's discretisations, and S_Q of all pairs."""
    figure, axes = panels(3.6, 3.6, 3.6, height=4.0)
    first = next(iter(rows.values()), ())
    levels = list(dict.fromkeys(row["level"] for row in first))
    for color, level in zip(COLORS[: len(levels)], levels, strict=True):
        shown = [row for row in first if row["level"] == level]
        for axis, key in zip(axes, ("smallest J", "smallest surface stretch"), strict=False):
            axis.plot([r["D / R"] for r in shown], [r[key] for r in shown], color=color, label=level)
            for r in shown:
                axis.plot(r["D / R"], r[key], marker=_marker(*r["places"][key]), color=color, ms=4)
    for axis, places in zip(axes, (PLACES, PLACES[1:]), strict=False):
        for marker, place in places:
            axis.plot([], [], ls="", marker=marker, color=GREY, ms=4, label=place)
    axes[1].axhline(CREASE, color="0.5", lw=0.8, ls=":")
    for color, (scene, path) in zip(COLORS[::-1], rows.items(), strict=False):
        known = [r for r in path if r["level"] == path[-1]["level"] and r["S_Q"] is not None]
        points, forces = [(r["D / R"], *r["S_Q"]) for r in known], [r["T"][0] for r in known]
        error_bars(axes[2], points, forces, color=color, marker="o", ms=3, label=scene)
    axes[2].axhline(1.0, color="0.5", lw=0.8, zorder=0)
    axes[2].set_ylim(0.0, TALLEST)  # above, T at small strain is nearly zero or has the other sign
    titles = "smallest J, thin pair", "smallest surface stretch, thin pair", "$S_Q$"
    for axis, title in zip(axes, titles, strict=True):
        axis.set(xlabel="$D/R$", title=title)
        if axis.get_legend_handles_labels()[0]:
            axis.legend()
    return figure


def _marker(away: float, depth: float) -> str:
    """Return the marker of a place: undeformed distance from the nearest ball's axis, and depth below the surface."""
    (base, _), (under, _), (beyond, _) = PLACES
    return base if depth > 0.0 else under if away < UNDER else beyond


STUDY = study_of_cases("deep", cases, present, publishes=("deep.png",))
