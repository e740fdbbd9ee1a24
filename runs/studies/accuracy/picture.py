"""The study's figure: error over processor time of every case, and the Pareto fronts."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runs.display.style import BLUE, GREEN, GREY, ORANGE, PURPLE, blank, look, save_figure
from runs.studies.accuracy.matrix import LADDER, OWN, TRUE

STYLES = {
    "point_load": (PURPLE, "D"),
    "linear_bem": (BLUE, "s"),
    "small_strain": (GREEN, "^"),
    "finite_strain": (ORANGE, "o"),
}
TITLES = {OWN: "against a better solution of the same model", TRUE: "against the finite-strain answer"}
LEAST_SECONDS, LEAST_ERROR = 1e-3, 1e-6
"""Lower limits of the plot: the process clock does not resolve shorter times; smaller errors are drawn here."""
SIDES = sorted(
    ((x, y) for x in (8.0, -8.0, 12.0, -12.0) for y in (4.0, -4.0, 9.0, -9.0, 14.0, -14.0)), key=np.hypot.reduce
)
"""Offsets [points] of a label from its point; of equally clear ones, the first is taken."""


@look()
def draw(rows: Sequence[Mapping[str, Any]], folder: Path) -> None:
    """Write pareto.svg and .png; fronts end at the reference's own error."""
    figure = blank(9.6, 5.4)
    places = figure.add_gridspec(2, 2, height_ratios=(1.0, 0.18))
    axes, key = [figure.add_subplot(places[0, k]) for k in (0, 1)], figure.add_subplot(places[1, :])
    key.set_axis_off()
    for axis, column in zip(axes, (OWN, TRUE), strict=True):
        known = [row for row in rows if row[column] is not None]
        if not known:  # no reference yet
            axis.set_axis_off()
            continue
        for model, (color, marker) in STYLES.items():
            _points(axis, [row for row in known if row["model"] == model], column, (color, marker, model))
        groups = [(color, [model]) for model, (color, _) in STYLES.items()]
        for color, models in groups if column == OWN else [(GREY, list(STYLES))]:
            best = front([row for row in known if row["model"] in models], column)
            x, y = _places(best, column, known=True)
            axis.plot(np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1], color=color, lw=1.0, zorder=0)
        _mark_reference(axis, known, column)
        axis.set(xscale="log", yscale="log", xlabel="processor time of one core [s]")
        axis.set_title(TITLES[column])
        axis.margins(x=0.2, y=0.08)
        for wanted in (0.1, 0.01, 0.001):
            axis.axhline(wanted, color=GREY, lw=0.5, ls=":", zorder=0)
    axes[0].set_ylabel("relative error of T")
    words = "numbers: accuracy asked; whiskers: own estimate; lines: Pareto fronts"
    handles, names = axes[0].get_legend_handles_labels()
    key.legend(handles, names, ncols=3, loc="center", title=words, title_fontsize=9)
    figure.draw_without_rendering()  # sizes of panels and labels
    for axis in axes:
        move_labels(axis)
    save_figure(figure, folder, "pareto")


def front(rows: Sequence[Mapping[str, Any]], column: str) -> list[Mapping[str, Any]]:
    """Return the Pareto-optimal rows in resolved error and time, cheapest first."""
    best: list[Mapping[str, Any]] = []
    known = [row for row in rows if row[column] is not None]
    for row in sorted(known, key=lambda row: (row["seconds"], _resolved(row, column))):
        if not best or _resolved(row, column) < _resolved(best[-1], column):
            best.append(row)
    return best


def _resolved(row: Mapping[str, Any], column: str) -> float:
    """Return an error, no smaller than that of its reference."""
    return float(max(row[column], row[f"{column}, known to"] or 0.0))


def _points(axis: Any, rows: Sequence[Mapping[str, Any]], column: str, style: tuple[str, str, str]) -> None:
    """Draw a model's cases: user settings filled and labelled, numerical parameters small and hollow."""
    color, marker, model = style
    chosen = [row for row in rows if row["parameter"] in LADDER]
    others = [row for row in rows if row["parameter"] not in (*LADDER, "reference")]
    if chosen:
        axis.plot(*_places(chosen, column), marker, color=color, ms=6, label=model)
        for row, x, y in zip(chosen, *_places(chosen, column), strict=True):
            of_this = column == OWN or model == "finite_strain"  # an estimate does not apply to another model's answer
            if of_this and row["estimate"] and row["estimate"] > y:
                axis.plot([x, x], [y, row["estimate"]], color=color, lw=0.7)
                axis.plot([x], [row["estimate"]], "_", color=color, ms=6, mew=0.9)
    if others:
        axis.plot(*_places(others, column), marker, color=color, mfc="none", ms=4, mew=0.8, label=f"{model}, numerics")
    named = [row for row in chosen if row["value"] != ""]
    for text, x, y in _labels(named, *_places(named, column)):
        axis.annotate(text, (x, y), SIDES[0], textcoords="offset points", va="center", fontsize=9, color=color)


