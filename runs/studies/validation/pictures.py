"""The study's figure: formulas of others as lines, our answers as points."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runs.display.style import BLUE, GREEN, GREY, ORANGE, PURPLE, error_bars, legend_or_note, look, panels, save_figure
from runs.studies.validation import formulas, large_strain
from runs.studies.validation.comparison import SECOND, Groups, Point

COLORS = (BLUE, ORANGE, GREEN, PURPLE)


@look()
def draw(every: Mapping[str, Groups], folder: Path) -> None:
    """Write validation.svg and .png; a panel without points says so."""
    figure, axes = panels(3.6, 3.6, 3.6, height=3.9)
    _bonded(axes[0], every["lebedev"])
    _spheres(axes[1], {**every["long"], **every["shojaeifard"]}, every["lin"])
    _coated(axes[2], every["perriot"])
    for axis in axes:
        legend_or_note(axis, fontsize=8)
    save_figure(figure, folder, "validation")


def _bonded(axis: Any, groups: Groups) -> None:
    points = [point for group in groups.values() for point in group]
    if points:
        chi = np.geomspace(0.09, 5.5, 120)
        axis.plot(chi, [formulas.lebedev_factor(c) for c in chi], color=BLUE, label="Lebedev and Ufliand")
        for name, terms, color in (
            ("Garcia 2018", formulas.GARCIA, GREEN),
            ("Dimitriadis 2002", formulas.DIMITRIADIS, ORANGE),
        ):
            axis.plot(chi, [formulas.series(terms, c) for c in chi], ls="--", lw=1.3, color=color, label=name)
        axis.plot([p.x for p in points], [p.ours for p in points], "ko", ms=4, mfc="none", label="linear_bem")
        axis.set(xscale="log", yscale="log")
    axis.set(xlabel="χ = √(R D) / h", ylabel="Q / Q Hertz", title="paraboloid on a bonded layer, nu = 0.5")


def _spheres(axis: Any, groups: Groups, half_space: Groups) -> None:
    for color, (name, points) in zip(COLORS, [g for g in groups.items() if not g[0].startswith(SECOND)], strict=False):
        thickness = float(name.split()[2])
        deepest = max(point.x for point in points)
        depths = np.linspace(0.01, deepest, 60)
        if thickness < large_strain.DEEP:
            axis.plot(depths, large_strain.curve(thickness, depths), color=color, lw=1.3)
            _bars(axis, points, color, f"h = {thickness:g} R, line: Long 2011")
    for points in list(half_space.values())[:1]:
        axis.plot(
            [p.x for p in points], [p.theirs for p in points], color=GREY, ls="--", lw=1.3, label="half-space, Lin 2009"
        )
        _bars(axis, points, GREY, "half-space, finite_strain")
    axis.set(xlabel="D / R", ylabel="Q / Q Hertz", title="sphere, finite strain, nu = 0.5")
    axis.set_ylim(top=1.4 * axis.get_ylim()[1])  # the legend is above the points


def _bars(axis: Any, points: Sequence[Point], color: str, label: str) -> None:
    error_bars(axis, [(point.x, point.ours, point.bar) for point in points], fmt="o", color=color, label=label)


def _coated(axis: Any, groups: Groups) -> None:
    x = np.geomspace(0.1, 3.0, 60)
    for color, (name, points) in zip(COLORS, [g for g in groups.items() if not g[0].startswith(SECOND)], strict=False):
        ratio = float(name.split()[1])
        low, high = ([formulas.perriot_modulus(v, 1.0, ratio, n) for v in x] for n in (1.06, 1.32))
        axis.fill_between(x, low, high, color=color, alpha=0.2, lw=0)
        axis.plot(
            [p.x for p in points], [p.ours for p in points], "o", ms=4, color=color, label=f"$E_2 / E_1$ = {ratio:g}"
        )
    if groups:
        axis.set(xscale="log", yscale="log")
    axis.set(xlabel="a / h", ylabel="effective modulus over the coating's", title="coated half-space (Perriot 2004)")
