"""The study's figure: error against processor time of every case, and the Pareto fronts."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from runs.display.style import BLUE, GREEN, GREY, ORANGE, PURPLE, look, panels, save_figure
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
LABEL = 5.0
"""Ratio of processor times at both ends of a label."""


@look()
def draw(rows: Sequence[Mapping[str, Any]], folder: Path) -> None:
    """Write pareto.svg and .png; fronts end at the reference's own error."""
    figure, (*axes, key) = panels(5.6, 5.6, 2.2, height=4.6)
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
            axis.plot(*_places(best, column, known=True), color=color, lw=1.0, drawstyle="steps-post", zorder=0)
        _mark_reference(axis, known, column)
        axis.set(xscale="log", yscale="log", xlabel="processor time of one core [s]")
        axis.set_title(TITLES[column])
        axis.margins(x=0.12, y=0.08)
        for wanted in (0.1, 0.01, 0.001):
            axis.axhline(wanted, color=GREY, lw=0.5, ls=":", zorder=0)
    axes[0].set_ylabel("relative error of T")
    words = "numbers: accuracy asked\nwhiskers: own estimate\nlines: Pareto fronts"
    handles, names = axes[0].get_legend_handles_labels()
    key.legend(handles, names, fontsize=8, loc="center left", title=words, title_fontsize=8, alignment="left")
    save_figure(figure, folder, "pareto")


def front(rows: Sequence[Mapping[str, Any]], column: str) -> list[Mapping[str, Any]]:
    """Return the Pareto-optimal rows in error and time, cheapest first.

    Errors are bounded below by the error of their reference.
    """

    def error(row: Mapping[str, Any]) -> float:
        return float(max(row[column], row[f"{column}, known to"] or 0.0))

    best: list[Mapping[str, Any]] = []
    for row in sorted((row for row in rows if row[column] is not None), key=lambda r: (r["seconds"], error(r))):
        if not best or error(row) < error(best[-1]):
            best.append(row)
    return best


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
    for text, place, offset in _labels(named, *_places(named, column)):
        paper = {"facecolor": "white", "alpha": 0.75, "linewidth": 0.0, "pad": 0.5}
        axis.annotate(text, place, offset, textcoords="offset points", fontsize=8, color=color, bbox=paper)


def _labels(
    rows: Sequence[Mapping[str, Any]], seconds: Sequence[float], errors: Sequence[float]
) -> list[tuple[str, tuple[float, float], tuple[float, float]]]:
    """Return labels (requested accuracy) with places and offsets [points]; overlapping cases share one.

    A label stands above its point, or below it where the next point to the right would be behind the label.
    """
    groups: list[list[tuple[float, float, float]]] = []
    for row, x, y in zip(rows, seconds, errors, strict=True):
        near = [g for g in groups if abs(math.log(x / g[0][1])) < 0.3 and abs(math.log(y / g[0][2])) < 0.3]
        if not near:
            groups.append([])
        (near or groups[-1:])[0].append((row["value"], x, y))
    labels: list[tuple[str, tuple[float, float], tuple[float, float]]] = []
    for group in groups:
        values, x, y = [value for value, _, _ in group], max(x for _, x, _ in group), max(y for _, _, y in group)
        places = zip(seconds, errors, strict=True)
        hides = any(1.0 < other / x < LABEL and abs(math.log(at / y)) < 1.0 for other, at in places)
        text = f"{max(values):g}" + (f" to {min(values):g}" if len(values) > 1 else "")
        labels.append((text, (x, y), (2, -13) if hides else (8, 3)))
    return labels


def _mark_reference(axis: Any, rows: Sequence[Mapping[str, Any]], column: str) -> None:
    """Draw the error of the finite-strain reference; smaller errors are not resolved."""
    known = next((row[f"{column}, known to"] for row in rows if row["model"] == "finite_strain"), None)
    if known is not None:
        color = STYLES["finite_strain"][0]
        axis.axhline(known, color=color, lw=0.9, ls="--", zorder=0)
        words = f"finite-strain reference known to {100.0 * known:.1g} %"
        axis.annotate(words, (0.0, known), (4, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
                      fontsize=8, color=color)  # fmt: skip


def _places(rows: Sequence[Mapping[str, Any]], column: str, known: bool = False) -> tuple[list[float], list[float]]:
    """Return seconds and errors as drawn; with ``known``, no smaller than the reference's error."""
    seconds = [max(row["seconds"], LEAST_SECONDS) for row in rows]
    least = [row[f"{column}, known to"] or 0.0 if known else 0.0 for row in rows]
    return seconds, [max(row[column], floor, LEAST_ERROR) for row, floor in zip(rows, least, strict=True)]
