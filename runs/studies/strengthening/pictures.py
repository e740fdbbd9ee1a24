"""The study's two figures: the headline curves of all models, and the influence of thickness, distance and material."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runs.display.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    error_bars,
    legend_or_note,
    look,
    panels,
    save_figure,
    zero_line,
)
from runs.studies.framework.case import Case
from runs.studies.strengthening.fitting import Fit
from runs.studies.strengthening.matrix import SIDES

Rows = Sequence[Mapping[str, Any]]
Paths = Sequence[tuple[Case, Rows]]
"""Every case with answers, and its rows."""
MARKS = ("o", "s", "^", "D", "v", "P")
COLORS = (ORANGE, BLUE, GREEN, PURPLE, GREY)
MEANINGLESS = 3.0
"""Larger ratios, where T at small strain is nearly zero, do not set the axes' range."""


@look()
def draw(paths: Paths, main: Mapping[str, Rows], fits: Mapping[str, Fit | None], folder: Path) -> None:
    """Write strengthening and parameters as .svg and .png; ``main`` are the headline's rows by layer."""
    save_figure(_headline(main, fits), folder, "strengthening")
    save_figure(_parameters(paths), folder, "parameters")


def _headline(main: Mapping[str, Rows], fits: Mapping[str, Fit | None]) -> Any:
    figure, axes = panels(5.0, 5.0, height=4.4)
    for axis, side, words in zip(axes, SIDES.values(), ("separation, h = 1.16 R", "attraction, h = 6 R"), strict=True):
        path = main[side]
        bars(axis, path, "S_Q", ORANGE, "o", "$S_Q$, at equal force")
        bars(axis, path, "S_D", GREEN, "^", "$S_D$, at equal approach", shift=0.006)
        known = [(math.sqrt(row["D"]), row["geometry"]) for row in path if row["geometry"] is not None]
        if known:
            axis.plot(*zip(*known, strict=True), color=BLUE, ls=":", label="exact sphere over paraboloid, small strain")
        curve = fits.get(side)
        if curve is not None:
            x = np.linspace(curve.least, curve.greatest, 100)
            root = np.sqrt(x) if curve.variable == "D/R" else x
            axis.plot(root, [curve(v) for v in x], color=GREY, lw=1.0, ls="--", zorder=0, label="fit to $S_Q$")
        finish(axis, path, f"{words}, L = 2 R")
        depths = axis.secondary_xaxis(
            "top", functions=(lambda x: x * abs(x), lambda d: np.sign(d) * np.sqrt(np.abs(d)))
        )
        reached = max((row["D"] for row in path), default=1.0)
        depths.set_xticks([d for d in (0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6) if d <= 1.05 * reached])
        depths.set_xlabel("$D/R$")
    axes[0].set_ylabel("T / T of small strain")
    return figure


def _parameters(paths: Paths) -> Any:
    figure, axes = panels(3.5, 3.5, 3.5, height=3.9)
    for axis, group, key in ((axes[0], "poisson", "nu"), (axes[1], "distance", "L")):
        thin = [one for one in paths if one[0].labels["group"] in (group, "headline") and one[0].labels["h"] < 2.0]
        for i, (case, path) in enumerate(sorted(thin, key=lambda one: one[0].labels[key])):
            name = f"{'ν' if key == 'nu' else 'L / R'} = {case.labels[key]:g}"
            bars(axis, path, "S_Q", COLORS[i % 5], MARKS[i % 6], name)
        rows = [row for _, path in thin for row in path]
        place = "lower left" if key == "nu" else "upper left"  # a curve of nu leaves the panel at the top
        finish(axis, rows, f"$S_Q$ over {'ν' if key == 'nu' else key}, h = 1.16 R", place)
    _sign(axes[2], [one for one in paths if one[0].labels["group"] == "sign"])
    return figure


def _sign(axis: Any, paths: Paths) -> None:
    for i, (case, path) in enumerate(paths):
        x, color = [math.sqrt(row["D"]) for row in path], COLORS[i % 5]
        finite, error, linear = ([row[key] / row["Q"] ** 2 for row in path] for key in ("T", "T_error", "T_linear"))
        name = f"h / R = {case.labels['h']:g}"
        axis.errorbar(x, finite, error, color=color, marker=MARKS[i % 6], ms=4, capsize=2, label=name)
        axis.plot(x, linear, color=color, ls=":", lw=1.2)
    legend_or_note(axis)
    zero_line(axis)
    axis.set(xlabel="√(D/R)", ylabel="$T E_1 R^2 / Q^2$", title="sign of T (dotted: small strain)")


def bars(axis: Any, path: Rows, key: str, color: str, marker: str, name: str, shift: float = 0.0) -> None:
    """Draw a factor with its error bars over the root of D / R."""
    known = [row for row in path if row[key] is not None]
    points = [(math.sqrt(row["D"]) + shift, row[key], row[f"{key}_error"]) for row in known]
    error_bars(axis, points, [row["T"] for row in known], color=color, marker=marker, capsize=2.5, lw=1.2, label=name)


def finish(axis: Any, path: Rows, title: str, corner: str = "upper left") -> None:
    """Finish a panel of factors: legend, axes and their range from the rows of its curves."""
    legend_or_note(axis, loc=corner)
    axis.axhline(1.0, color="0.5", lw=0.8, zorder=0)
    axis.set(xlabel="√(D/R)", title=title)
    axis.set_xlim(left=0.0)
    values = [row["S_Q"] for row in path if row["S_Q"] is not None and abs(row["S_Q"]) < MEANINGLESS]
    if values:  # wide error bars of the smallest loads must not flatten the curves
        low, high = min(0.9, *values), max(1.1, *values)
        axis.set_ylim(low - 0.1 * (high - low), high + 0.25 * (high - low))
