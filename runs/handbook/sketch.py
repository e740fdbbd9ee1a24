"""The sketch on the physics page: a section through two balls and the layer that they dent, by the linear model."""

from pathlib import Path
from typing import Any

import numpy as np

from linear_bem import Ball, Layer, Load, Problem, solve_contact
from runs.display.style import BLUE, GREY, ORANGE, blank, look, save_figure

THICKNESS, APPROACH, DISTANCE = 1.3, 0.3, 2.3
"""Over R; nu = 0.3, for which the balls attract each other and their common dent is well visible."""


@look()
def draw(folder: Path) -> None:
    """Write sketch.svg: a section that defines R, h, L, D, Q and T."""
    from matplotlib.patches import Circle  # noqa: PLC0415

    half = 0.5 * DISTANCE
    balls = (Ball((-half, 0.0), 1.0), Ball((half, 0.0), 1.0))
    solution = solve_contact(Problem(Layer(1.0, 0.3, THICKNESS), balls, Load("approach", (APPROACH, APPROACH))), 1e-3)
    x = np.linspace(-3.3, 3.3, 331)
    surface = -solution.displacement(x, np.zeros_like(x))
    attract = np.sign(solution.result().balls[0].tangential_force[0])
    figure = blank(4.6, 3.05)
    axes = figure.subplots()
    axes.fill_between(x, -THICKNESS, surface, color="#e8dcc8", lw=0.0, zorder=1)
    axes.plot(x, surface, color="#8a6d3b", lw=1.2, zorder=3)
    axes.axhline(0.0, color=GREY, lw=0.7, ls=":", zorder=1)
    axes.fill_between([-3.3, 3.3], -THICKNESS - 0.27, -THICKNESS, color="#b8bdc2", lw=0.0, zorder=1)
    for side in (-1.0, 1.0):
        place = side * half, 1.0 - APPROACH
        axes.add_patch(Circle(place, 1.0, facecolor="#dfe5ea", edgecolor="#3a4650", lw=1.0, zorder=2))
        _arrow(axes, (side * half, 2.75), (side * half, 2.05), BLUE, "Q", (side * half + 0.13, 2.45))
        end = side * half - attract * side * 0.62
        _arrow(axes, (side * half, 0.7), (end, 0.7), ORANGE, "T", (0.5 * (end + side * half) - 0.06, 0.82))
    _measure(axes, (-half, 1.25), (half, 1.25), "L", (0.0, 1.36))
    _measure(axes, (-2.9, -THICKNESS), (-2.9, 0.0), "h", (-3.12, -0.5 * THICKNESS - 0.06))
    _measure(axes, (half, -APPROACH), (half, 0.0), "D", (half + 0.19, -0.5 * APPROACH - 0.06))
    _measure(axes, (half, 0.7), (half + 0.72, 1.39), "R", (half + 0.46, 0.88))
    axes.text(0.0, -0.62 * THICKNESS, "layer: E, nu", ha="center", fontsize=13)
    axes.text(0.0, -THICKNESS - 0.2, "rigid base, or a substrate", ha="center", fontsize=11)
    axes.annotate("z", (-3.2, 0.02), (-3.2, 0.7), ha="center", arrowprops={"arrowstyle": "<-", "color": GREY})
    axes.annotate("x", (-3.22, 0.04), (-2.5, 0.04), va="center", arrowprops={"arrowstyle": "<-", "color": GREY})
    axes.set(xlim=(-3.3, 3.3), ylim=(-THICKNESS - 0.27, 2.85), aspect="equal")
    axes.set_axis_off()
    save_figure(figure, folder, "sketch", kinds=("svg",))


def _arrow(axes: Any, start: Any, end: Any, color: str, text: str, place: Any) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": color, "lw": 2.0}, zorder=5)
    axes.text(*place, text, color=color, fontsize=14, fontweight="bold", zorder=5)


def _measure(axes: Any, start: Any, end: Any, text: str, place: Any) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "<->", "color": "0.2", "lw": 0.9}, zorder=5)
    axes.text(*place, text, fontsize=13, fontstyle="italic", ha="center", zorder=5)