def _labels(
    rows: Sequence[Mapping[str, Any]], seconds: Sequence[float], errors: Sequence[float]
) -> list[tuple[str, float, float]]:
    """Return labels (requested accuracy) with the places of their points; overlapping points share one."""
    groups: list[list[tuple[float, float, float]]] = []
    for row, x, y in zip(rows, seconds, errors, strict=True):
        near = [g for g in groups if abs(math.log(x / g[0][1])) < 0.3 and abs(math.log(y / g[0][2])) < 0.3]
        if not near:
            groups.append([])
        (near or groups[-1:])[0].append((row["value"], x, y))
    labels = []
    for group in groups:
        values, *places = zip(*group, strict=True)
        x, y = np.exp(np.mean(np.log(places), axis=1))
        labels.append((f"{max(values):g}" + (f" to {min(values):g}" if len(values) > 1 else ""), float(x), float(y)))
    return labels


def move_labels(axis: Any) -> None:
    """Move every label to where it covers least of lines, points and texts, nearer to its point than to others."""
    labels = [text for text in axis.texts if text.get_position() == SIDES[0]]
    drawn = [_pixels(line) for line in axis.lines if line.get_linestyle() != ":"]
    drawn += [_filled(text) for text in axis.texts if text not in labels]
    points = axis.transData.transform([text.xy for text in labels])
    for place, label in enumerate(labels):

        def covered(side: tuple[float, float], label: Any = label, place: int = place) -> int:
            label.set(position=side, ha="left" if side[0] > 0.0 else "right")
            box = label.get_window_extent()
            outside = sum(not axis.bbox.contains(*corner) for corner in box.corners())
            away = np.linalg.norm(np.maximum(np.maximum(box.min - points, points - box.max), 0.0), axis=1)
            wrong = np.count_nonzero(away < 1.5 * away[place]) - 1
            return 1000 * (outside + wrong) + int(box.padded(3.0).count_contains(np.concatenate(drawn)))

        best = min(SIDES, key=covered)
        covered(best)
        drawn.append(_filled(label))


def _pixels(line: Any) -> Any:
    """Return points along a line, or about its markers."""
    corners = line.get_transform().transform(line.get_xydata())
    if line.get_linestyle() == "None":
        half = 0.5 * line.get_markersize() * line.figure.dpi / 72.0
        around = half * np.stack(np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)), axis=-1).reshape(-1, 1, 2)
        return (corners + around).reshape(-1, 2)
    shares = np.linspace(0.0, 1.0, 200)[:, None, None]
    return ((1.0 - shares) * corners[:-1] + shares * corners[1:]).reshape(-1, 2)


def _filled(text: Any) -> Any:
    """Return points spread over the area of a text."""
    box = text.get_window_extent()
    x, y = np.linspace(box.x0, box.x1, 30), np.linspace(box.y0, box.y1, 6)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _mark_reference(axis: Any, rows: Sequence[Mapping[str, Any]], column: str) -> None:
    """Draw the error of the finite-strain reference; smaller errors are not resolved."""
    known = next((row[f"{column}, known to"] for row in rows if row["model"] == "finite_strain"), None)
    if known is not None:
        color = STYLES["finite_strain"][0]
        axis.axhline(known, color=color, lw=0.9, ls="--", zorder=0)
        words = f"finite_strain known to {100.0 * known:.1g} %"
        axis.annotate(words, (0.0, known), (4, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
                      fontsize=9, color=color)  # fmt: skip


def _places(rows: Sequence[Mapping[str, Any]], column: str, known: bool = False) -> tuple[list[float], list[float]]:
    """Return seconds and errors as drawn; with ``known``, no smaller than the reference's error."""
    seconds = [max(row["seconds"], LEAST_SECONDS) for row in rows]
    return seconds, [max(_resolved(row, column) if known else row[column], LEAST_ERROR) for row in rows]
